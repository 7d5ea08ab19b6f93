"""Rough metal and glass: white furnaces, reciprocity, limits, and measured metals."""

import cmath
import itertools
import math

import numpy as np
import pytest

from raytracer.core.fresnel import fresnel_conductor, fresnel_dielectric
from raytracer.core.microfacet import SMOOTH_ALPHA
from raytracer.plugins.materials.base.interface import row
from raytracer.plugins.materials.dielectric import Dielectric
from raytracer.plugins.materials.rough_conductor import METALS, RoughConductor
from raytracer.plugins.materials.rough_dielectric import RoughDielectric
from raytracer.plugins.textures.base.interface import ParameterPacker, textures_of
from raytracer.plugins.textures.checker import Checker
from tests.plugins.materials.kernels import (
    SITE,
    evaluate_many,
    evaluate_row,
    frame,
    incoming,
    mirrored,
    packed_row,
    scatter_many,
)
from tests.plugins.shapes.kernels import unit

ROUGHNESSES = (0.05, 0.1, 0.2, 0.35, 0.5, 0.7, 0.85, 1.0)
ANGLES = (0.0, 30.0, 60.0, 75.0, 85.0, 89.0)

WHITE_METAL = {"albedo": (1.0, 1.0, 1.0)}


# ---- Quadrature of lobes of any width


def graded(about, low, high, finest):
    """Nodes and weights on (low, high): Gauss by cells, which shrink to `finest` towards the points `about`."""
    reach = high - low
    steps = np.geomspace(finest, reach, int(1.5 * math.log(reach / finest)) + 2)
    edges = np.concatenate(
        [np.linspace(low, high, 41), about, *(point + sign * steps for point in about for sign in (1.0, -1.0))]
    )
    edges = np.unique(np.clip(edges, low, high))
    edges = edges[np.append(True, np.diff(edges) > 1e-14)]
    nodes, weights = np.polynomial.legendre.leggauss(4)
    widths = np.diff(edges)[:, None]
    return (edges[:-1, None] + widths * (0.5 + 0.5 * nodes)).ravel(), (0.5 * widths * weights).ravel()


def hemisphere(axis, finest):
    """Directions (n, 3) and solid angles (n,) of the half sphere that `axis` is in, dense about it and at the rim.

    On one side of the plane of incidence, for twice the solid angle: light goes alike to the other.
    """
    z, by_z = graded([0.0, abs(float(axis[2]))], 0.0, 1.0, finest)
    phi, by_phi = graded([0.0], 0.0, math.pi, 30.0 * finest)
    sine = np.sqrt((1.0 - z) * (1.0 + z))[:, None]
    turned = phi + math.atan2(axis[1], axis[0])
    points = np.stack(
        np.broadcast_arrays(sine * np.cos(turned), sine * np.sin(turned), math.copysign(1.0, axis[2]) * z[:, None]), -1
    )
    return points.reshape(-1, 3), np.outer(by_z, 2.0 * by_phi).ravel()


def cap(axis, finest):
    """Directions and solid angles of the half of the sphere below z = 0, in rings about `axis`."""
    angle, by_angle = graded([0.0], 0.0, math.pi, finest)
    phi = (np.arange(256) + 0.5) * (2.0 * math.pi / 256)
    sine = np.sin(angle)[:, None]
    local = np.stack(np.broadcast_arrays(sine * np.cos(phi), sine * np.sin(phi), np.cos(angle)[:, None]), -1)
    points = local.reshape(-1, 3) @ frame(axis)
    weights = np.repeat(by_angle * np.sin(angle) * (2.0 * math.pi / 256), 256)
    below = points[:, 2] < 0.0
    return points[below], weights[below]


