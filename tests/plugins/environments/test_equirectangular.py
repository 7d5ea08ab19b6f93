"""Latitude-longitude maps: what they show where, and that directions are drawn as their density says."""

import math

import numba
import numpy as np
import pytest

from raytracer.film.formats.base.image_format import StoredImage
from raytracer.plugins.environments.base.equirectangular import equirectangular
from raytracer.schema.registry import ENVIRONMENTS
from tests.plugins.environments.kernels import density, drawn, seen
from tests.small_scenes import assert_mean, image, mean
from tests.statistics import chi2_test

RNG = np.random.default_rng(11)
DIRECTIONS = RNG.normal(size=(2000, 3))
DIRECTIONS /= np.linalg.norm(DIRECTIONS, axis=1, keepdims=True)


def hot_pixel():
    picture = np.full((16, 32, 3), 1e-3)
    picture[5, 9] = 1e6
    return picture


def one(row, column):
    picture = np.zeros((8, 16, 3))
    picture[row, column] = 1.0
    return picture


MAPS = {
    "noise": RNG.random((16, 32, 3)) ** 4,
    "hot pixel": hot_pixel(),
    "one pixel": np.ones((1, 1, 3)),
    "one row": RNG.random((1, 7, 3)),
    "one column": RNG.random((6, 1, 3)),
    "black but for one": one(3, 4),
    "black but for the pole": one(0, 4),
    "black but for the other pole": one(7, 15),
    "black but for the seam": one(4, 0),
    "black half": np.concatenate([np.ones((8, 32, 3)), np.zeros((8, 32, 3))]),
    "one channel": RNG.random((9, 9, 3)) * [0.0, 0.0, 1.0],
}
each = pytest.mark.parametrize("name", MAPS)


def packed(name, rotation=0.0):
    return equirectangular(MAPS[name], rotation)


def uv_of(directions):
    """(u, v) in the unit square, by the definition."""
    x, y, z = directions.T
    return np.stack([(np.arctan2(x, -z) / (2.0 * math.pi)) % 1.0, np.arccos(np.clip(y, -1.0, 1.0)) / math.pi], axis=1)


def direction_of(u, v):
    theta, phi = math.pi * np.asarray(v), 2.0 * math.pi * np.asarray(u)
    return np.stack([np.sin(theta) * np.sin(phi), np.cos(theta), -np.sin(theta) * np.cos(phi)], axis=-1)


# ---- What is seen


def test_columns_run_from_behind_over_the_right():
    # The edges are at -z, a quarter of the width is +x, the middle +z; +y is the top.  Wide enough to be smooth.
    columns = np.arange(256.0)
    picture = np.zeros((64, 256, 3))
    picture[..., 0] = columns + 0.5
    picture[..., 1] = np.arange(64.0)[:, None] + 0.5
    environment = equirectangular(picture)
    # By bilinear interpolation u * 256 and v * 64, but at the seam, where 0.5 and 255.5 meet.
    expected = {(1, 0, 0): 64.0, (0, 0, 1): 128.0, (-1, 0, 0): 192.0, (0, 0, -1): 128.0}
    for direction, column in expected.items():
        np.testing.assert_allclose(seen(environment, direction)[0], [column, 32.0, 0.0], atol=1e-9)
    tilted = np.array([1.0, 1.0, 0.0]) / math.sqrt(2.0)
    np.testing.assert_allclose(seen(environment, tilted)[0, :2], [64.0, 16.0], atol=1e-9)


@each
def test_map_is_bilinear_between_centres(name):
    # Against a plain lookup in the map, repeated to its sides and doubled at the poles.
    picture = MAPS[name].astype(np.float32).astype(np.float64)
    height, width, _ = picture.shape
    padded = np.pad(picture, ((1, 1), (0, 0), (0, 0)), mode="edge")
    padded = np.pad(padded, ((0, 0), (1, 1), (0, 0)), mode="wrap")
    u, v = uv_of(DIRECTIONS).T
    x, y = u * width + 0.5, v * height + 0.5
    j, i = np.floor(x).astype(int), np.floor(y).astype(int)
    s, t = (x - j)[:, None], (y - i)[:, None]
    expected = (1 - t) * ((1 - s) * padded[i, j] + s * padded[i, j + 1]) + t * (
        (1 - s) * padded[i + 1, j] + s * padded[i + 1, j + 1]
    )
    np.testing.assert_allclose(seen(packed(name), DIRECTIONS), expected, rtol=1e-9, atol=1e-9 * picture.max())


