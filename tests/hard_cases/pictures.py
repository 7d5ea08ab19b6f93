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

import numpy as np

from tests.repository import ROOT

WIDTH = 400


# ---- Mechanisms, taken out


def no_offsets():
    """Rays start on the surface that they leave."""
    from raytracer.core import geometry

    geometry.OFFSET_ULPS = 0.0


def fixed_offset(metres):
    """Rays start at the same distance from any surface."""
    from raytracer.core import geometry
    from raytracer.core.compiler.dispatch import kernel
    from raytracer.core.primitives import discs, parallelograms, spheres, translated, triangles

    def hit_offset(accuracy, extent, near):
        return metres

    for module in (geometry, discs, parallelograms, spheres, translated, triangles):
        if hasattr(module, "hit_offset"):
            module.hit_offset = kernel(hit_offset)


def least_distance():
    """Rays start on the surface that they leave, and do not see what is nearer than a millimetre."""
    from raytracer.core import embree
    from raytracer.core.compiler.dispatch import kernel
    from raytracer.core.embree import DIRECTION, ORIGIN, TFAR, TNEAR

    def set_ray(packet, lane, origin, direction, tfar):
        for axis in range(3):
            embree.store_float(packet, lane, ORIGIN + axis, origin[axis])
            embree.store_float(packet, lane, DIRECTION + axis, direction[axis])
        embree.store_float(packet, lane, TNEAR, 1e-3)
        embree.store_float(packet, lane, TFAR, tfar)

    fixed_offset(0.0)
    embree.set_ray = kernel(set_ray)


def not_recentred():
    """Scenes are packed where they are."""
    from raytracer.scene.pack import origin_shift

    origin_shift._LEAST_GAIN = np.inf


# ---- Scenes


def _cover(keys, by=(0.0, 0.0, 0.0)):
    """The cover, with these overrides, moved by a vector."""
    from tests.moving import checked, document, moved

    path = ROOT / "scenes" / "cover.yaml"
    film = {"width": WIDTH, "height": WIDTH * 9 // 16}
    return checked(moved(document(path), by), path.parent, film=film, render=keys)


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


def _written(text):
    def scene(keys):
        from raytracer.scene.load import build

        return build(text, "picture.yaml", {f"render.{key}": value for key, value in keys.items()})

    return scene


# ---- Pictures

FAST = {"accuracy": "fast"}
CHANCE = {"light_sampling": "paths"}

ROWS = {
    "acne": (
        _cover,
        ("naive: rays start on the surface", FAST, no_offsets),
        ("rays start off it by its error bound", {}, None),
    ),
    "banding": (
        _written(_PLANET),
        ("naive: float32 hits, rays start 1 mm off", FAST, lambda: fixed_offset(1e-3)),
        ("hits solved again in float64", {}, None),
    ),
    "far": (
        # A million metres from the origin along each axis.
        lambda keys: _cover(keys, (1e6, -1e6, 1e6)),
        ("naive: packed where it is, 1,700 km out", FAST, not_recentred),
        ("recentred in float64", {}, None),
    ),
    "fireflies": (
        _written(_CAUSTIC),
        ("naive: lights are met by chance", CHANCE, None),
        ("aimed at, and weighted", {}, None),
        ("and with `clamp: 4`, which says what it took", {"clamp": 4}, None),
    ),
    "leaks": (
        _written(_DOLLS_HOUSE),
        ("naive: nothing nearer than 1 mm is seen", {}, least_distance),
        ("no such distance: dark corners", {}, None),
    ),
}
"""Rows of pictures: their scene as a function of the keys of `render` that are changed, and for each picture its
caption, the keys that it changes, and what is taken out of the program."""

SPP = {"leaks": 100}


def rendered(name, number, out):
    """Render one panel into a file (height, width, 3) of bytes."""
    scene, *panels = ROWS[name]
    _, keys, patch = panels[number]
    if patch is not None:
        patch()
    from raytracer.rendering.render import render

    np.save(out, render(scene(keys), spp=SPP.get(name, 64)).image.display())


def composed(name):
    """Render all panels of a row, each in a process of its own, and put them side by side."""
    from docs.gallery_paper import GALLERY, save_small, sheet

    _, *panels = ROWS[name]
    pictures = []
    with tempfile.TemporaryDirectory() as folder:
        for number, (_, _, patch) in enumerate(panels):
            out = f"{folder}/{number}.npy"
            # What is patched is not in the sources, by which the cache tells kernels apart.
            cache = {} if patch is None else {"RAYTRACER_CACHE_DIR": f"{folder}/cache_{number}"}
            command = [sys.executable, "-m", "tests.hard_cases.pictures", "--one", json.dumps([name, number, out])]
            subprocess.run(command, check=True, cwd=ROOT, env={**os.environ, **cache})
            pictures.append(np.load(out))
    target = GALLERY / f"hard_{name}.jpg"
    save_small(sheet(pictures, [caption for caption, *_ in panels], len(pictures)), target)
    print(f"{target.relative_to(ROOT)}: {target.stat().st_size} bytes", flush=True)


def main():
    """Render the pictures that are named, or all."""
    if sys.argv[1:2] == ["--one"]:
        rendered(*json.loads(sys.argv[2]))
        return
    for name in sys.argv[1:] or ROWS:
        composed(name)


if __name__ == "__main__":
    main()
