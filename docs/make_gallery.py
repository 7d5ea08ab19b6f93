"""Render the scenes of the repository into docs/gallery, small: `make gallery`.

    python docs/make_gallery.py [NAME ...]    those alone: cover, lecture_aperture, optics_coma, ...

Of a scene of scenes/lecture or scenes/optics, a picture shows several settings side by side: those of `LECTURE` and
`OPTICS`.  `sweep` is the contact sheet in docs/sweeps.md; `lightfield_letters` and the like, of `LIGHT_FIELDS`, are
what is made of light fields.
"""

import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from raytracer.analysis.probe import probe_sphere
from raytracer.analysis.sweep.contact_sheet import SHEET
from raytracer.analysis.sweep.run import sweep
from raytracer.cli.base.app import main as run_command
from raytracer.film.light_field.field import LightField
from raytracer.film.light_field.layout import extract_light_field
from raytracer.film.light_field.lf import write
from raytracer.film.srgb import to_uint8
from raytracer.lightfield.refocusing.refocus import refocus
from raytracer.rendering.render import render
from raytracer.scene.load import load
from raytracer.scene.spec import SceneSpec

ROOT = Path(__file__).parents[1]
SCENES = ROOT / "scenes"
GALLERY = ROOT / "docs" / "gallery"
LONGEST_EDGE = 800
SPP = 256
MOST_BYTES = 300_000

SWEEP_WIDTH = 1600

GAP = 6
CAPTION = 24
FONT_SIZE = 15
PAPER = (255, 255, 255)
INK = (40, 40, 40)
QUALITIES = (92, 88, 84, 80, 75)


class Variant(NamedTuple):
    """A setting of a scene: what stands below its picture, and the keys that it changes, as `-D` does.

    stretch : how many times as wide as recorded the picture is shown, which undoes what an anamorphic lens did.
    """

    caption: str
    keys: Mapping[str, Any]
    stretch: float = 1.0


class Sheet(NamedTuple):
    """How the settings of a scene are shown: how many in a row, each how wide and high at most (px); spp."""

    columns: int
    width: int
    spp: int
    variants: Sequence[Variant]


def _one_key(key: str, captions: Mapping[str, Any]) -> list[Variant]:
    """Settings that differ in the value of one key, by their captions."""
    return [Variant(caption, {key: value}) for caption, value in captions.items()]


ENGRAVED = (
    (1.4, "1/500"), (2, "1/250"), (2.8, "1/125"), (4, "1/60"), (5.6, "1/30"), (8, "1/15"), (11, "1/8"), (16, "1/4"),
    (22, "1/2"), (32, "1"),
)  # fmt: skip
"""What stands on a lens and its camera for f/2^(k/2) and 2^(k-10) s, k from 1 to 10."""

