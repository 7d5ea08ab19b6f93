"""Random numbers, and the directions that are drawn with them: discs, frames, distributions."""

import math

import numpy as np
from scipy.stats import norm

from raytracer.core.microfacet import ggx, sample_visible_normal
from raytracer.core.sampling import SAMPLERS, warp
from raytracer.core.vec import basis
from raytracer.optics.glass import parse_glass
from raytracer.plugins.environments.base.equirectangular import equirectangular
from raytracer.plugins.materials.rough_conductor import RoughConductor
from raytracer.plugins.media.homogeneous import Homogeneous
from tests.core.sampling.draws import draw_1d, draw_2d
from tests.hard_cases.harness import ROUNDING, hard_case
from tests.hard_cases.spheres import ORIGIN, spheres
from tests.plugins.environments.kernels import density, drawn
from tests.plugins.materials import test_contract as contract
from tests.plugins.materials.kernels import evaluate_many, incoming, scatter_many
from tests.plugins.media import kernels as media
from tests.plugins.shapes.kernels import pdf_of, sample, unit
from tests.statistics import CYLINDER, cell_integrals, chi2_excess, cylinder, directions, sidak
from tests.vectorised import rows, vectorised

ALARM = 1e-3
"""Odds with which a topic's chi-square tests reject what is right; seeds are fixed."""

# ---- Discs and frames


@hard_case(35, "Shirley, Chiu 1997, JGT 2(3); Pharr et al. 2023, PBRT, A.5.1 and 8.6.1", None, 20_000, 1_000_000)
def concentric_disc(trials):
    """The middle and the rim of the disc from which cosine-weighted directions are drawn.

    The middle is 0 / 0 of the map's two coordinates; at the rim 1 - x^2 - y^2 rounds to less than 0, so its root is no
    number.  Naive: the map in float32 as it is printed.  Ours must have none of either: nothing is tolerated.
    """
    rng = np.random.default_rng(35)
    rim = np.array([0.0, 2.0**-33, 1.0 - 2.0**-33, 1.0 - ROUNDING])[rng.integers(0, 4, trials)]
    u = np.stack([rim, rng.random(trials)], axis=1)
    u = np.where(rng.random(trials)[:, None] < 0.5, u, u[:, ::-1])
    ours = vectorised(warp.sample_cosine_hemisphere)(rows(u[:, 0]), rows(u[:, 1]))
    x, y = _disc32(u)
    lost = np.isnan(np.sqrt(np.float32(1.0) - x * x - y * y))
    yield "directions at the rim that are no numbers", lost, (~np.isfinite(ours)).any(axis=1)
    middles = np.hypot(*_disc32(np.array([[0.5, 0.5]]))), np.hypot(*warp.sample_disc(0.5, 0.5))
    yield "distance of the image of (1/2, 1/2) from the middle", *middles


def _disc32(u):
    a, b = (np.float32(2.0) * u.astype(np.float32) - np.float32(1.0)).T
    quarter = np.float32(0.25 * np.pi)
    first = np.abs(a) > np.abs(b)
    radius, angle = np.where(first, a, b), quarter * np.where(first, b / a, np.float32(2.0) - a / b)
    return radius * np.cos(angle), radius * np.sin(angle)


