"""Random numbers, and the directions that are drawn with them: discs, frames, distributions."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from raytracer.core.compiler.dispatch import entry
from raytracer.core.microfacet import sample_visible_normal
from raytracer.core.primitives.spheres import Spheres
from raytracer.core.sampling import SAMPLERS, warp
from raytracer.core.vec import basis
from raytracer.optics.glass import parse_glass
from raytracer.plugins.environments.base.equirectangular import equirectangular
from raytracer.plugins.materials.base.interface import MaterialSpec
from raytracer.plugins.materials.rough_conductor import RoughConductor
from raytracer.plugins.media.homogeneous import Homogeneous
from tests.core.sampling.draws import draw_1d, draw_2d
from tests.core.sampling.test_warp import PDF_SPHERE, pdf_hemisphere
from tests.core.test_microfacet import pdf_visible_normal
from tests.hard_cases.harness import Measured, hard_case
from tests.plugins.environments.kernels import density, drawn
from tests.plugins.materials import test_contract as contract
from tests.plugins.materials.kernels import evaluate_many, incoming, scatter_many
from tests.plugins.media import kernels as media
from tests.plugins.shapes.kernels import pdf_of, sample
from tests.statistics import CYLINDER, cell_integrals, chi2_excess, cylinder, directions, sidak

ROUNDING = 2.0**-53
"""The most by which rounding to float64 changes a number, relative to it."""

ALARM = 1e-3
"""Odds with which a topic's chi-square tests reject what is right; seeds are fixed."""


# ---- Discs and frames


@hard_case(
    35, "Shirley, Chiu 1997, JGT 2(3); Pharr et al. 2023, PBRT, A.5.1 and 8.6.1", quick=20_000, thorough=1_000_000
)
def concentric_disc(trials: int) -> list[Measured]:
    """The middle and the rim of the disc from which cosine-weighted directions are drawn.

    The middle is 0 / 0 of the map's two coordinates; at the rim 1 - x^2 - y^2 rounds to less than 0, so its root is no
    number.  Naive: the map in float32 as it is printed.  Ours must have none of either: nothing is tolerated.
    """
    rng = np.random.default_rng(35)
    rim = np.array([0.0, 2.0**-33, 1.0 - 2.0**-33, 1.0 - ROUNDING])[rng.integers(0, 4, trials)]
    u = np.stack([rim, rng.random(trials)], axis=1)
    u = np.where(rng.random(trials)[:, None] < 0.5, u, u[:, ::-1])
    ours = np.array([warp.sample_cosine_hemisphere(u1, u2) for u1, u2 in u.tolist()])

    x, y = _disc32(u)
    with np.errstate(invalid="ignore"):
        lost = np.isnan(np.sqrt(np.float32(1.0) - x * x - y * y)).sum()
        middle = np.hypot(*_disc32(np.array([[0.5, 0.5]])))[0]
    return [
        Measured(
            "directions at the rim that are no numbers", float(lost), float((~np.isfinite(ours)).any(axis=1).sum()), 0.0
        ),
        Measured(
            "distance of the image of (1/2, 1/2) from the middle",
            float(middle),
            math.hypot(*warp.sample_disc(0.5, 0.5)),
            0.0,
        ),
    ]