LECTURE = {
    "focal_lengths": Sheet(
        3, 400, 128, _one_key("camera.focal_length", {f"{length} mm": length for length in (17, 24, 35, 50, 100, 200)})
    ),
    "dolly_zoom": Sheet(
        3,
        400,
        128,
        [
            Variant(
                f"{length} mm from {0.088 * length:.3g} m",
                {"camera.focal_length": length, "camera.look_from": [0, 1.4, 0.088 * length]},
            )
            for length in (17, 50, 200)
        ],
    ),
    "sensor_sizes": Sheet(
        3,
        400,
        128,
        [
            *(Variant(f"{name}, 28 mm", {"camera.sensor": name}) for name in ("full_frame", "aps_c", "1-inch")),
            *(
                Variant(
                    f"{name}, 75 mm equivalent",
                    {"camera.sensor": name, "camera.focal_length": None, "camera.equivalent_focal_length": 75},
                )
                for name in ("full_frame", "four_thirds", "1/2.3-inch")
            ),
        ],
    ),
    "aperture": Sheet(
        3,
        400,
        256,
        [
            Variant(f"f/{n}, {time} s", {"camera.f_number": n, "camera.shutter": time})
            for n, time in ((1.4, "1/500"), (4, "1/60"), (22, "1/2"))
        ],
    ),
    "equivalent_exposures": Sheet(
        5,
        240,
        256,
        [
            Variant(f"f/{n}, {time} s", {"camera.f_number": 2 ** (k / 2), "camera.shutter": 2.0 ** (k - 10)})
            for k, (n, time) in enumerate(ENGRAVED, start=1)
        ],
    ),
    "shutter": Sheet(
        2,
        480,
        128,
        [
            Variant(f"1/{rate} s, ISO {iso}", {"camera.shutter": f"1/{rate} s", "camera.iso": iso})
            for rate, iso in ((240, 3200), (120, 1600), (60, 800), (30, 400), (15, 200), (8, 100))
        ],
    ),
    "propeller": Sheet(
        4,
        300,
        128,
        [
            Variant("all at once", {"camera.shutter.readout": 0}),
            Variant("1/60 s, down", {"camera.shutter.readout": "1/60"}),
            Variant("1/25 s, down", {}),
            Variant("1/25 s, right", {"camera.shutter.direction": "right"}),
        ],
    ),
    "train": Sheet(
        2,
        480,
        128,
        [
            Variant("all at once", {"camera.shutter.readout": 0}),
            Variant("electronic, 1/30 s down", {}),
            Variant("electronic, 1/30 s up", {"camera.shutter.direction": "up"}),
            Variant(
                "focal plane, 1/250 s down",
                {"camera.shutter.readout": "1/250", "camera.shutter.curtain": "focal_plane"},
            ),
        ],
    ),
    "iso_noise": Sheet(
        2,
        480,
        512,
        [
            Variant(f"ISO {iso}, 1/{iso * 16 // 100} s", {"camera.iso": iso, "camera.shutter": 100 / 16 / iso})
            for iso in (100, 1600, 6400, 25600)
        ],
    ),
    "focus_breathing": Sheet(
        3,
        400,
        128,
        _one_key("camera.focus_on", {f"on the {name}": name for name in ("last ball", "green ball", "red ball")}),
    ),
    "bokeh": Sheet(
        3,
        400,
        512,
        [
            Variant("round", {}),
            Variant("six blades", {"camera.aperture_shape": {"type": "polygon", "blades": 6}}),
            Variant(
                "five blades, curved", {"camera.aperture_shape": {"type": "polygon", "blades": 5, "curvature": 0.5}}
            ),
            Variant("anamorphic", {"camera.aperture_shape": {"type": "round", "anamorphic": 2}}),
            Variant("vignetted by a rim", {"camera.vignetting": {"diameter": 60, "distance": 90}}),
            Variant("a mask", {"camera.aperture_shape": {"type": "image", "file": "heart.png"}}),
        ],
    ),
    "frozen_drop": Sheet(
        3,
        400,
        256,
        [
            Variant(f"flash of 1/{rate} s", {f"lights[{k}].duration": f"1/{rate} s" for k in range(2)})
            for rate in (20000, 1000, 60)
        ],
    ),
    "light_trails": Sheet(
        3,
        400,
        1024,
        [
            Variant(f"{time} s, ISO {iso}", {"camera.shutter": f"{time} s", "camera.iso": iso})
            for time, iso in (("1/16", 12800), ("1", 800), ("8", 100))
        ],
    ),
    "pinhole": Sheet(
        3,
        400,
        128,
        [
            Variant("hole of 6 mm, 1/80 s", {"camera.diameter": 6, "camera.shutter": 1 / 80}),
            Variant("1 mm, 0.45 s", {"camera.diameter": 1, "camera.shutter": 0.45}),
            Variant("0.35 mm, 3.7 s", {"camera.diameter": 0.35, "camera.shutter": 3.7}),
        ],
    ),
    "no_lens": Sheet(
        2,
        400,
        256,
        [
            Variant("no lens, 1/80000 s", {}),
            Variant(
                "35 mm, f/11, 1/160 s",
                {"camera.type": "pinhole", "camera.focal_length": 35, "camera.f_number": 11, "camera.shutter": 1 / 160},
            ),
        ],
    ),
}


