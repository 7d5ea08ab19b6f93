"""Pictures of docs/plenoptic-experiment.md: a sheet a lens, microlenses of four sizes, crosstalk, and vignetting."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from docs.gallery_paper import SCENES, sheet
from raytracer.film.image import Image as Picture
from raytracer.film.light_field.field import LightField
from raytracer.film.light_field.layout import extract_light_field
from raytracer.lightfield.devignetting import devignette, white_scene
from raytracer.lightfield.refocusing.refocus import refocus
from raytracer.rendering.render import render
from raytracer.scene.load import load
from raytracer.scene.spec import SceneSpec
from raytracer.util.srgb import to_uint8

LENSES = ("double_gauss", "telephoto", "wide", "fisheye")
SIZES = (6, 8, 12, 16)
"""Pixels under a microlens."""

DEPTHS = {"the near ball": 1.5, "the box": 2.0, "the far ball": 3.0, "the wall": 6.0}
"""Distances of what is in the scenes, over that of the plane of focus."""

_SPP = 32
_PANEL = (300, 225)
_SMALL = 150
"""Pictures of fewer pixels than this are enlarged with their pixels to be seen."""


def _load(lens: str, **keys: Any) -> SceneSpec:
    """Load the scene of a lens, without dispersion, which is coloured noise in single views."""
    changed = {f"camera.{key}": value for key, value in keys.items()} | {"camera.dispersion": False}
    return load(SCENES / "lightfield" / f"glass_{lens}.yaml", changed)


def _take(spec: SceneSpec) -> tuple[Picture, Picture, LightField]:
    """Render the raw picture and the white one; the third is the light field, devignetted."""
    raw, white = (render(it, spp=_SPP).image for it in (spec, white_scene(spec)))
    return raw, white, devignette(extract_light_field(raw), extract_light_field(white))


def _refocused(field: LightField, distance: float) -> NDArray[np.uint8]:
    return to_uint8(refocus(field, distance).radiance)


def _part(raw: Picture, pixels: int, middle: tuple[int, int]) -> NDArray[np.uint8]:
    """Cut about 8 x 6 microlenses out of a raw picture, about a place (px)."""
    (x, y), (half_x, half_y) = middle, (4 * pixels, 3 * pixels)
    return to_uint8(raw.radiance[y - half_y : y + half_y, x - half_x : x + half_x])


def _sheet(pictures: Mapping[str, NDArray[np.uint8]], columns: int) -> Image.Image:
    panels = [Image.fromarray(picture) for picture in pictures.values()]
    hows = [Image.Resampling.NEAREST if panel.width < _SMALL else Image.Resampling.LANCZOS for panel in panels]
    resized = [np.asarray(panel.resize(_PANEL, how)) for panel, how in zip(panels, hows, strict=True)]
    return sheet(resized, list(pictures), columns)


def lens_picture(lens: str) -> Image.Image:
    """One raw picture through a lens, its parts, views through parts of the lens, and four focuses made of it."""
    spec = _load(lens)
    raw, _, field = _take(spec)
    count, focus = field.views.rows, 1.0 / field.views.inverse_focus
    places = range(count)
    first, middle, last = 1, count // 2, count - 2
    blurred = to_uint8(refocus(extract_light_field(raw), focus).radiance)
    pictures = {
        "the raw picture": to_uint8(raw.radiance),
        "a part of it": _part(raw, count, (620, 400)),
        "the photograph: all is blurred": blurred,
        "all views": to_uint8(np.block([[[field.view(row, column)] for column in places] for row in places])),
        "from the left of the lens": to_uint8(field.view(middle, first)),
        "from its right": to_uint8(field.view(middle, last)),
        "from its bottom": to_uint8(field.view(last, middle)),
        "from its top": to_uint8(field.view(first, middle)),
        **{f"refocused on {name}": _refocused(field, factor * focus) for name, factor in DEPTHS.items()},
    }
    return _sheet(pictures, 4)


def sizes_picture() -> Image.Image:
    """Microlenses of four sizes before one sensor, behind a telephoto: raw pictures, views, and one focus."""
    rows: list[dict[str, NDArray[np.uint8]]] = [{}, {}, {}]
    for pixels in SIZES:
        # A telephoto hardly vignettes.
        raw = render(_load("telephoto", **{"microlenses.pixels": pixels}), spp=_SPP).image
        field = extract_light_field(raw)
        views, focus = field.views, 1.0 / field.views.inverse_focus
        rows[0][f"{pixels} x {pixels} pixels each"] = to_uint8(raw.radiance[368:432, 576:660])
        rows[1][f"a view of {views.width} x {views.height}"] = to_uint8(field.view(*views.nearest()))
        rows[2][f"{views.columns} x {views.rows} views refocused"] = _refocused(field, DEPTHS["the far ball"] * focus)
    return _sheet(rows[0] | rows[1] | rows[2], len(SIZES))


def white_picture() -> Image.Image:
    """What a double Gauss vignettes, and what a white picture mends: raw pictures, a view from the rim, photographs."""
    spec = _load("double_gauss")
    raw, white, even = _take(spec)
    plain = extract_light_field(raw)
    rim, focus = (plain.views.rows // 2, 1), DEPTHS["the box"] / plain.views.inverse_focus
    count = plain.views.rows
    pictures = {
        "the white picture": to_uint8(0.8 * white.radiance),
        "its middle": to_uint8(0.8 * white.radiance[324:396, 432:528]),
        "its corner": to_uint8(0.8 * white.radiance[: 6 * count, : 8 * count]),
        "the raw picture": to_uint8(raw.radiance),
        "a view from the rim of the lens": to_uint8(plain.view(*rim)),
        "devignetted": to_uint8(even.view(*rim)),
        "refocused": _refocused(plain, focus),
        "refocused, devignetted": _refocused(even, focus),
    }
    return _sheet(pictures, 4)


def crosstalk_picture() -> Image.Image:
    """Microlenses that are made for f/4 behind a double Gauss at f/4 and at f/2, without crosstalk and with it."""
    pictures = {}
    for f_number in (4, 2):
        for crosstalk in (False, True):
            keys = {"microlenses.crosstalk": crosstalk, "f_number": f_number}
            # At f/4 their distance is that which matches.
            spec = _load("double_gauss", **keys, **{"microlenses.distance": _MATCHED, "focus_distance": "1 m"})
            image = render(white_scene(spec), spp=_SPP).image
            words = f"f/{f_number}, {'with' if crosstalk else 'without'} crosstalk"
            pictures[words] = to_uint8(0.25 * image.radiance[324:396, 432:528])
    return _sheet(pictures, 4)


_MATCHED = "1.2575 mm"
"""Distance of the sensor behind microlenses of 0.3 mm at which the sub-images of an f/4 lens touch."""

MADE: Mapping[str, Callable[[], Image.Image]] = {
    **{f"plenoptic_{lens}": partial(lens_picture, lens) for lens in LENSES},
    "plenoptic_sizes": sizes_picture,
    "plenoptic_white": white_picture,
    "plenoptic_crosstalk": crosstalk_picture,
}
"""What makes each of the pictures."""