def _disc32(u: NDArray[np.float64]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    a, b = (np.float32(2.0) * u.astype(np.float32) - np.float32(1.0)).T
    quarter = np.float32(0.25 * np.pi)
    with np.errstate(invalid="ignore", divide="ignore"):
        first = np.abs(a) > np.abs(b)
        radius, angle = np.where(first, a, b), quarter * np.where(first, b / a, np.float32(2.0) - a / b)
    return radius * np.cos(angle), radius * np.sin(angle)


@hard_case(
    36, "Duff et al. 2017, Building an Orthonormal Basis, Revisited, JCGT 6(1), figure 1", quick=5_000, thorough=500_000
)
def orthonormal_basis(trials: int) -> list[Measured]:
    """The frame about normals that look almost straight back, against Frisvad's in float32.

    1 / (1 + z) of a z near -1 has no digits, so Frisvad's tangents are neither of unit length nor at right angles.
    Each entry of our frame's Gram matrix takes three products of numbers, themselves wrong by up to four roundings.
    """
    rng = np.random.default_rng(36)
    known = np.array([[0.00038527316, 0.00038460016, -0.99999988079]])
    tilt, phi = 10.0 ** rng.uniform(-9.0, 0.0, trials), rng.uniform(0.0, 2.0 * np.pi, trials)
    steep = np.stack([tilt * np.cos(phi), tilt * np.sin(phi), -np.ones(trials)], axis=1)
    poles = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [1.0, 0.0, -0.0], [-0.0, -1.0, 0.0]])
    normals = np.concatenate([known, poles, steep, rng.normal(size=(trials, 3))])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    # Our frame's own pole is -y.
    both = np.concatenate([normals, normals[:, [1, 2, 0]]])
    ours = np.array([[*basis((x, y, z)), (x, y, z)] for x, y, z in both.tolist()])
    tolerance = 3.0 * (2.0 * 4.0 + 1.0) * ROUNDING
    return [
        Measured("largest entry of the frame's Gram matrix less 1", _off(_frisvad32(normals)), _off(ours), tolerance)
    ]


def _off(frames: NDArray[Any]) -> float:
    frames = frames.astype(np.float64)
    return float(np.abs(frames @ frames.transpose(0, 2, 1) - np.eye(3)).max())


def _frisvad32(normals: NDArray[np.float64]) -> NDArray[np.float32]:
    """References: Frisvad 2012, "Building an Orthonormal Basis ... Without Normalization", JGT 16(3), listing 2."""
    x, y, z = normals.astype(np.float32).T
    one = np.float32(1.0)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        a = one / (one + z)
        b = -x * y * a
        frames = np.stack([one - x * x * a, b, -x, b, one - y * y * a, -y, x, y, z], axis=1).reshape(-1, 3, 3)
    return np.asarray(frames[z >= np.float32(-0.9999999)])


# ---- Distributions


@hard_case(47, "Subr, Arvo 2007; pbrt-v4 src/pbrt/bsdfs_test.cpp", quick=50_000, thorough=1_000_000)
def directions_follow_their_densities(samples: int) -> list[Measured]:
    """Chi-square of every sampler of directions against the density that it tells, over the critical value.

    At the critical value, all tests of a row together reject what is right once in a thousand times.  Naive: for the
    sphere, even in the angle from the pole; for cones too; for cosines, the normal plus a point *within* the unit ball;
    facets without regard to whether they are seen; a map by its pixels, as if they all had one solid angle; and for
    materials, a density that forgets what facets scatter more than once.  How much is absorbed is not asked here.
    """
    rng = np.random.default_rng(47)
    u = rng.random((samples, 2))
    rows = [_warps(u, rng), _sphere_lights(u), _visible_normals(u), _maps(u), _phases(u)]
    return [*rows, _materials(samples, ANGLES if samples > 100_000 else ANGLES[:1])]


ANGLES = (30.0, 0.0, 75.0, 85.0)


def _excess(
    samples: NDArray[np.float64], pdf: Callable[..., Any], bounds: Any, cells: Any, order: int, tests: int
) -> float:
    mass = cell_integrals(pdf, bounds, cells, order)
    observed, _ = np.histogramdd(samples, bins=cells, range=bounds)
    assert observed.sum() == len(samples), "samples out of bounds"
    return chi2_excess(observed, len(samples) * mass / mass.sum(), ALARM, tests)