@hard_case(36, "Duff et al. 2017, Building an Orthonormal Basis, Revisited, JCGT 6(1), figure 1", None, 5_000, 500_000)
def orthonormal_basis(trials):
    """The frame about normals that look almost straight back, against Frisvad's in float32.

    1 / (1 + z) of a z near -1 has no digits, so Frisvad's tangents are neither of unit length nor at right angles.
    Each entry of our frame's Gram matrix takes three products of numbers, themselves wrong by up to four roundings.
    """
    rng = np.random.default_rng(36)
    known = np.array([[0.00038527316, 0.00038460016, -0.99999988079]])
    tilt, phi = 10.0 ** rng.uniform(-9.0, 0.0, trials), rng.uniform(0.0, 2.0 * np.pi, trials)
    steep = np.stack([tilt * np.cos(phi), tilt * np.sin(phi), -np.ones(trials)], axis=1)
    poles = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [1.0, 0.0, -0.0], [-0.0, -1.0, 0.0]])
    normals = unit(np.concatenate([known, poles, steep, rng.normal(size=(trials, 3))]))
    # Our frame's own pole is -y.
    both = np.concatenate([normals, normals[:, [1, 2, 0]]])
    frames = _frisvad32(normals), np.stack([*vectorised(basis)(rows(both)), both], axis=1)
    off = (axes @ axes.transpose(0, 2, 1) - np.eye(3) for axes in frames)
    yield "largest entry of the frame's Gram matrix less 1", *off, 3.0 * (2.0 * 4.0 + 1.0) * ROUNDING


def _frisvad32(normals):
    """References: Frisvad 2012, "Building an Orthonormal Basis ... Without Normalization", JGT 16(3), listing 2."""
    x, y, z = normals.astype(np.float32).T
    one = np.float32(1.0)
    a = one / (one + z)
    b = -x * y * a
    frames = np.stack([one - x * x * a, b, -x, b, one - y * y * a, -y, x, y, z], axis=1).reshape(-1, 3, 3)
    return frames[z >= np.float32(-0.9999999)].astype(np.float64)


# ---- Distributions


@hard_case(47, "Subr, Arvo 2007; pbrt-v4 src/pbrt/bsdfs_test.cpp", quick=50_000, thorough=1_000_000)
def directions_follow_their_densities(samples):
    """Chi-square of every sampler of directions against the density that it tells, over the critical value.

    At the critical value, all tests of a row together reject what is right once in a thousand times.  Naive: for the
    sphere, even in the angle from the pole; for cones too; for cosines, the normal plus a point *within* the unit ball;
    facets without regard to whether they are seen; a map by its pixels, as if they all had one solid angle; and for
    materials, a density that forgets what facets scatter more than once.  How much is absorbed is not asked here.
    """
    rng = np.random.default_rng(47)
    u = rng.random((samples, 2))
    families = {
        "sphere, hemisphere, cosines": _warps(u, rng),
        "sphere lights": _sphere_lights(u),
        "visible facets": _visible_normals(u),
        "environment maps": _maps(u),
        "phase functions": _phases(u),
        "materials": _materials(samples, ANGLES if samples > 100_000 else ANGLES[:1]),
    }
    for name, (naive, found) in families.items():
        # Each naive way has to be noticed.
        yield f"{name}: chi-square over critical", min(naive), max(found), 1.0


ANGLES = (30.0, 0.0, 75.0, 85.0)


def _excess(samples, pdf, cells, order, tests, bounds=CYLINDER):
    """Chi-square of samples (n, d) over its critical value; pdf : of coordinates (n, d), or one number."""
    densities = pdf if callable(pdf) else lambda x: np.full(len(x), pdf)
    mass = cell_integrals(densities, bounds, cells, order)
    observed, _ = np.histogramdd(samples, bins=cells, range=bounds)
    assert observed.sum() == len(samples), "samples out of bounds"
    return chi2_excess(observed, len(samples) * mass / mass.sum(), ALARM, tests)


def _warps(u, rng):
    numbers = rows(u[:, 0]), rows(u[:, 1])

    def lambert(x):
        return np.maximum(0.0, x[:, 0]) / np.pi

    def excess(ways, pdf):
        return _excess(cylinder(ways), pdf, (20, 40), 4, 3)

    found = [
        excess(vectorised(warp.sample_sphere)(*numbers), 0.25 / np.pi),
        excess(vectorised(warp.sample_cone)(*numbers, 1.0), lambda x: np.where(x[:, 0] >= 0.0, 0.5 / np.pi, 0.0)),
        excess(vectorised(warp.sample_cosine_hemisphere)(*numbers), lambert),
    ]
    within = rng.normal(size=(len(u), 3))
    within *= (rng.random(len(u)) ** (1.0 / 3.0) / np.linalg.norm(within, axis=1))[:, None]
    lazy = unit(within + np.array([0.0, 0.0, 1.0]))
    angles = np.stack([np.cos(np.pi * u[:, 0]), 2.0 * np.pi * u[:, 1] - np.pi], axis=1)
    return [_excess(angles, 0.25 / np.pi, (20, 40), 4, 3), excess(lazy, lambert)], found


