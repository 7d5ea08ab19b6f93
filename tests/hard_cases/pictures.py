"""What naive programs show where this one does not: pictures side by side, into docs/gallery/hard_*.jpg.

    python -m tests.hard_cases.pictures [NAME ...]      acne, banding, far, fireflies, leaks

The naive way is this program with one of its mechanisms taken out, in a process of its own with a kernel cache of its
own, before anything is compiled.
"""

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

ROOT = Path(__file__).parents[2]
WIDTH = 400


# ---- Mechanisms, taken out


def no_offsets() -> None:
    """Rays start on the surface that they leave."""
    from raytracer.core import geometry

    geometry.OFFSET_ULPS = 0.0


def fixed_offset(metres: float) -> Callable[[], None]:
    """Rays start at the same distance from any surface."""

    def patch() -> None:
        from raytracer.core import geometry
        from raytracer.core.primitives import discs, parallelograms, spheres, translated, triangles

        def hit_offset(accuracy, extent, near):  # type: ignore[no-untyped-def]
            return metres

        for module in (geometry, discs, parallelograms, spheres, translated, triangles):
            if hasattr(module, "hit_offset"):
                module.hit_offset = _compiled(hit_offset)

    return patch


def least_distance(metres: float) -> Callable[[], None]:
    """Rays start on the surface that they leave, and do not see what is nearer than a fixed distance."""

    def patch() -> None:
        from raytracer.core import embree
        from raytracer.core.embree import DIRECTION, ORIGIN, TFAR, TNEAR

        def set_ray(packet, lane, origin, direction, tfar):  # type: ignore[no-untyped-def]
            for axis in range(3):
                embree.store_float(packet, lane, ORIGIN + axis, origin[axis])
                embree.store_float(packet, lane, DIRECTION + axis, direction[axis])
            embree.store_float(packet, lane, TNEAR, metres)
            embree.store_float(packet, lane, TFAR, tfar)

        fixed_offset(0.0)()
        embree.set_ray = _compiled(set_ray)

    return patch


def not_recentred() -> None:
    """Scenes are packed where they are."""
    from raytracer.scene.pack import origin_shift

    origin_shift._LEAST_GAIN = np.inf


def _compiled(function: Callable[..., Any]) -> Any:
    from raytracer.core.compiler.dispatch import kernel

    return kernel(function)


# ---- Scenes