def _warps(u: NDArray[np.float64], rng: np.random.Generator) -> Measured:
    sphere = np.array([warp.sample_sphere(*pair) for pair in u.tolist()])
    half = np.array([warp.sample_cone(*pair, 1.0) for pair in u.tolist()])
    cosine = np.array([warp.sample_cosine_hemisphere(*pair) for pair in u.tolist()])
    flat = np.vectorize(pdf_hemisphere)
    lambert = np.vectorize(warp.pdf_cosine_hemisphere)
    found = [
        _excess(cylinder(sphere), lambda x: np.full(len(x), PDF_SPHERE), CYLINDER, (20, 40), 4, 3),
        _excess(cylinder(half), lambda x: flat(x[:, 0]), CYLINDER, (20, 40), 4, 3),
        _excess(cylinder(cosine), lambda x: lambert(x[:, 0]), CYLINDER, (20, 40), 4, 3),
    ]
    within = rng.normal(size=(len(u), 3))
    within *= (rng.random(len(u)) ** (1.0 / 3.0) / np.linalg.norm(within, axis=1))[:, None]
    lazy = within + np.array([0.0, 0.0, 1.0])
    lazy /= np.linalg.norm(lazy, axis=1, keepdims=True)
    angles = np.stack([np.cos(np.pi * u[:, 0]), 2.0 * np.pi * u[:, 1] - np.pi], axis=1)
    naive = [
        _excess(angles, lambda x: np.full(len(x), PDF_SPHERE), CYLINDER, (20, 40), 4, 3),
        _excess(cylinder(lazy), lambda x: lambert(x[:, 0]), CYLINDER, (20, 40), 4, 3),
    ]
    return Measured("sphere, hemisphere, cosines: chi-square over critical", min(naive), max(found), 1.0)


def _sphere_lights(u: NDArray[np.float64]) -> Measured:
    """Directions to spheres that fill a thin cone and a wide one, and from within, about the axis to the centre."""
    found, naive = [], []
    for distance in (1e4, 1.5, 0.5):
        table = Spheres(np.array([[0.0, 0.0, distance]]), np.ones(1), np.zeros(1, np.int32))
        points = sample((table,), 0, 0, (0.0, 0.0, 0.0), u)
        way = points.point / np.linalg.norm(points.point, axis=1, keepdims=True)
        if distance < 1.0:
            # By area, whose density in solid angle depends on the point that a direction meets.
            bounds, cells, order = CYLINDER, (40, 8), 8
            found.append(
                _excess(
                    cylinder(way), lambda x, t=table, d=distance: _seen_from_within(t, d, x), bounds, cells, order, 3
                )
            )
            continue
        most = warp.one_minus_cosine(1.0 / distance**2)
        sine2 = way[:, 0] ** 2 + way[:, 1] ** 2
        height = np.minimum(1.0, sine2 / (1.0 + way[:, 2]) / most)
        phi = np.arctan2(way[:, 1], way[:, 0])
        pdf = float(points.pdf[0]) * most
        bounds = ((0.0, 1.0), (-np.pi, np.pi))
        found.append(
            _excess(np.stack([height, phi], axis=1), lambda x, p=pdf: np.full(len(x), p), bounds, (20, 40), 2, 3)
        )
        even = np.stack([u[:, 0] ** 2, 2.0 * np.pi * u[:, 1] - np.pi], axis=1)
        naive.append(_excess(even, lambda x, p=pdf: np.full(len(x), p), bounds, (20, 40), 2, 3))
    return Measured("sphere lights: chi-square over critical", min(naive), max(found), 1.0)


def _seen_from_within(table: Spheres, distance: float, coordinates: NDArray[np.float64]) -> NDArray[np.float64]:
    """`pdf_point` of where directions from the origin meet a unit sphere about (0, 0, distance) that holds it."""
    way = directions(coordinates)
    along = distance * way[:, 2]
    points = way * (along + np.sqrt(1.0 - distance**2 + along**2))[:, None]
    return pdf_of((table,), 0, 0, (0.0, 0.0, 0.0), points, points - [0.0, 0.0, distance])


