"""Light and what scatters it: weights, environment maps, facets, furnaces, and media."""

import math

import numpy as np

from raytracer.core.microfacet import ggx
from raytracer.plugins.environments.base.equirectangular import equirectangular
from raytracer.plugins.lights.base.interface import mis_weight_light_sample, mis_weight_path, power_heuristic
from raytracer.plugins.media.homogeneous import Homogeneous
from raytracer.rendering.render import render
from raytracer.scene.load import build
from tests.hard_cases.harness import ROUNDING, hard_case
from tests.plugins.environments.kernels import density, drawn, seen
from tests.plugins.materials.kernels import evaluate_many, scatter_many
from tests.plugins.materials.test_contract import spec_of
from tests.plugins.media import kernels as media
from tests.small_scenes import image, mean
from tests.statistics import CYLINDER, cell_integrals, directions

# ---- Weights


@hard_case(37, "Veach 1997, thesis, eq. 9.11; Pharr et al. 2023, PBRT, 2.2.3", "plates")
def multiple_importance_weights(_):
    """Weights of two strategies whose densities lie anywhere from 0 over 1e-320 to 1e308 and infinity.

    Naive: p^2 / (p^2 + q^2) as it is printed, whose squares over- and underflow.  Ours: the weights, and that both
    strategies together count light once, to the roundings of two quotients, two sums and two products.
    """
    sizes = np.concatenate([[0.0], 10.0 ** np.arange(-320.0, 309.0, 4.0), [math.inf]]).tolist()
    # What has no density is never drawn, and two strategies without choice never meet.
    pairs = [(p, q) for p in sizes for q in sizes if p > 0.0 and not (math.isinf(p) and math.isinf(q))]
    ours = [(mis_weight_light_sample(None, p, q), mis_weight_path(None, q, p) if q > 0.0 else 0.0) for p, q in pairs]
    squares = np.array(pairs) ** 2
    naive = squares / squares.sum(axis=1, keepdims=True)
    naive[np.array(pairs)[:, 1] == 0.0, 1] = 0.0
    ends = [power_heuristic(p, q) for p in (0.0, math.inf) for q in (0.0, math.inf)]
    yield "weights that are no numbers", np.isnan(naive), np.isnan([*np.ravel(ours), *ends])
    sums = (np.nan_to_num(np.sum(weights, axis=1) - 1.0, nan=math.inf) for weights in (naive, ours))
    yield "both weights' sum less 1", *sums, 6.0 * ROUNDING


_MAPS = "mitsuba3 src/emitters/tests/test_envmap.py; Pharr et al. 2023, PBRT, 12.5.2"


