"""Compare pictures refocused from raw pictures behind real lenses with photographs through the same glass.

    python bench/plenoptic_experiment.py [--lens double_gauss] [--pixels 12] [--spp 32]

For each lens of scenes/lightfield/glass_*.yaml and microlenses of each size the raw picture and the white one are
rendered, and refocused in the range in which neighbouring views differ by a pixel at most.  They should be what the
camera `lens` takes, focused there and framed as the views; both are divided by their pictures of white.

It is the optics that are compared: surfaces shine in the colours of their textures, and glass does not disperse, so
that no noise comes from light's many paths and wavelengths.  Prints relative root mean square errors (%), as the table
of docs/plenoptic-experiment.md has them.

References: Ng, Levoy, Bredif, Duval, Horowitz, Hanrahan 2005, "Light Field Photography with a Hand-Held Plenoptic
Camera", Stanford CTSR 2005-02, sec. 5.
"""

import argparse
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from raytracer.film.light_field.field import LightField
from raytracer.film.light_field.focusing import refocusable
from raytracer.film.light_field.layout import extract_light_field
from raytracer.film.light_field.views import Views
from raytracer.lightfield.devignetting import devignette, light_in_the_middle, white_scene
from raytracer.lightfield.refocusing.refocus import refocus
from raytracer.optics.sensor_formats import SensorSpec
from raytracer.plugins.cameras.lens import RealLens
from raytracer.plugins.materials.emitter import Emitter
from raytracer.rendering.render import render
from raytracer.scene.load import load
from raytracer.scene.spec import SceneSpec

Array = NDArray[np.float64]

SCENES = Path(__file__).resolve().parents[1] / "scenes" / "lightfield"
LENSES = ("double_gauss", "telephoto", "wide", "fisheye")
PIXELS = (6, 8, 12, 16)
"""Pixels under a microlens: before one sensor, so that more of them are fewer microlenses."""

PARTS = (-1.0, -0.5, 0.0, 0.5)
"""Places in the range that can be refocused, in 1/distance from the plane of focus: its ends are those of the range."""

FARTHEST = 6.0
"""Distance of the wall, behind which nothing is focused on, in distances of focus."""

BORDER = 4
"""Pixels at the border that do not count: not all views see them."""


class Taken(NamedTuple):
    """What a camera took: its views as they came, of white, and devignetted."""

    plain: LightField
    white: LightField
    even: LightField


class Errors(NamedTuple):
    """Relative errors of a refocused picture against the photograph, and of the photograph itself.

    even : both divided by their pictures of white.
    plain : with the lens's vignetting, relative to their middles.
    unfocused : of the picture as it was taken.
    noise : standard error of the photograph.
    """

    distance: float
    even: float
    plain: float
    unfocused: float
    noise: float


def load_glass(name: str, pixels: int) -> SceneSpec:
    """Load the scene of a lens, with microlenses of a size."""
    spec = load(SCENES / f"glass_{name}.yaml", {"camera.microlenses.pixels": pixels, "camera.dispersion": False})
    matte: dict[str, Any] = spec.materials
    shining = {key: Emitter(radiance=material.albedo, two_sided=True) for key, material in matte.items()}
    settings = spec.render.model_copy(update={"max_depth": 1})
    return spec.model_copy(update={"materials": shining, "render": settings, "environment": None})


def take(spec: SceneSpec, spp: int) -> Taken:
    """Take the raw picture of a scene, and the white one by the same rays."""
    plain, white = (extract_light_field(render(it, spp=spp).image) for it in (spec, white_scene(spec)))
    return Taken(plain, white, devignette(plain, white))