def albedo(spec, degrees, *, front=True, material=None):
    """The integral of f |cos| over all directions, by channel; `material` is a row to take in place of the spec's."""
    direction = incoming(degrees)
    material = material or packed_row(spec)
    alpha = spec.roughness**2
    # Near grazing, narrow lobes are as long as they are high above the horizon; broad ones need no such grid.
    points, weights = hemisphere(mirrored(direction), 2e-7 if alpha < 0.1 else 2e-4)
    total = np.asarray(weights @ evaluate_row(material, direction, points, front=front)[0])
    if isinstance(spec, RoughDielectric):
        eta = spec.eta() ** (1.0 if front else -1.0)
        tangent = np.array(direction[:2]) / eta
        sine2 = float(tangent @ tangent)
        axis = np.append(tangent / max(1.0, math.sqrt(sine2)), -math.sqrt(max(0.0, 1.0 - sine2)))
        points, weights = hemisphere(axis, 2e-7) if alpha < 0.1 else cap(axis, 0.02 * alpha)
        total = total + weights @ evaluate_row(material, direction, points, front=front)[0]
    return np.asarray(total)


# ---- White furnaces


@pytest.mark.parametrize(
    ("spec", "sides", "angles"),
    [
        *((RoughConductor(**WHITE_METAL, roughness=roughness), [True], ANGLES) for roughness in ROUGHNESSES),
        *((RoughDielectric(ior=1.5, roughness=roughness), [True, False], ANGLES) for roughness in ROUGHNESSES),
        *(
            (RoughDielectric(ior=ior, outside_ior=outside, roughness=roughness), [True, False], [50.0])
            for ior, outside in ((1.33, 1.5), (2.4, 1.0))
            for roughness in (0.1, 0.4, 0.8)
        ),
    ],
)
def test_white_furnace_closes(spec, sides, angles):
    for degrees, front in itertools.product(angles, sides):
        np.testing.assert_allclose(albedo(spec, degrees, front=front), 1.0, rtol=0.0, atol=1e-3)


@pytest.mark.parametrize("roughness", [0.05, 0.3, 1.0])
def test_light_in_lossless_materials_keeps_its_weight(roughness):
    # As light is followed, each direction has the weight 1: a furnace without noise, at any angle.
    for degrees in (*ANGLES, 89.99):
        for spec in (RoughConductor(**WHITE_METAL, roughness=roughness), RoughDielectric(roughness=roughness)):
            for front in (True, False):
                _, weight, _ = scatter_many(spec, incoming(degrees), 20_000, front=front)
                np.testing.assert_allclose(weight, 1.0, rtol=1e-12)


def test_without_multiple_scattering_what_meets_a_second_facet_is_lost():
    for degrees in (0.0, 60.0):
        for front in (True, False):
            for kind, more in ((RoughConductor, WHITE_METAL), (RoughDielectric, {})):
                spec = kind(**more, roughness=0.8, multiple_scattering=False)
                _, weight, _ = scatter_many(spec, incoming(degrees), 50_000, front=front)
                np.testing.assert_allclose(weight[weight > 0.0], 1.0, rtol=1e-12)
                expected = albedo(spec, degrees, front=front)[0]
                assert expected < 0.98
                assert (weight[:, 0] > 0.0).mean() == pytest.approx(expected, abs=0.011)


@pytest.mark.parametrize("roughness", [0.08, 0.3, 0.62, 0.97])
def test_white_furnace_of_a_textured_roughness_closes(roughness):
    grey = Checker(even=(roughness,) * 3, odd=(roughness,) * 3)
    for kind, more in ((RoughConductor, WHITE_METAL), (RoughDielectric, {})):
        spec = kind(**more, roughness=grey)
        book = ParameterPacker(used=textures_of(spec))
        material = row(type(spec).pack([spec], book), 0, book.tables, SITE)
        assert material.alpha == pytest.approx(roughness**2, rel=1e-12)
        for degrees in (0.0, 60.0, 85.0):
            closed = albedo(kind(**more, roughness=roughness), degrees, material=material)
            np.testing.assert_allclose(closed, 1.0, rtol=0.0, atol=4e-3)


# ---- Reciprocity


