"""Renders the reference images of tests/test_regression.py anew: `python -m tests.make_references [NAME ...]`.

Run it when a picture changes for a reason, look at the difference first (`rt compare`), and say the reason in the
commit.  Each is small, noisy, and knows its noise, so that a test can tell whether another render differs by more.
"""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from raytracer.comparison import save_reference
from raytracer.rendering import render
from raytracer.scene.load import build, load
from raytracer.scene.spec import SceneSpec

ROOT = Path(__file__).parent.parent
FOLDER = Path(__file__).parent / "references"
GENERATED = {"million": "million.ply", "instances": "forest_russet.npy"}
"""Scenes that are made of files which are not in the repository, and the last of these that is made."""

SPP = 4096
SEED = 12345


def _repository(name: str, width: int, height: int) -> Callable[..., SceneSpec]:
    """A scene of the repository at a small size."""
    size = {"film.width": width, "film.height": height}
    return lambda **overrides: load(ROOT / "scenes" / f"{name}.yaml", {**size, **overrides})


def _text(text: str) -> Callable[..., SceneSpec]:
    return lambda **overrides: build(text, "reference.yaml", overrides, base=FOLDER)


# Every shape and material that there is, lit by an environment and by lamps of every shape.
_ZOO = """
camera: {type: pinhole, look_from: [0, 2.5, 6], look_at: [0, 0.6, 0], vfov: 40}
film: {width: 72, height: 48, filter: box}
render: {max_depth: 16, rr_depth: 3}
environment: {type: gradient, horizon: [0.1, 0.1, 0.15], zenith: [0.05, 0.1, 0.3]}
materials:
  floor: {type: lambertian, albedo: [0.6, 0.55, 0.5]}
  red: {type: lambertian, albedo: [0.7, 0.2, 0.15]}
  brass: {type: metal, albedo: [0.8, 0.6, 0.2], fuzz: 0.3}
  mirror: {type: metal, albedo: 0.9, fuzz: 0}
  glass: {type: dielectric, ior: 1.5}
  warm: {type: emitter, radiance: [6, 5, 4]}
  bright: {type: emitter, radiance: [8, 8, 6]}
  both sides: {type: emitter, radiance: 5, two_sided: true}
objects:
  - {type: disc, center: [0, 0, 0], normal: [0, 1, 0], radius: 6, material: floor}
  - {type: sphere, center: [-1.6, 0.5, 0], radius: 0.5, material: brass}
  - {type: sphere, center: [-0.4, 0.5, 0.8], radius: 0.5, material: glass}
  - type: box
    min: [-0.4, 0, -0.4]
    max: [0.4, 1.2, 0.4]
    material: mirror
    transform: [{rotate: {axis: [0, 1, 0], angle: 25}}, {translate: [0.8, 0, -0.8]}]
  - {type: triangle, vertices: [[1.2, 0, 0.6], [2.4, 0, 0.2], [1.8, 1.2, 0.1]], material: red}
  - {type: mesh, file: octahedron.obj, material: red, transform: [{scale: 0.5}, {translate: [-2.4, 0.5, 1]}]}
  - type: mesh
    file: octahedron.obj
    smooth: true
    material: brass
    transform: [{scale: 0.5}, {translate: [1, 0.5, 1.6]}]
  - {type: quad, corner: [-2, 2.5, -1.5], edges: [[0.8, 0, 0], [0, 0, 0.8]], material: warm}
  - {type: sphere, center: [2.4, 1.8, -0.5], radius: 0.2, material: {type: emitter, radiance: [4, 8, 12]}}
  - {type: disc, center: [0, 2.6, 0.5], normal: [0.2, -1, 0], radius: 0.3, material: bright}
  - {type: triangle, vertices: [[-3, 1, -1], [-3, 1.6, -1], [-2.6, 1.3, -1.3]], material: both sides}
  - {type: box, min: [2.6, 0, 0.4], max: [2.8, 0.5, 0.6], material: {type: emitter, radiance: [5, 2, 2]}}
"""

# A wide lens, three distances, a filter with negative lobes.
_LENS = """
camera: {type: thin_lens, look_from: [0, 1, 5], look_at: [0, 0.6, 0], vfov: 35, focus_distance: 5, defocus_angle: 4}
film: {width: 72, height: 48, filter: mitchell}
render: {max_depth: 8}
environment: {type: gradient, horizon: [1, 1, 1], zenith: [0.5, 0.7, 1.0]}
objects:
  - {type: sphere, center: [0, -1000, 0], radius: 1000, material: {type: lambertian, albedo: [0.5, 0.5, 0.4]}}
  - {type: sphere, center: [-1, 0.5, 2], radius: 0.5, material: {type: lambertian, albedo: [0.8, 0.3, 0.3]}}
  - {type: sphere, center: [0, 0.5, 0], radius: 0.5, material: {type: metal, albedo: 0.9, fuzz: 0.05}}
  - {type: sphere, center: [1.5, 0.5, -3], radius: 0.5, material: {type: dielectric, ior: 1.5}}
  - {type: sphere, center: [-0.5, 0.2, 1], radius: 0.2, material: {type: emitter, radiance: 3}}
"""

REFERENCES: dict[str, Callable[..., SceneSpec]] = {
    "bouncing": _repository("bouncing", 72, 40),
    "cornell": _repository("cornell", 56, 56),
    "cover": _repository("cover", 72, 40),
    "fan": _repository("fan", 72, 40),
    "glass": _repository("glass", 72, 40),
    "instances": _repository("instances", 64, 36),
    "metals": _repository("metals", 72, 48),
    "million": _repository("million", 48, 48),
    "nested": _repository("nested", 48, 48),
    "next_week": _repository("next_week", 48, 48),
    "smoke": _repository("smoke", 56, 56),
    "studio": _repository("studio", 72, 40),
    "textures": _repository("textures", 72, 40),
    "zoo": _text(_ZOO),
    "lens": _text(_LENS),
}


def spec_of(name: str, **settings: Any) -> SceneSpec:
    """A reference's scene, sampled independently: only then does the variance of its samples tell the picture's."""
    return REFERENCES[name](**{"render.sampler": "independent", **settings})


def main(names: list[str]) -> None:
    """Render and save the references of these names, or all."""
    FOLDER.mkdir(exist_ok=True)
    for name in names or REFERENCES:
        image = render(spec_of(name), spp=SPP, seed=SEED).image
        assert image.variance is not None
        save_reference(FOLDER / f"{name}.npz", image.radiance, image.variance, image.settings)


if __name__ == "__main__":
    main(sys.argv[1:])
