"""Random numbers, what they are turned into, and how samples add up to pixels."""

import math
from typing import Any, NamedTuple
from unittest.mock import patch

import numpy as np

from raytracer.core.compiler.dispatch import entry, kernel
from raytracer.core.sampling import SAMPLERS, pixel_key, sample_1d, sample_2d
from raytracer.core.sampling.hashing import unit_interval
from raytracer.film.film import Film
from raytracer.kernel.path_state import workspace
from raytracer.kernel.pixel_accumulator import accumulate
from raytracer.kernel.russian_roulette import LEAST_THROUGHPUT, russian_roulette
from raytracer.plugins.materials.base.interface import Draws, scatter
from raytracer.plugins.materials.lambertian import Lambertian
from raytracer.rendering.diagnostics import replay_samples
from raytracer.rendering.film_region import film_view
from raytracer.rendering.render import render
from raytracer.scene.pack.scene import pack
from tests.hard_cases.harness import ROUNDING, hard_case
from tests.plugins.materials.kernels import incoming, packed_row
from tests.small_scenes import scene
from tests.vectorised import random_draws, rows, vectorised

ROUNDOFF = ROUNDING
PACKET = 8

MANY = 1_000_000
"""Trials at a time, so that they take little memory."""


class _Rule(NamedTuple):
    """As much of a scene as `russian_roulette` asks for."""

    roulette: int


@hard_case(40, "Veach 1997, sec. 10.4; pbrt-v4 ch. 13.4", quick=100_000, thorough=10_000_000)
def roulette_above_one(paths):
    """Russian roulette with a throughput of 1.7.

    Naive: the throughput is taken for the probability, and its path, which always survives, goes on with 1.7 / 1.7.
    Clamped at 1, the path goes on as it is, exactly.  Below 1 the mean must stay what it was: of paths of 0.1 that
    survive with q = 0.4, within 5 standard deviations 0.1 sqrt((1 / q - 1) / N), where naive paths, not weighted up,
    leave 0.1 q.
    """

    def weights(throughput):
        given = (_Rule(0), (throughput,) * 3, LEAST_THROUGHPUT, 9)
        parts = [min(MANY, paths - first) for first in range(0, paths, MANY)]
        draws = (random_draws(part, seed=seed) for seed, part in enumerate(parts))
        survival = np.concatenate([vectorised(russian_roulette)(*given, some) for some in draws])
        return np.where(survival > 0.0, throughput / survival, 0.0)

    yield "light lost at 1.7", 1.7 - 1.7 / 1.7, weights(1.7) - 1.7
    throughput, below = 0.1, weights(0.1)
    tolerance = 5.0 * throughput * math.sqrt((LEAST_THROUGHPUT / throughput - 1.0) / paths)
    naive = throughput * (below > 0.0).mean()
    yield "error of the mean at 0.1", naive - throughput, below.mean() - throughput, tolerance


# ---- Sums


@entry
def _add_up(film, work, values):
    for first in range(0, len(values), 8):
        count = min(8, len(values) - first)
        for lane in range(count):
            for channel in range(3):
                work.radiance[lane, channel] = values[first + lane]
            work.weight[lane] = 1.0
        accumulate(None, None, film, work, 0, 0, 0, count)


def _summed(values):
    """A film of one pixel with these samples, grey ones."""
    film = film_view(Film.empty(1, 1))
    _add_up(film, workspace(), values)
    return film


@hard_case(42, "Chan, Golub, LeVeque 1983, The American Statistician 37(3)", quick=1 << 20, thorough=10**8)
def sums_of_many(count):
    """A million equal samples of 0.1, and the variance of 100 + 0.01 U.

    Naive: sums in float32 stop to grow (0.96 % too much at 10^6, 79 % too little at 10^8), and E[x^2] - E[x]^2 cancels.
    The running mean rounds each packet's mean (8 roundings of sums and one of the division) and its own update (3), of
    which each is weighted by its share of the samples but the last ones: at most packets + 12 roundoffs.  The updating
    algorithm's variance is off by at most n u kappa, kappa = mean / deviation (Chan, Golub, LeVeque, table 2).
    """
    values = np.full(count, 0.1)
    naive = float(np.cumsum(values.astype(np.float32), dtype=np.float32)[-1]) / count
    means = (mean / 0.1 - 1.0 for mean in (naive, _summed(values).mean[0, 0, 0]))
    yield "relative error of the mean", *means, (count / PACKET + 12.0) * ROUNDOFF

    noisy = 100.0 + 0.01 * np.random.default_rng(1).random(min(count, 10**6))
    exact = noisy.astype(np.longdouble)
    truth = float(((exact - exact.mean()) ** 2).sum())
    small = noisy.astype(np.float32)
    one_pass = len(noisy) * float(np.mean(small * small, dtype=np.float32) - np.mean(small, dtype=np.float32) ** 2)
    kappa = 100.0 / math.sqrt(truth / len(noisy))
    sums = (m2 / truth - 1.0 for m2 in (one_pass, _summed(noisy).m2[0, 0, 0]))
    yield "relative error of the variance", *sums, len(noisy) * ROUNDOFF * kappa