def _f(spec, a, b):
    """f of light from `b`, followed back from `a`, (n, 3) each; both point away from the surface."""
    up = np.where(a[:, 2:] > 0.0, 1.0, -1.0) * [0.0, 0.0, 1.0]
    value, _ = evaluate_many(spec, -a, b, front=a[:, 2] > 0.0, normal=up)
    return value / np.abs(b[:, 2:])


@pytest.mark.parametrize("roughness", [0.05, 0.3, 1.0])
@pytest.mark.parametrize(
    ("kind", "keys", "ior", "outside"),
    [
        (RoughConductor, {"metal": "copper"}, 0.0, 1.0),
        (RoughConductor, {"albedo": (0.9, 0.5, 0.1)}, 0.0, 1.0),
        (RoughDielectric, {"ior": 1.5}, 1.5, 1.0),
        (RoughDielectric, {"ior": 1.33, "outside_ior": 1.5}, 1.33, 1.5),
    ],
)
def test_light_goes_both_ways_alike_in_basic_radiance(kind, keys, ior, outside, roughness):
    # Helmholtz: f(a, b) = f(b, a).  Through glass, with radiance, f(a, b) / n_a^2 = f(b, a) / n_b^2, n_a being the
    # index where a is, and light going from b to a (Veach 1997, eq. 5.14).  Basic radiance L / n^2 turns f(a, b) into
    # f(a, b) n_b^2 / n_a^2, for which this reads f(a, b) / n_b^2 = f(b, a) / n_a^2.
    spec = kind(**keys, roughness=roughness)
    a, b = unit(np.random.default_rng(7).normal(size=(300, 3))).reshape(2, 150, 3)
    if not ior:
        # Metal is seen from its outside alone.
        a, b = a * np.sign(a[:, 2:]), b * np.sign(b[:, 2:])
    n_a, n_b = (np.where(vectors[:, 2:] > 0.0, outside, ior) for vectors in (a, b))
    there, back = _f(spec, a, b), _f(spec, b, a)
    np.testing.assert_allclose(there / n_b**2, back / n_a**2, rtol=1e-9)
    crossed = ((n_a != n_b)[:, 0] & (there[:, 0] > 1e-3)).sum()
    assert crossed > 5 or not ior or roughness < 0.1


# ---- Limits


@pytest.mark.parametrize("roughness", [0.0, 0.03, 1.0001 * math.sqrt(SMOOTH_ALPHA)])
def test_metal_of_little_roughness_is_a_mirror_by_fresnel(roughness):
    # Just above where it counts as one: the lobe's tail holds a part alpha^2 / (alpha^2 + tan^2) beyond an angle.
    eta, k = METALS["gold"]
    spec, smooth = RoughConductor(metal="gold", roughness=roughness), roughness < math.sqrt(SMOOTH_ALPHA)
    for degrees in (0.0, 85.0, 40.0) if smooth else (40.0,):
        direction = incoming(degrees)
        outgoing, weight, pdf = scatter_many(spec, direction, 4 if smooth else 100_000)
        off = np.linalg.norm(outgoing - mirrored(direction), axis=1)
        assert np.isinf(pdf).all() == smooth
        assert np.quantile(off, 0.98) <= (1e-14 if smooth else 20.0 * SMOOTH_ALPHA)
        expected = fresnel_conductor(-direction[2], eta, k)
        np.testing.assert_allclose(weight.mean(axis=0), expected, rtol=1e-12 if smooth else 1e-4)
    if not smooth:
        np.testing.assert_allclose(albedo(spec, 40.0), expected, rtol=1e-3)


