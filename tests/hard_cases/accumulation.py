"""Random numbers, what they are turned into, and how samples add up to pixels."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import raytracer.rendering.render
from raytracer.core.compiler.dispatch import entry
from raytracer.core.sampling import SAMPLERS, pixel_key, sample_1d, sample_2d
from raytracer.core.sampling.hashing import unit_interval
from raytracer.film.film import Film
from raytracer.kernel.path_state import workspace
from raytracer.kernel.pixel_accumulator import FilmView, accumulate
from raytracer.kernel.russian_roulette import LEAST_THROUGHPUT, russian_roulette
from raytracer.plugins.materials.base.interface import Draws, scatter
from raytracer.plugins.materials.lambertian import Lambertian
from raytracer.rendering.diagnostics import SamplePacket, replay_samples
from raytracer.rendering.film_region import film_view
from raytracer.rendering.render import render
from raytracer.rendering.session import Rendered
from raytracer.scene.pack.scene import PackedScene, pack
from tests.hard_cases.harness import Measured, hard_case
from tests.plugins.materials.kernels import incoming, packed_row
from tests.small_scenes import scene

# The unit roundoff of float64: a rounded result is off by at most this part of itself.
ROUNDOFF = 2.0**-53

PACKET = 8


# ---- Russian roulette


class _Rule(NamedTuple):
    """As much of a scene as `russian_roulette` asks for."""

    roulette: int


@entry
def _survivors(rule, sampler, throughput, weights):
    key = pixel_key(sampler, 0, 0)
    for index in range(len(weights)):
        draws = Draws(sampler, key, index, 8)
        survival = russian_roulette(rule, (throughput, throughput, throughput), LEAST_THROUGHPUT, 9, draws)
        weights[index] = throughput / survival if survival > 0.0 else 0.0


@hard_case(40, "Veach 1997, sec. 10.4; pbrt-v4 ch. 13.4", quick=100_000, thorough=10_000_000)
def roulette_above_one(paths: int) -> list[Measured]:
    """Russian roulette with a throughput of 1.7.

    Naive: the throughput is taken for the probability, and its path, which always survives, goes on with 1.7 / 1.7.
    Clamped at 1, the path goes on as it is, exactly.  Below 1 the mean must stay what it was: of paths of 0.1 that
    survive with q = 0.4, within 5 standard deviations 0.1 sqrt((1 / q - 1) / N), where naive paths, not weighted up,
    leave 0.1 q.
    """
    sampler = SAMPLERS["independent"](1, 1)
    weights = np.empty(paths)
    _survivors(_Rule(0), sampler, 1.7, weights)
    throughput = 0.1
    q = throughput / LEAST_THROUGHPUT
    below = np.empty(paths)
    _survivors(_Rule(0), sampler, throughput, below)
    naive = throughput * float((below > 0.0).mean())
    return [
        Measured("light lost at 1.7", naive=1.7 - 1.7 / 1.7, ours=float(np.abs(weights - 1.7).max()), tolerance=0.0),
        Measured(
            "error of the mean at 0.1",
            naive=abs(naive - throughput),
            ours=abs(float(below.mean()) - throughput),
            tolerance=5.0 * throughput * math.sqrt((1.0 / q - 1.0) / paths),
        ),
    ]


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


def _summed(values: NDArray[np.float64]) -> FilmView:
    """A film of one pixel with these samples, grey ones."""
    film = film_view(Film.empty(1, 1))
    _add_up(film, workspace(), values)
    return film


@hard_case(42, "Chan, Golub, LeVeque 1983, The American Statistician 37(3)", quick=1 << 20, thorough=10**8)
def sums_of_many(count: int) -> list[Measured]:
    """A million equal samples of 0.1, and the variance of 100 + 0.01 U.

    Naive: sums in float32 stop to grow (0.96 % too much at 10^6, 79 % too little at 10^8), and E[x^2] - E[x]^2 cancels.
    The running mean rounds each packet's mean (8 roundings of sums and one of the division) and its own update (3), of
    which each is weighted by its share of the samples but the last ones: at most packets + 12 roundoffs.  The updating
    algorithm's variance is off by at most n u kappa, kappa = mean / deviation (Chan, Golub, LeVeque, table 2).
    """
    values = np.full(count, 0.1)
    mean = float(_summed(values).mean[0, 0, 0])
    naive = float(np.cumsum(values.astype(np.float32), dtype=np.float32)[-1]) / count

    noisy = 100.0 + 0.01 * np.random.default_rng(1).random(min(count, 10**6))
    film = _summed(noisy)
    exact = noisy.astype(np.longdouble)
    truth = float(((exact - exact.mean()) ** 2).sum())
    small = noisy.astype(np.float32)
    one_pass = len(noisy) * float(np.mean(small * small, dtype=np.float32) - np.mean(small, dtype=np.float32) ** 2)
    kappa = 100.0 / math.sqrt(truth / len(noisy))
    return [
        Measured(
            "relative error of the mean",
            naive=abs(naive / 0.1 - 1.0),
            ours=abs(mean / 0.1 - 1.0),
            tolerance=(count / PACKET + 12.0) * ROUNDOFF,
        ),
        Measured(
            "relative error of the variance",
            naive=abs(one_pass / truth - 1.0),
            ours=abs(float(film.m2[0, 0, 0]) / truth - 1.0),
            tolerance=len(noisy) * ROUNDOFF * kappa,
        ),
    ]


_ROOM = """
camera: {type: pinhole, look_from: [0, 0, 4], look_at: [0, 0, 0], vfov: 40}
environment: {type: constant, radiance: 1}
objects:
  - {name: ball, type: sphere, center: [0, 0, 0], radius: 1, material: {type: lambertian, albedo: 0.8}}
  - {name: glass, type: sphere, center: [1.2, 0, 0.8], radius: 0.5, material: {type: dielectric}}
  - {type: quad, corner: [-1, 3, -1], edges: [[2, 0, 0], [0, 0, 2]], material: {type: emitter, radiance: 30}}
