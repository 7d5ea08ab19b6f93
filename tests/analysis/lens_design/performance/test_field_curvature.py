"""Coddington's equations against real rays close to the chief ray."""

import math
from typing import Any

import numpy as np
import pytest

from raytracer.analysis.lens_design.performance.chief_rays import chief_rays_at_fields, object_points
from raytracer.analysis.lens_design.performance.field_aberrations import field_curvature
from raytracer.analysis.lens_design.performance.optical_bench import MERIDIANS, OpticalBench, set_up_bench
from raytracer.optics.lens_system.ray_tracing import trace_rays
from raytracer.scene.assets.lenses import read_lens
from tests.analysis.lens_design.benches import (
    SHIPPED,
    aspheric_pair,
    bench_at,
    closest,
    cylinder_pair,
    rays_close_to,
    sensor,
)


def foci(bench: OpticalBench, meridian: str, field_deg: float) -> Any:
    """Tangential and sagittal focus along the axis, from the film, of pairs of rays on both sides of the chief ray."""
    chief = chief_rays_at_fields(bench, meridian, bench.primary, np.array([field_deg]))
    origin, toward = chief.origin[0], chief.toward[0]
    near = not math.isinf(bench.distance)
    start = object_points(bench, chief.origin, -chief.toward)[0] if near else origin
    column = MERIDIANS[meridian]
    across = np.eye(3)[1 - column]
    found = []
    for along in (np.cross(toward, across), across):
        apart = 1e-2 if not near else 1e-2 / bench.distance
        origins, directions = rays_close_to(start, toward, along, apart, parallel=not near)
        weights, points, onward = trace_rays(bench.without_rims(), origins, directions)
        assert (weights > 0.0).all()
        found.append(closest(points, onward)[2] - bench.film)
    return found


@pytest.mark.parametrize("distance", [math.inf, 300.0])
@pytest.mark.parametrize(("make", "meridian"), [(aspheric_pair, "y"), (cylinder_pair, "y"), (cylinder_pair, "x")])
def test_foci_are_where_real_rays_meet(make: Any, meridian: str, distance: float) -> None:
    bench = bench_at(make(), sensor_mm=sensor(10.0), focus_distance_mm=distance, steps=5)
    found = field_curvature(bench, meridian)
    for row, angle in enumerate(found.field_deg):
        tangential, sagittal = foci(bench, meridian, float(angle))
        assert found.tangential_mm[0, row] == pytest.approx(tangential, abs=1e-4)
        assert found.sagittal_mm[0, row] == pytest.approx(sagittal, abs=1e-4)


def test_the_petzval_surface_is_three_times_as_far_from_the_tangential_focus_as_from_the_sagittal_one() -> None:
    # In the limit of small fields: Welford 1986, ch. 8.
    bench = bench_at(aspheric_pair(), sensor_mm=sensor(1.0), steps=5)
    found = field_curvature(bench)
    tangential, sagittal = (row[0, 1:] - found.petzval_mm[1:] for row in (found.tangential_mm, found.sagittal_mm))
    np.testing.assert_allclose(tangential, 3.0 * sagittal, rtol=1e-2)
    assert abs(sagittal[-1]) > 0.1 * abs(found.petzval_mm[-1])


def test_the_fisheye_out_to_its_rim() -> None:
    path = next(path for path in SHIPPED if "fisheye" in path.name)
    bench = set_up_bench(read_lens(path))
    found = field_curvature(bench)
    for row in (10, 25, 38):
        tangential, sagittal = foci(bench, "y", float(found.field_deg[row]))
        assert found.tangential_mm[0, row] == pytest.approx(tangential, abs=1e-4)
        assert found.sagittal_mm[0, row] == pytest.approx(sagittal, abs=1e-4)