@pytest.mark.parametrize("front", [True, False])
def test_glass_at_no_roughness_is_smooth_glass(front):
    for roughness in (0.0, 0.03):
        for degrees in (0.0, 35.0, 80.0):
            direction = incoming(degrees)
            rough = RoughDielectric(ior=1.5, roughness=roughness)
            outgoing, weight, pdf = scatter_many(rough, direction, 20_000, front=front)
            expected, _, _ = scatter_many(Dielectric(ior=1.5), direction, 20_000, front=front)
            # The same directions, and as often.
            for sign in (1.0, -1.0):
                result, wanted = outgoing[sign * outgoing[:, 2] > 0.0], expected[sign * expected[:, 2] > 0.0]
                assert abs(len(result) - len(wanted)) < 5.0 * math.sqrt(2.0 * (1.0 + len(wanted)))
                np.testing.assert_allclose(result, np.broadcast_to(wanted[:1], result.shape), rtol=0.0, atol=1e-12)
            assert (weight == 1.0).all()
            assert np.isinf(pdf).all()


def test_glass_of_little_roughness_reflects_by_fresnel():
    spec = RoughDielectric(ior=1.5, roughness=1.0001 * math.sqrt(SMOOTH_ALPHA))
    for degrees, front in ((0.0, True), (60.0, True), (30.0, False)):
        direction = incoming(degrees)
        outgoing, _, _ = scatter_many(spec, direction, 100_000, front=front)
        expected, cos_t = fresnel_dielectric(-direction[2], 1.5 if front else 1.0 / 1.5)
        up = outgoing[:, 2] > 0.0
        assert up.mean() == pytest.approx(expected, abs=5.0 * math.sqrt(expected / 100_000) + 1e-4)
        assert np.median(outgoing[~up, 2]) == pytest.approx(-cos_t, abs=2e-3)


def test_equal_indices_are_nothing_at_all():
    for degrees in (0.0, 60.0, 90.0):
        direction = incoming(degrees)
        outgoing, weight, pdf = scatter_many(RoughDielectric(ior=1.5, outside_ior=1.5, roughness=0.7), direction, 100)
        np.testing.assert_array_equal(outgoing, np.tile(direction, (100, 1)))
        assert (weight == 1.0).all()
        assert np.isinf(pdf).all()


@pytest.mark.parametrize("ulps", [-64, -1, 1, 2, 64])
@pytest.mark.parametrize("roughness", [0.3, 1.0])
def test_indices_that_differ_by_rounding_lose_no_light(roughness, ulps):
    # As a quotient of quotients of indices gives them.  As much light goes straight on as for a difference of 1e-6,
    # by which times their slope facets turn it.
    near, far = (RoughDielectric(ior=ior, roughness=roughness) for ior in (1.0 + ulps * 2.0**-52, 1.0 + 1e-6))
    count = 4000
    for degrees in (0.0, 60.0):
        for front in (True, False):
            direction = incoming(degrees)
            expected, *_ = scatter_many(far, direction, count, front=front, seed=6)
            outgoing, weight, pdf = scatter_many(near, direction, count, front=front)
            assert (weight == 1.0).all()
            assert (pdf > 0.0).all()
            straight = np.linalg.norm(outgoing - direction, axis=1) < 1e-9
            alike = np.linalg.norm(expected - direction, axis=1) < 1e-3
            deviation = math.sqrt((alike.mean() * (1.0 - alike.mean()) + 1.0 / count) * 2.0 / count)
            assert abs(straight.mean() - alike.mean()) < 4.5 * deviation
            value, density = evaluate_many(near, direction, outgoing, front=front)
            assert np.isfinite(value).all()
            assert np.isfinite(density).all()


@pytest.mark.parametrize("roughness", [math.sqrt(SMOOTH_ALPHA), 0.05, 1.0])
def test_directions_along_the_surface_give_numbers(roughness):
    # Hard case 39, at cosines down to none at all.
    for cosine in (0.0, 1e-300, 1e-16, 1e-9, 1e-4):
        direction = (math.sqrt(1.0 - cosine * cosine), 0.0, -cosine)
        for spec in (RoughConductor(metal="gold", roughness=roughness), RoughDielectric(roughness=roughness)):
            for front in (True, False):
                outgoing, weight, _ = scatter_many(spec, direction, 1000, front=front)
                value, pdf = evaluate_many(spec, direction, outgoing, front=front)
                assert np.isfinite(outgoing).all()
                assert (weight <= 1.0 + 1e-12).all()
                assert np.isfinite(value).all()
                assert np.isfinite(pdf).all()


