"""Lenses that disperse: their table of indices, and diaphragms and coatings as they are packed."""

import numpy as np
import pytest

from raytracer.optics.glass import AIR, CATALOGUE, LINE_D, constant_index_glass
from raytracer.optics.lens_system.coatings import Coating, Coatings
from raytracer.optics.lens_system.lens import FIRST_WAVELENGTH, LAST_WAVELENGTH, STEP, Element, Lens
from raytracer.optics.lens_system.ray_tracing import trace_rays
from raytracer.plugins.apertures.polygon import PolygonAperture
from tests.optics.lens_system.kernels import unit
from tests.optics.lens_system.test_first_order import STOP, thin


def slab(name):
    return Lens("slab", (Element(0.01, 5.0, CATALOGUE[name], 9.0), Element(0.0, 0.0, AIR, 9.0)))


@pytest.mark.parametrize("name", CATALOGUE)
def test_indices_between_the_rows_of_the_table_are_right_to_a_millionth(name):
    lens = slab(name)
    packed = lens.packed(dispersion=True)
    wavelengths = np.random.default_rng(1).uniform(FIRST_WAVELENGTH, LAST_WAVELENGTH, 400)
    if not CATALOGUE[name].disperses():
        assert packed.indices is None
        return
    rows = packed.indices.ior[:, 1]
    table = FIRST_WAVELENGTH + STEP * np.arange(len(rows))
    assert table[-1] == LAST_WAVELENGTH
    between = np.interp(wavelengths, table, rows)
    np.testing.assert_allclose(between, CATALOGUE[name].ior(wavelengths), rtol=0.0, atol=1e-6)
    np.testing.assert_array_equal(packed.indices.ior[:, [0, 2]], 1.0)


def test_rays_with_wavelengths_go_as_through_a_lens_of_their_index():
    lens, rng = slab("N-SF11"), np.random.default_rng(2)
    starts = np.stack([*rng.uniform(-5.0, 5.0, (2, 40)), np.full(40, -9.0)], axis=1)
    ways = unit(np.stack([*rng.uniform(-0.1, 0.1, (2, 40)), np.ones(40)], axis=1))
    wavelengths = rng.uniform(380.0, 780.0, 40)
    table = lens.packed(dispersion=True)
    weights, points, onward = trace_rays(table, starts, ways, True, wavelengths)
    assert weights.all()
    for ray, wavelength in enumerate(wavelengths):
        _, point, way = trace_rays(lens.packed(float(wavelength)), starts[ray], ways[ray])
        np.testing.assert_allclose(points[ray], point[0], rtol=0.0, atol=2e-6)
        np.testing.assert_allclose(onward[ray], way[0], rtol=0.0, atol=5e-7)
    # At its rows there is nothing between; beyond the table is its end; and no wavelength is the d line.
    for wavelength, same in ((486.0, 486.0), (780.0, 780.0), (900.0, 780.0), (100.0, 380.0)):
        found = trace_rays(table, starts, ways, True, wavelength)
        expected = trace_rays(lens.packed(same), starts, ways)
        np.testing.assert_allclose(found[2], expected[2], rtol=0.0, atol=1e-15)
    np.testing.assert_array_equal(trace_rays(table, starts, ways)[2], trace_rays(table, starts, ways, True, LINE_D)[2])


def test_what_a_lens_does_not_have_is_not_packed():
    plain = Lens("plain", (*thin(50.0, 5.0), STOP))
    packed = plain.packed(dispersion=True, coatings=True)
    assert packed[5:] == (None, None, None, None)
    coated = Lens(
        "coated", (Element(0.01, 5.0, constant_index_glass(1.6), 9.0, coating=Coating()), Element(0.0, 0.0, AIR, 9.0))
    )
    assert coated.packed().coatings is None
    assert isinstance(coated.packed(coatings=True).coatings, Coatings)
    with pytest.raises(ValueError, match="surface 2 has a coating, but no glass"):
        Lens("coated air", (Element(0.0, 1.0, AIR, 9.0), Element(0.0, 0.0, AIR, 9.0, coating=Coating())))


def test_a_diaphragm_lets_through_what_its_shape_does():
    """A square with a corner at the top, of the area of the disc: |x| + |y| <= sqrt(pi / 2) radii."""
    lens = Lens("stop first", (STOP._replace(radius=8.0), *thin(100.0)))
    square = PolygonAperture(blades=4).pack({})
    packed = lens.packed(stop_radius=5.0, diaphragm=square)
    x, y = np.meshgrid(np.linspace(-8.0, 8.0, 81), np.linspace(-8.0, 8.0, 81))
    starts = np.stack([x.ravel(), y.ravel(), np.full(x.size, -1.0)], axis=1)
    weights, _, _ = trace_rays(packed, starts, (0.0, 0.0, 1.0))
    inside = np.abs(starts[:, 0]) + np.abs(starts[:, 1]) <= 5.0 * np.sqrt(np.pi / 2.0)
    np.testing.assert_array_equal(weights, inside)
    # Its corners reach beyond the round one's radius.
    assert np.hypot(*starts[weights > 0.0, :2].T).max() > 6.0