@hard_case(38, _MAPS, "hot_pixel", quick=20_000, thorough=2_000_000)
def environment_map_of_one_pixel(samples):
    """An environment map with one hot pixel, one that is black, the seam where it closes, and its poles.

    Light of the sphere from samples by radiance; naive: directions drawn evenly, most of which miss the pixel.
    Radiance over density varies under the pixel's tent as the sine of the angle from the pole does, less than a fifth:
    five standard deviations are tolerated.  Across the seam 1e-9 rad may change the radiance by that part of a texel's
    width, 2 pi / 32, at most; naive: a map that ends at its edges.  Naive at the poles: probability over sin theta.
    """
    rng = np.random.default_rng(38)
    picture = np.full((16, 32, 3), 1e-3)
    picture[5, 9] = 1e6
    hot = equirectangular(picture)
    uniform = directions(np.stack([rng.uniform(-1.0, 1.0, samples), rng.uniform(-np.pi, np.pi, samples)], axis=1))
    out = drawn(hot, rng.random((samples, 2)))

    def light(angles):
        """Radiance times the sine, by (theta, phi) as of the map, so that its kinks are at edges of cells."""
        theta, phi = angles.T
        toward = np.stack([np.sin(theta) * np.sin(phi), np.cos(theta), -np.sin(theta) * np.cos(phi)], axis=1)
        return seen(hot, toward)[:, 0] * np.sin(theta)

    true = cell_integrals(light, ((0.0, np.pi), (0.0, 2.0 * np.pi)), (32, 64), order=4).sum()
    grid = cell_integrals(lambda x: seen(hot, directions(x))[:, 0], CYLINDER, (512, 64), order=4)
    assert math.isclose(true, grid.sum(), rel_tol=0.02)
    means = seen(hot, uniform)[:, 0].mean() * 4.0 * np.pi, (out.radiance[:, 0] / out.pdf).mean()
    yield "light of the sphere, relative", *(found / true - 1.0 for found in means), 5.0 * 0.2 / math.sqrt(samples)

    # A black map, whose probabilities are 0 / 0.
    black = np.zeros((16, 32)) / np.zeros((16, 32)).sum()
    is_none = equirectangular(np.zeros((16, 32, 3))) is None
    yield "probabilities of a black map that are no numbers", np.isnan(black), not is_none

    # Either side of the seam, and the poles.
    noise = rng.random((16, 32, 3))
    noisy = equirectangular(noise)
    step = 1e-9
    sides = np.array([[sign * math.sin(step), 0.3, -math.cos(step)] for sign in (1.0, -1.0)])
    left, right = seen(noisy, sides / np.linalg.norm(sides, axis=1, keepdims=True))
    edges = noise[:, 0].mean(axis=0) - noise[:, 31].mean(axis=0)
    bound = 2.0 * step * 32.0 / (2.0 * np.pi) * float(np.ptp(noise))
    yield "jump of the radiance at the seam", edges, left - right, bound
    poles = np.array([[0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [-0.0, 1.0, -0.0], [1e-300, -1.0, 0.0]])
    naive = noise[[0, 15, 0, 15], 0, 0] / np.hypot(poles[:, 0], poles[:, 2])
    ours = np.concatenate([density(noisy, poles), seen(noisy, poles).ravel(), drawn(noisy, [[0.0, 0.0]]).pdf])
    yield "densities and radiances at the poles that are no numbers", ~np.isfinite(naive), ~np.isfinite(ours)


# ---- Facets

COSINES = (1.0, 1e-4, 1e-9, 1e-16, 1e-160, 1e-300, 0.0)


@hard_case(39, "Walter et al. 2007, eq. 33; Pharr et al. 2023, PBRT, 9.6.1 (smooth below 1e-3)", "facets")
def narrow_lobes_and_grazing_light(_):
    """GGX facets at their peak, from alpha 1 down to 1e-4, and light that comes along the surface.

    Naive: the density from cos^2 and tan^2 in float32, as it is printed; and its quotients D G / (4 cos cos) at cosines
    down to 0.  Ours against extended precision: a sum of two squares, its square and a quotient, with an input that is
    wrong by a rounding to the fourth power: 12 roundings.
    """
    for alpha in (1.0, 0.1, 1e-2, 1e-3, 1e-4):
        for slope in (0.0, 0.25, 0.5, 1.0, 2.0):
            cosine = 1.0 / math.sqrt(1.0 + (alpha * slope) ** 2)
            half = (alpha * slope * cosine, 0.0, cosine)
            x, y, z, a = map(np.longdouble, (*half, alpha))
            exact = float(a * a / (np.longdouble(np.pi) * (x * x + y * y + a * a * z * z) ** 2))
            errors = (found / exact - 1.0 for found in (_ggx32(alpha, cosine), ggx(alpha, half)))
            yield "density of facets, relative", *errors, 12.0 * ROUNDING
    # Mirrored light of alpha 0.1 at these cosines, by the formula in float32.
    what = "numbers that are none, at cosines down to 0"
    c, a = np.array(COSINES, np.float32), np.float32(0.1)
    tangent2 = (np.float32(1.0) - c * c) / (c * c)
    masked = np.float32(2.0) / (np.float32(1.0) + np.sqrt(np.float32(1.0) + a * a * tangent2))
    value = masked * masked / (np.float32(4.0 * np.pi) * a * a * c * c)
    yield what, ~np.isfinite(value), 0
    kinds = {"rough_conductor": {"metal": "gold"}, "rough_dielectric": {}, "principled": {"metallic": 0.5}}
    for kind, keys in kinds.items():
        for roughness in (0.0317, 0.1, 1.0):
            yield what, 0, _nonsense(spec_of(kind, keys).model_copy(update={"roughness": roughness}))


def _ggx32(alpha, cosine):
    one, a, c = map(np.float32, (1.0, alpha, cosine))
    root = c * c * (a * a - one) + one
    found = float(a * a / (np.float32(np.pi) * root * root))
    return found if math.isfinite(found) else math.inf


def _nonsense(spec):
    """Tell which directions, weights and densities of a material are no numbers, at grazing and other incidence."""
    found = []
    for cosine in COSINES:
        sine = math.sqrt(1.0 - cosine * cosine)
        for front in (True, False):
            outgoing, weight, pdf = scatter_many(spec, (sine, 0.0, -cosine), 100, front=front)
            along = np.concatenate([outgoing, [(-sine, 0.0, cosine), (sine, 0.0, cosine), (1.0, 0.0, 0.0)]])
            value, again = evaluate_many(spec, (sine, 0.0, -cosine), along, front=front)
            found += [~np.isfinite(array).ravel() for array in (outgoing, weight, value, again)] + [~(pdf > 0.0)]
    return np.concatenate(found)


# ---- Furnaces


BALL = """
camera: {type: pinhole, look_from: [0, 0, 4], look_at: [0, 0, 0], vfov: 40}
environment: {type: constant, radiance: 1}
objects:
  - {type: sphere, center: [0, 0, 0], radius: 1, material: {type: lambertian, albedo: 1}}
"""

HALF = """
camera: {type: pinhole, look_from: [0, 0.5, 0.8], look_at: [0, 3, 0.8], up: [0, 0, 1], vfov: 20}
objects:
  - {type: sphere, center: [0, 0, 0], radius: 1, material: {type: lambertian, albedo: 1}}
  - {type: sphere, center: [0, 0, 0], radius: 0.7071067811865476, material: {type: emitter, radiance: 1}}
"""

GLOWING = """
film: {width: 8, height: 8}
render: {light_sampling: paths, rr_depth: 1000}
camera: {type: pinhole, look_from: [0, 0.2, 0], look_at: [1, 0, 0], vfov: 60}
objects:
  - type: sphere
    center: [0, 0, 0]
    radius: -1
    material: {type: principled, base_color: 0.5, specular: 0, roughness: 1, emission: 0.5}
"""


@hard_case(41, "pbrt-v4 src/pbrt/cpu/integrators_test.cpp (analytic scenes)", "furnace", quick=1, thorough=4)
def furnaces(runs):
    """What reflects all light, within radiance 1, is 1; what reflects half and emits half is 1 - 0.5^(n + 1).

    Naive: the ball in float32 without an offset, half of whose rays meet the ball that they leave and are lost at the
    last bounce; and light that is aimed at and found again, each counted in full, 1.5 where it should be 1.  Ours: the
    ball to rounding and without variance.  Half and half: a white wall whose view a lamp fills by half, within 4.5
    standard deviations of the mean, which its pixels tell; and, thoroughly, a wall that does both, whose depth is
    counted from the camera, to the rounding of n sums.
    """
    lost = _lost_by_self_hits()
    ball = image(BALL, lit=True, spp=64, max_depth=8)
    yield "white ball in radiance 1, less 1", lost, ball.radiance - 1.0, 1e-12
    yield "variance of the white ball", lost * (1.0 - lost), ball.variance, 1e-24
    for depth in (3, 6)[:runs]:
        value, deviation = mean(image(HALF, lit=True, spp=256, max_depth=depth))
        errors = (0.5 * (1.0 - 0.5 ** (depth - 2)), value - (1.0 - 0.5 ** (depth - 1)))
        yield f"lamp and wall, {depth} segments", *errors, 4.5 * deviation.max()
    for depth in (2, 5, 30)[: runs - 1]:
        glow = render(build(GLOWING, "test.yaml", {"render.max_depth": depth}), spp=4, threads=2).image
        errors = (0.5 * (1.0 - 0.5 ** (depth - 1)), glow.radiance - (1.0 - 0.5**depth))
        yield f"glowing wall, {depth} segments", *errors, 2.0 * depth * ROUNDING


def _lost_by_self_hits(paths=20_000):
    """Measure the light that a white ball in radiance 1 lacks after 8 segments, in float32 and with no offset."""
    rng = np.random.default_rng(41)

    def unit(vectors):
        return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)

    normal = unit(rng.normal(size=(paths, 3)).astype(np.float32))
    # Off the origin, where coordinates round as they do in a scene.
    center = np.array([0.3, 20.0, 0.7], np.float32)
    position = normal + center
    alive = np.ones(paths, np.bool_)
    for _ in range(7):
        direction = unit(normal + unit(rng.normal(size=(paths, 3)).astype(np.float32)))
        to = position - center
        b = (to * direction).sum(axis=1)
        root = b * b - (to * to).sum(axis=1) + np.float32(1.0)
        near, far = -b - np.sqrt(root), -b + np.sqrt(root)
        t = np.where(near > 0.0, near, far)
        alive &= (root >= 0.0) & (t > 0.0)
        position = np.where(alive[:, None], position + t[:, None] * direction, position)
        normal = unit(position - center)
    return float(alive.mean())


