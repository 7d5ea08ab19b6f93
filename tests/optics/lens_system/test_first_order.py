"""Pupils and f-numbers: lens formulas against traced rays."""

import math

import numpy as np
import pytest

from raytracer.optics.glass import AIR, constant_index_glass
from raytracer.optics.lens_system.first_order import cardinal_points, entrance_pupil, exit_pupil, ray_transfer_matrix
from raytracer.optics.lens_system.lens import Element, Lens
from raytracer.optics.lens_system.lens_setup import f_number_of, stop_radius_for, widest_f_number
from raytracer.optics.lens_system.ray_tracing import trace_paths, trace_rays
from raytracer.optics.lens_system.surfaces import slice_surfaces
from tests.optics.lens_system.kernels import DOUBLE_GAUSS, unit

F, APART = 100.0, 20.0
STOP = Element(0.0, APART, AIR, 5.0, "stop", is_stop=True)


def lens_of(rows):
    return Lens(
        "rows", tuple(Element(1 / r if r else 0.0, t, constant_index_glass(n), a, is_stop=not r) for r, t, n, a in rows)
    )


def thin(f, behind=0.0, radius=30.0):
    """A biconvex lens without thickness: 1/f = (n - 1) 2 / R."""
    return Element(1.0 / f, 0.0, constant_index_glass(1.5), radius), Element(-1.0 / f, behind, AIR, radius)


def test_a_stop_in_front_is_the_entrance_pupil_and_its_image_the_exit_pupil():
    packed = Lens("stop first", (STOP, *thin(F))).packed()
    assert entrance_pupil(packed) == pytest.approx((0.0, 5.0))
    # 1 / s' = 1 / f - 1 / s: virtual, before the lens, and larger.
    image = 1.0 / (1.0 / F - 1.0 / APART)
    assert exit_pupil(packed) == pytest.approx((APART + image, -5.0 * image / APART), rel=1e-12)


def test_a_stop_behind_is_the_exit_pupil_and_its_image_the_entrance_pupil():
    packed = Lens("stop last", (*thin(F, APART), STOP)).packed()
    assert exit_pupil(packed) == pytest.approx((APART, 5.0))
    image = 1.0 / (1.0 / F - 1.0 / APART)
    assert entrance_pupil(packed) == pytest.approx((-image, -5.0 * image / APART), rel=1e-12)


def test_a_stop_in_the_focal_plane_has_its_pupil_at_infinity():
    packed = Lens("telecentric", (*thin(128.0, 128.0), STOP)).packed()
    assert entrance_pupil(packed) == (math.inf, math.inf)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_rays_towards_a_pupils_middle_go_through_the_stops(side):
    packed = lens_of(DOUBLE_GAUSS).packed()
    pupil = entrance_pupil(packed) if side > 0.0 else exit_pupil(packed)
    way = unit([0.0, 1e-4, side])[0]
    for aim, expected in ((0.0, 0.0), (1e-3 * pupil.radius, 1e-3 * packed.radius[packed.stop])):
        start = np.array([0.0, aim, pupil.z]) - 200.0 * way
        weights, points, _ = trace_paths(packed, start, way, side > 0.0)
        assert weights[0] == 1.0
        # Off by the third order of the angle.
        assert points[0, packed.stop, 1] == pytest.approx(expected, abs=1e-7)


