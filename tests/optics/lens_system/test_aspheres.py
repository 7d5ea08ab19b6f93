"""Conics, even aspheres and cylinders: by the figures that focus without error, and by the definition of their sag."""

import math

import numpy as np
import pytest

from raytracer.optics.glass import AIR, constant_index_glass
from raytracer.optics.lens_system.lens import Element, Lens
from raytracer.optics.lens_system.ray_tracing import trace_rays
from raytracer.optics.lens_system.surfaces import slice_surfaces
from tests.optics.lens_system.kernels import crossing, parallel, unit

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

    The oracle looks at 1500 pieces of the ray for changes of the sign of z - sag(x, y).  With air on both sides nothing
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

    places = np.linspace(0.0, 6.0 * radius, 1501)
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


def test_spheres_among_other_shapes_are_spheres():
    # Shapes have formulas of their own; an asphere without coefficients, and a conic of k = 0, are spheres too.
    rng = np.random.default_rng(7)
    starts = np.stack([*rng.uniform(-9.0, 9.0, (2, 2000)), np.full(2000, -30.0)], axis=1)
    ways = unit(np.stack([*rng.uniform(-0.3, 0.3, (2, 2000)), np.ones(2000)], axis=1))
    sphere = Element(0.04, 3.0, GLASS, 9.0)
    hyperbola = Element(-0.02, 0.0, AIR, 9.0, "conic", conic=-0.4)
    plain = trace_rays(alone(sphere), starts, ways)
    mixed = Lens("mixed", (sphere, hyperbola)).packed()
    assert mixed.shapes is not None
    first = trace_rays(slice_surfaces(mixed, 0, 1), starts, ways)
    for one, other in zip(plain, first, strict=True):
        np.testing.assert_allclose(other, one, rtol=0.0, atol=2e-14)
    # A tiny coefficient takes the other way to the same surface.
    tiny = trace_rays(alone(sphere._replace(kind="asphere", coefficients=(1e-30,))), starts, ways)
    for one, other in zip(plain, tiny, strict=True):
        np.testing.assert_allclose(other, one, rtol=0.0, atol=2e-14)


def test_a_cylinder_bends_light_across_its_axis_only():
    heights = np.linspace(-9.0, 9.0, 19)
    sphere = Lens("round", (Element(0.02, 5.0, GLASS, 9.5), Element(0.0, 0.0, AIR, 9.5))).packed()
    _, expected, bent = trace_rays(sphere, *parallel(heights, 20.0, axis=1))
    for axis, across in (("x", 1), ("y", 0)):
        surface = Element(0.02, 5.0, GLASS, 9.5, "cylindrical", axis=axis)
        packed = Lens("cylinder", (surface, Element(0.0, 0.0, AIR, 9.5))).packed()
        # In the plane across the axis it is as a sphere; along the axis, as flat glass.
        _, points, onward = trace_rays(packed, *parallel(heights, 20.0, axis=across))
        np.testing.assert_allclose(points[:, across], expected[:, 1], rtol=0.0, atol=1e-14)
        np.testing.assert_allclose(onward[:, across], bent[:, 1], rtol=0.0, atol=1e-15)
        np.testing.assert_allclose(onward[:, 1 - across], 0.0, rtol=0.0, atol=0.0)
        _, _, straight = trace_rays(packed, *parallel(heights, 20.0, axis=1 - across))
        np.testing.assert_allclose(straight, np.tile((0.0, 0.0, 1.0), (19, 1)), rtol=0.0, atol=1e-15)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"kind": "cylindrical"}, "needs an axis, x or y"),
        ({"axis": "x"}, "if and only if it is cylindrical"),
        ({"kind": "cylindrical", "axis": "x", "conic": -1.0}, "neither conic nor aspheric"),
        ({"conic": math.nan}, "not finite"),
        ({"curvature": math.inf}, "not finite"),
        ({"kind": "asphere", "coefficients": (math.inf,)}, "not finite"),
        ({"conic": 1.0, "radius": 40.0}, "an ellipsoid of radius 50 mm, which reaches no 40 mm far out"),
        ({"radius": 51.0}, "a sphere of radius 50 mm, which reaches no 51 mm far out"),
        ({"radius": 0.0}, "lets no light through"),
        ({"thickness": -1.0}, "behind the next one"),
    ],
)
def test_what_is_no_surface_is_named(changes, words):
    with pytest.raises(ValueError, match=f"^surface 2 .*{words}"):
        Lens("bad", (Element(0.0, 1.0, GLASS, 9.0), Element(0.02, 0.0, AIR, 9.0)._replace(**changes)))


def test_two_stops_and_no_surfaces_are_named():
    with pytest.raises(ValueError, match="a lens needs a surface"):
        Lens("empty", ())
    stop = Element(0.0, 1.0, AIR, 9.0, "stop", is_stop=True)
    with pytest.raises(ValueError, match="surface 2 is a second stop"):
        Lens("two", (stop, stop))