# ---- Media

_ASKEW = (0.36, 0.48, -0.8)


@hard_case(45, "Pharr et al. 2023, PBRT, 11.2.1; Henyey, Greenstein 1941, eq. 2", "no_medium", 2_000, 200_000)
def media_of_nothing(trials):
    """A medium that takes nothing is none; all light goes straight on, or back, where g is 1 or -1.

    Naive: a distance -log(1 - u) / sigma, the transmittance exp(-sigma d) to the end of space, and the phase function
    and its cosines as they are printed, (1 + g^2 - q^2) / 2g, which cancel for small g.  Ours may be off by the
    roundings of a cosine of magnitude 1 that a rotated frame and five products have gone into.
    """
    rng = np.random.default_rng(45)
    clear = media.packed(Homogeneous(absorption=(0.0, 0.0, 0.0), scattering=(0.0, 0.0, 0.0)))
    u = rng.random(trials)
    for distance in (0.0, 1.0, 1e30, math.inf):
        far, weight, _ = media.fly_many(clear, trials, distance=distance)
        through = media.transmittance_many(clear, 10, distance=distance)
        taken = np.concatenate([(weight - 1.0).ravel(), (through - 1.0).ravel(), 1.0 * np.isfinite(far)])
        flown = -np.log1p(-u) / 0.0
        naive = np.nan_to_num(np.exp(-0.0 * np.minimum(flown, distance)) - 1.0, nan=math.inf)
        yield "light taken by sigma = 0", naive, taken

    def scattered(g):
        table = media.packed(Homogeneous(scattering=(1.0, 1.0, 1.0), g=g))
        return media.scatter_many(table, _ASKEW, ends)

    ends = np.concatenate([[[0.0, 0.0], [1.0 - ROUNDING, 0.5], [0.5, 0.25]], rng.random((trials, 2))])
    for g in (1.0, -1.0, 1.0 - ROUNDING, 0.0, 1e-30):
        outgoing, pdf, again = scattered(g)
        ours = np.concatenate([~np.isfinite(outgoing).ravel(), ~(pdf > 0.0), ~np.isfinite(again)])
        naive = ~np.isfinite(_henyey_greenstein(g, ends[:, 0]))
        yield "numbers of the phase function that are none", naive, ours
    # Nearly isotropic, cosines are nearly 2 u - 1, and 3/2 g (1 - (2 u - 1)^2) more, of which g^2 remains.
    for g in (1e-9, 1e-12, 1e-15):
        even = 2.0 * ends[:, 0] - 1.0
        expected = even + 1.5 * g * (1.0 - even * even)
        cosines = _henyey_greenstein(g, ends[:, 0])[0], scattered(g)[0] @ np.array(_ASKEW)
        yield "cosine drawn for small g", *(cosine - expected for cosine in cosines), 16.0 * ROUNDING


def _henyey_greenstein(g, u):
    """Cosines and their densities as they are printed."""
    q = (1.0 - g * g) / (1.0 - g + 2.0 * g * u)
    cosine = (1.0 + g * g - q * q) / np.float64(2.0 * g)
    return cosine, (1.0 - g * g) / (4.0 * np.pi * (1.0 + g * g - 2.0 * g * cosine) ** 1.5)