@entry
def _visible(alpha, toward, u, out):
    for index in range(len(u)):
        half = sample_visible_normal(alpha, toward, u[index, 0], u[index, 1])
        for axis in range(3):
            out[index, axis] = half[axis]


@entry
def _visible_pdf(alpha, toward, half, out):
    for index in range(len(out)):
        out[index] = pdf_visible_normal(alpha, toward, (half[index, 0], half[index, 1], half[index, 2]))


def _visible_normals(u: NDArray[np.float64]) -> Measured:
    found, naive = [], []
    for alpha in (0.2, 1.0):
        for cosine in (1.0, 0.5, 0.1):
            toward = (math.sqrt(1.0 - cosine * cosine), 0.0, cosine)
            half = np.empty((len(u), 3))
            _visible(alpha, toward, np.ascontiguousarray(u), half)

            def pdf(x: NDArray[np.float64], alpha: float = alpha, toward: Any = toward) -> NDArray[np.float64]:
                points = directions(x)
                out = np.empty(len(points))
                _visible_pdf(alpha, toward, points, out)
                return np.where(points[:, 2] > 0.0, out, 0.0)

            found.append(_excess(cylinder(half), pdf, CYLINDER, (60, 24), 12, 6))
            # All facets, by their areas: Walter et al. 2007, eq. 35 and 36.
            height = np.sqrt((1.0 - u[:, 0]) / (1.0 + (alpha * alpha - 1.0) * u[:, 0]))
            every = np.stack([height, 2.0 * np.pi * u[:, 1] - np.pi], axis=1)
            if cosine == 0.5:
                naive.append(_excess(every, lambda x, pdf=pdf: np.maximum(pdf(x), 1e-6), CYLINDER, (60, 24), 12, 6))
    return Measured("visible facets: chi-square over critical", min(naive), max(found), 1.0)