def _sphere_lights(u):
    """Directions to spheres that fill a thin cone and a wide one, and from within, about the axis to the centre."""
    found, naive = [], []
    for distance in (1e4, 1.5, 0.5):
        table = (spheres([0.0, 0.0, distance], 1.0),)
        points = sample(table, 0, 0, ORIGIN, u)
        way = unit(points.point)
        if distance < 1.0:
            # By area, whose density in solid angle depends on the point that a direction meets.
            def seen_from_within(x, table=table, distance=distance):
                ways = directions(x)
                along = distance * ways[:, 2]
                met = ways * (along + np.sqrt(1.0 - distance**2 + along**2))[:, None]
                return pdf_of(table, 0, 0, ORIGIN, met, met - [0.0, 0.0, distance])

            found.append(_excess(cylinder(way), seen_from_within, (40, 8), 8, 3))
            continue
        most = warp.one_minus_cosine(1.0 / distance**2)
        height = np.minimum(1.0, (way[:, 0] ** 2 + way[:, 1] ** 2) / (1.0 + way[:, 2]) / most)
        ours = np.stack([height, np.arctan2(way[:, 1], way[:, 0])], axis=1)
        even = np.stack([u[:, 0] ** 2, 2.0 * np.pi * u[:, 1] - np.pi], axis=1)
        for places, excesses in ((ours, found), (even, naive)):
            bounds = ((0.0, 1.0), CYLINDER[1])
            excesses.append(_excess(places, float(points.pdf[0]) * most, (20, 40), 2, 3, bounds))
    return naive, found


def _visible_normals(u):
    found, naive = [], []
    for alpha in (0.2, 1.0):
        for cosine in (1.0, 0.5, 0.1):
            toward = (math.sqrt(1.0 - cosine * cosine), 0.0, cosine)

            def pdf(x, alpha=alpha, toward=toward):
                """Heitz 2018, JCGT 7(4), eq. 1."""
                half = directions(x)
                stretched = math.sqrt(toward[2] ** 2 + alpha**2 * (1.0 - toward[2] ** 2))
                seen = np.maximum(0.0, half @ toward) / (toward[2] + stretched)
                return np.where(half[:, 2] > 0.0, 2.0 * seen * vectorised(ggx)(alpha, rows(half)), 0.0)

            half = vectorised(sample_visible_normal)(alpha, toward, rows(u[:, 0]), rows(u[:, 1]))
            found.append(_excess(cylinder(half), pdf, (60, 24), 12, 6))
            if cosine == 0.5:
                # All facets, by their areas: Walter et al. 2007, eq. 35 and 36.
                height = np.sqrt((1.0 - u[:, 0]) / (1.0 + (alpha * alpha - 1.0) * u[:, 0]))
                every = np.stack([height, 2.0 * np.pi * u[:, 1] - np.pi], axis=1)
                naive.append(_excess(every, lambda x, pdf=pdf: np.maximum(pdf(x), 1e-6), (60, 24), 12, 6))
    return naive, found


