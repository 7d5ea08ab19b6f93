"""What is measured, how much of it, on which tiles and in which order."""

from pathlib import Path

import numpy as np
import pytest

from raytracer.analysis.cost.bench import Purpose, Subject, seeds
from raytracer.analysis.cost.compare import _differs, is_steady
from raytracer.analysis.cost.measure_scene import Pilot, RayCount, Replicates, WarmScene, count_rays, warm_up
from raytracer.analysis.cost.rounds import prepare_variant, variant_order
from raytracer.analysis.cost.study import plan
from raytracer.analysis.cost.tile_sample import (
    TileSample,
    choose_subset,
    choose_tiles,
    inclusion_probabilities,
    replicate_workload,
    round_workload,
    sample_levels,
)
from raytracer.analysis.cost.variants import make_variants
from raytracer.core.error_estimate.intervals import Interval
from raytracer.film.window import Window
from raytracer.rendering.tile_scheduler import TILE_SIZE, split_into_tiles
from raytracer.scene.effects import effects_of
from raytracer.scene.load import load
from raytracer.scene.pack.scene import pack
from raytracer.scene.render_settings import Render
from raytracer.scene.scene_assets import SceneAssets
from tests.analysis.cost.made_up import World, scene_of

LARGE = split_into_tiles(Window(0, 0, 1200, 675))
SMALL = split_into_tiles(Window(0, 0, 64, 48))


@pytest.mark.parametrize("pace", [1e3, 1e4, 1e5, 1e6, 1e7])
@pytest.mark.parametrize("windows", [LARGE, SMALL])
def test_replicates_take_about_the_time_they_may(windows, pace):
    size = replicate_workload(windows, 60.0, pace, None)
    assert size.spp & (size.spp - 1) == 0
    seconds = 4 * size.spp * size.tiles * 256 / pace
    assert seconds < 80.0
    # More time than that goes unused only where the picture is done with.
    assert seconds > 30.0 or size.tiles == len(windows)


@pytest.mark.parametrize("tiles", [None, 500, 3225])
@pytest.mark.parametrize("turns", [18, 300, 3000, 60_000])
def test_the_means_of_all_rounds_fit_into_memory(tiles, turns):
    size = round_workload(LARGE, 1.0, 1e9, tiles, turns)
    assert size.tiles >= 1
    # Three channels of 8 bytes.
    assert turns * size.tiles * 256 * 24 <= 2**30
    # What is rendered is what the time allows, on fewer tiles.
    assert size.spp == 1024


def test_seeds_differ_by_purpose_and_go_on():
    assert seeds(1, Purpose.PILOT, 5)[:3] == seeds(1, Purpose.PILOT, 3)
    assert not set(seeds(1, Purpose.PILOT, 5)) & (set(seeds(1, Purpose.ROUND, 5)) | set(seeds(2, Purpose.PILOT, 5)))


@pytest.mark.parametrize(
    ("ratio", "floor", "differs"),
    [
        (Interval(1.10, 1.05, 1.15), 0.03, True),
        (Interval(0.90, 0.85, 0.95), 0.03, True),
        (Interval(1.10, 0.99, 1.15), 0.03, False),
        (Interval(1.10, 1.05, 1.15), 0.12, False),
        (Interval(0.90, 0.85, 0.95), 0.12, False),
        (Interval(0.0, 0.0, 0.0), 0.12, True),
        (Interval(float("nan"), float("nan"), float("nan")), 0.0, False),
    ],
)
def test_a_difference_is_more_than_equal_variants_show(ratio, floor, *, differs):
    assert _differs(ratio, floor) is differs


TRIANGLES = """\
camera: {{type: pinhole, look_from: [0, 0, 5], look_at: [0, 0, 0], vfov: 40, shutter: {{open: 0, close: 1}}}}
film: {{width: 32, height: 16}}
environment: {{type: constant, radiance: 1}}
objects:
  - {{type: mesh, file: ball.obj, material: {{type: {material}, albedo: 0.5}}}}
  - {{type: sphere, center: [{x}, 0, 0], radius: 0.5, motion: {{velocity: [1, 0, 0]}}}}
  - {{type: sphere, center: [0, 3, 0], radius: 0.5, material: {{type: emitter, radiance: 9}}}}
  - {{type: instance, of: heap}}
groups:
  heap:
    - {{type: sphere, center: [3, 0, 0], radius: 0.5}}
render: {{accuracy: {accuracy}}}
"""