# ---- Metals


# Linear colours at normal incidence, from whole spectra: Akenine-Moller et al. 2018, "Real-Time Rendering", 4th ed.,
# table 9.2 (three wavelengths cannot give a red above 1, nor quite the purity of gold's blue); and the indices of
# Johnson and Christy, or Rakic, on either side of 550 nm.
@pytest.mark.parametrize(
    ("metal", "colour", "n", "k"),
    [
        ("gold", (1.022, 0.782, 0.344), (0.29, 0.43), (2.455, 2.863)),
        ("silver", (0.972, 0.960, 0.915), (0.05, 0.06), (3.586, 3.858)),
        ("copper", (0.955, 0.638, 0.538), (0.70, 1.02), (2.577, 2.704)),
        ("aluminium", (0.913, 0.922, 0.924), (0.87340, 1.0728), (6.2418, 6.7839)),
    ],
)
def test_metals_have_their_colours_and_measured_indices(metal, colour, n, k):
    _, weight, _ = scatter_many(RoughConductor(metal=metal, roughness=0.0), (0.0, 0.0, -1.0), 1)
    np.testing.assert_allclose(weight[0], colour, rtol=0.0, atol=0.07)
    for (low, high), value in zip((n, k), METALS[metal], strict=True):
        assert low <= value[1] <= high


def test_reflectance_of_metal_is_that_of_complex_refraction():
    # Fresnel's amplitudes with a complex index and cosine.
    for n, k in ((0.2, 3.4), (1.5, 7.0), (1.5, 0.0), (0.05, 4.4), (3.0, 0.5), (0.7, 0.1)):
        for cosine in (1.0, 0.9, 0.5, 0.1, 1e-3):
            index = complex(n, -k)
            bent = cmath.sqrt(index * index - (1.0 - cosine * cosine))
            perpendicular = (cosine - bent) / (cosine + bent)
            parallel = (index * index * cosine - bent) / (index * index * cosine + bent)
            expected = 0.5 * (abs(perpendicular) ** 2 + abs(parallel) ** 2)
            assert fresnel_conductor(cosine, (n,) * 3, (k,) * 3)[0] == pytest.approx(expected, rel=1e-12)
    assert fresnel_conductor(0.0, (0.2,) * 3, (3.4,) * 3)[0] == 1.0
    assert fresnel_conductor(0.3, (1.0,) * 3, (0.0,) * 3)[0] == pytest.approx(0.0, abs=1e-15)
    assert fresnel_conductor(0.4, (0.0,) * 3, (1.0,) * 3)[0] == 1.0


def test_an_albedo_is_what_smooth_metal_reflects_at_normal_incidence():
    _, weight, _ = scatter_many(RoughConductor(albedo=(0.9, 0.5, 0.1), roughness=0.0), (0.0, 0.0, -1.0), 1)
    np.testing.assert_allclose(weight[0], (0.9, 0.5, 0.1), rtol=1e-14)
    _, weight, _ = scatter_many(RoughConductor(albedo=(0.9, 0.5, 0.1), roughness=0.0), (1.0, 0.0, 0.0), 1)
    np.testing.assert_allclose(weight[0], 1.0, rtol=1e-14)


def test_light_between_mirrors_deepens_the_colour_of_rough_metal():
    # Each further mirror takes its part: what is added to green and blue of gold, by red, falls with their reflectance.
    smooth, rough = (albedo(RoughConductor(metal="gold", roughness=roughness), 30.0) for roughness in (0.1, 1.0))
    assert (rough[1:] / rough[0] < 0.97 * smooth[1:] / smooth[0]).all()
    assert (rough < smooth).all()
