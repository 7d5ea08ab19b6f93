"""Shipped scenes that are moved a million metres away, or made smaller or larger, look the same but for noise."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from raytracer.analysis.compare import z_test
from raytracer.core.world_origin import Origin
from raytracer.scene.pack.scene import PackedScene, pack
from tests.moving import checked, document, moved, pictured, scaled
from tests.repository import SCENES, need_files_of

FAR = (1e6, -1e6, 1e6)

MOVED = {
    "cover": 96,
    "cornell": 64,
    "million": 64,
    "instances": 96,
    "bouncing": 96,
    "fan": 96,
    "studio": 96,
    "smoke": 64,
    "textures": 96,
    "glass": 96,
    "metals": 96,
    "next_week": 64,
    "nested": 96,
    "prism": 96,
    "diamond": 64,
}
"""Scenes, and how wide their pictures are (px)."""

SPP = 256


def packed(name: str, width: int, found: dict[str, Any]) -> PackedScene:
    film = found["film"]
    height = round(width * film["height"] / film["width"])
    settings = {"film": {"width": width, "height": height}, "render": {"sampler": "independent", "max_depth": 16}}
    return pack(checked(found, SCENES, **settings))


def source(name: str) -> dict[str, Any]:
    need_files_of(name)
    return document(Path(SCENES / f"{name}.yaml"))


def test_every_scene_is_moved() -> None:
    assert set(MOVED) == {path.stem for path in SCENES.glob("*.yaml")}


@pytest.mark.slow
@pytest.mark.parametrize("name", MOVED)
def test_scenes_look_the_same_a_million_metres_away(name: str) -> None:
    found = source(name)
    here, there = (packed(name, MOVED[name], some) for some in (found, moved(found, FAR)))
    assert here.scene.origin is None
    assert there.scene.origin is not None
    # Solid textures stay where they are in the world: look the same points up, of which this needs to know.
    here = here._replace(scene=here.scene._replace(origin=Origin(FAR, there.scene.origin.groups)))
    first, second = pictured(here, spp=SPP, seed=1), pictured(there, spp=SPP, seed=2)
    verdict = z_test(first.radiance, first.variance, second.radiance, second.variance)
    assert verdict.passed, verdict.reason


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
def test_grids_lights_and_motions_look_the_same_a_million_metres_away(tmp_path: Path) -> None:
    np.save(tmp_path / "plume.npy", np.random.default_rng(1).random((9, 12, 9), np.float32))
    found = yaml.safe_load(_PLACES)
    settings = {"render": {"sampler": "independent", "max_depth": 8}}
    here, other = (pack(checked(some, tmp_path, **settings)) for some in (found, moved(found, FAR)))
    assert other.scene.origin is not None
    here = here._replace(scene=here.scene._replace(origin=other.scene.origin))
    first, second = pictured(here, spp=SPP, seed=1), pictured(other, spp=SPP, seed=2)
    verdict = z_test(first.radiance, first.variance, second.radiance, second.variance)
    assert verdict.passed, verdict.reason


@pytest.mark.slow
@pytest.mark.parametrize("factor", [1e-9, 1e-4, 1e-2, 1e4, 1e9])
@pytest.mark.parametrize("name", ["cornell", "cover", "smoke", "fan"])
def test_scenes_look_the_same_in_another_size(name: str, factor: float) -> None:
    found = source(name)
    own, other = (packed(name, 64, some) for some in (found, scaled(found, factor)))
    first, second = pictured(own, spp=SPP, seed=1), pictured(other, spp=SPP, seed=2)
    verdict = z_test(first.radiance, first.variance, second.radiance, second.variance)
    assert verdict.passed, verdict.reason