def photograph_scene(spec: SceneSpec, views: Views, distance: float) -> SceneSpec:
    """Put the lens without microlenses, focused at a distance (m), before a film that is framed as the views."""
    camera: Any = spec.camera
    keys = {key: getattr(camera, key) for key in ("look_from", "look_at", "up", "lens", "f_number", "dispersion")}
    given = {key: value for key, value in keys.items() if value is not None}
    focused = RealLens(**given, focus_distance=distance).bind_assets({"lens": camera.glass()})
    image = 2.0 * focused.lens_setup().thin.image_distance
    sensor = SensorSpec(width=-image * views.plane.left, height=image * views.plane.top)
    film = spec.film.model_copy(update={"width": views.width, "height": views.height})
    return spec.model_copy(update={"camera": focused.model_copy(update={"sensor": sensor}), "film": film})


def distances(views: Views) -> list[float]:
    """Choose distances (m) in the range that can be refocused, as far as the wall."""
    reach = 1.0 / refocusable(views)[0] - views.inverse_focus
    inverses = [max(views.inverse_focus + part * reach, views.inverse_focus / FARTHEST) for part in PARTS]
    return [1.0 / inverse for inverse in dict.fromkeys(inverses)]


def relative_rms(picture: Array, truth: Array) -> float:
    """Compute the root mean square of the difference over that of the truth, but for the border."""
    inner = slice(BORDER, -BORDER), slice(BORDER, -BORDER)
    return float(np.sqrt(((picture - truth)[inner] ** 2).mean() / (truth[inner] ** 2).mean()))


def compare(spec: SceneSpec, taken: Taken, distance: float, spp: int) -> Errors:
    """Compare the picture refocused at a distance with the photograph."""
    views = taken.plain.views
    scene = photograph_scene(spec, views, distance)
    # The scene's white is that of a camera with views: of the photograph only the surroundings are taken.
    surroundings = {key: getattr(white_scene(spec), key) for key in ("render", "environment", "materials", "objects")}
    photograph = render(scene, spp=spp).image
    white = render(scene.model_copy(update={**surroundings, "textures": {}}), spp=spp).image.radiance
    even = refocus(taken.even, distance).radiance
    plain, light = (refocus(field, distance).radiance for field in (taken.plain, taken.white))
    middle = light[views.height // 3 : -(views.height // 3), views.width // 3 : -(views.width // 3)].mean()
    shown = white[views.height // 3 : -(views.height // 3), views.width // 3 : -(views.width // 3)].mean()
    # Devignetted views are as bright as the middle of the picture, and photographs of the radiance of the scene.
    truth = photograph.radiance / white * light_in_the_middle(taken.white)
    return Errors(
        distance,
        relative_rms(even, truth),
        relative_rms(plain * (shown / middle), photograph.radiance),
        relative_rms(refocus(taken.even, views.focus_distance).radiance, truth),
        float(np.sqrt(photograph.variance.mean() / (photograph.radiance**2).mean())),
    )


def main() -> None:
    """Print a table of all lenses and sizes, or of some."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--lens", choices=LENSES, action="append")
    parser.add_argument("--pixels", type=int, action="append")
    parser.add_argument("--spp", type=int, default=16)
    options = parser.parse_args()
    head = (
        "lens",
        "pixels",
        "views",
        "view (px)",
        "focused at (m)",
        "error (%)",
        "vignetted",
        "not refocused",
        "noise",
    )
    print(f"| {' | '.join(head)} |")
    print("|---|---|---|---|---|---|---|---|---|")
    for name in options.lens or LENSES:
        for pixels in options.pixels or PIXELS:
            spec = load_glass(name, pixels)
            taken = take(spec, options.spp)
            views = taken.plain.views
            size = f"{name} | {pixels} | {views.columns} x {views.rows} | {views.width} x {views.height}"
            for distance in distances(views):
                try:
                    errors = compare(spec, taken, distance, 16 * options.spp)
                except ValidationError as error:
                    print(f"| {size} | {distance:.4g} | {error.errors()[0]['msg']} |", flush=True)
                    continue
                numbers = " | ".join(f"{100.0 * number:.2f}" for number in errors[1:])
                print(f"| {size} | {distance:.4g} | {numbers} |", flush=True)


if __name__ == "__main__":
    main()
