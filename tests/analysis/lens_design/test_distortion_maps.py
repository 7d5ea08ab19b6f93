"""Maps of distortion: there and back, against traced rays, and against OpenCV."""

import functools
import math

import numpy as np
import pytest

from raytracer.analysis.lens_design.distortion_maps import distortion_map as files
from raytracer.analysis.lens_design.distortion_maps.distortion_map import trace_distortion_map
from raytracer.analysis.lens_design.distortion_maps.tables import fitted_points
from raytracer.analysis.lens_design.performance import chief_rays as chief
from raytracer.analysis.lens_design.performance.optical_bench import set_up_bench
from raytracer.analysis.lens_design.performance.results import Settings
from tests.analysis.lens_design.benches import cylinder_pair, shipped

cv2 = pytest.importorskip("cv2")

WIDTH = 300
NAMES = ("double-gauss-50mm", "fisheye-10mm", "phone-3.7mm", "wide-22mm", "cylinders")


def bench(name, **settings):
    lens = cylinder_pair() if name == "cylinders" else shipped(name)
    side = min(43.3, lens.image_circle or 43.3) / math.hypot(3.0, 2.0)
    size = (12.0, 8.0) if name == "cylinders" else (3.0 * side, 2.0 * side)
    return set_up_bench(lens, Settings(**{"sensor_mm": size, **settings}))


@functools.cache
def mapped(name, **settings):
    return trace_distortion_map(bench(name, **settings), WIDTH)


@pytest.mark.parametrize("name", NAMES)
def test_the_inverse_undoes_the_map(name):
    found = mapped(name)
    points = found.grid.points()
    for there, back in ((found.undistorted, found.distorted), (found.distorted, found.undistorted)):
        again = back(there(points))
        lit = np.isfinite(again).all(axis=-1)
        assert lit.mean() > 0.8
        assert np.abs(again - points)[lit].max() / found.grid.pitch < 1e-3


@pytest.mark.parametrize("name", ["double-gauss-50mm", "phone-3.7mm"])
@pytest.mark.parametrize("distance", [math.inf, 1500.0])
def test_points_lie_where_their_chief_rays_land(name, distance):
    made = bench(name, focus_distance_mm=distance)
    found = trace_distortion_map(made, WIDTH)
    half = 0.5 * math.hypot(*made.settings.sensor_mm)
    fields = np.degrees(np.arctan(np.linspace(0.05, 0.95, 7) * half / found.scale[0]))
    heights = chief.chief_rays_at_fields(made, "y", made.primary, fields).height
    turned = np.array([math.cos(0.7), math.sin(0.7)])
    ideal = (found.scale[0] * np.tan(np.radians(fields)))[:, None] * turned
    np.testing.assert_allclose(found.distorted(ideal), heights[:, None] * turned, atol=1e-6 * half)


def test_cylinders_are_traced_across_both_planes():
    found = mapped("cylinders")
    made = bench("cylinders")
    for axis, meridian in enumerate(("x", "y")):
        fields = np.array([1.0, 2.0])
        heights = chief.chief_rays_at_fields(made, meridian, made.primary, fields).height
        ideal = np.zeros((2, 2))
        ideal[:, axis] = found.scale[axis] * np.tan(np.radians(fields))
        np.testing.assert_allclose(found.distorted(ideal)[:, axis], heights, atol=1e-7)
    assert found.scale[0] != pytest.approx(found.scale[1], rel=0.1)


@pytest.mark.parametrize("name", ["double-gauss-50mm", "wide-22mm", "phone-3.7mm", "fisheye-10mm"])
def test_models_are_opencv_s(name):
    """Each puts the points of the film where OpenCV puts them, as far from the traced ones as it says."""
    found = mapped(name)
    film = fitted_points(found.grid)
    seen = found.undistorted(film) / found.scale[0]
    away = np.linalg.norm(seen, axis=1)
    if name == "fisheye-10mm":
        assert (found.models[0].name, found.ideal) == ("fisheye", "equidistant")
        lit = away < math.radians(85.0)
        world = np.column_stack([seen * np.sinc(away / math.pi)[:, None], np.cos(away)])[lit]
    else:
        lit = np.isfinite(away)
        world = np.column_stack([seen, np.ones(len(seen))])[lit]
    for model in found.models:
        if (model.name == "fisheye") != (name == "fisheye-10mm"):
            continue
        project = cv2.fisheye.projectPoints if model.name == "fisheye" else cv2.projectPoints
        put, _ = project(world[:, None], np.zeros(3), np.zeros(3), found.camera_matrix(), model.coefficients)
        off = np.linalg.norm(put[:, 0] - found.grid.pixels(film[lit]), axis=1)
        if model.name == "fisheye":
            assert off.max() <= 1.001 * model.largest_px + 1e-6
        else:
            assert off.max() == pytest.approx(model.largest_px, rel=1e-3, abs=1e-6)
            assert np.sqrt(np.mean(off**2)) == pytest.approx(model.rms_px, rel=1e-3, abs=1e-6)
    assert found.models[0].rms_px < 0.1


def test_opencv_reads_the_file(tmp_path):
    found = mapped("wide-22mm")
    path = tmp_path / "wide.yaml"
    path.write_bytes(files.to_opencv_yaml(found))
    stored = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    np.testing.assert_array_equal(stored.getNode("camera_matrix").mat(), found.camera_matrix())
    coefficients = stored.getNode("distortion_coefficients").mat()
    np.testing.assert_array_equal(coefficients.ravel(), found.models[0].coefficients)
    assert stored.getNode("image_width").real() == WIDTH
    assert stored.getNode("distortion_model").string() == found.models[0].name
