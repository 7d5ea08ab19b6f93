"""Conics, even aspheres and cylinders: by the figures that focus without error, and by the definition of their sag."""

import numpy as np
import pytest

from raytracer.optics.glass import AIR, constant_index_glass
from raytracer.optics.lens_system.lens import Element, Lens
from raytracer.optics.lens_system.ray_tracing import trace_rays
from tests.optics.lens_system.rays import crossing, parallel, unit

GLASS = constant_index_glass(1.5)


def alone(element):
    return Lens("a surface", (element,)).packed()


HEIGHTS = np.linspace(0.1, 19.9, 100)


def test_an_ellipsoid_of_glass_has_one_focus_within():
    # Descartes 1637, "La Dioptrique", discourse 8: k = -1 / n^2, focus n R / (n - 1) behind the vertex.
    packed = alone(Element(0.02, 0.0, GLASS, 20.0, "conic", conic=-1.0 / 1.5**2))
    weights, points, directions = trace_rays(packed, *parallel(HEIGHTS, 20.0, axis=1))
    assert weights.all()
    np.testing.assert_allclose(crossing(points, directions), 1.5 * 50.0 / 0.5, rtol=0.0, atol=1e-11)


def test_a_hyperboloid_of_glass_has_one_focus_behind():
    # The same: k = -n^2, focus R / (n - 1) behind the vertex.
    packed = Lens(
        "plano-hyperbolic", (Element(0.0, 9.0, GLASS, 20.0), Element(-0.02, 0.0, AIR, 20.0, "conic", conic=-(1.5**2)))
    ).packed()
    weights, points, directions = trace_rays(packed, *parallel(HEIGHTS, 20.0, axis=1))
    assert weights.all()
    np.testing.assert_allclose(crossing(points, directions), 109.0, rtol=0.0, atol=1e-11)
    # And light from there comes out parallel.
    ways = unit(np.stack([0 * HEIGHTS, HEIGHTS / 100.0, np.full(100, -1.0)], axis=1))
    weights, _, directions = trace_rays(packed, [0.0, 0.0, 109.0], ways, towards_film=False)
    assert weights[:80].all()
    np.testing.assert_allclose(np.abs(directions[:80]), np.tile((0.0, 0.0, 1.0), (80, 1)), rtol=0.0, atol=1e-13)


ASPHERES = {
    "weak": Element(0.01, 0.0, GLASS, 10.0, "asphere", coefficients=(1e-5, -2e-8)),
    "flat base": Element(0.0, 0.0, GLASS, 10.0, "asphere", coefficients=(1e-4, -2e-6, 1e-8)),
    "phone": Element(0.3, 0.0, GLASS, 1.5, "asphere", conic=-3.2, coefficients=(-0.05, 0.03, -0.02, 0.004, -0.0003)),
    "gull wing": Element(-0.1, 0.0, GLASS, 2.5, "asphere", coefficients=(-0.05, 0.02, -0.002, 0.0001)),
    "to its rim": Element(0.1, 0.0, GLASS, 10.0, "asphere", coefficients=(1e-5,)),
    "conic": Element(-0.05, 0.0, GLASS, 10.0, "conic", conic=-2.5),
    "cylinder": Element(0.05, 0.0, GLASS, 10.0, "cylindrical", axis="x"),
}


@pytest.mark.parametrize("steep", [0.1, 1.0, 4.0])
@pytest.mark.parametrize("towards_film", [True, False])
@pytest.mark.parametrize("name", ASPHERES)
def test_rays_meet_the_surface_that_the_sag_describes(name, towards_film, steep):
    """Every ray that passes is on the surface; and one that crosses it once, within the rim, is not lost.

    The oracle looks at 4000 pieces of the ray for changes of the sign of z - sag(x, y).  With air on both sides nothing
    is reflected.
    """
    element, count = ASPHERES[name]._replace(glass=AIR), 300
    radius, side = element.radius, 1.0 if towards_film else -1.0
    rng = np.random.default_rng(5)
    through = np.stack([*rng.uniform(-radius, radius, (2, count)), np.zeros(count)], axis=1)
    ways = unit(np.stack([*rng.uniform(-steep, steep, (2, count)), np.full(count, side)], axis=1))
    starts = through - 3.0 * radius * ways
    weights, points, onward = trace_rays(alone(element), starts, ways, towards_film)
    assert np.isfinite(points).all()
    passed = weights > 0.0
    assert passed.mean() > 0.02
    np.testing.assert_array_equal(onward, ways)
    x, y, z = points[passed].T
    # Where the surface is steep, sags are as much less sure than places.
    slope = np.abs(element.sag(0.999 * x, 0.999 * y) - element.sag(x, y)) / (1e-3 * np.hypot(x, y))
    assert (np.abs(z - element.sag(x, y)) <= 1e-14 * radius * (1.0 + 2.0 * slope)).all()
    along = ((points - starts) * ways).sum(axis=1, keepdims=True)
    np.testing.assert_allclose((starts + along * ways)[passed], points[passed], rtol=0.0, atol=1e-14 * radius)

    places = np.linspace(0.0, 6.0 * radius, 4001)
    x, y, z = np.moveaxis(starts[:, None] + places[:, None] * ways[:, None], 2, 0)
    above = np.where(np.hypot(x, y) < radius, z - element.sag(x, y), np.nan)
    crossed = (above[:, :-1] * side <= 0.0) & (above[:, 1:] * side >= 0.0)
    back = (above[:, :-1] * side > 0.0) & (above[:, 1:] * side < 0.0)
    once = (crossed.sum(axis=1) == 1) & ~back.any(axis=1)
    assert once.mean() > 0.02
    assert weights[once].all()


@pytest.mark.parametrize("name", ASPHERES)
def test_nothing_hangs_or_is_no_number(name):
    rng = np.random.default_rng(6)
    starts = rng.normal(0.0, 10.0, (5000, 3))
    ways = unit(rng.normal(0.0, 1.0, (5000, 3)))
    ways[:10], starts[10:20], ways[20:30] = np.nan, np.inf, (1.0, 0.0, 0.0)
    for towards_film in (True, False):
        weights, points, onward = trace_rays(alone(ASPHERES[name]), starts, ways, towards_film)
        assert set(np.unique(weights)) <= {0.0, 1.0}
        assert np.isfinite(points[weights > 0.0]).all()
        assert np.isfinite(onward[weights > 0.0]).all()
        assert not weights[:20].any()