OPTICS = {
    "spherical_aberration": Sheet(
        1,
        720,
        4096,
        [
            Variant("plano-convex singlet, f/4", {}),
            Variant("f/8", {"camera.f_number": 8}),
            Variant(
                "an ideal lens, f/4",
                {
                    "camera": {
                        "type": "thin_lens",
                        "sensor": {"width": 12, "height": 2},
                        "focal_length": 100,
                        "f_number": 4,
                        "focus_distance": 2,
                    }
                },
            ),
        ],
    ),
    "coma": Sheet(2, 480, 2048, [Variant("hyperboloid, f/2.5", {}), Variant("f/5", {"camera.f_number": 5})]),
    "field_curvature": Sheet(
        2,
        480,
        512,
        [
            Variant("achromat, focus 4 m away", {}),
            Variant("focus 6 m away", {"camera.focus_distance": 6}),
        ],
    ),
    "fisheye": Sheet(
        2,
        480,
        256,
        [
            Variant("fisheye, 10 mm", {}),
            Variant("wide-angle, 22 mm", {"camera.lens": "../lenses/wide-22mm.yaml", "camera.sensor": "full_frame"}),
        ],
    ),
    "chromatic_fringes": Sheet(
        2,
        480,
        1024,
        [Variant("singlet of flint", {}), Variant("achromat", {"camera.lens": "../lenses/achromat-100mm.yaml"})],
    ),
    "swirly_bokeh": Sheet(
        3,
        400,
        512,
        [
            Variant("double Gauss, f/2", {}),
            Variant("f/4", {"camera.f_number": 4}),
            Variant(
                "Petzval, f/2.2",
                {
                    "camera.lens": "../lenses/petzval-100mm.yaml",
                    "camera.f_number": 2.2,
                    "camera.look_from": [0, 0.27, 1.3],
                },
            ),
        ],
    ),
    "anamorphic_bokeh": Sheet(
        1,
        800,
        512,
        [
            Variant("anamorphic, desqueezed 2x", {}, 2.0),
            Variant(
                "double Gauss",
                {
                    "camera.lens": "../lenses/double-gauss-50mm.yaml",
                    "camera.sensor": {"width": 33.2, "height": 12.45},
                    "film.width": 800,
                },
            ),
        ],
    ),
    "flare": Sheet(
        3,
        400,
        4096,
        [
            Variant("no reflections", {"camera.flare": False}),
            Variant("bare glass", {"camera.dispersion": False}),
            Variant("coated", {"camera.lens": "../lenses/double-gauss-50mm-coated.yaml"}),
        ],
    ),
}

SHEETS = {"lecture": LECTURE, "optics": OPTICS}
"""Scenes of which several settings are shown, by their folders."""


def smaller(file: Path, keys: Mapping[str, Any], width: int, height: int) -> SceneSpec:
    """A scene whose film fits into width x height pixels."""
    film = load(file, dict(keys)).film
    factor = min(1.0, width / film.width, height / film.height)
    size = {"film.width": round(factor * film.width), "film.height": round(factor * film.height)}
    return load(file, {**keys, **size})


