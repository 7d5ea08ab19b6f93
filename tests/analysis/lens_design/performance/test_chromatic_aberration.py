"""Chromatic aberration of singlets and doublets."""

import numpy as np
import pytest

from raytracer.analysis.lens_design.performance.field_aberrations import axial_shift_mm, chromatic_aberration
from raytracer.analysis.lens_design.performance.first_order import first_order
from raytracer.optics.glass import AIR, CATALOGUE, LINE_C, LINE_D, LINE_F, constant_index_glass
from tests.analysis.lens_design.benches import THIN, bench_at, lens_of, sensor, stop, symmetric_lens, thin_lens


@pytest.mark.parametrize("name", ["N-BK7", "N-SF11"])
def test_a_singlet_spreads_its_focus_by_f_over_v(name: str) -> None:
    glass = CATALOGUE[name]
    found = chromatic_aberration(bench_at(thin_lens(100.0, 0.5, glass, 10.0)))
    # Exactly, f (n_d - 1) (1 / (n_F - 1) - 1 / (n_C - 1)).
    d, f, c = (float(glass.ior(line)) - 1.0 for line in (LINE_D, LINE_F, LINE_C))
    assert found.axial_between_ends_mm == pytest.approx(100.0 * d * (1.0 / f - 1.0 / c), rel=1e-6)
    # Which is f / V, but for what the yellow is off the middle of a glass that disperses much.
    assert found.axial_between_ends_mm == pytest.approx(-100.0 / glass.abbe(), rel=0.02 if name == "N-BK7" else 0.03)
    # Blue is bent most.
    assert (np.diff(found.axial_mm) > 0.0).all()
    # The stop is at the lens: all chief rays go straight through.
    assert np.abs(found.lateral_um).max() < 1e-4


def achromat() -> object:
    """Thin, cemented: powers V1 / (V1 - V2) and -V2 / (V1 - V2) of a hundredth."""
    crown, flint = CATALOGUE["N-BK7"], CATALOGUE["N-SF11"]
    v1, v2 = crown.abbe(), flint.abbe()
    power1, power2 = 0.01 * v1 / (v1 - v2), -0.01 * v2 / (v1 - v2)
    c1 = 0.5 * power1 / (float(crown.ior()) - 1.0)
    c3 = -c1 - power2 / (float(flint.ior()) - 1.0)
    return lens_of((c1, THIN, crown, 5.0, {"is_stop": True}), (-c1, THIN, flint, 5.0), (c3, 0.0, AIR, 5.0))


def test_an_achromat_brings_its_two_colours_together() -> None:
    bench = bench_at(achromat())  # type: ignore[arg-type]
    found = chromatic_aberration(bench)
    assert abs(found.axial_between_ends_mm) < 1e-6
    # Both are behind the yellow: the secondary spectrum, about f / 2000.
    assert 0.02 < axial_shift_mm(bench, 486.1327) < 0.1


def test_symmetry_leaves_no_lateral_colour_at_life_size() -> None:
    glass = CATALOGUE["N-SF11"]
    lens = symmetric_lens()
    dispersing = lens_of(
        *(
            (*row[:2], glass if row.glass.name != "air" else AIR, *row[3:4], {"is_stop": row.is_stop})
            for row in lens.elements
        )
    )
    distance = 2.0 * first_order(bench_at(dispersing)).focal_length_mm
    bench = bench_at(dispersing, focus_distance_mm=distance, sensor_mm=sensor(8.0))
    found = chromatic_aberration(bench)
    # Chief rays of all colours go through the middle of the stop, and so leave as they came.
    assert np.abs(found.lateral_um).max() < 1e-6
    assert np.abs(chromatic_aberration(bench_at(dispersing, sensor_mm=sensor(8.0))).lateral_um).max() > 1.0


def test_a_stop_before_a_thin_lens_makes_blue_images_smaller() -> None:
    glass, before = CATALOGUE["N-BK7"], 20.0
    lens = thin_lens(100.0, 0.0, glass, 30.0).elements
    bench = bench_at(lens_of(stop(before, 5.0), *(row[:4] for row in lens)), sensor_mm=sensor(1.0))
    found = chromatic_aberration(bench)
    # A ray that meets the lens at the height y is bent by y / f, and goes on to the film at 100 mm.
    height = before * np.tan(np.radians(found.field_deg))
    for row, line in enumerate((LINE_D, LINE_F, LINE_C)):
        power = 0.01 * (float(glass.ior(line)) - 1.0) / (float(glass.ior()) - 1.0)
        expected = -1e3 * 100.0 * height * (power - 0.01)
        np.testing.assert_allclose(found.lateral_um[row], expected, rtol=1e-3, atol=1e-9)
    assert found.lateral_um[1, -1] < -1.0


def test_no_dispersion_no_colour() -> None:
    found = chromatic_aberration(bench_at(thin_lens(100.0, 0.5, constant_index_glass(1.5), 10.0)))
    assert not found.axial_mm.any()
    assert not found.lateral_um.any()