@pytest.mark.parametrize("degrees", [90.0, -30.0, 360.0, 1234.5])
def test_rotation_turns_counter_clockwise_from_above(degrees):
    # What was seen along d is seen along R d, where R about +y takes +z towards +x.
    angle = math.radians(degrees)
    turn = np.array([[math.cos(angle), 0, math.sin(angle)], [0, 1, 0], [-math.sin(angle), 0, math.cos(angle)]])
    turned = packed("noise", degrees)
    np.testing.assert_allclose(seen(turned, DIRECTIONS @ turn.T), seen(packed("noise"), DIRECTIONS), atol=1e-10)
    numbers = RNG.random((500, 2))
    np.testing.assert_allclose(
        drawn(turned, numbers).direction, drawn(packed("noise"), numbers).direction @ turn.T, atol=1e-12
    )


# ---- What is drawn


@each
def test_density_is_that_of_the_sample(name):
    # Where both ways of finding a direction give the same density, MIS weights sum to 1.
    environment = packed(name, 33.0)
    out = drawn(environment, RNG.random((4000, 2)))
    np.testing.assert_allclose(np.linalg.norm(out.direction, axis=1), 1.0, rtol=1e-14)
    np.testing.assert_allclose(density(environment, out.direction), out.pdf, rtol=1e-6)
    np.testing.assert_allclose(seen(environment, out.direction), out.radiance, rtol=1e-6, atol=1e-12 * MAPS[name].max())
    assert (out.pdf > 0.0).all()
    assert out.radiance.any(axis=1).all()


@each
def test_directions_are_drawn_by_their_density(name):
    # In (u, v), where a density in solid angle counts 2 pi^2 sin theta; cells end where the map has a kink.
    environment = packed(name)
    height, width, _ = MAPS[name].shape
    out = drawn(environment, RNG.random((200_000, 2)))

    def pdf(uv):
        return density(environment, direction_of(uv[:, 0], uv[:, 1])) * 2.0 * math.pi**2 * np.sin(math.pi * uv[:, 1])

    chi2_test(uv_of(out.direction), pdf, ((0.0, 1.0), (0.0, 1.0)), (2 * width, 2 * height), order=4, tests=len(MAPS))


@each
def test_light_is_never_where_nothing_is_drawn_and_extreme_numbers_draw_sound_directions(name):
    environment, last = packed(name), 1.0 - 2.0**-53
    bright = seen(environment, DIRECTIONS).any(axis=1)
    assert (density(environment, DIRECTIONS)[bright] > 0.0).all()
    for values in drawn(environment, [(0.0, 0.0), (last, last), (0.5, 0.5), (0.0, last)]):
        assert np.isfinite(values).all()
    poles_and_seam = np.array([[0, 1, 0], [0, -1, 0], [0, 0, -1], [-0.0, 0, -1], [0, 1, -0.0]], np.float64)
    assert np.isfinite(seen(environment, poles_and_seam)).all()
    assert np.isfinite(density(environment, poles_and_seam)).all()


def test_a_hot_pixel_has_little_noise():
    # Radiance over pdf is nearly the same for all: the whole sphere's light, 32 x 16 pixels of it hot in one.  Of
    # uniform directions it would have a standard deviation of some 20 times the mean.
    out = drawn(packed("hot pixel"), RNG.random((100_000, 2)))
    each_one = out.radiance[:, 0] / out.pdf
    assert each_one.std() < 0.2 * each_one.mean()


def test_well_spread_numbers_give_well_spread_directions():
    # A grid of numbers, one in each cell: the mean radiance of a hemisphere's worth has far less noise than by chance.
    environment = packed("noise")
    grid = (np.stack(np.meshgrid(np.arange(64), np.arange(64)), axis=-1).reshape(-1, 2) + RNG.random((4096, 2))) / 64.0

    def estimate(numbers):
        out = drawn(environment, numbers)
        return float((out.radiance[:, 0] * np.maximum(out.direction[:, 1], 0.0) / out.pdf).mean())

    exact = estimate(RNG.random((500_000, 2)))
    by_chance = np.std([estimate(RNG.random((4096, 2))) for _ in range(20)])
    assert abs(estimate(grid) - exact) < 0.5 * by_chance


# ---- The kind


def spec_of(**keys):
    return ENVIRONMENTS.specs()["image"].model_validate({"type": "image", "file": "map.exr", **keys})