"""


@hard_case(42, "exact sums by math.fsum, Shewchuk 1997", quick=4096, thorough=1_000_000)
def drift_of_a_pixel(spp: int) -> list[Measured]:
    """The mean of a million real samples of a pixel, against their exact sum.

    Naive: a running sum in float32.  The exact mean is that of the very samples, which are taken once more.
    The tolerance is that of equal samples, above: 1.4e-11 of a million.
    """
    spec = scene(_ROOM, width=16, height=16)
    spec = spec.model_copy(update={"render": spec.render.model_copy(update={"spp": spp, "seed": 3})})
    place = (10, 7)
    image = render(spec, threads=1, crop=(*place, place[0] + 1, place[1] + 1)).image
    values = np.concatenate([packet.values for packet in _Again(pack(spec)).samples(*place, spp)])
    exact = [math.fsum(values[:, channel]) / spp for channel in range(3)]
    naive = np.cumsum(values.astype(np.float32), axis=0, dtype=np.float32)[-1] / np.float32(spp)
    return [
        Measured(
            "relative drift of the mean",
            naive=float(np.max(np.abs(naive / exact - 1.0))),
            ours=float(np.max(np.abs(image.radiance[0, 0] / exact - 1.0))),
            tolerance=(spp / PACKET + 12.0) * ROUNDOFF,
        )
    ]


class _Again:
    """A scene whose samples are taken once more."""

    def __init__(self, packed: PackedScene) -> None:
        self._accel = packed.build()
        self._scene = packed.scene._replace(accel=self._accel.address)
        self._film = film_view(Film.empty(1, 1))

    def samples(self, x: int, y: int, spp: int) -> list[SamplePacket]:
        """Those of a pixel, packet by packet."""
        return list(replay_samples(self._scene, self._film, x, y, spp))

    def dropped(self, x: int, y: int, spp: int) -> NDArray[np.bool_]:
        """Tell of each sample (spp,) if it is not finite."""
        return np.isnan(np.concatenate([packet.weights for packet in self.samples(x, y, spp)]))


# ---- Random numbers


@entry
def _units(words, out):
    for index in range(len(words)):
        out[index] = unit_interval(words[index])


@entry
def _drawn(sampler, first, out):
    key = pixel_key(sampler, 3, 5)
    for index in range(len(out)):
        a, b = sample_2d(sampler, key, first + index, 9)
        out[index] = max(sample_1d(sampler, key, first + index, 8), max(a, b))


@hard_case(43, "pbrt-v4, util/rng.h (OneMinusEpsilon)", quick=20_000, thorough=4_000_000)
def numbers_below_one(count: int) -> list[Measured]:
    """The largest 32-bit words as numbers in [0, 1).

    Naive: as float32, 2^32 - 1 is 2^32, so its product with 2^-32 is 1, and an index made of it lies behind the end.
    None of ours may be 1: not of the largest words, nor of any sampler with any number of strata.
    """
    words = np.arange(2**32 - count, 2**32, dtype=np.uint64)
    naive = words.astype(np.uint32).astype(np.float32) * np.float32(2.0**-32)
    ours = np.empty(count)
    _units(words, ours)
    drawn = np.empty(count)
    reached = int((ours >= 1.0).sum())
    for name in SAMPLERS:
        for spp in (1, 7, 2**31 - 1):
            _drawn(SAMPLERS[name](0, spp), 2**31 - count, drawn)
            reached += int((drawn >= 1.0).sum())
    return [Measured("numbers that reach 1", naive=float((naive >= 1.0).sum()), ours=float(reached), tolerance=0.0)]


# ---- Directions


class _Given(NamedTuple):
    """A sampler of chosen pairs (n, 2), by sample."""

    pairs: NDArray[np.float64]


@pixel_key.register(_Given)
def pixel_key_given(sampler, x, y):
    return np.uint64(0)


@sample_1d.register(_Given)
def sample_1d_given(sampler, key, index, dimension):
    return sampler.pairs[index, 0]


@sample_2d.register(_Given)
def sample_2d_given(sampler, key, index, dimension):
    return sampler.pairs[index, 0], sampler.pairs[index, 1]


@entry
def _scattered(material, sampler, direction, normal, outgoing, pdf):
    for index in range(len(pdf)):
        out = scatter(material, direction, normal, True, Draws(sampler, pixel_key(sampler, 0, 0), index, 8))
        for axis in range(3):
            outgoing[index, axis] = out.direction[axis]
        pdf[index] = out.pdf


@hard_case(44, "RayTracing/raytracing.github.io issue 619, pull request 1616", quick=1000, thorough=1_000_000)
def matte_directions(count: int) -> list[Measured]:
    """Directions from a matte surface: the normal and a random unit vector may add up to nothing.

    Naive, as in the first editions of the book: normal + unit vector, normalised, in float32, for unit vectors opposite
    to the normal but for some 1e-4, 1e-8, 1e-23 of it, where the sum is wrong or zero; and points of a cube whose
    squared length underflows.  Ours must be unit vectors within 4 roundoffs of three components, on the normal's side,
    with a finite density, for the smallest and largest numbers that a sampler gives and some at random.
    """
    ends = np.array([2.0**-33, 2.0**-20, 0.25, 0.5, 0.5 + 2.0**-33, 0.75, 1.0 - 2.0**-20, 1.0 - 2.0**-33])
    grid = np.stack(np.meshgrid(ends, ends), axis=-1).reshape(-1, 2)
    pairs = np.concatenate([grid, np.random.default_rng(2).random((count, 2))])
    normal = (0.0, 0.6, -0.8)
    outgoing, pdf = np.empty((len(pairs), 3)), np.empty(len(pairs))
    _scattered(packed_row(Lambertian()), _Given(pairs), incoming(30.0), normal, outgoing, pdf)
    lengths = np.linalg.norm(outgoing, axis=1)
    wrong = ~(np.abs(lengths - 1.0) <= 4.0 * 3.0 * ROUNDOFF) | ~(outgoing @ np.array(normal) >= -4.0 * ROUNDOFF)
    wrong |= ~np.isfinite(pdf) | (pdf < 0.0)
    return [
        Measured(
            "directions that are none",
            naive=float(_naive_failures()),
            ours=float(np.count_nonzero(wrong)),
            tolerance=0.0,
        )
    ]


def _naive_failures() -> int:
    """Count near-opposite vectors, and tiny ones, that fail to become a direction in float32."""
    failures = 0
    normal = np.array([0.0, 0.0, 1.0], np.float32)
    for tilt in (1e-4, 1e-8, 1e-23):
        unit = np.array([tilt, 0.0, -1.0], np.float32)
        tiny = np.array([tilt, tilt, tilt], np.float32)
        for vector, along in ((normal + unit, normal), (tiny, None)):
            with np.errstate(all="ignore"):
                length = np.sqrt(np.dot(vector, vector))
                direction = vector / length
            is_unit = abs(float(np.linalg.norm(direction.astype(np.float64))) - 1.0) < 1e-6
            # A direction of the cosine distribution lies on the normal's side.
            failures += not (is_unit and (along is None or float(direction @ along) >= 0.0))
    return failures


# ---- Samples that are no numbers


def poisoned(packed: PackedScene, name: str) -> PackedScene:
    """The scene with a not-a-number for the albedo of the first material of this kind, such as "lambertian"."""
    tables = list(packed.scene.materials)
    (number,) = (i for i, table in enumerate(tables) if type(table).__module__.endswith(name))
    values = tables[number].albedo.values.copy()
    values[0] = math.nan
    tables[number] = tables[number]._replace(albedo=tables[number].albedo._replace(values=values))
    return packed._replace(scene=packed.scene._replace(materials=tuple(tables)))


def _rendered_poisoned(spec: Any) -> Rendered:
    found = raytracer.rendering.render.pack
    raytracer.rendering.render.pack = lambda spec, **settings: poisoned(found(spec, **settings), "lambertian")
    try:
        return render(spec, threads=2)
    finally:
        raytracer.rendering.render.pack = found


@hard_case(46, "pbrt-v4 film.cpp zeroes them, the book's program hides them", quick=64)
def samples_that_are_no_numbers(spp: int) -> list[Measured]:
    """A material whose albedo is not a number.

    Naive: one such sample is enough to lose a pixel.  Here they are dropped, counted, and the first of them named, so
    that its path can be looked at; what others bring stays.
    """
    spec = scene(_ROOM, width=16, height=16, spp=spp)
    found = _rendered_poisoned(spec)
    plain = render(spec, threads=2)
    stats = found.stats
    again = _Again(poisoned(pack(spec), "lambertian"))
    dropped = np.array([[again.dropped(x, y, spp) for x in range(16)] for y in range(16)])
    y, x, first = np.argwhere(dropped)[0]
    lost = np.count_nonzero(~np.isfinite(found.image.radiance).all(axis=2))
    # Pixels that see nothing but the environment are as they were.
    sky = plain.image.radiance == 1.0
    changed = np.count_nonzero(found.image.radiance[sky] != 1.0)
    misnamed = stats.first_nan != {"pixel": [x, y], "sample": first}
    return [
        Measured("pixels lost", naive=float(dropped.any(axis=2).sum()), ours=float(lost + changed), tolerance=0.0),
        Measured(
            "samples not reported",
            naive=float(dropped.sum()),
            ours=float(abs(int(dropped.sum()) - stats.nan_samples) + misnamed),
            tolerance=0.0,
        ),
    ]