def sheet(pictures: Sequence[NDArray[np.uint8]], captions: Sequence[str], columns: int) -> Image.Image:
    """Pictures of one size (height, width, 3) in rows, each with its caption below."""
    height, width, _ = pictures[0].shape
    rows = -(-len(pictures) // columns)
    paper = Image.new("RGB", (columns * (width + GAP) - GAP, rows * (height + CAPTION + GAP) - GAP), PAPER)
    draw, font = ImageDraw.Draw(paper), ImageFont.load_default(FONT_SIZE)
    for number, (picture, caption) in enumerate(zip(pictures, captions, strict=True)):
        left, top = number % columns * (width + GAP), number // columns * (height + CAPTION + GAP)
        paper.paste(Image.fromarray(picture), (left, top))
        draw.text((left + width // 2, top + height + CAPTION // 2), caption, INK, font, anchor="mm")
    return paper


def save_small(paper: Image.Image, target: Path) -> None:
    """Save a picture as finely compressed as the size allows."""
    for quality in QUALITIES:
        paper.save(target, quality=quality)
        if target.stat().st_size <= MOST_BYTES:
            break


def scene_picture(file: Path) -> None:
    """Render a scene as it is."""
    rendered = render(smaller(file, {}, LONGEST_EDGE, LONGEST_EDGE), spp=SPP)
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
        spec = smaller(SCENES / folder / f"{name}.yaml", variant.keys, wanted.width, wanted.width)
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


# ---- Light fields


def _rendered(name: str, keys: Mapping[str, Any], spp: int) -> LightField:
    return extract_light_field(render(load(SCENES / "lightfield" / f"{name}.yaml", dict(keys)), spp=spp).image)


def _refocused(field: LightField, distance: float, **settings: Any) -> NDArray[np.uint8]:
    return to_uint8(refocus(field, distance, **settings).radiance)


def letters_picture() -> Image.Image:
    """One view of the nine letters, and the same focused on three of them."""
    field = _rendered("letters", {"camera.rows": 9, "camera.columns": 9, "camera.spacing": "15 mm"}, 8)
    distances = {"focused on 1 m": 1.0, "on 1.6 m": 1.6, "on 2.5 m": 2.5}
    pictures = [to_uint8(field.view(4, 4)), *(_refocused(field, distance) for distance in distances.values())]
    return sheet(pictures, ["one view of 81", *distances], 2)


def dragons_picture() -> Image.Image:
    """Two dragons, focused on one, on the other, stopped down, and with a plane of focus that leans."""
    field = _rendered("dragons", {}, 8)
    pictures = {
        "focused on 1.5 m": _refocused(field, 1.5),
        "on 2.3 m": _refocused(field, 2.3),
        "on 1.5 m, through 25 of the 90 mm": _refocused(field, 1.5, aperture=0.025),
        # The camera looks down by 10.3 degrees, and is 0.36 m above this plane, which is level.
        "a level plane of focus, through both": _refocused(field, 2.02, tilt=79.7),
    }
    return sheet(list(pictures.values()), list(pictures), 2)


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


def sphere_picture() -> Image.Image:
    """All directions from a point among the spheres of the cover."""
    seen = probe_sphere(SCENES / "cover.yaml", (4.0, 1.2, 2.0), toward=(0.0, 1.0, 0.0), width=LONGEST_EDGE, spp=64)
    return Image.fromarray(seen.image.display())


LIGHT_FIELDS: Mapping[str, Callable[[], Image.Image]] = {
    "letters": letters_picture,
    "dragons": dragons_picture,
    "depth": depth_picture,
    "microlenses": microlenses_picture,
    "sphere": sphere_picture,
}
"""What makes the pictures of docs/lightfields.md."""


def main() -> None:
    """Render the scenes that are named, or all."""
    GALLERY.mkdir(exist_ok=True)
    plain = {file.stem: file for file in sorted(SCENES.glob("*.yaml"))}
    in_folders = [f"{folder}_{name}" for folder, sheets in SHEETS.items() for name in sheets]
    of_light_fields = [f"lightfield_{name}" for name in LIGHT_FIELDS]
    for name in sys.argv[1:] or [*plain, *in_folders, *of_light_fields, "sweep"]:
        if name in plain:
            scene_picture(plain[name])
        elif name == "sweep":
            sweep_picture()
        elif name in of_light_fields:
            save_small(LIGHT_FIELDS[name.removeprefix("lightfield_")](), GALLERY / f"{name}.jpg")
        else:
            folder, _, scene = name.partition("_")
            settings_picture(folder, scene)
        picture = GALLERY / f"{name}.jpg"
        print(f"{picture.relative_to(ROOT)}: {picture.stat().st_size} bytes", flush=True)
        if picture.stat().st_size > MOST_BYTES:
            raise SystemExit(f"{picture}: is larger than {MOST_BYTES} bytes")


if __name__ == "__main__":
    main()