def test_parts_of_a_lens_are_the_lens():
    packed = lens_of(DOUBLE_GAUSS).packed()
    count = len(packed.vertex)
    whole = ray_transfer_matrix(packed)
    for cut in (0, 3, 5, count):
        front, back = slice_surfaces(packed, 0, cut), slice_surfaces(packed, cut, count)
        assert (front.stop, back.stop) == ((5, -1) if cut > 5 else (-1, 5 - cut))
        way = packed.vertex[cut] - packed.vertex[cut - 1] if 0 < cut < count else 0.0
        between = np.array([[1.0, way / packed.ior[cut]], [0.0, 1.0]])
        np.testing.assert_allclose(
            ray_transfer_matrix(back) @ between @ ray_transfer_matrix(front), whole, rtol=1e-12, atol=1e-14
        )
    start, way = np.array([0.5, 2.0, -5.0]), unit([0.02, -0.03, 1.0])[0]
    _, (point,), (onward,) = trace_rays(packed, start, way)
    _, (first,), (between,) = trace_rays(slice_surfaces(packed, 0, 4), start, way)
    _, (second,), (behind,) = trace_rays(slice_surfaces(packed, 4, count), first, between)
    np.testing.assert_array_equal((second, behind), (point, onward))


def test_cylinders_have_power_across_their_axis_only():
    c, n = 0.02, 1.5
    for axis, other in (("x", "y"), ("y", "x")):
        surface = Element(c, 1.0, constant_index_glass(n), 9.0, "cylindrical", axis=axis)
        packed = Lens("cylinder", (surface, Element(0.0, 0.0, AIR, 9.0))).packed()
        assert cardinal_points(packed, other).focal_length == pytest.approx(1.0 / ((n - 1.0) * c))
        with pytest.raises(ValueError, match="no power"):
            cardinal_points(packed, axis)


def test_without_a_stop_the_rim_that_light_of_the_axis_fills_is_one():
    assert Lens("singlet", thin(F)).stop() == 0
    narrow = (*thin(F, 10.0), Element(0.0, 3.0, constant_index_glass(1.5), 7.0), Element(0.0, 0.0, AIR, 9.0))
    assert Lens("narrow behind", narrow).stop() == 2
    # At 10 mm the cone has 0.9 of its width: a rim of 27.1 mm does not touch it, and one of 26.9 mm does.
    wide = (*thin(F, 10.0), Element(0.0, 0.0, AIR, 27.1))
    assert Lens("as wide", wide).stop() == 0
    assert Lens("less wide", (*wide[:2], wide[2]._replace(radius=26.9))).stop() == 2


@pytest.mark.parametrize("f_number", [2.018, 2.8, 5.6, 22.0, 1000.0])
def test_the_stop_closes_to_the_f_number_asked_for(f_number):
    lens = lens_of(DOUBLE_GAUSS)
    radius = stop_radius_for(lens, f_number)
    assert f_number_of(lens.packed(stop_radius=radius)) == pytest.approx(f_number, rel=1e-12)
    assert f_number_of(lens.stopped_down(radius).packed()) == pytest.approx(f_number, rel=1e-12)
    # Light at the height f / 2N grazes it: what is a little nearer to the axis passes, and what is farther does not.
    height = cardinal_points(lens.packed()).focal_length / (2.0 * f_number)
    starts = np.array([[0.0, height * (1.0 - 1e-9), -9.0], [height * (1.0 + 1e-9), 0.0, -9.0]])
    weights, _, _ = trace_rays(lens.packed(stop_radius=radius), starts, (0.0, 0.0, 1.0))
    assert weights.tolist() == [1.0, 0.0]


def test_a_lens_does_not_open_beyond_its_rims():
    lens = lens_of(DOUBLE_GAUSS)
    widest = widest_f_number(lens)
    assert widest == pytest.approx(2.0, rel=0.01)
    assert stop_radius_for(lens, widest) <= 8.55
    for f_number in (1.4, 0.0, -2.0, math.nan, math.inf):
        with pytest.raises(ValueError, match=rf"opens to f/{widest:.4g}, and cannot be set to"):
            stop_radius_for(lens, f_number)
    with pytest.raises(ValueError, match=r"opens to a radius of 8\.55 mm, not 9 mm"):
        lens.packed(stop_radius=9.0)
    # A rim before a stop that is never filled limits the light.
    assert widest_f_number(Lens("rim", (*thin(F, 1.0, 10.0), STOP._replace(radius=50.0)))) == pytest.approx(
        5.0, rel=0.01
    )
