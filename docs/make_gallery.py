"""Render the scenes of the repository into docs/gallery, small: `make gallery`.

    python docs/make_gallery.py [NAME ...]    those alone: cover, lecture_aperture, optics_coma, ...

Of a scene of scenes/lecture or scenes/optics, a picture shows several settings side by side: those of
`gallery_sheets.py`.  `sweep` is the contact sheet of docs/sweeps.md; others are made one by one, by `MADE`.
"""

import sys
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from raytracer.analysis.sweep.contact_sheet import SHEET
from raytracer.analysis.sweep.run import sweep
from raytracer.cli.base.app import main as run_command
from raytracer.optics.sensor_formats import SENSORS
from raytracer.rendering.render import render
from raytracer.scene.load import load
from raytracer.scene.spec import SceneSpec
from raytracer.util.srgb import to_uint8

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

from docs import gallery_light_fields, gallery_plenoptic  # noqa: E402
from docs.examples.lensless import reconstruct, scene_shadow  # noqa: E402
from docs.gallery_paper import (  # noqa: E402
    FONT_SIZE,
    GALLERY,
    INK,
    LONGEST_EDGE,
    MOST_BYTES,
    PAPER,
    SCENES,
    SPP,
    save_small,
    sheet,
)
from docs.gallery_sheets import SHEETS  # noqa: E402

NOISE = 0.03
MOST_SPP = 1024
SWEEP_WIDTH = 1600


def smaller(file: Path, keys: Mapping[str, Any], width: int, height: int) -> SceneSpec:
    """A scene whose film fits into width x height pixels."""
    film = load(file, dict(keys)).film
    factor = min(1.0, width / film.width, height / film.height)
    size = {"film.width": round(factor * film.width), "film.height": round(factor * film.height)}
    return load(file, {**keys, **size})


def scene_picture(file: Path) -> None:
    """Render a scene with as many samples as its noise calls for, or a showcase with those that it asks for."""
    spec = smaller(file, {}, LONGEST_EDGE, LONGEST_EDGE)
    is_showcase = file.parent.name == "showcase"
    rendered = render(spec, spp=spec.render.spp) if is_showcase else render(spec, spp=MOST_SPP, noise=NOISE)
    rendered.image.save(GALLERY / f"{file.stem}.jpg")


def stretched(picture: NDArray[np.uint8], factor: float) -> NDArray[np.uint8]:
    """A picture (height, width, 3) so many times as wide."""
    if factor == 1.0:
        return picture
    height, width, _ = picture.shape
    return np.asarray(Image.fromarray(picture).resize((round(factor * width), height), Image.Resampling.LANCZOS))


def settings_picture(folder: str, name: str) -> None:
    """Render the settings of a scene side by side, as finely compressed as the size allows."""
    wanted = SHEETS[folder][name]
    pictures = []
    for variant in wanted.variants:
        spec = smaller(SCENES / folder / f"{wanted.scene or name}.yaml", variant.keys, wanted.width, wanted.width)
        pictures.append(stretched(render(spec, spp=wanted.spp).image.display(), variant.stretch))
    paper = sheet(pictures, [variant.caption for variant in wanted.variants], wanted.columns)
    save_small(paper, GALLERY / f"{folder}_{name}.jpg")


def sweep_picture() -> None:
    """The contact sheet of a lens from f/1.4 to f/22, focused on three things."""
    values = {"camera.focus_on": ["yellow ball", "red ball", "last ball"], "camera.f_number": "1.4..22"}
    metered = {"camera.exposure": "auto", "camera.iso": None}
    with tempfile.TemporaryDirectory() as folder:
        sweep(SCENES / "lecture" / "aperture.yaml", values | metered, folder=folder, spp=64)
        with Image.open(Path(folder) / SHEET) as paper:
            small = paper.convert("RGB")
    small.thumbnail((SWEEP_WIDTH, SWEEP_WIDTH), Image.Resampling.LANCZOS)
    save_small(small, GALLERY / "sweep.jpg")


# ---- The lecture


def nested_sensors_picture() -> Image.Image:
    """Draw the frames of all sensors on what the largest records through one lens."""
    largest = max(SENSORS.values())
    size = {"film.width": LONGEST_EDGE, "film.height": round(LONGEST_EDGE * largest[1] / largest[0])}
    sensor = {"width": largest[0], "height": largest[1]}
    spec = load(SCENES / "lecture" / "sensor_sizes.yaml", {**size, "camera.sensor": sensor, "camera.focal_length": 50})
    paper = Image.fromarray(render(spec, spp=SPP).image.display())
    draw, font = ImageDraw.Draw(paper), ImageFont.load_default(FONT_SIZE)
    x, y = 0.5 * paper.width, 0.5 * paper.height
    for number, (name, size_mm) in enumerate(sorted(SENSORS.items(), key=lambda item: -item[1][0])):
        right, down = (0.5 * LONGEST_EDGE / largest[0] * edge for edge in size_mm)
        draw.rectangle((x - right, y - down, x + right - 1, y + down - 1), outline=PAPER, width=2)
        place = (x - right + 6, y - down + 4)
        # The small ones have their names beside them.
        if number > 4:
            place = (x + 0.19 * paper.width, y + 22 * (number - 7))
            draw.line((x + right, y, place[0] - 4, place[1] + 9), fill=PAPER)
        draw.text(place, name, PAPER, font, stroke_width=2, stroke_fill=INK)
    return paper