_ROOM = """
camera: {type: pinhole, look_from: [0, 0, 4], look_at: [0, 0, 0], vfov: 40}
environment: {type: constant, radiance: 1}
objects:
  - {name: ball, type: sphere, center: [0, 0, 0], radius: 1, material: {type: lambertian, albedo: 0.8}}
  - {name: glass, type: sphere, center: [1.2, 0, 0.8], radius: 0.5, material: {type: dielectric}}
  - {type: quad, corner: [-1, 3, -1], edges: [[2, 0, 0], [0, 0, 2]], material: {type: emitter, radiance: 30}}
"""


@hard_case(42, "exact sums by math.fsum, Shewchuk 1997", quick=4096, thorough=1_000_000)
def drift_of_a_pixel(spp):
    """The mean of a million real samples of a pixel, against their exact sum.

    Naive: a running sum in float32.  The exact mean is that of the very samples, which are taken once more.
    The tolerance is that of equal samples, above: 1.4e-11 of a million.
    """
    spec = scene(_ROOM, lit=True, width=16, height=16)
    spec = spec.model_copy(update={"render": spec.render.model_copy(update={"spp": spp, "seed": 3})})
    image = render(spec, threads=1, crop=(10, 7, 11, 8)).image
    values = np.concatenate([packet.values for packet in _again(pack(spec))(10, 7, spp)])
    exact = np.array([math.fsum(column) / spp for column in values.T])
    naive = np.cumsum(values.astype(np.float32), axis=0, dtype=np.float32)[-1] / np.float32(spp)
    drifts = (found / exact - 1.0 for found in (naive, image.radiance[0, 0]))
    yield "relative drift of the mean", *drifts, (spp / PACKET + 12.0) * ROUNDOFF


def _again(packed):
    """A function of a pixel that takes its samples once more, packet by packet."""
    accel, film = packed.build(), film_view(Film.empty(1, 1))
    ready = packed.scene._replace(accel=accel.address)
    # The acceleration structure has to live as long as its samples are taken.
    return lambda x, y, spp, accel=accel: list(replay_samples(ready, film, x, y, spp))


# ---- Random numbers


@kernel
def largest_draw(sampler, key, index):
    a, b = sample_2d(sampler, key, index, 9)
    return max(sample_1d(sampler, key, index, 8), max(a, b))


@hard_case(43, "pbrt-v4, util/rng.h (OneMinusEpsilon)", quick=20_000, thorough=4_000_000)
def numbers_below_one(count):
    """The largest 32-bit words as numbers in [0, 1).

    Naive: as float32, 2^32 - 1 is 2^32, so its product with 2^-32 is 1, and an index made of it lies behind the end.
    None of ours may be 1: not of the largest words, nor of any sampler with any number of strata.
    """
    samplers = [make(0, spp) for make in SAMPLERS.values() for spp in (1, 7, 2**31 - 1)]
    for below in range(0, count, MANY):
        words = np.arange(2**32 - min(count, below + MANY), 2**32 - below, dtype=np.uint64)
        naive = words.astype(np.uint32).astype(np.float32) * np.float32(2.0**-32)
        yield "numbers that reach 1", naive >= 1.0, vectorised(unit_interval)(rows(words)) >= 1.0
        indices = rows((words - np.uint64(2**31)).astype(np.int64))
        for sampler in samplers:
            drawn = vectorised(largest_draw)(sampler, pixel_key(sampler, 3, 5), indices)
            yield "numbers that reach 1", 0, drawn >= 1.0


# ---- Directions


class _Given(NamedTuple):
    """A sampler of one chosen pair."""

    pair: Any


@sample_1d.register(_Given)
def sample_1d_given(sampler, key, index, dimension):
    return sampler.pair[0]


@sample_2d.register(_Given)
def sample_2d_given(sampler, key, index, dimension):
    return sampler.pair