def test_black_maps_are_none():
    black = StoredImage(np.zeros((4, 8, 3), np.float32), False)
    white = StoredImage(np.ones((4, 8, 3), np.float32), False)
    assert spec_of().pack({"file": black}) is None
    assert spec_of(scale=0).pack({"file": white}) is None
    assert spec_of(scale=[0, 0, 1e-3]).pack({"file": white}) is not None


def test_integers_are_srgb_unless_told_otherwise():
    # IEC 61966-2-1: 188 of 255 is 0.5029 in linear light.
    grey = StoredImage(np.full((2, 4, 1), 188, np.uint8), True)
    linear = StoredImage(np.full((2, 4, 4), 0.5, np.float32), False)

    def value(picture, **keys):
        return float(seen(spec_of(**keys).pack({"file": picture}), [1.0, 0.0, 0.0])[0, 1])

    assert value(grey) == pytest.approx(0.5029, abs=1e-4)
    assert value(grey, encoding="srgb") == value(grey)
    assert value(grey, encoding="linear") == pytest.approx(188.0 / 255.0, rel=1e-6)
    assert value(linear) == 0.5
    assert value(linear, encoding="srgb") == pytest.approx(0.2140, abs=1e-4)
    assert value(linear, scale=[1, 3, 1]) == 1.5


@pytest.mark.parametrize(
    ("value", "words"), [(np.nan, "holds NaN"), (-1.0, "negative"), (np.inf, "infinite"), (1e39, "3.4e38")]
)
def test_maps_of_what_is_no_radiance_are_refused(value, words):
    picture = np.ones((4, 8, 3))
    picture[1, 2, 0] = value
    with pytest.raises(ValueError, match=words):
        equirectangular(picture)


def test_maps_of_all_sizes_are_of_one_type():
    assert numba.typeof(packed("one pixel")) == numba.typeof(packed("noise", 30.0))


# ---- In a scene


def test_aiming_changes_no_picture(tmp_path):
    # The same scene with surfaces that aim at the map, and with paths that find it by themselves.
    np.save(tmp_path / "map.npy", np.random.default_rng(2).random((6, 12, 3)) ** 3)
    text = """
camera: {type: pinhole, look_from: [0, 0, 9], look_at: [0, 0, 0], vfov: 8}
environment: {type: image, file: map.npy}
objects:
  - {type: sphere, center: [0, 0, 0], radius: 1, material: {type: lambertian, albedo: 0.7}}
"""
    aimed = image(text, base=tmp_path, filled=False, spp=512)
    followed = image(text, base=tmp_path, filled=False, spp=2048, seed=2, light_sampling="paths")
    (value, deviation), (other, other_deviation) = mean(aimed), mean(followed)
    np.testing.assert_array_less(np.abs(value - other), 4.0 * np.hypot(deviation, other_deviation))
    assert (np.hypot(deviation, other_deviation) < 0.01 * value).all()
    # By pixels too: not more of them far apart than chance has it.
    z = (aimed.radiance - followed.radiance) / np.sqrt(aimed.variance + followed.variance)
    assert np.abs(z).max() < 5.0
    assert 0.8 < z.std() < 1.2


def test_a_small_bright_lamp_is_found(tmp_path):
    # One hot pixel straight up, of solid angle 2 pi (1 - cos(pi / 64)): followed paths would hardly meet it.
    picture = np.zeros((64, 128, 3))
    picture[:1] = 1000.0
    np.save(tmp_path / "map.npy", picture)
    floor = """
camera: {type: pinhole, look_from: [0, 3, 0], look_at: [0, 0, 0], up: [0, 0, 1], vfov: 2}
environment: {type: image, file: map.npy}
objects:
  - {type: sphere, center: [0, -1000, 0], radius: 1000, material: {type: lambertian, albedo: 1}}
"""
    # Irradiance by quadrature over the angle from the pole: 1000 in the first row's half, linear to 0 in the next.
    t = (np.arange(100_000) + 0.5) / 100_000 * 1.5 * math.pi / 64
    radiance = 1000.0 * np.clip(1.5 - t * 64 / math.pi, 0.0, 1.0)
    expected = (radiance * np.cos(t) * np.sin(t)).sum() * 2.0 * math.pi * t[-1] / 100_000 / math.pi
    assert_mean(image(floor, base=tmp_path, filled=False, spp=64, max_depth=2), expected)
