"""Views with poses of their own: what is checked, how views in one plane become such, and their `.lf` files."""

import dataclasses

import h5py
import numpy as np
import pytest

from raytracer.film.light_field import lf
from raytracer.film.light_field.field import LightField
from raytracer.film.light_field.posed_field import PosedLightField
from raytracer.film.light_field.posed_views import PosedViews
from raytracer.film.light_field.views import Plane, Pose, Views
from raytracer.util.errors import InputError


def looking(origin, forward):
    """The pose of a view at a place that looks along a direction, with up as near to +y as can be."""
    forward = np.asarray(forward) / np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 1.0, 0.0])
    right /= np.linalg.norm(right)
    return np.array([origin, right, np.cross(right, forward), forward])


def posed(rows=2, columns=3, width=8, height=6):
    rng = np.random.default_rng(0)
    pose = np.array([looking(*rng.normal(size=(2, 3))) for _ in range(rows * columns)]).reshape(rows, columns, 4, 3)
    plane = rng.normal(size=(rows, columns, 3))
    plane[..., 0] = np.abs(plane[..., 0]) + 0.1
    return PosedViews(pose, plane, width, height)


def posed_field():
    rng, views = np.random.default_rng(1), posed()
    size = (views.rows, views.columns, views.height, views.width)
    layers = {"depth": rng.uniform(1.0, 9.0, size), "object_id": rng.integers(0, 9, size, dtype=np.uint32)}
    return PosedLightField(rng.random((*size, 3)), views, layers, {"spp": 16})


def seen(pose, plane, point):
    """The pixel at which a view sees a point."""
    right, up, depth = pose[1:] @ (point - pose[0])
    return np.array([(right / depth - plane[1]) / plane[0], (plane[2] - up / depth) / plane[0]])


def test_views_in_one_plane_become_views_that_see_the_same():
    # The format's own formula: a point at x of the middle and 1 / w away is at x - u (w - w0) in the view at u.
    rng = np.random.default_rng(2)
    pose = looking([1.0, 2.0, 3.0], [0.3, -0.2, -1.0])
    views = Views(rng.normal(size=(2, 3, 2)), Plane(0.01, -0.1, 0.07), 20, 15, inverse_focus=0.4, pose=Pose.of(pose))
    converted = PosedViews.of(views)
    for x, distance in ((np.array([0.02, -0.03]), 2.0), (np.array([0.0, 0.05]), 7.0)):
        point = pose[0] + distance * (pose[3] + x @ pose[1:3])
        for row, column in np.ndindex(2, 3):
            tangent = x - views.position[row, column] * (1.0 / distance - 0.4)
            expected = [(tangent[0] + 0.1) / 0.01, (0.07 - tangent[1]) / 0.01]
            pixel = seen(converted.pose[row, column], converted.plane[row, column], point)
            assert pixel == pytest.approx(expected, abs=1e-9)


def test_views_without_a_place_in_the_scene_look_along_z_from_the_origin():
    converted = PosedViews.of(Views(np.array([[[1.0, 2.0]]]), Plane(0.01, -0.1, 0.07), 20, 15))
    assert converted.pose[0, 0].tolist() == [[1, 2, 0], [1, 0, 0], [0, 1, 0], [0, 0, -1]]


@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_the_point_at_which_all_look_is_found(sense):
    middle = np.array([1.0, 2.0, 3.0])
    places = middle + np.random.default_rng(3).normal(size=(6, 3))
    pose = np.array([looking(place, sense * (middle - place)) for place in places]).reshape(2, 3, 4, 3)
    plane = np.broadcast_to([0.1, -0.4, 0.3], (2, 3, 3))
    assert PosedViews(pose, plane, 8, 6).focus_point() == pytest.approx(middle, abs=1e-9)


def test_parallel_views_look_at_no_point():
    parallel = Views(np.random.default_rng(0).normal(size=(2, 2, 2)), Plane(0.1, -0.4, 0.3), 8, 6)
    assert PosedViews.of(parallel).focus_point() is None


