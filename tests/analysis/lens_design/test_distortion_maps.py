"""Maps of distortion: there and back, against traced rays, and against OpenCV."""

import functools
import json
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
    points = found.grid.points()[::7]
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


def test_the_middle_is_undistorted():
    found = mapped("double-gauss-50mm")
    near = np.array([[0.0, 0.0], [1e-3, 0.0], [0.0, -1e-3]])
    np.testing.assert_allclose(found.distorted(near), near, atol=1e-9)


def test_the_map_straightens_a_picture():
    """A smooth picture as the lens gives it, straightened by the map, is the picture as it was."""
    found = mapped("double-gauss-50mm")
    there, back = found.maps()
    height, width = found.grid.height, found.grid.width
    y, x = np.mgrid[:height, :width].astype(np.float32)

    def scene(x, y):
        return (np.sin(x / 12.0) * np.cos(y / 15.0)).astype(np.float32)

    # What the lens gives at a pixel is the ideal picture at that pixel's undistorted place.
    given = scene(back[..., 0], back[..., 1])
    straight = cv2.remap(given, there[..., 0], there[..., 1], cv2.INTER_CUBIC)
    inside = (there > 3.0).all(axis=-1) & (there[..., 0] < width - 4) & (there[..., 1] < height - 4)
    assert inside.mean() > 0.5
    assert np.abs(straight - scene(x, y))[inside].max() < 0.01
    assert np.abs(given - scene(x, y))[inside].max() > 0.1


def test_the_archive_holds_the_maps(tmp_path):
    found = mapped("double-gauss-50mm")
    path = tmp_path / "map.npz"
    path.write_bytes(files.to_npz(found))
    with np.load(path) as arrays:
        there, back = found.maps()
        np.testing.assert_array_equal(arrays["map_x"], there[..., 0])
        np.testing.assert_array_equal(arrays["inverse_y"], back[..., 1])
        about = json.loads(str(arrays["about"]))
    assert about == json.loads(json.dumps(files.as_dict(found)))
    assert about["models"][0]["rms_px"] == found.models[0].rms_px


def test_a_lens_that_sees_behind_itself_has_no_pinhole():
    found = mapped("fisheye-10mm", sensor_mm=(36.0, 24.0))
    assert found.models[0].name == "fisheye"
    outside = found.undistorted(np.array([[30.0, 0.0]]))
    assert np.isnan(outside).all()
