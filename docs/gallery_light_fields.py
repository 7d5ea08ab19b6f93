"""Pictures of docs/gallery that are made of light fields."""

import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from docs.gallery_paper import GAP, LONGEST_EDGE, PAPER, SCENES, sheet
from raytracer.analysis.probe import probe_sphere
from raytracer.cli.base.app import main as run_command
from raytracer.film.light_field.field import LightField
from raytracer.film.light_field.layout import extract_light_field
from raytracer.film.light_field.lf import open as open_light_field
from raytracer.film.light_field.lf import write
from raytracer.lightfield.capturing.capture import capture
from raytracer.lightfield.refocusing.refocus import refocus
from raytracer.lightfield.views.synthesis import view_at
from raytracer.rendering.render import render
from raytracer.scene.load import load
from raytracer.util.srgb import to_uint8


def _rendered(name: str, keys: Mapping[str, Any], spp: int) -> LightField:
    """Render all views of a scene, in bands that fit into memory."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "views.lf"
        capture(load(SCENES / "lightfield" / f"{name}.yaml", dict(keys)), file, spp=spp)
        with open_light_field(file) as field:
            return LightField(np.asarray(field.radiance[...]), field.views)


def _refocused(field: LightField, distance: float, **settings: Any) -> NDArray[np.uint8]:
    return to_uint8(refocus(field, distance, **settings).radiance)


def letters_picture() -> Image.Image:
    """One view of the nine letters, and the same focused on three of them."""
    keys = {"camera.fill": True}
    field = _rendered("letters", keys, MANY_VIEWS_SPP)
    distances = {"focused on 1 m": 1.0, "on 1.6 m": 1.6, "on 2.5 m": 2.5}
    pictures = [_middle_view("letters", keys, field), *(_refocused(field, each) for each in distances.values())]
    return sheet(pictures, ["one view of 289", *distances], 2)


MANY_VIEWS_SPP, VIEW_SPP = 3, 16
"""Samples of each pixel of 17 x 17 views, of which a picture that is focused has 289 times as many; and of a single
view that is shown."""


def _middle_view(name: str, keys: Mapping[str, Any], field: LightField) -> NDArray[np.uint8]:
    """Render the view in the middle once more, with the samples that one alone needs."""
    views = field.views
    row, column = views.nearest()
    left, top = column * views.width, row * views.height
    scene = load(SCENES / "lightfield" / f"{name}.yaml", dict(keys))
    crop = (left, top, left + views.width, top + views.height)
    return to_uint8(render(scene, spp=VIEW_SPP, crop=crop).image.radiance)


def dragons_picture() -> Image.Image:
    """Two dragons, focused on one, on the other, stopped down, and with a plane of focus that leans."""
    field = _rendered("dragons", DRAGON_VIEWS, MANY_VIEWS_SPP)
    pictures = {
        "focused on 1.5 m": _refocused(field, 1.5),
        "on 2.3 m": _refocused(field, 2.3),
        "on 1.5 m, through 25 of the 90 mm": _refocused(field, 1.5, aperture=0.025),
        # The camera looks down by 10.3 degrees, and is 0.36 m above this plane, which is level.
        "a level plane of focus, through both": _refocused(field, 2.02, tilt=79.7),
    }
    return sheet(list(pictures.values()), list(pictures), 2)


DRAGON_VIEWS = {"camera.rows": 17, "camera.columns": 17, "camera.spacing": "5.294 mm"}
"""More views through the same 90 mm, so that the blur shows no single one of them."""


def depth_picture() -> Image.Image:
    """Draw how far away the two dragons are, both sharp, and one line of pixels from all views of a row."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "dragons.lf"
        write(file, _rendered("dragons", {}, 8))
        commands = {"depth": ["--near", "1.1", "--far", "4"], "all-in-focus": ["--near", "1.1", "--far", "4"]}
        pictures = []
        for name, words in {**commands, "epi": ["--line", "150"]}.items():
            output = Path(folder) / f"{name}.png"
            run_command(["lightfield", name, str(file), *words, "-o", str(output), "--quiet"])
            with Image.open(output) as picture:
                pictures.append(picture.convert("RGB"))
    depth, sharp, epi = pictures
    paper = Image.new("RGB", (2 * depth.width + GAP, depth.height + GAP + epi.height), PAPER)
    paper.paste(depth, (0, 0))
    paper.paste(sharp, (depth.width + GAP, 0))
    paper.paste(epi, ((paper.width - epi.width) // 2, depth.height + GAP))
    return paper


def microlenses_picture() -> Image.Image:
    """Small and large microlenses before one sensor: part of the raw picture, a view, and a picture refocused."""
    pictures: dict[str, NDArray[np.uint8]] = {}
    size = (400, 300)
    for name in ("small", "large"):
        image = render(load(SCENES / "lightfield" / f"{name}.yaml"), spp=16).image
        field = extract_light_field(image)
        raw = to_uint8(image.radiance[650:800, 800:1000])
        made = {
            f"{name} microlenses: raw picture": raw,
            f"{name}: one of {field.views.rows * field.views.columns} views": to_uint8(
                field.view(*field.views.nearest())
            ),
            f"{name}: focused on 0.77 m": _refocused(field, 0.77),
        }
        pictures |= {
            words: np.asarray(Image.fromarray(part).resize(size, Image.Resampling.NEAREST))
            for words, part in made.items()
        }
    return sheet(list(pictures.values()), list(pictures), 3)


def raw_picture() -> Image.Image:
    """One raw picture through a double Gauss: its cells, what its pixels see from, and four focuses made of it."""
    glass = {"camera.lens": "../lenses/double-gauss-50mm.yaml", "camera.focal_length": None, "camera.f_number": 2}
    near = {"camera.focus_on": None, "camera.focus_distance": 0.65}
    image = render(load(SCENES / "lightfield" / "small.yaml", glass | near), spp=32).image
    field = extract_light_field(image)
    count = range(field.views.rows)
    pictures = {
        "the raw picture": to_uint8(image.radiance),
        "a part of it": to_uint8(image.radiance[560:602, 700:756]),
        "the mean of each cell": _refocused(field, 0.65),
        "all views": to_uint8(np.block([[[field.view(row, column)] for column in count] for row in count])),
        **{
            f"view from {words}": to_uint8(field.view(*place))
            for words, place in {"the left": (2, 1), "the middle": (2, 2), "the right": (2, 4), "below": (4, 2)}.items()
        },
        **{f"refocused on {distance} m": _refocused(field, distance) for distance in (0.77, 0.9, 1.1, 1.6)},
    }
    panels = [Image.fromarray(picture) for picture in pictures.values()]
    # Cells keep their pixels.
    sizes = [(panel, Image.Resampling.NEAREST if panel.width < 300 else Image.Resampling.LANCZOS) for panel in panels]
    return sheet([np.asarray(panel.resize((300, 225), how)) for panel, how in sizes], list(pictures), 4)


def window_picture() -> Image.Image:
    """A room through a window from three eyes, what a light field shows them, and what a photograph does."""
    field = _rendered("window", {}, 48)
    seen = _rendered("window", {"camera.columns": 3, "camera.spacing": WINDOW_EYES[2]}, 256)
    rows = {
        "a window": [seen.view(0, column) for column in range(3)],
        "a screen with the light field": [view_at(field, eye, 0.0) for eye in WINDOW_EYES],
        "a screen with a photograph": [seen.view(0, 1)] * 3,
    }
    sides = ("left", "middle", "right")
    panels = [Image.fromarray(to_uint8(view)).resize((320, 240)) for views in rows.values() for view in views]
    captions = [f"{words}, from the {side}" for words in rows for side in sides]
    return sheet([np.asarray(panel) for panel in panels], captions, 3)


WINDOW_EYES = (-0.255, 0.0, 0.255)
"""Where the eyes stand (m): the outer ones between two cameras of the light field."""


def two_planes_picture() -> Image.Image:
    """Views from points of one plane, and points of the other one as seen from everywhere."""
    film = {"film.width": 80, "film.height": 60}
    field = _rendered("window", {"camera.rows": 49, "camera.columns": 49, "camera.spacing": "12.5 mm", **film}, 8)
    pictures: dict[str, NDArray[np.uint8]] = {}
    for words, (row, column) in {"left": (24, 4), "middle": (24, 24), "right": (24, 44), "top": (4, 24)}.items():
        view = Image.fromarray(to_uint8(field.view(row, column)))
        pictures[f"(u, v) fixed: {words}"] = np.asarray(view.resize((240, 180), Image.Resampling.NEAREST))
    for words, (row, column) in TWO_PLANES_POINTS.items():
        # One pixel of every view.
        cell = np.array([[field.view(v, u)[row, column] for u in range(49)] for v in range(49)])
        panel = Image.new("RGB", (240, 180), PAPER)
        panel.paste(Image.fromarray(to_uint8(cell)).resize((180, 180), Image.Resampling.NEAREST), (30, 0))
        pictures[f"(s, t) fixed: {words}"] = np.asarray(panel)
    return sheet(list(pictures.values()), list(pictures), 4)


TWO_PLANES_POINTS = {"the wall": (4, 40), "the pane, left": (30, 20), "its middle": (30, 40), "its right": (30, 60)}
"""Points of the window's plane: row and column of a view of 80 x 60 pixels."""


def sphere_picture() -> Image.Image:
    """All directions from a point among the spheres of the cover."""
    seen = probe_sphere(SCENES / "cover.yaml", (4.0, 1.2, 2.0), toward=(0.0, 1.0, 0.0), width=LONGEST_EDGE, spp=64)
    return Image.fromarray(seen.image.display())


def raw_dragons_picture() -> Image.Image:
    """Two dragons at four focuses, from one raw picture through a double Gauss."""
    image = render(load(SCENES / "lightfield" / "dragons_lens.yaml")).image
    field = extract_light_field(image)
    pictures = {
        "the raw picture": to_uint8(image.radiance),
        "the mean of each cell": _refocused(field, 0.5),
        **{f"refocused on {distance} m": _refocused(field, distance) for distance in DRAGON_FOCUSES},
    }
    panels = [Image.fromarray(picture).resize((400, 300), Image.Resampling.LANCZOS) for picture in pictures.values()]
    return sheet([np.asarray(panel) for panel in panels], list(pictures), 2)


DRAGON_FOCUSES = (0.58, 0.66, 0.79, 0.98)
"""What is refocused of dragons_lens.yaml: near and far parts of either dragon (m)."""


MADE: Mapping[str, Callable[[], Image.Image]] = {
    "lightfield_letters": letters_picture,
    "lightfield_dragons": dragons_picture,
    "lightfield_depth": depth_picture,
    "lightfield_microlenses": microlenses_picture,
    "lightfield_sphere": sphere_picture,
    "lightfield_window": window_picture,
    "lightfield_two_planes": two_planes_picture,
    "lightfield_raw": raw_picture,
    "lightfield_raw_dragons": raw_dragons_picture,
}
"""What makes each of the pictures."""