def _without(array, index, value):
    changed = np.array(array)
    changed[index] = value
    return changed


@pytest.mark.parametrize(
    ("key", "change", "sentence"),
    [
        ("pose", lambda a: a[..., :3, :], "must have the shape"),
        ("pose", lambda a: _without(a, (0, 0, 0, 0), np.nan), "must be finite"),
        ("pose", lambda a: _without(a, (1, 2, 1), 0.0), "axes of view 1,2"),
        ("pose", lambda a: a * np.array([1.0, -1.0, 1.0, 1.0])[:, None], "axes of view 0,0"),
        ("plane", lambda a: a[:, :2], "must have the shape"),
        ("plane", lambda a: _without(a, (0, 1, 0), 0.0), "pixels have a size"),
        ("width", lambda n: 0, "must have pixels"),
    ],
)
def test_a_geometry_that_makes_no_sense_is_refused(key, change, sentence):
    views = posed()
    with pytest.raises(ValueError, match=sentence):
        dataclasses.replace(views, **{key: change(getattr(views, key))})


def test_a_file_keeps_all(tmp_path):
    field = posed_field()
    lf.write(tmp_path / "a.lf", field, dtype="float64")
    assert lf.is_posed(tmp_path / "a.lf")
    with lf.open_posed(tmp_path / "a.lf") as found:
        assert np.array_equal(found.views.pose, field.views.pose)
        assert np.array_equal(found.views.plane, field.views.plane)
        assert np.array_equal(found.radiance, field.radiance)
        assert all(np.array_equal(found.layers[name], field.layers[name]) for name in field.layers)
        assert found.settings == {"spp": 16}
        assert "3 x 2 views of 8 x 6" in repr(found)


def test_a_file_of_views_in_one_plane_is_read_as_posed_too(tmp_path):
    views = Views(np.random.default_rng(0).normal(size=(2, 3, 2)), Plane(0.01, -0.1, 0.07), 4, 3, inverse_focus=0.4)
    planar = LightField(np.random.default_rng(1).random((2, 3, 3, 4, 3)), views, {}, settings={"spp": 4})
    lf.write(tmp_path / "a.lf", planar, dtype="float64")
    assert not lf.is_posed(tmp_path / "a.lf")
    with lf.open_posed(tmp_path / "a.lf") as found:
        assert np.array_equal(found.views.pose, PosedViews.of(views).pose)
        assert np.array_equal(found.radiance, planar.radiance)
        assert found.settings == planar.settings


def test_readers_of_views_in_one_plane_refuse_it_in_a_sentence(tmp_path):
    lf.write(tmp_path / "a.lf", posed_field())
    with pytest.raises(InputError, match=r"a\.lf: its views have poses of their own"):
        lf.open(tmp_path / "a.lf")


def test_a_depth_with_channels_is_no_depth():
    field = posed_field()
    with pytest.raises(ValueError, match="layer depth must have one number a pixel"):
        PosedLightField(field.radiance, field.views, {"depth": np.ones(np.shape(field.radiance))})


def _replace(file, name, array):
    del file[name]
    file[name] = array


@pytest.mark.parametrize(
    ("harm", "sentence"),
    [
        (lambda file: _replace(file, "pose", np.zeros((2, 3, 4, 3))), "axes of view 0,0"),
        (lambda file: _replace(file, "pose", np.zeros((3, 2, 4, 3))), "pose must be of shape"),
        (lambda file: _replace(file, "plane", np.zeros((2, 3, 2))), "plane must be of shape"),
        (lambda file: file.__delitem__("plane"), "has no dataset plane"),
        (lambda file: file.attrs.update(version=3), "of version 3"),
    ],
)
def test_a_file_whose_geometry_makes_no_sense_is_refused(tmp_path, harm, sentence):
    path = tmp_path / "a.lf"
    lf.write(path, posed_field())
    with h5py.File(path, "r+") as file:
        harm(file)
    with pytest.raises(InputError, match=rf"a\.lf: .*{sentence}"):
        lf.open_posed(path)
