"""Light and what scatters it: weights, environment maps, facets, furnaces, and media."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytracer.core.microfacet import ggx
from raytracer.plugins.environments.base.equirectangular import equirectangular
from raytracer.plugins.lights.base.interface import mis_weight_light_sample, mis_weight_path, power_heuristic
from raytracer.plugins.materials.base.interface import MaterialSpec
from raytracer.plugins.media.homogeneous import Homogeneous
from raytracer.rendering.render import render
from raytracer.scene.load import build
from tests.hard_cases.harness import Measured, hard_case
from tests.plugins.environments.kernels import density, drawn, seen
from tests.plugins.materials import test_contract as contract
from tests.plugins.materials.kernels import evaluate_many, scatter_many
from tests.plugins.media import kernels as media
from tests.small_scenes import image, mean
from tests.statistics import CYLINDER, cell_integrals, directions

ROUNDING = 2.0**-53
"""The most by which rounding to float64 changes a number, relative to it."""


# ---- Weights


@hard_case(37, "Veach 1997, thesis, eq. 9.11; Pharr et al. 2023, PBRT, 2.2.3", scene="37_plates.yaml")
def multiple_importance_weights(_: int) -> list[Measured]:
    """Weights of two strategies whose densities lie anywhere from 0 over 1e-320 to 1e308 and infinity.

    Naive: p^2 / (p^2 + q^2) as it is printed, whose squares over- and underflow.  Ours: the weights, and that both
    strategies together count light once, to the roundings of two quotients, two sums and two products.
    """
    sizes = np.concatenate([[0.0], 10.0 ** np.arange(-320.0, 309.0, 4.0), [math.inf]]).tolist()
    # What has no density is never drawn, and two strategies without choice never meet.
    pairs = [(p, q) for p in sizes for q in sizes if p > 0.0 and not (math.isinf(p) and math.isinf(q))]
    ours = np.array(
        [(mis_weight_light_sample(None, p, q), mis_weight_path(None, q, p) if q > 0.0 else 0.0) for p, q in pairs]
    )
    naive = np.array([(_squares(p, q), _squares(q, p) if q > 0.0 else 0.0) for p, q in pairs])
    ends = [power_heuristic(p, q) for p in (0.0, math.inf) for q in (0.0, math.inf)]
    return [
        Measured(
            "weights that are no numbers",
            float(np.isnan(naive).sum()),
            float(np.isnan([*ours.ravel(), *ends]).sum()),
            0.0,
        ),
        Measured(
            "both weights' sum less 1", _worst(naive.sum(axis=1) - 1.0), _worst(ours.sum(axis=1) - 1.0), 6.0 * ROUNDING
        ),
    ]


def _worst(errors: NDArray[np.float64]) -> float:
    """The largest magnitude; infinite if any is no number."""
    return float(np.abs(np.where(np.isnan(errors), math.inf, errors)).max())


def _squares(p: float, q: float) -> float:
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        a, b = np.float64(p) ** 2, np.float64(q) ** 2
        return float(a / (a + b))


@hard_case(
    38,
    "mitsuba3 src/emitters/tests/test_envmap.py; Pharr et al. 2023, PBRT, 12.5.2",
    quick=20_000,
    thorough=2_000_000,
    scene="38_hot_pixel.yaml",
)
def environment_map_of_one_pixel(samples: int) -> list[Measured]:
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
    grid = cell_integrals(lambda x: seen(hot, directions(x))[:, 0], CYLINDER, (512, 64), order=4)
    true = float(cell_integrals(_sphere_of(hot), ((0.0, np.pi), (0.0, 2.0 * np.pi)), (32, 64), order=4).sum())
    assert math.isclose(true, float(grid.sum()), rel_tol=0.02)
    evenly = float((seen(hot, uniform)[:, 0] * 4.0 * np.pi).mean())
    found = float((out.radiance[:, 0] / out.pdf).mean())

    # A black map, whose probabilities are 0 / 0.
    with np.errstate(invalid="ignore"):
        black = np.zeros((16, 32)) / np.zeros((16, 32)).sum()
    is_none = equirectangular(np.zeros((16, 32, 3))) is None

    # Either side of the seam, and the poles.
    noise = rng.random((16, 32, 3))
    noisy = equirectangular(noise)
    step = 1e-9
    sides = np.array([[sign * math.sin(step), 0.3, -math.cos(step)] for sign in (1.0, -1.0)])
    left, right = seen(noisy, sides / np.linalg.norm(sides, axis=1, keepdims=True))
    poles = np.array([[0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [-0.0, 1.0, -0.0], [1e-300, -1.0, 0.0]])
    with np.errstate(divide="ignore"):
        naive_poles = noise[[0, 15, 0, 15], 0, 0] / np.hypot(poles[:, 0], poles[:, 2])
    ours_poles = np.concatenate([density(noisy, poles), seen(noisy, poles).ravel(), drawn(noisy, [[0.0, 0.0]]).pdf])
    edge = noise[:, [0, 31]].mean(axis=0)
    return [
        Measured(
            "light of the sphere, relative",
            abs(evenly / true - 1.0),
            abs(found / true - 1.0),
            5.0 * 0.2 / math.sqrt(samples),
        ),
        Measured(
            "probabilities of a black map that are no numbers",
            float(np.isnan(black).sum()),
            0.0 if is_none else math.nan,
            0.0,
        ),
        Measured(
            "jump of the radiance at the seam",
            _worst(edge[0] - edge[1]),
            _worst(left - right),
            2.0 * step * 32.0 / (2.0 * np.pi) * float(np.ptp(noise)),
        ),
        Measured(
            "densities and radiances at the poles that are no numbers",
            float((~np.isfinite(naive_poles)).sum()),
            float((~np.isfinite(ours_poles)).sum()),
            0.0,
        ),
    ]


def _sphere_of(environment: Any) -> Callable[[NDArray[np.float64]], NDArray[np.float64]]:
    """Radiance times the sine, by (theta, phi) as of the map, so that its kinks are at edges of cells."""

    def light(angles: NDArray[np.float64]) -> NDArray[np.float64]:
        theta, phi = angles.T
        toward = np.stack([np.sin(theta) * np.sin(phi), np.cos(theta), -np.sin(theta) * np.cos(phi)], axis=1)
        return np.asarray(seen(environment, toward)[:, 0] * np.sin(theta))

    return light


# ---- Facets


@hard_case(39, "Walter et al. 2007, eq. 33; Pharr et al. 2023, PBRT, 9.6.1 (smooth below 1e-3)", scene="39_facets.yaml")
def narrow_lobes_and_grazing_light(_: int) -> list[Measured]:
    """GGX facets at their peak, from alpha 1 down to 1e-4, and light that comes along the surface.

    Naive: the density from cos^2 and tan^2 in float32, as it is printed; and its quotients D G / (4 cos cos) at cosines
    down to 0.  Ours against extended precision: a sum of two squares, its square and a quotient, with an input that is
    wrong by a rounding to the fourth power: 12 roundings.
    """
    alphas = np.array([1.0, 0.1, 1e-2, 1e-3, 1e-4])
    slopes = np.array([0.0, 0.25, 0.5, 1.0, 2.0])
    worst = naive = 0.0
    for alpha in alphas.tolist():
        for slope in slopes.tolist():
            cosine = 1.0 / math.sqrt(1.0 + (alpha * slope) ** 2)
            half = (alpha * slope * cosine, 0.0, cosine)
            exact = _ggx_exactly(alpha, half)
            worst = max(worst, abs(ggx(alpha, half) / exact - 1.0))
            naive = max(naive, abs(_ggx32(alpha, cosine) / exact - 1.0))
    specs = [_spec("rough_conductor", metal="gold"), _spec("rough_dielectric"), _spec("principled", metallic=0.5)]
    lost = sum(
        _nonsense(spec.model_copy(update={"roughness": rough})) for spec in specs for rough in (0.0317, 0.1, 1.0)
    )
    return [
        Measured("density of facets, relative", naive, worst, 12.0 * ROUNDING),
        Measured("numbers that are none, at cosines down to 0", float(_grazing32()), float(lost), 0.0),
    ]


def _spec(kind: str, **parameters: Any) -> MaterialSpec:
    return contract.spec_of(kind, parameters)


def _ggx_exactly(alpha: float, half: tuple[float, float, float]) -> float:
    x, y, z = (np.longdouble(value) for value in half)
    a = np.longdouble(alpha)
    spread = x * x + y * y + a * a * z * z
    return float(a * a / (np.longdouble(np.pi) * spread * spread))


def _ggx32(alpha: float, cosine: float) -> float:
    one, a, c = (np.float32(value) for value in (1.0, alpha, cosine))
    with np.errstate(divide="ignore", invalid="ignore"):
        root = c * c * (a * a - one) + one
        found = float(a * a / (np.float32(np.pi) * root * root))
    return found if math.isfinite(found) else math.inf


COSINES = (1.0, 1e-4, 1e-9, 1e-16, 1e-160, 1e-300, 0.0)


def _nonsense(spec: MaterialSpec) -> int:
    """Count directions, weights and densities of a material that are no numbers, at grazing and other incidence."""
    count = 0
    for cosine in COSINES:
        direction = (math.sqrt(1.0 - cosine * cosine), 0.0, -cosine)
        for front in (True, False):
            outgoing, weight, pdf = scatter_many(spec, direction, 100, front=front)
            along = np.concatenate(
                [outgoing, [(-direction[0], 0.0, cosine), (direction[0], 0.0, cosine), (1.0, 0.0, 0.0)]]
            )
            value, again = evaluate_many(spec, direction, along, front=front)
            count += int(sum((~np.isfinite(array)).sum() for array in (outgoing, weight, value, again)))
            count += int((~(pdf > 0.0)).sum())
    return count


def _grazing32() -> int:
    """Count values of the formula in float32, mirrored light of alpha 0.1 at these cosines, that are no numbers."""
    c = np.array(COSINES, np.float32)
    a = np.float32(0.1)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        tangent2 = (np.float32(1.0) - c * c) / (c * c)
        masked = np.float32(2.0) / (np.float32(1.0) + np.sqrt(np.float32(1.0) + a * a * tangent2))
        value = masked * masked / (np.float32(4.0 * np.pi) * a * a * c * c)
    return int((~np.isfinite(value)).sum())


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


@hard_case(
    41, "pbrt-v4 src/pbrt/cpu/integrators_test.cpp (analytic scenes)", quick=1, thorough=4, scene="41_furnace.yaml"
)
def furnaces(runs: int) -> list[Measured]:
    """What reflects all light, within radiance 1, is 1; what reflects half and emits half is 1 - 0.5^(n + 1).

    Naive: the ball in float32 without an offset, half of whose rays meet the ball that they leave and are lost at the
    last bounce; and light that is aimed at and found again, each counted in full, 1.5 where it should be 1.  Ours: the
    ball to rounding and without variance.  Half and half: a white wall whose view a lamp fills by half, within 4.5
    standard deviations of the mean, which its pixels tell; and, thoroughly, a wall that does both, whose depth is
    counted from the camera, to the rounding of n sums.
    """
    lost = _lost_by_self_hits()
    ball = image(BALL, spp=64, max_depth=8)
    assert ball.variance is not None
    found = [
        Measured("white ball in radiance 1, less 1", lost, _worst(ball.radiance - 1.0), 1e-12),
        Measured("variance of the white ball", lost * (1.0 - lost), float(ball.variance.max()), 1e-24),
    ]
    for depth in (3, 6)[:runs]:
        expected = 1.0 - 0.5 ** (depth - 1)
        value, deviation = mean(image(HALF, spp=256, max_depth=depth))
        twice = expected + 0.5 * (1.0 - 0.5 ** (depth - 2))
        found.append(
            Measured(
                f"lamp and wall, {depth} segments",
                abs(twice - expected),
                _worst(value - expected),
                4.5 * float(deviation.max()),
            )
        )
    for depth in (2, 5, 30)[: runs - 1]:
        expected = 1.0 - 0.5**depth
        glow = render(build(GLOWING, "test.yaml", {"render.max_depth": depth}), spp=4, threads=2).image
        twice = expected + 0.5 * (1.0 - 0.5 ** (depth - 1))
        found.append(
            Measured(
                f"glowing wall, {depth} segments",
                abs(twice - expected),
                _worst(glow.radiance - expected),
                2.0 * depth * ROUNDING,
            )
        )
    return found


def _lost_by_self_hits(paths: int = 20_000) -> float:
    """Measure the light that a white ball in radiance 1 lacks after 8 segments, in float32 and with no offset."""
    rng = np.random.default_rng(41)
    one = np.float32(1.0)
    point = rng.normal(size=(paths, 3)).astype(np.float32)
    point /= np.linalg.norm(point, axis=1, keepdims=True)
    # Off the origin, where coordinates round as they do in a scene.
    center = np.array([0.3, 20.0, 0.7], np.float32)
    position, normal = point + center, point
    alive = np.ones(paths, np.bool_)
    for _ in range(7):
        shift = rng.normal(size=(paths, 3)).astype(np.float32)
        direction = normal + shift / np.linalg.norm(shift, axis=1, keepdims=True)
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        to = position - center
        b = (to * direction).sum(axis=1)
        root = b * b - (to * to).sum(axis=1) + one
        with np.errstate(invalid="ignore"):
            near, far = -b - np.sqrt(root), -b + np.sqrt(root)
        t = np.where(near > 0.0, near, far)
        alive &= (root >= 0.0) & (t > 0.0)
        position = np.where(alive[:, None], position + t[:, None] * direction, position)
        out = position - center
        normal = out / np.linalg.norm(out, axis=1, keepdims=True)
    return float(alive.mean())


# ---- Media


@hard_case(
    45,
    "Pharr et al. 2023, PBRT, 11.2.1; Henyey, Greenstein 1941, eq. 2",
    quick=2_000,
    thorough=200_000,
    scene="45_no_medium.yaml",
)
def media_of_nothing(trials: int) -> list[Measured]:
    """A medium that takes nothing is none; all light goes straight on, or back, where g is 1 or -1.

    Naive: a distance -log(1 - u) / sigma, the transmittance exp(-sigma d) to the end of space, and the phase function
    and its cosines as they are printed, (1 + g^2 - q^2) / 2g, which cancel for small g.  Ours may be off by the
    roundings of a cosine of magnitude 1 that a rotated frame and five products have gone into.
    """
    rng = np.random.default_rng(45)
    clear = media.packed(Homogeneous(absorption=(0.0, 0.0, 0.0), scattering=(0.0, 0.0, 0.0)))
    u = rng.random(trials)
    taken = naive_taken = 0.0
    for distance in (0.0, 1.0, 1e30, math.inf):
        far, weight, _ = media.fly_many(clear, trials, distance=distance)
        through = media.transmittance_many(clear, 10, distance=distance)
        taken = max(taken, _worst(weight - 1.0), _worst(through - 1.0), _worst(1.0 * np.isfinite(far)))
        with np.errstate(invalid="ignore", divide="ignore"):
            flown = -np.log1p(-u) / 0.0
            naive_taken = max(naive_taken, _worst(np.exp(-0.0 * np.minimum(flown, distance)) - 1.0))

    ends = np.concatenate([[[0.0, 0.0], [1.0 - ROUNDING, 0.5], [0.5, 0.25]], rng.random((trials, 2))])
    lost = naive_lost = 0
    for g in (1.0, -1.0, 1.0 - ROUNDING, 0.0, 1e-30):
        outgoing, pdf, again = media.scatter_many(_phase(g), _ASKEW, ends)
        lost += int((~np.isfinite(outgoing)).sum() + (~(pdf > 0.0)).sum() + (~np.isfinite(again)).sum())
        cosine, density_ = _henyey_greenstein(g, ends[:, 0])
        naive_lost += int((~np.isfinite(cosine)).sum() + (~np.isfinite(density_)).sum())
    # Nearly isotropic, cosines are nearly 2 u - 1, and 3/2 g (1 - (2 u - 1)^2) more, of which g^2 remains.
    off = naive_off = 0.0
    for g in (1e-9, 1e-12, 1e-15):
        even = 2.0 * ends[:, 0] - 1.0
        expected = even + 1.5 * g * (1.0 - even * even)
        outgoing, _, _ = media.scatter_many(_phase(g), _ASKEW, ends)
        off = max(off, _worst(outgoing @ np.array(_ASKEW) - expected))
        naive_off = max(naive_off, _worst(_henyey_greenstein(g, ends[:, 0])[0] - expected))
    return [
        Measured("light taken by sigma = 0", naive_taken, taken, 0.0),
        Measured("numbers of the phase function that are none", float(naive_lost), float(lost), 0.0),
        Measured("cosine drawn for small g", naive_off, off, 16.0 * ROUNDING),
    ]


_ASKEW = (0.36, 0.48, -0.8)


def _phase(g: float) -> Any:
    return media.packed(Homogeneous(scattering=(1.0, 1.0, 1.0), g=g))


def _henyey_greenstein(g: float, u: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Cosines and their densities as they are printed."""
    with np.errstate(invalid="ignore", divide="ignore"):
        q = (1.0 - g * g) / (1.0 - g + 2.0 * g * u)
        cosine = (1.0 + g * g - q * q) / np.float64(2.0 * g)
        return cosine, (1.0 - g * g) / (4.0 * np.pi * (1.0 + g * g - 2.0 * g * cosine) ** 1.5)