def scene_with(folder, material="metal", accuracy="robust", x=2.0):
    (folder / "ball.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    path = folder / "scene.yaml"
    path.write_text(TRIANGLES.format(material=material, accuracy=accuracy, x=x))
    return load(path)


def test_variants_share_the_ray_caster_of_the_scene_where_they_can(tmp_path):
    spec, world = scene_with(tmp_path), World()
    scene = Subject(world.prepare(spec, None), world.bench(), 1)
    windows = split_into_tiles(Window(0, 0, 32, 16))
    shared = {}
    for variant in make_variants(scene.prepared.spec, scene.prepared.packed):
        subject = prepare_variant(scene, variant, windows, SceneAssets(spec))
        shared[variant.name] = subject.prepared.accel is scene.prepared.accel
    assert {name for name, is_shared in shared.items() if not is_shared} == {"accuracy=fast", "motion_blur"}
    assert {"material.metal", "light_sampling=paths", "roulette=off", "A/A"} <= shared.keys()


def test_variants_that_are_equal_seldom_seem_to_take_another_time():
    rng = np.random.default_rng(8)
    times = np.exp(0.02 * rng.standard_normal((2000, 2, 9)))
    # Student's t with 8 degrees of freedom exceeds 3 in 1.7 % of cases.
    assert np.mean([is_steady(own, scene) for own, scene in times]) < 0.025
    assert np.mean([is_steady(1.04 * own, scene) for own, scene in times]) > 0.75


WINDOWS = split_into_tiles(Window(0, 0, 330, 200))


@pytest.mark.parametrize("count", [1, 5, 40, len(WINDOWS) - 1, len(WINDOWS), 10**6])
def test_as_many_tiles_as_asked_for(count):
    size = np.random.default_rng(1).exponential(size=len(WINDOWS))
    for seed in range(20):
        chosen = choose_tiles(WINDOWS, count, np.random.default_rng(seed), size)
        assert len(chosen.windows) == len(set(chosen.windows)) == min(count, len(WINDOWS))
        assert np.all(chosen.weight >= 1.0)


def test_chances_are_in_proportion_to_size_and_at_most_one():
    size = np.array([100.0, 50.0, 1.0, 2.0, 3.0, 4.0])
    probability = inclusion_probabilities(size, 3)
    # Both large ones are sure, and the last place is shared by the rest.
    np.testing.assert_allclose(probability, [1.0, 1.0, 0.1, 0.2, 0.3, 0.4])


@pytest.mark.parametrize("of_part", [False, True])
def test_weighted_sums_are_those_of_all_tiles_on_average(of_part):
    rng = np.random.default_rng(7)
    size = rng.exponential(size=len(WINDOWS)) + 0.1
    value = dict(zip(WINDOWS, rng.exponential(size=len(WINDOWS)), strict=True))
    sums = []
    for seed in range(400):
        chosen = choose_tiles(WINDOWS, 60, np.random.default_rng(seed), size)
        if of_part:
            chosen, pixels = choose_subset(chosen, 20, np.random.default_rng(seed + 10**6))
            assert pixels.sum() == chosen.pixels.sum()
        sums.append(chosen.weight @ [value[window] for window in chosen.windows])
    assert np.mean(sums) == pytest.approx(sum(value.values()), abs=4.0 * np.std(sums) / np.sqrt(len(sums)))


def test_tiles_are_spread_over_the_picture():
    square = split_into_tiles(Window(0, 0, 16 * TILE_SIZE, 16 * TILE_SIZE))
    chosen = choose_tiles(square, 64, np.random.default_rng(5))
    # Every block of 4 x 4 tiles holds four of them.
    blocks = np.zeros((4, 4), dtype=int)
    for window in chosen.windows:
        blocks[window.top // (4 * TILE_SIZE), window.left // (4 * TILE_SIZE)] += 1
    np.testing.assert_array_equal(blocks, 4)


def test_pixels_go_into_the_picture_where_they_came_from():
    film = np.arange(200 * 330 * 3, dtype=np.float64).reshape(200, 330, 3)
    chosen = choose_tiles(WINDOWS, 40, np.random.default_rng(6))
    patch = np.full((40, TILE_SIZE, TILE_SIZE, 3), np.nan)
    for number, (left, top, right, bottom) in enumerate(chosen.windows):
        patch[number, : bottom - top, : right - left] = film[top:bottom, left:right]
    picture = np.full_like(film, np.nan)
    chosen.spread(chosen.flat(patch), picture)
    known = np.isfinite(picture)
    assert known.sum() == 3 * chosen.pixels.sum()
    np.testing.assert_array_equal(picture[known], film[known])
    assert np.array_equal(np.bincount(chosen.owner), chosen.pixels)
    # 330 = 20 * 16 + 10, 200 = 12 * 16 + 8.
    assert TileSample.of(WINDOWS, np.ones(len(WINDOWS))).pixels[-1] == 10 * 8


SCENES = Path(__file__).parents[3] / "scenes"


def test_every_effect_is_in_it_once_with_its_reason():
    packed = pack(load(SCENES / "smoke.yaml"))
    effects = effects_of(packed.spec, packed.scene)
    items = plan(packed.spec, packed)
    told = {item.name: item for item in items if item.group != "setting"}
    assert set(told) == set(effects)
    for name, effect in effects.items():
        assert told[name].group == ("simulated" if effect.active else "left out")
        assert told[name].why.startswith(effect.why)
    assert len({(item.group, item.name) for item in items}) == len(items)
    # It says what no variant can leave out.
    assert "all the light that there is" in told["material.emitter"].why
    assert "no variant" not in told["media"].why


def test_every_setting_is_told_with_its_value():
    packed = pack(load(SCENES / "cornell.yaml", {"render.spp": 123, "render.sampler": "stratified"}))
    settings = {item.name: item.why for item in plan(packed.spec, packed) if item.group == "setting"}
    assert set(settings) == {*Render.model_fields, "film", "filter"}
    assert settings["spp"].startswith("123 samples")
    assert settings["sampler"].startswith("stratified: ")
    assert settings["film"].startswith("600 x 600 pixels")
    assert settings["filter"].startswith("box: ")
    assert not any("{" in why for why in settings.values())


def test_a_number_of_tiles_that_is_given_is_kept():
    assert replicate_workload(LARGE, 60.0, 1e6, 7).tiles == 7
    assert replicate_workload(SMALL, 60.0, 1e6, 10**6).tiles == len(SMALL)
    assert round_workload(LARGE, 1.0, 1e9, 7, 90).tiles == 7


def test_levels_are_powers_of_two_or_of_four():
    assert sample_levels(256, is_progressive=True) == (16, 32, 64, 128, 256)
    assert sample_levels(256, is_progressive=False) == (16, 64, 256)
    assert sample_levels(16, is_progressive=True) == (8, 16)


def test_every_variant_is_at_every_place_once():
    square = np.array([variant_order(7, turn) for turn in range(7)])
    for line in (*square, *square.T):
        assert sorted(line) == list(range(7))


def test_the_pace_is_that_of_the_whole_picture(tmp_path):
    world = World(per_sample=1e-5)
    spec = scene_of(tmp_path, 640, 400)
    windows = split_into_tiles(Window(0, 0, 640, 400))
    subject = Subject(world.prepare(spec, None), world.bench(), 4)
    assert warm_up(subject, windows, 0) == pytest.approx(4e5 / world.unevenness(windows).mean(), rel=0.1)
    # The first look takes no longer than a look.
    assert sum(count * spp for count, spp, _ in world.calls) * 256 / 4e5 < 3.0


def test_what_is_in_proportion_to_size_is_known_without_error():
    size = np.random.default_rng(3).exponential(size=len(WINDOWS)) + 0.1
    place = {window: number for number, window in enumerate(WINDOWS)}
    chosen = choose_tiles(WINDOWS, 25, np.random.default_rng(4), size)
    assert chosen.weight @ size[[place[window] for window in chosen.windows]] == pytest.approx(size.sum())


def test_rays_of_the_picture_are_as_uncertain_as_they_are_said_to_be():
    windows = split_into_tiles(Window(0, 0, 160, 112))
    rng = np.random.default_rng(8)
    truth = 256.0 * rng.lognormal(1.0, 0.5, len(windows))
    off = []
    for _ in range(2000):
        # Some tiles are measured so well that they are known.
        measured = choose_tiles(windows, 30, rng)
        is_measured = np.isin(np.arange(len(windows)), [windows.index(window) for window in measured.windows])
        pilot = Pilot(choose_tiles(windows, len(windows), rng), None, None, rng.normal(truth, 20.0, (2, len(windows))))
        replicates = Replicates(measured, {}, None, np.tile(truth[is_measured], (4, 1)), 0, 1.0)
        found = count_rays(WarmScene(None, windows, 1.0, pilot), replicates)
        off.append((found.value - truth.sum()) / found.error)
    # Some 40 tiles tell the standard error, so that it is near a normal distribution's.
    assert np.mean(off) == pytest.approx(0.0, abs=4.0 / 2000**0.5)
    assert np.std(off) == pytest.approx(1.0, abs=0.08)


def test_rays_of_a_picture_that_is_measured_as_a_whole_are_known():
    windows = split_into_tiles(Window(0, 0, 160, 112))
    tiles, rays = TileSample.of(windows, np.ones(len(windows))), np.full((4, len(windows)), 300.0)
    pilot = Pilot(tiles, None, None, np.random.default_rng(9).normal(300.0, 20.0, (2, len(windows))))
    replicates = Replicates(tiles, {}, None, rays, 0, 1.0)
    assert count_rays(WarmScene(None, windows, 1.0, pilot), replicates) == RayCount(300.0 * len(windows), 0.0)
    assert np.isnan(count_rays(WarmScene(None, windows, 1.0, None), replicates).value)
