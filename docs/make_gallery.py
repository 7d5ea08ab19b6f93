"""Render the scenes of the repository into docs/gallery, small: `make gallery`.

    python docs/make_gallery.py [NAME ...]    those alone: cover, lecture_aperture, optics_coma, ...

Of a scene of scenes/lecture or scenes/optics, a picture shows several settings side by side: those of
`gallery_sheets.py`.  `sweep` is the contact sheet of docs/sweeps.md; others are made one by one, by `MADE`.
"""

import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

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
from raytracer.lightfield.refocusing.refocus import refocus
from raytracer.optics.sensor_formats import SENSORS
from raytracer.rendering.render import render
from raytracer.scene.load import load
from raytracer.scene.spec import SceneSpec
from raytracer.util.srgb import to_uint8

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

from docs.examples.lensless import reconstruct, scene_shadow  # noqa: E402
from docs.gallery_sheets import SHEETS  # noqa: E402

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


def sphere_picture() -> Image.Image:
    """All directions from a point among the spheres of the cover."""
    seen = probe_sphere(SCENES / "cover.yaml", (4.0, 1.2, 2.0), toward=(0.0, 1.0, 0.0), width=LONGEST_EDGE, spp=64)
    return Image.fromarray(seen.image.display())


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
    "lecture_lensless": lensless_picture,
    "lightfield_letters": letters_picture,
    "lightfield_dragons": dragons_picture,
    "lightfield_depth": depth_picture,
    "lightfield_microlenses": microlenses_picture,
    "lightfield_sphere": sphere_picture,
    "lightfield_raw": raw_picture,
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
    plain = {file.stem: file for file in sorted(SCENES.glob("*.yaml"))}
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