def noise_crops_picture() -> Image.Image:
    """Enlarge a few pixels of the pictures of ISO 100 to 25600, each pixel a square."""
    crops = []
    variants = SHEETS["lecture"]["iso_noise"].variants
    for variant in variants:
        spec = load(SCENES / "lecture" / "iso_noise.yaml", dict(variant.keys))
        part = Image.fromarray(render(spec, spp=2 * SPP).image.display()).crop((190, 150, 270, 210))
        crops.append(np.asarray(part.resize((400, 300), Image.Resampling.NEAREST)))
    return sheet(crops, [variant.caption for variant in variants], 2)


def inside_camera_picture() -> Image.Image:
    """Look into a camera: open, stopped down, and with the slit of its shutter in two places."""
    variants = {
        "open": {},
        "stopped down to half": {"groups.blade[0].min": [0.76, 0.18, -0.72]},
        **{f"the slit on its way, {words}": _curtains(*edges) for words, edges in SLITS.items()},
    }
    file = SCENES / "lecture" / "inside_camera.yaml"
    pictures = [render(load(file, keys), denoise=True).image.display() for keys in variants.values()]
    return sheet(pictures, list(variants), 2)


SLITS = {"early": (0.1, 0.7), "late": (-0.8, -0.2)}
"""Lower and upper edge of the slit."""


def _curtains(first: float, second: float) -> dict[str, Any]:
    """Move the edges of the two curtains to these heights."""
    return {"objects.first_curtain.max": [2.48, first, 1.5], "objects.second_curtain.min": [2.5, second, -1.5]}


GAIN = 64
"""Gain of the pictures that show where a signal is amplified: from ISO 100 to 6400."""

GAINS = {
    "before the converter, 10 bits": (10, GAIN),
    "after it, 14 bits": (14, 1),
    "after it, 12 bits": (12, 1),
    "after it, 10 bits": (10, 1),
}
"""Bits of the converter, and the gain before it; what is missing to GAIN is multiplied afterwards."""


def gain_picture() -> Image.Image:
    """Enlarge a few pixels of one exposure, amplified before and after it was converted to numbers."""
    crops = []
    for bits, before in GAINS.values():
        sensor = {"format": "full_frame", "noise": True, "bit_depth": bits}
        keys = {"camera.sensor": sensor, "camera.iso": 100 * before, "camera.shutter": 1 / (16 * GAIN)}
        spec = load(SCENES / "lecture" / "iso_noise.yaml", keys)
        recorded = render(spec, spp=2 * SPP, crop=(190, 150, 270, 210)).image.radiance
        part = Image.fromarray(to_uint8(recorded * (GAIN / before)))
        crops.append(np.asarray(part.resize((400, 300), Image.Resampling.NEAREST)))
    return sheet(crops, list(GAINS), 2)


def lensless_picture() -> Image.Image:
    """A mask in place of a lens: what the sensor records, the mask, its reconstruction, and what one hole shows."""
    file = SCENES / "lecture" / "lensless.yaml"
    scene = load(file)
    recorded = render(scene, spp=16 * SPP).image.radiance
    shadow = scene_shadow(scene, file.parent)
    hole = {"camera.aperture_shape": "round", "camera.diameter": 0.56}
    seen = render(load(file, hole), spp=SPP).image.radiance
    pictures = {
        "what the sensor records": recorded,
        "the shadow of the mask": np.repeat(shadow[..., None], 3, axis=2),
        "reconstructed": reconstruct(recorded, shadow),
        "one hole, in 480 times the time": seen,
    }
    panels = [to_uint8(np.maximum(picture, 0.0) / np.percentile(picture, 99.5)) for picture in pictures.values()]
    return sheet(panels, list(pictures), 2)


MADE: Mapping[str, Callable[[], Image.Image]] = {
    "lecture_nested_sensors": nested_sensors_picture,
    "lecture_noise_crops": noise_crops_picture,
    "lecture_gain": gain_picture,
    "lecture_inside_camera": inside_camera_picture,
    "lecture_lensless": lensless_picture,
    **gallery_light_fields.MADE,
    **gallery_plenoptic.MADE,
}
"""What makes the pictures that are more than settings of a scene side by side."""


CROSS_SECTIONS = {
    "lens_section": "double-gauss-50mm",
    "lens_phone": "phone-3.7mm",
    "lens_plano_convex": "plano-convex-100mm",
}
"""Lenses that `rt lens` draws, by the names of the drawings."""


def main() -> None:
    """Render the scenes that are named, or all; and draw the lenses."""
    GALLERY.mkdir(exist_ok=True)
    plain = {file.stem: file for file in sorted([*SCENES.glob("*.yaml"), *SCENES.glob("showcase/*.yaml")])}
    in_folders = [f"{folder}_{name}" for folder, sheets in SHEETS.items() for name in sheets]
    for name, lens in CROSS_SECTIONS.items():
        run_command(["lens", str(SCENES / "lenses" / f"{lens}.yaml"), "-o", str(GALLERY / f"{name}.svg"), "--quiet"])
    for name in sys.argv[1:] or [*plain, *in_folders, *MADE, "sweep"]:
        if name in plain:
            scene_picture(plain[name])
        elif name == "sweep":
            sweep_picture()
        elif name in MADE:
            save_small(MADE[name](), GALLERY / f"{name}.jpg")
        else:
            folder, _, scene = name.partition("_")
            settings_picture(folder, scene)
        picture = GALLERY / f"{name}.jpg"
        print(f"{picture.relative_to(ROOT)}: {picture.stat().st_size} bytes", flush=True)
        if picture.stat().st_size > MOST_BYTES:
            raise SystemExit(f"{picture}: is larger than {MOST_BYTES} bytes")


if __name__ == "__main__":
    main()
