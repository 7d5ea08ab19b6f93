"""Shipped scenes that are moved a million metres away, or made smaller or larger, look the same but for noise."""

import numpy as np
import pytest
import yaml

from raytracer.analysis.compare import z_test
from raytracer.core.world_origin import Origin
from raytracer.scene.pack.scene import pack
from tests.moving import checked, document, moved, pictured, scaled
from tests.repository import SCENES, need_files_of

FAR = (1e6, -1e6, 1e6)

NARROW = {"cornell": 64, "million": 64, "smoke": 64, "next_week": 64, "diamond": 64}
"""Scenes whose pictures are less than 96 px wide."""

NAMES = sorted(path.stem for path in SCENES.glob("*.yaml"))


def packed(found, width, base=SCENES, max_depth=16):
    film = found["film"]
    size = {"width": width, "height": round(width * film["height"] / film["width"])}
    return pack(checked(found, base, film=size, render={"sampler": "independent", "max_depth": max_depth}))


def source(name):
    need_files_of(name)
    return document(SCENES / f"{name}.yaml")


def assert_alike(first, second, spp=256):
    a, b = pictured(first, spp=spp, seed=1), pictured(second, spp=spp, seed=2)
    verdict = z_test(a.radiance, a.variance, b.radiance, b.variance)
    assert verdict.passed, verdict.reason


def assert_alike_far_away(here, there):
    assert here.scene.origin is None
    assert there.scene.origin is not None
    # Solid textures stay where they are in the world: look the same points up, of which this needs to know.
    assert_alike(here._replace(scene=here.scene._replace(origin=Origin(FAR, there.scene.origin.groups))), there)


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_scenes_look_the_same_a_million_metres_away(name):
    found = source(name)
    assert_alike_far_away(*(packed(some, NARROW.get(name, 96)) for some in (found, moved(found, FAR))))


_PLACES = """
camera: {type: pinhole, look_from: [0, 1.5, 5], look_at: [0, 0.7, 0], vfov: 40, shutter: {open: 0, close: 1},
  motion: {velocity: [0.1, 0, 0], spin: {axis: [0, 1, 0], rate: 5, center: [0, 0, 0]}}}
film: {width: 64, height: 48}
media:
  plume: {type: grid, file: plume.npy, min: [-0.5, 0.01, -0.5], max: [0.5, 1.5, 0.5], extinction: 6, albedo: 0.8}
lights:
  - {type: point, position: [2, 3, 2], intensity: 20}
  - {type: spot, position: [-2, 4, 1], look_at: [0, 0.5, 0], intensity: 40, angle: 30, penumbra: 5}
  - {type: flash, energy: 5}
objects:
  - {type: quad, corner: [-5, 0, 5], edges: [[10, 0, 0], [0, 0, -10]], material: {type: lambertian, albedo: 0.6}}
  - {type: box, min: [-0.5, 0.01, -0.5], max: [0.5, 1.5, 0.5], medium: plume}
  - {type: sphere, center: [1, 0.3, 0.5], radius: 0.3, transform: [{scale: [1, 1.5, 1]}]}
  - {type: sphere, center: [-1, 0.3, 1], radius: 0.3, motion: {spin: {axis: [0, 1, 0], rate: 60, center: [-1, 0, 0.5]}}}
  - {type: disc, center: [-1.5, 1, -1], normal: [1, 0, 1], radius: 0.5,
     motion: {keyframes: [{time: 0, transform: []}, {time: 0.5, transform: [{translate: [0, 0.3, 0]}]},
       {time: 1, transform: [{translate: [0.3, 0.3, 0]}]}]}}
"""


@pytest.mark.slow
def test_grids_lights_and_motions_look_the_same_a_million_metres_away(tmp_path):
    np.save(tmp_path / "plume.npy", np.random.default_rng(1).random((9, 12, 9), np.float32))
    found = yaml.safe_load(_PLACES)
    assert_alike_far_away(*(packed(some, 64, tmp_path, max_depth=8) for some in (found, moved(found, FAR))))


@pytest.mark.slow
@pytest.mark.parametrize("factor", [1e-9, 1e-4, 1e-2, 1e4, 1e9])
@pytest.mark.parametrize("name", ["cornell", "cover", "smoke", "fan"])
def test_scenes_look_the_same_in_another_size(name, factor):
    found = source(name)
    assert_alike(*(packed(some, 64) for some in (found, scaled(found, factor))))