def _cover(keys: Mapping[str, Any]) -> Any:
    """The cover, with these overrides."""
    from raytracer.scene.load import load

    size = {"film.width": WIDTH, "film.height": WIDTH * 9 // 16}
    return load(ROOT / "scenes" / "cover.yaml", {**size, **keys})


def _moved_cover(keys: Mapping[str, Any]) -> Any:
    """The cover, a million metres from the origin along each axis."""
    by = np.array([1e6, -1e6, 1e6])
    spec = _cover(keys)
    camera = {key: (np.array(getattr(spec.camera, key)) + by).tolist() for key in ("look_from", "look_at")}
    moved = {f"camera.{key}": value for key, value in camera.items()}
    for number in range(len(spec.objects)):
        moved[f"objects[{number}].transform"] = [{"translate": by.tolist()}]
    return _cover({**keys, **moved})


_PLANET = """
camera: {type: pinhole, look_from: [0, 3, 14], look_at: [0, 1.4, 0], vfov: 40}
film: {width: 400, height: 225}
environment: {type: gradient, horizon: 0.25, zenith: [0.1, 0.15, 0.25]}
lights: [{type: sun, direction: [-1, -0.3, -0.5], irradiance: 5}]
objects:
  - {type: sphere, center: [0, -20000, 0], radius: 20000, material: {type: lambertian, albedo: 0.5}}
  - {type: sphere, center: [0, 1, 0], radius: 1, material: {type: lambertian, albedo: [0.6, 0.2, 0.1]}}
  - {type: sphere, center: [-3, 1, 1], radius: 1, material: {type: lambertian, albedo: [0.1, 0.3, 0.6]}}
  - {type: sphere, center: [3, 1, 0.5], radius: 1, material: {type: lambertian, albedo: [0.6, 0.5, 0.2]}}
"""

# Two centimetres wide, of walls that have one side each.
_DOLLS_HOUSE = """
camera: {type: pinhole, look_from: [0, 0.0075, 0.0095], look_at: [0, 0.0065, -0.01], vfov: 75}
film: {width: 400, height: 300}
render: {max_depth: 12}
environment: {type: constant, radiance: [2, 2.5, 3.5]}
materials: {wall: {type: lambertian, albedo: 0.6}, lamp: {type: emitter, radiance: [16, 13.6, 9.6]}}
objects:
  - {type: box, min: [-0.01, 0, -0.01], max: [0.01, 0.015, 0.01], material: wall}
  - {type: box, min: [-0.006, 0, -0.007], max: [-0.001, 0.006, -0.003], material: wall}
  - {type: box, min: [0.002, 0, -0.005], max: [0.006, 0.003, -0.001], material: wall}
  - {type: sphere, center: [0, 0.0135, -0.002], radius: 0.0009, material: lamp}
"""

_CAUSTIC = """
camera: {type: pinhole, look_from: [0, 2.2, 5.2], look_at: [0, 0.9, 0], vfov: 40}
film: {width: 400, height: 300}
materials:
  wall: {type: lambertian, albedo: 0.7}
objects:
  - {type: quad, corner: [-4, 0, -2], edges: [[0, 0, 8], [8, 0, 0]], material: wall}
  - {type: quad, corner: [-4, 0, -2], edges: [[8, 0, 0], [0, 5, 0]], material: wall}
  - {type: sphere, center: [-1.1, 0.8, 0], radius: 0.8, material: {type: dielectric, ior: 1.5}}
  - {type: sphere, center: [1.1, 0.8, -0.2], radius: 0.8, material: {type: metal, albedo: [0.9, 0.7, 0.4], fuzz: 0.1}}
  - {type: sphere, center: [-2.6, 4, 1.5], radius: 0.06, material: {type: emitter, radiance: 2200}}
"""


def _written(text: str) -> Callable[[Mapping[str, Any]], Any]:
    def scene(keys: Mapping[str, Any]) -> Any:
        from raytracer.scene.load import build

        return build(text, "picture.yaml", keys)

    return scene


# ---- Pictures


class Panel(NamedTuple):
    """A picture of a row: its caption, the keys that it changes, and what is taken out of the program."""

    caption: str
    keys: Mapping[str, Any] = {}
    patch: Callable[[], None] | None = None


class Row(NamedTuple):
    """Pictures of a scene, as a function of the keys that are changed; how many samples a pixel they have."""

    scene: Callable[[Mapping[str, Any]], Any]
    spp: int
    panels: Sequence[Panel]


FAST = {"render.accuracy": "fast"}

ROWS = {
    "acne": Row(
        _cover,
        64,
        [
            Panel("naive: rays start on the surface", FAST, no_offsets),
            Panel("rays start off it by its error bound"),
        ],
    ),
    "banding": Row(
        _written(_PLANET),
        64,
        [
            Panel("naive: float32 hits, rays start 1 mm off", FAST, fixed_offset(1e-3)),
            Panel("hits solved again in float64"),
        ],
    ),
    "far": Row(
        _moved_cover,
        64,
        [
            Panel("naive: packed where it is, 1,700 km out", FAST, not_recentred),
            Panel("recentred in float64"),
        ],
    ),
    "fireflies": Row(
        _written(_CAUSTIC),
        64,
        [
            Panel("naive: lights are met by chance", {"render.light_sampling": "paths"}),
            Panel("aimed at, and weighted"),
            Panel("and with `clamp: 4`, which says what it took", {"render.clamp": 4}),
        ],
    ),
    "leaks": Row(
        _written(_DOLLS_HOUSE),
        100,
        [
            Panel("naive: nothing nearer than 1 mm is seen", {}, least_distance(1e-3)),
            Panel("no such distance: dark corners"),
        ],
    ),
}


def rendered(name: str, number: int, out: Path) -> None:
    """Render one panel into a file (height, width, 3) of bytes."""
    row = ROWS[name]
    panel = row.panels[number]
    if panel.patch is not None:
        panel.patch()
    from raytracer.rendering.render import render

    np.save(out, render(row.scene(panel.keys), spp=row.spp).image.display())


def composed(name: str) -> None:
    """Render all panels of a row, each in a process of its own, and put them side by side."""
    from docs.make_gallery import GALLERY, save_small, sheet

    pictures = []
    with tempfile.TemporaryDirectory() as folder:
        for number, panel in enumerate(ROWS[name].panels):
            out = Path(folder) / f"{number}.npy"
            # What is patched is not in the sources, by which the cache tells kernels apart.
            cache = {} if panel.patch is None else {"RAYTRACER_CACHE_DIR": str(Path(folder) / f"cache_{number}")}
            command = [sys.executable, "-m", "tests.hard_cases.pictures", "--one", json.dumps([name, number, str(out)])]
            subprocess.run(command, check=True, cwd=ROOT, env={**os.environ, **cache})
            pictures.append(np.load(out))
    target = GALLERY / f"hard_{name}.jpg"
    save_small(sheet(pictures, [panel.caption for panel in ROWS[name].panels], len(pictures)), target)
    print(f"{target.relative_to(ROOT)}: {target.stat().st_size} bytes", flush=True)


def main() -> None:
    """Render the pictures that are named, or all."""
    if sys.argv[1:2] == ["--one"]:
        name, number, out = json.loads(sys.argv[2])
        rendered(name, number, Path(out))
        return
    for name in sys.argv[1:] or ROWS:
        composed(name)


if __name__ == "__main__":
    main()
