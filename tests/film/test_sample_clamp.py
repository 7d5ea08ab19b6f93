"""The clamp of bright samples, and the account of the radiance that it removes."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from raytracer.analysis.cost.variants import make_variants
from raytracer.cli.base.app import main
from raytracer.core.compiler.dispatch import entry
from raytracer.film import load_layers
from raytracer.film.film import Film
from raytracer.kernel.path_log import path_log
from raytracer.kernel.path_state import workspace
from raytracer.kernel.pixel_accumulator import Clamp, accumulate
from raytracer.rendering.film_region import film_view
from raytracer.scene.load import build
from raytracer.scene.pack.scene import pack

SCENE = """\
camera: {type: pinhole, look_from: [0, 0, 4], look_at: [0, 0, 0], vfov: 40}
film: {width: 24, height: 16}
render: {spp: 16, max_depth: 5}
environment: {type: constant, radiance: 0.5}
objects:
  - {type: sphere, center: [0, 0, 0], radius: 1, material: {type: lambertian, albedo: 0.8}}
"""


@entry
def _accumulate(clamp, film, work, values, weights):
    for first in range(0, len(values), 8):
        count = min(8, len(values) - first)
        for lane in range(count):
            for channel in range(3):
                work.radiance[lane, channel] = values[first + lane, channel]
            work.weight[lane] = weights[first + lane]
        accumulate(None, clamp, film, work, 0, 0, 0, count)


def gathered(values, weights, limit):
    """A film of one pixel with these samples of a radiance, each times its weight."""
    film = film_view(Film.empty(1, 1, is_clamped=True))
    _accumulate(Clamp(limit), film, workspace(), values, weights)
    return film


def test_a_bright_sample_keeps_its_hue_and_what_it_loses_is_counted():
    values = np.array([[1.0, 2.0, 4.0], [8.0, 2.0, 0.0], [1.0, 1.0, 1.0], [4.0, 4.0, 4.0]])
    film = gathered(values, np.ones(4), 4.0)
    kept = np.array([[1.0, 2.0, 4.0], [4.0, 1.0, 0.0], [1.0, 1.0, 1.0], [4.0, 4.0, 4.0]])
    np.testing.assert_allclose(film.mean[0, 0], kept.mean(axis=0), rtol=1e-15)
    np.testing.assert_allclose(film.m2[0, 0], ((kept - kept.mean(axis=0)) ** 2).sum(axis=0), rtol=1e-14)
    # What is at the limit is not above it.
    np.testing.assert_array_equal(film.removed[0, 0], [4.0, 1.0, 0.0, 1.0])


def test_a_path_that_is_written_down_ends_with_what_the_clamp_leaves_of_it():
    log = path_log(1, 8)
    film = film_view(Film.empty(1, 1, is_clamped=True))
    values = np.array([[1.0, 2.0, 4.0], [8.0, 2.0, 0.0], [1.0, 1.0, 1.0]])
    _accumulate(Clamp(4.0), film, workspace(log=log), values, np.full(3, 0.5))
    assert log.state[0] == 1
    np.testing.assert_array_equal(log.rows[0, 2:12], [8.0, 2.0, 0.0, 2.0, 0.5, 0.0, 0.5, 4.0, 1.0, 0.0])


def test_radiance_is_measured_and_its_weight_is_not():
    # A camera whose rays count for a thousandth, a filter's negative lobe, and one for nothing.
    values, weights = np.full((3, 3), 10.0), np.array([1e-3, -0.5, 0.0])
    film = gathered(values, weights, 5.0)
    np.testing.assert_allclose(film.mean[0, 0], 5.0 * weights.mean(), rtol=1e-14)
    np.testing.assert_allclose(film.removed[0, 0], [*[5.0 * weights.sum()] * 3, 3.0], rtol=1e-14)


def test_nothing_is_lost_without_a_trace():
    random = np.random.default_rng(1)
    values, weights = random.pareto(1.5, (1003, 3)), random.random(1003)
    film = gathered(values, weights, 2.0)
    total = film.mean[0, 0] * 1003 + film.removed[0, 0, :3]
    np.testing.assert_allclose(total, (weights[:, None] * values).sum(axis=0), rtol=1e-12)
    assert film.removed[0, 0, 3] == np.count_nonzero(values.max(axis=1) > 2.0)


def test_what_is_not_finite_is_dropped_and_not_clamped():
    values = np.ones((8, 3))
    values[2, 1], values[5, 0] = np.nan, np.inf
    film = gathered(values, np.ones(8), 2.0)
    assert (film.count[0, 0], film.bad[0, 0]) == (6, 2)
    np.testing.assert_array_equal(film.mean[0, 0], 1.0)
    assert not film.removed.any()


@pytest.fixture
def scene(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "ball.yaml"
    path.write_text(SCENE)
    return path


def test_it_says_what_it_took(scene, capsys):
    # Where the ball is not, all samples are 0.5; on it they are 0.4 or 0.
    words = ["-D", "render.clamp=0.45", "-o", "a.exr", "--stats", "a.json"]
    assert main(["render", "ball.yaml", *words]) == 0
    err = capsys.readouterr().err
    stats = json.loads(Path("a.json").read_text())
    taken = stats["clamp"]
    layers, settings = load_layers("a.exr")
    radiance = layers["radiance"]
    assert radiance.max() == np.float32(0.45)
    # Of each sample of the environment 0.05 of 0.5 went; of the others nothing.
    assert taken["limit"] == 0.45
    assert 0.3 < taken["samples"] < 1.0
    samples, light = 24 * 16 * 3 * taken["samples"], radiance.sum(dtype=np.float64)
    assert taken["light"] == pytest.approx(0.05 * samples / (light + 0.05 * samples), rel=1e-6)
    assert float(settings["clamp"]) == 0.45
    assert float(settings["clamp_took"]) == taken["light"]
    said = re.search(r"all samples finite, clamp took ([\d.]+) % of the light, in ([\d.]+) % of the samples\n", err)
    assert float(said[1]) == pytest.approx(100.0 * taken["light"], rel=0.01)
    assert float(said[2]) == pytest.approx(100.0 * taken["samples"], rel=0.01)
    # Some samples of edges see the ball.
    assert main(["explain", "ball.yaml", "-D", "render.clamp=0.45", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["effects"]["clamp"]["active"]


def test_without_a_clamp_nothing_is_said_of_it(scene, capsys):
    assert main(["render", "ball.yaml", "-o", "a.exr", "--stats", "a.json"]) == 0
    assert "clamp" not in capsys.readouterr().err
    assert json.loads(Path("a.json").read_text())["clamp"] == {}
    assert "clamp" not in load_layers("a.exr")[1]


@pytest.mark.parametrize("value", ["0", "-1"])
def test_a_limit_is_a_positive_number(value, scene, capsys):
    assert main(["validate", "ball.yaml"]) == 0
    assert main(["render", "ball.yaml", "-D", f"render.clamp={value}"]) == 2
    assert "clamp" in capsys.readouterr().err


def test_its_cost_is_an_arm():
    spec = build(SCENE.replace("spp: 16", "spp: 16, clamp: 0.3"), "test.yaml")
    packed = pack(spec)
    (arm,) = (variant for variant in make_variants(spec, packed) if variant.name == "clamp")
    assert arm.packed_variant(packed.scene).clamp is None
    assert not arm.needs_repacking
    assert "clamp" not in {
        variant.name for variant in make_variants(build(SCENE, "test.yaml"), pack(build(SCENE, "t.yaml")))
    }