def _maps(u: NDArray[np.float64]) -> Measured:
    rng = np.random.default_rng(48)
    noise, hot = rng.random((16, 32, 3)) ** 4, np.full((16, 32, 3), 1e-3)
    hot[2, 0] = 1.0
    found, naive = [], []
    for picture in (noise, hot):
        environment = equirectangular(picture)
        way = drawn(environment, u).direction
        places = np.stack(
            [
                (np.arctan2(way[:, 0], -way[:, 2]) / (2.0 * np.pi)) % 1.0,
                np.arccos(np.clip(way[:, 1], -1.0, 1.0)) / np.pi,
            ],
            axis=1,
        )

        def pdf(x: NDArray[np.float64], environment: Any = environment) -> NDArray[np.float64]:
            theta, phi = np.pi * x[:, 1], 2.0 * np.pi * x[:, 0]
            toward = np.stack([np.sin(theta) * np.sin(phi), np.cos(theta), -np.sin(theta) * np.cos(phi)], axis=1)
            return density(environment, toward) * 2.0 * np.pi**2 * np.sin(theta)

        bounds = ((0.0, 1.0), (0.0, 1.0))
        found.append(_excess(places, pdf, bounds, (64, 32), 4, 2))
        weights = picture.sum(axis=2).ravel()
        texel = rng.choice(512, size=len(u), p=weights / weights.sum())
        even = np.stack([(texel % 32 + u[:, 0]) / 32.0, (texel // 32 + u[:, 1]) / 16.0], axis=1)
        naive.append(_excess(even, lambda x, pdf=pdf: pdf(x), bounds, (64, 32), 4, 2))
    return Measured("environment maps: chi-square over critical", min(naive), max(found), 1.0)


def _phases(u: NDArray[np.float64]) -> Measured:
    found, naive = [], []
    up = (0.0, 0.0, 1.0)
    for g in (0.0, 0.5, -0.9):
        table = media.packed(Homogeneous(scattering=(1.0, 1.0, 1.0), g=g))
        pdf = lambda x, table=table: media.evaluate_many(table, up, directions(x))  # noqa: E731
        outgoing, _, _ = media.scatter_many(table, up, u)
        found.append(_excess(cylinder(outgoing), pdf, CYLINDER, (40, 8), 24, 3))
        # Cosines against the direction that light comes from, where the formula has the direction of travel.
        naive.append(_excess(cylinder(-outgoing), pdf, CYLINDER, (40, 8), 24, 3) if g != 0.0 else math.inf)
    return Measured("phase functions: chi-square over critical", min(naive), max(found), 1.0)


def _lit() -> list[MaterialSpec]:
    materials = (case.values[0] for case in contract.CASES)
    return [spec for spec in materials if spec.has_non_delta_bsdf() and not spec.is_index_matched()]


def _materials(samples: int, angles: tuple[float, ...]) -> Measured:
    lit = _lit()
    tests = len(lit) * len(angles)
    found = [_material_excess(spec, spec, degrees, samples, tests) for spec in lit for degrees in angles]
    rough = RoughConductor(albedo=(1.0, 1.0, 1.0), roughness=0.9)
    once = rough.model_copy(update={"multiple_scattering": False})
    return Measured(
        "materials: chi-square over critical", _material_excess(rough, once, 30.0, samples, tests), max(found), 1.0
    )


def _material_excess(drawing: MaterialSpec, telling: MaterialSpec, degrees: float, samples: int, tests: int) -> float:
    """Directions that one material draws against the density that another tells, over cells of directions."""
    rows, columns = 16, 24
    direction = incoming(degrees)
    axis, lowest = contract.support(drawing, direction)
    outgoing, weight, _ = scatter_many(drawing, direction, samples)
    local = outgoing[weight.any(axis=1)] @ contract.frame(axis).T
    s = contract.place(local[:, 2], lowest)
    phi = np.arctan2(local[:, 1], local[:, 0]) % (2.0 * np.pi)
    edges = [np.linspace(0.0, 1.0 + 1e-12, rows + 1), np.linspace(0.0, 2.0 * np.pi, columns + 1)]
    observed, _, _ = np.histogram2d(s, phi, edges)
    # Lobes of rough facets seen from the side are cut by the horizon: their cells take many points.
    grid = contract.cells(axis, lowest, rows, columns, 64 if samples > 100_000 else 24)
    _, pdf = evaluate_many(telling, direction, grid[..., :3].reshape(-1, 3))
    expected = samples * (pdf.reshape(grid.shape[:3]) * grid[..., 3]).sum(axis=2)
    # A sliver above the horizon may fall between the points.
    some = expected >= 1.0
    observed, expected = observed[some], expected[some]
    return chi2_excess(observed, expected * (observed.sum() / expected.sum()), ALARM, tests)


@hard_case(
    47,
    "Helmholtz 1867; Veach 1997, thesis, sec. 5.3; pbrt-v4 src/pbrt/bsdfs_test.cpp",
    quick=20_000,
    thorough=1_000_000,
)
def materials_keep_energy_and_are_reciprocal(samples: int) -> list[Measured]:
    """No material gives back more light than it gets, and all but One Weekend's fuzzy metal are reciprocal.

    Naive: a white matte body under a coat that takes nothing from it, which gives back 1 + F; and that fuzzy metal,
    whose lobe is one about the mirrored direction and not about the half vector, by its definition.  The mean weight of
    lossless materials is 1; pbrt tolerates 1.01.  Of glass, light in basic radiance goes both ways alike once each is
    divided by the square of the index at its far end.
    """
    most = 0.0
    for spec in _lit():
        for degrees in (0.0, 60.0, 85.0):
            _, weight, _ = scatter_many(spec, incoming(degrees), samples)
            deviation = float(weight.std(axis=0).max()) / math.sqrt(samples)
            most = max(most, float(weight.mean(axis=0).max()) - 1.0 - 5.0 * deviation)
    coat = 0.04 + 0.96 * (1.0 - math.cos(math.radians(85.0))) ** 5
    rng = np.random.default_rng(49)
    pairs = rng.normal(size=(100, 2, 3))
    pairs /= np.linalg.norm(pairs, axis=2, keepdims=True)
    reciprocal = [spec for spec in _lit() if spec.type != "metal"]
    fuzzy = contract.spec_of("metal", {"albedo": 1.0, "fuzz": 1.0})
    return [
        Measured("light given back, more than came", coat, most, 0.01),
        Measured(
            "f(a, b) and f(b, a), relative",
            _asymmetry(fuzzy, pairs),
            max(_asymmetry(s, pairs) for s in reciprocal),
            1e-6,
        ),
    ]


def _asymmetry(spec: MaterialSpec, pairs: NDArray[np.float64]) -> float:
    """The largest relative difference of f there and back, of light in basic radiance, among pairs of directions."""
    inside, outside = (float(parse_glass(getattr(spec, key, 1.0)).ior()) for key in ("ior", "outside_ior"))
    worst = 0.0
    for a, b in pairs:
        there, back = (
            _basic(spec, x, y, inside if y[2] < 0.0 and spec.type == "rough_dielectric" else outside)
            for x, y in ((a, b), (b, a))
        )
        if there.max() > 0.0 or back.max() > 0.0:
            worst = max(
                worst, float((np.abs(there - back) / np.maximum(np.maximum(there, back), np.finfo(float).tiny)).max())
            )
    return worst


def _basic(spec: MaterialSpec, a: NDArray[np.float64], b: NDArray[np.float64], index: float) -> NDArray[np.float64]:
    """f of light from `b`, where the index is this, seen from `a`: of basic radiance, over the index squared."""
    front = bool(a[2] > 0.0)
    x, y, z = (-a).tolist()
    value, _ = evaluate_many(spec, (x, y, z), b[None], front=front, normal=(0.0, 0.0, 1.0 if front else -1.0))
    return np.asarray(value[0] / abs(b[2])) / index**2


@hard_case(47, "pbrt-v4 src/pbrt/samplers_test.cpp", quick=64, thorough=1024)
def dimensions_are_uncorrelated(pixels: int) -> list[Measured]:
    """E[u_i u_j] = 1/4 for all pairs of the first 64 dimensions, by 256 samples of each of some pixels.

    Naive: Halton's sequence without scrambling, whose high bases go in step for as many samples.  The error is in
    standard deviations of independent numbers; as many as one false alarm in a thousand allows are tolerated.
    """
    samples = 256
    found = 0.0
    for make in SAMPLERS.values():
        sampler = make(47, samples)
        for draw in (draw_1d, draw_2d):
            wide = 64 if draw is draw_1d else 32
            found = max(found, _correlation(draw(sampler, pixels, samples, range(wide)).reshape(-1, 64)))
    halton = np.tile(np.stack([_radical_inverse(base, samples) for base in _primes(64)], axis=1), (pixels, 1))
    tests = 64 * 63 // 2 * 2 * len(SAMPLERS)
    return [
        Measured(
            "largest |z| of E[u_i u_j] - 1/4", _correlation(halton), found, float(norm.isf(0.5 * sidak(ALARM, tests)))
        )
    ]


def _correlation(numbers: NDArray[np.float64]) -> float:
    products = numbers.T @ numbers / len(numbers)
    off = products[np.triu_indices(numbers.shape[1], 1)] - 0.25
    # The variance of u v is 1/9 - 1/16.
    return float(np.abs(off).max() / math.sqrt(7.0 / 144.0 / len(numbers)))


def _primes(count: int) -> list[int]:
    return [n for n in range(2, 400) if all(n % k for k in range(2, math.isqrt(n) + 1))][:count]


def _radical_inverse(base: int, count: int) -> NDArray[np.float64]:
    value, scale, rest = np.zeros(count), 1.0, np.arange(count)
    while rest.any():
        scale /= base
        value += scale * (rest % base)
        rest //= base
    return value