@hard_case(44, "RayTracing/raytracing.github.io issue 619, pull request 1616", quick=1000, thorough=1_000_000)
def matte_directions(count):
    """Directions from a matte surface: the normal and a random unit vector may add up to nothing.

    Naive, as in the first editions of the book: normal + unit vector, normalised, in float32, for unit vectors opposite
    to the normal but for some 1e-4, 1e-8, 1e-23 of it, where the sum is wrong or zero; and points of a cube whose
    squared length underflows.  Ours must be unit vectors within 4 roundoffs of three components, on the normal's side,
    with a finite density, for the smallest and largest numbers that a sampler gives and some at random.
    """
    ends = np.array([2.0**-33, 2.0**-20, 0.25, 0.5, 0.5 + 2.0**-33, 0.75, 1.0 - 2.0**-20, 1.0 - 2.0**-33])
    grid = np.stack(np.meshgrid(ends, ends), axis=-1).reshape(-1, 2)
    pairs = rows(np.concatenate([grid, np.random.default_rng(2).random((count, 2))]))
    normal = (0.0, 0.6, -0.8)
    draws = Draws(_Given(pairs), np.uint64(0), 0, 8)
    out = vectorised(scatter)(packed_row(Lambertian()), incoming(30.0), normal, True, draws)
    lengths = np.linalg.norm(out.direction, axis=1)
    right = (np.abs(lengths - 1.0) <= 4.0 * 3.0 * ROUNDOFF) & (out.direction @ np.array(normal) >= -4.0 * ROUNDOFF)
    yield "directions that are none", _naive_failures(), ~(right & np.isfinite(out.pdf) & (out.pdf >= 0.0))


def _naive_failures():
    """Count near-opposite vectors, and tiny ones, that fail to become a direction in float32."""
    failures = 0
    normal = np.array([0.0, 0.0, 1.0], np.float32)
    for tilt in (1e-4, 1e-8, 1e-23):
        unit = np.array([tilt, 0.0, -1.0], np.float32)
        tiny = np.array([tilt, tilt, tilt], np.float32)
        for vector, along in ((normal + unit, normal), (tiny, None)):
            direction = vector / np.sqrt(np.dot(vector, vector))
            is_unit = abs(float(np.linalg.norm(direction.astype(np.float64))) - 1.0) < 1e-6
            # A direction of the cosine distribution lies on the normal's side.
            failures += not (is_unit and (along is None or float(direction @ along) >= 0.0))
    return failures


# ---- Samples that are no numbers


def poisoned(packed, name):
    """The scene with a not-a-number for the albedo of the first material of this kind, such as "lambertian"."""
    tables = list(packed.scene.materials)
    (number,) = (i for i, table in enumerate(tables) if type(table).__module__.endswith(name))
    values = tables[number].albedo.values.copy()
    values[0] = math.nan
    tables[number] = tables[number]._replace(albedo=tables[number].albedo._replace(values=values))
    return packed._replace(scene=packed.scene._replace(materials=tuple(tables)))


@hard_case(46, "pbrt-v4 film.cpp zeroes them, the book's program hides them", quick=64)
def samples_that_are_no_numbers(spp):
    """A material whose albedo is not a number.

    Naive: one such sample is enough to lose a pixel.  Here they are dropped, counted, and the first of them named, so
    that its path can be looked at; what others bring stays.
    """
    spec = scene(_ROOM, lit=True, width=16, height=16, spp=spp)
    plain = render(spec, threads=2).image.radiance
    with patch(
        "raytracer.rendering.render.pack", lambda *given, **named: poisoned(pack(*given, **named), "lambertian")
    ):
        found = render(spec, threads=2)
    again = _again(poisoned(pack(spec), "lambertian"))
    weights = [np.concatenate([packet.weights for packet in again(n % 16, n // 16, spp)]) for n in range(256)]
    dropped = np.isnan(weights)
    # Pixels that see nothing but the environment are as they were.
    radiance, sky = found.image.radiance, plain == 1.0
    lost = np.count_nonzero(~np.isfinite(radiance).all(axis=2)) + np.count_nonzero(radiance[sky] != 1.0)
    yield "pixels lost", dropped.any(axis=1), lost
    number, first = np.argwhere(dropped)[0]
    misnamed = found.stats.first_nan != {"pixel": [number % 16, number // 16], "sample": first}
    yield "samples not reported", dropped, abs(int(dropped.sum()) - found.stats.nan_samples) + misnamed