def _maps(u):
    rng = np.random.default_rng(48)
    noise, hot = rng.random((16, 32, 3)) ** 4, np.full((16, 32, 3), 1e-3)
    hot[2, 0] = 1.0
    found, naive = [], []
    for picture in (noise, hot):
        environment = equirectangular(picture)
        way = drawn(environment, u).direction
        turns = (np.arctan2(way[:, 0], -way[:, 2]) / (2.0 * np.pi)) % 1.0
        places = np.stack([turns, np.arccos(np.clip(way[:, 1], -1.0, 1.0)) / np.pi], axis=1)

        def pdf(x, environment=environment):
            theta, phi = np.pi * x[:, 1], 2.0 * np.pi * x[:, 0]
            toward = np.stack([np.sin(theta) * np.sin(phi), np.cos(theta), -np.sin(theta) * np.cos(phi)], axis=1)
            return density(environment, toward) * 2.0 * np.pi**2 * np.sin(theta)

        weights = picture.sum(axis=2).ravel()
        texel = rng.choice(512, size=len(u), p=weights / weights.sum())
        even = np.stack([(texel % 32 + u[:, 0]) / 32.0, (texel // 32 + u[:, 1]) / 16.0], axis=1)
        for some, excesses in ((places, found), (even, naive)):
            excesses.append(_excess(some, pdf, (64, 32), 4, 2, ((0.0, 1.0), (0.0, 1.0))))
    return naive, found


def _phases(u):
    found, naive = [], []
    up = (0.0, 0.0, 1.0)
    for g in (0.0, 0.5, -0.9):
        table = media.packed(Homogeneous(scattering=(1.0, 1.0, 1.0), g=g))
        pdf = lambda x, table=table: media.evaluate_many(table, up, directions(x))  # noqa: E731
        outgoing, _, _ = media.scatter_many(table, up, u)
        found.append(_excess(cylinder(outgoing), pdf, (40, 8), 24, 3))
        if g != 0.0:
            # Cosines against the direction that light comes from, where the formula has the direction of travel.
            naive.append(_excess(cylinder(-outgoing), pdf, (40, 8), 24, 3))
    return naive, found


def _lit():
    materials = (case.values[0] for case in contract.CASES)
    return [spec for spec in materials if spec.has_non_delta_bsdf() and not spec.is_index_matched()]


def _materials(samples, angles):
    lit = _lit()
    tests = len(lit) * len(angles)
    rough = RoughConductor(albedo=(1.0, 1.0, 1.0), roughness=0.9)
    once = rough.model_copy(update={"multiple_scattering": False})
    found = [_material_excess(spec, spec, degrees, samples, tests) for spec in lit for degrees in angles]
    return [_material_excess(rough, once, 30.0, samples, tests)], found


def _material_excess(drawing, telling, degrees, samples, tests):
    """Directions that one material draws against the density that another tells, over cells of directions."""
    height, width = 16, 24
    direction = incoming(degrees)
    axis, lowest = contract.support(drawing, direction)
    outgoing, weight, _ = scatter_many(drawing, direction, samples)
    local = outgoing[weight.any(axis=1)] @ contract.frame(axis).T
    s = contract.place(local[:, 2], lowest)
    phi = np.arctan2(local[:, 1], local[:, 0]) % (2.0 * np.pi)
    edges = [np.linspace(0.0, 1.0 + 1e-12, height + 1), np.linspace(0.0, 2.0 * np.pi, width + 1)]
    observed, _, _ = np.histogram2d(s, phi, edges)
    # Lobes of rough facets seen from the side are cut by the horizon: their cells take many points.
    grid = contract.cells(axis, lowest, height, width, 64 if samples > 100_000 else 24)
    _, pdf = evaluate_many(telling, direction, grid[..., :3].reshape(-1, 3))
    expected = samples * (pdf.reshape(grid.shape[:3]) * grid[..., 3]).sum(axis=2)
    # A sliver above the horizon may fall between the points.
    observed, expected = observed[expected >= 1.0], expected[expected >= 1.0]
    return chi2_excess(observed, expected * (observed.sum() / expected.sum()), ALARM, tests)


@hard_case(47, "Helmholtz 1867; Veach 1997, thesis, sec. 5.3; pbrt-v4 src/pbrt/bsdfs_test.cpp", None, 20_000, 1_000_000)
def materials_keep_energy_and_are_reciprocal(samples):
    """No material gives back more light than it gets, and all but One Weekend's fuzzy metal are reciprocal.

    Naive: a white matte body under a coat that takes nothing from it, which gives back 1 + F; and that fuzzy metal,
    whose lobe is one about the mirrored direction and not about the half vector, by its definition.  The mean weight of
    lossless materials is 1; pbrt tolerates 1.01.  Of glass, light in basic radiance goes both ways alike once each is
    divided by the square of the index at its far end.
    """
    coat = 0.04 + 0.96 * (1.0 - math.cos(math.radians(85.0))) ** 5
    for spec in _lit():
        for degrees in (0.0, 60.0, 85.0):
            _, weight, _ = scatter_many(spec, incoming(degrees), samples)
            deviation = weight.std(axis=0).max() / math.sqrt(samples)
            gain = max(0.0, weight.mean(axis=0).max() - 1.0 - 5.0 * deviation)
            yield "light given back, more than came", coat, gain, 0.01
    pairs = unit(np.random.default_rng(49).normal(size=(20, 3))).reshape(2, 10, 3)
    fuzzy = _asymmetry(contract.spec_of("metal", {"albedo": 1.0, "fuzz": 1.0}), *pairs)
    for spec in _lit():
        if spec.type != "metal":
            yield "f(a, b) and f(b, a), relative", fuzzy, _asymmetry(spec, *pairs), 1e-6


def _asymmetry(spec, a, b):
    """The relative differences of f there and back, of light in basic radiance, of all pairs of directions (n, 3)."""
    there, back = (np.array([_basic(spec, seen, lit) for seen in some]) for some, lit in ((a, b), (b, a)))
    back = back.swapaxes(0, 1)
    return (there - back) / np.maximum(np.maximum(there, back), np.finfo(float).tiny)


def _basic(spec, seen, lit):
    """f of light from directions (n, 3), as seen from one: of basic radiance, over the square of the index there."""
    inside, outside = (float(parse_glass(getattr(spec, key, 1.0)).ior()) for key in ("ior", "outside_ior"))
    index = np.where((lit[:, 2:] < 0.0) & (spec.type == "rough_dielectric"), inside, outside)
    front = bool(seen[2] > 0.0)
    normal = (0.0, 0.0, 1.0 if front else -1.0)
    value, _ = evaluate_many(spec, tuple((-seen).tolist()), lit, front=front, normal=normal)
    return value / np.abs(lit[:, 2:]) / index**2


@hard_case(47, "pbrt-v4 src/pbrt/samplers_test.cpp", quick=64, thorough=1024)
def dimensions_are_uncorrelated(pixels):
    """E[u_i u_j] = 1/4 for all pairs of the first 64 dimensions, by 256 samples of each of some pixels.

    Naive: Halton's sequence without scrambling, whose high bases go in step for as many samples.  The error is in
    standard deviations of independent numbers; as many as one false alarm in a thousand allows are tolerated.
    """
    samples = 256
    halton = np.tile(np.stack([_radical_inverse(base, samples) for base in _primes(64)], axis=1), (pixels, 1))
    naive = _correlation(halton)
    most = norm.isf(0.5 * sidak(ALARM, 64 * 63 // 2 * 2 * len(SAMPLERS)))
    for make in SAMPLERS.values():
        for draw, wide in ((draw_1d, 64), (draw_2d, 32)):
            found = _correlation(draw(make(47, samples), pixels, samples, range(wide)).reshape(-1, 64))
            yield "largest |z| of E[u_i u_j] - 1/4", naive, found, most


def _correlation(numbers):
    products = numbers.T @ numbers / len(numbers)
    off = products[np.triu_indices(numbers.shape[1], 1)] - 0.25
    # The variance of u v is 1/9 - 1/16.
    return np.abs(off).max() / math.sqrt(7.0 / 144.0 / len(numbers))


def _primes(count):
    return [n for n in range(2, 400) if all(n % k for k in range(2, math.isqrt(n) + 1))][:count]


def _radical_inverse(base, count):
    value, scale, rest = np.zeros(count), 1.0, np.arange(count)
    while rest.any():
        scale /= base
        value += scale * (rest % base)
        rest //= base
    return value
