"""Pictures with cameras, transforms.json: where they stand, what is in one plane, and what is refused."""

import dataclasses
import json
import math
import os

import numpy as np
import PIL.Image
import pytest

from raytracer.film import image_file
from raytracer.film.image import Image
from raytracer.film.light_field import lf
from raytracer.film.light_field.field import LightField
from raytracer.film.light_field.posed_field import PosedLightField
from raytracer.film.light_field.posed_views import PosedViews
from raytracer.film.light_field.views import Plane, Views
from raytracer.lightfield.formats.exporter import export
from raytracer.lightfield.formats.importer import import_views
from raytracer.util.errors import InputError
from tests.lightfield.test_mosaics import POSE, light_field

SIZE = (5, 7)


def field_of(views, depth=True):
    rng = np.random.default_rng(2)
    size = (views.rows, views.columns, views.height, views.width)
    radiance = rng.random((*size, 3)).astype(np.float32)
    layers = {"depth": rng.uniform(1.0, 5.0, size).astype(np.float32)} if depth else {}
    kind = PosedLightField if isinstance(views, PosedViews) else LightField
    return kind(radiance, views, layers)


def same_rays(found, views, tolerance=1e-12):
    """All pixels of all views see along the same rays, wherever the middle of the views is taken to be."""
    a, b = (each if isinstance(each, PosedViews) else PosedViews.of(each) for each in (found, views))
    assert np.allclose(a.pose, b.pose, rtol=0.0, atol=tolerance)
    assert np.allclose(a.plane, b.plane, rtol=0.0, atol=tolerance)


@pytest.mark.parametrize("pose", [POSE, None])
@pytest.mark.parametrize("inverse_focus", [0.4, 0.0, -0.3])
def test_views_of_one_plane_are_taken_back(tmp_path, inverse_focus, pose):
    geometry = dataclasses.replace(light_field().views, inverse_focus=inverse_focus, pose=pose)
    field = field_of(geometry)
    export(field, tmp_path / "a", layout="transforms", suffix=".exr")
    found = import_views(tmp_path / "a")
    assert isinstance(found, LightField)
    assert np.array_equal(np.asarray(found.radiance), field.radiance)
    assert np.array_equal(np.asarray(found.layers["depth"]).astype(np.float32), field.layers["depth"])
    assert np.allclose(found.views.position, geometry.position, rtol=0.0, atol=1e-14)
    assert np.allclose(found.views.plane, geometry.plane, rtol=0.0, atol=1e-14)
    assert found.views.inverse_focus == pytest.approx(inverse_focus, abs=1e-12)
    assert found.views.cell == geometry.cell
    same_rays(found.views, geometry)


def test_a_camera_is_that_of_opengl(tmp_path):
    """By hand, of one view: up on the right of the middle, and sheared to converge at 2.5 m."""
    geometry = light_field().views
    export(field_of(geometry), tmp_path / "transforms.json")
    stated = json.loads((tmp_path / "transforms.json").read_text())
    assert (stated["w"], stated["h"], stated["fl_x"], stated["fl_y"]) == (7, 5, 100.0, 100.0)
    assert stated["camera_angle_x"] == pytest.approx(2.0 * math.atan(0.035))
    # Whoever finds cx for all does not look for that of a frame.
    assert not {"cx", "cy"} & set(stated)
    frame = stated["frames"][3]
    assert frame["file_path"] == "images/view_00_03.png"
    # At 30 mm to the right and 30 mm up in the pose's axes; the camera looks against its third.
    place = np.array(POSE.origin) + 0.03 * np.array(POSE.right) + 0.03 * np.array(POSE.up)
    expected = np.eye(4)
    expected[:3] = np.stack([POSE.right, POSE.up, -np.array(POSE.forward), place], axis=1)
    assert np.allclose(frame["transform_matrix"], expected, rtol=0.0, atol=1e-15)
    # The point at 2.5 m on the axis of the middle, at 3.5, 2.5 of its picture, is there in this view too: it lies 30 mm
    # to the left and below, by 0.012, 1.2 pixels, from the principal point.
    assert frame["cx"] == pytest.approx(3.5 + 1.2)
    assert frame["cy"] == pytest.approx(2.5 - 1.2)


def round_an_object(count=6):
    angle = 2.0 * math.pi * np.arange(count) / count
    forward = -np.stack([np.cos(angle), np.sin(angle), np.zeros(count)], axis=1)
    up = np.broadcast_to([0.0, 0.0, 1.0], (count, 3))
    right = np.cross(forward, up)
    pose = np.stack([-2.0 * forward, right, up, forward], axis=1)
    plane = np.array([[0.01 + 0.001 * k, -0.03, 0.02] for k in range(count)])
    return PosedViews(pose.reshape(2, 3, 4, 3), plane.reshape(2, 3, 3), SIZE[1], SIZE[0])


def test_views_with_poses_of_their_own_are_taken_back(tmp_path):
    field = field_of(round_an_object())
    export(field, tmp_path / "a", layout="transforms", suffix=".npy")
    found = import_views(tmp_path / "a")
    assert isinstance(found, PosedLightField)
    assert np.array_equal(np.asarray(found.radiance), field.radiance)
    same_rays(found.views, field.views)
    lf.write(tmp_path / "a.lf", found)
    with lf.open_posed(tmp_path / "a.lf") as stored:
        same_rays(stored.views, field.views)
        assert np.array_equal(np.asarray(stored.layers["depth"]), field.layers["depth"])
    with pytest.raises(InputError, match="poses of their own, which grid cannot tell: export as transforms"):
        export(field, tmp_path / "b", layout="grid")


# ---- Files of other programs


def turn(angle):
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def write_frames(folder, places, shared, axes=None, **more):
    axes = np.eye(3) if axes is None else axes
    frames = []
    for number, place in enumerate(places):
        np.save(folder / f"p{number}.npy", np.full((*SIZE, 3), float(number)))
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = axes, axes @ place
        frames.append({"file_path": f"./p{number}.npy", "transform_matrix": matrix.tolist(), **more})
    (folder / "transforms.json").write_text(json.dumps({**shared, "frames": frames}))


ANGLE = {"camera_angle_x": 2.0 * math.atan(0.5)}
GRID = [(0.1 * x, 0.2 * y, 3.0) for x in range(3) for y in range(2)]


@pytest.mark.parametrize("axes", [np.eye(3), turn(0.3) @ np.roll(np.eye(3), 1, axis=0)])
def test_cameras_in_a_plane_are_put_into_rows_and_columns(tmp_path, axes):
    write_frames(tmp_path, GRID, ANGLE, axes)
    found = import_views(tmp_path)
    assert isinstance(found, LightField)
    # They were written column by column from below: row 0 is the highest.
    assert np.asarray(found.radiance[..., 0, 0, 0]).tolist() == [[1.0, 3.0, 5.0], [0.0, 2.0, 4.0]]
    assert np.allclose(found.views.position[0], [[-0.1, 0.1], [0.0, 0.1], [0.1, 0.1]], rtol=0.0, atol=1e-14)
    # Half of 7 pixels is 0.5 at a distance of 1; parallel views see the middle at 3.5, 2.5.
    assert found.views.plane == pytest.approx((1.0 / 7.0, -0.5, 2.5 / 7.0))
    assert found.views.inverse_focus == 0.0
    assert np.allclose(found.views.pose.origin, axes @ (0.1, 0.1, 3.0))
    assert np.allclose(found.views.pose.forward, -axes[:, 2])


def test_float32_and_uneven_rows_stay_in_a_plane(tmp_path):
    places = np.array([(0.1 * k, 0.0, 3.0) for k in range(5)] + [(0.05, 0.3, 3.0)])
    write_frames(tmp_path, places, ANGLE, turn(1.0).astype(np.float32).astype(float))
    found = import_views(tmp_path)
    assert isinstance(found, LightField)
    assert found.radiance.shape[:2] == (1, 6)
    assert (np.diff(found.views.position[0, :, 0]) >= -1e-6).all()


@pytest.mark.parametrize(
    ("places", "more"),
    [
        ([(0, 0, 0), (0.1, 0, 0), (0, 0, 0.1)], [{}] * 3),
        ([(0, 0, 0), (0.1, 0, 0)], [{"fl_x": 9.0}, {"fl_x": 10.0}]),
        ([(0, 0, 0), (0.1, 0, 0), (0.2, 0, 0)], [{"cx": 3.0}, {"cx": 4.0}, {"cx": 3.0}]),
    ],
    ids=["out of the plane", "other lenses", "not sheared alike"],
)
def test_what_is_in_no_plane_has_poses(tmp_path, places, more):
    write_frames(tmp_path, places, {"fl_x": 9.0})
    stated = json.loads((tmp_path / "transforms.json").read_text())
    for frame, keys in zip(stated["frames"], more, strict=True):
        frame.update(keys)
    (tmp_path / "transforms.json").write_text(json.dumps(stated))
    found = import_views(tmp_path)
    assert isinstance(found, PosedLightField)
    assert found.views.plane[0, 0].tolist() == [1.0 / more[0].get("fl_x", 9.0), *found.views.plane[0, 0, 1:]]
    assert np.asarray(found.radiance[0, :, 0, 0, 0]).tolist() == list(range(len(places)))


def test_pictures_without_a_suffix_and_depths_of_16_bits(tmp_path):
    (tmp_path / "train").mkdir()
    Image(np.full((*SIZE, 3), 1.0)).save(tmp_path / "train" / "r_0.png")
    PIL.Image.fromarray(np.arange(35, dtype=np.uint16).reshape(SIZE) * 1000).save(tmp_path / "d.png")
    frame = {"file_path": "./train/r_0", "depth_file_path": "d.png", "transform_matrix": np.eye(4).tolist()}
    (tmp_path / "transforms_train.json").write_text(json.dumps({**ANGLE, "frames": [frame]}))
    found = import_views(tmp_path / "transforms_train.json")
    assert np.array_equal(found.radiance[0, 0], np.ones((*SIZE, 3)))
    depth = np.asarray(found.layers["depth"][0, 0])
    # Millimetres; nothing is known where a file has 0.
    assert np.isnan(depth[0, 0])
    assert np.allclose(depth.ravel()[1:], np.arange(1, 35), rtol=1e-12)


def changed(**keys):
    return lambda stated: stated.update(keys)


def framed(**keys):
    return lambda stated: stated["frames"][1].update(keys)


def scaled(stated):
    stated["frames"][1]["transform_matrix"][0][0] = 2.0


def mirrored(stated):
    stated["frames"][1]["transform_matrix"][0][0] = -1.0


WRONG = {
    "distortion": (changed(k1=-0.1), "frame 0: has distortion, k1 = -0.1: undistort the pictures first"),
    "tangential": (framed(p2=1e-9), "frame 1: has distortion, p2 = 1e-09"),
    "a fisheye": (changed(camera_model="OPENCV_FISHEYE"), "camera_model OPENCV_FISHEYE is not read"),
    "another fisheye": (changed(is_fisheye=True), "is of a fisheye, which is not read"),
    "turned axes": (changed(from_na=True), "has its axes turned"),
    "a rolling shutter": (changed(rolling_shutter=[0, 0.1, 0]), "has a rolling shutter"),
    "a scale": (scaled, "frame 1: transform_matrix must turn and move the camera, without scaling or mirroring"),
    "a mirror": (mirrored, "frame 1: transform_matrix must turn and move the camera"),
    "numbers": (framed(transform_matrix=[[1, 2], [3, 4]]), "must be 4 rows of 4 finite numbers"),
    "ragged": (framed(transform_matrix=[[1, 2], [3]]), "must be 4 rows of 4 numbers"),
    "no matrix": (framed(transform_matrix=None), "must be 4 rows of 4"),
    "nan": (framed(transform_matrix=[[math.nan] * 4] * 4), "must be 4 rows of 4 finite numbers"),
    "a text": (framed(cx="left"), "frame 1: cx must be a finite number"),
    "infinity": (framed(fl_x=math.inf), "frame 1: fl_x must be a finite number"),
    "no length": (framed(fl_x=0.0), "frame 1: fl_x and fl_y must be greater than 0"),
    "no lens": (lambda stated: stated.pop("camera_angle_x"), "has no field of view: fl_x"),
    "tall pixels": (framed(fl_x=10.0, fl_y=20.0), "its pixels are not square: fl_x is 10, fl_y 20"),
    "another size": (framed(w=800), "frame 1: w is 800, and the picture has 7 pixels there"),
    "no name": (framed(file_path=3), "file_path must be the name of a picture"),
    "no picture": (framed(file_path="q.npy"), "q.npy: no such file"),
    "outside": (framed(file_path="../../q.npy"), "leads out of .*, where files may be named"),
    "a null": (framed(file_path="a\0b"), "names a file by letters that cannot be printed"),
    "half a letter": (framed(depth_file_path="\udc80"), "names a file by letters that cannot be printed"),
    "a folder": (framed(file_path="."), "names a picture or a depth by '.', which is no file"),
    "an empty name": (framed(file_path=""), "names a picture or a depth by '', which is no file"),
    "an empty depth": (framed(depth_file_path=""), "names a picture or a depth by '', which is no file"),
    "many digits": (framed(fl_x=10**400), "frame 1: fl_x must be a finite number"),
    "a scale of many digits": (changed(integer_depth_scale=-(10**400)), "integer_depth_scale must be a finite number"),
    "a long name": (framed(file_path="a" * 300), "cannot be read: File name too long"),
    "no frames": (changed(frames=[]), "has no frames"),
    "a number": (changed(frames=[1]), "has no frames"),
    "a lens": (changed(rt={"cell": "wide"}), "rt must hold what rt wrote of the lens"),
    "a depth": (framed(depth_file_path=1), "depth_file_path that of a file"),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_file_that_cannot_be_read_is_told_in_a_sentence(tmp_path, name):
    change, sentence = WRONG[name]
    folder = tmp_path / "a" / "b"
    os.makedirs(folder)
    write_frames(folder, GRID, ANGLE)
    stated = json.loads((folder / "transforms.json").read_text())
    change(stated)
    (folder / "transforms.json").write_text(json.dumps(stated))
    with pytest.raises(InputError, match=sentence) as told:
        np.asarray(import_views(folder).radiance[:])
    assert str(folder) in str(told.value)
    assert "\n" not in str(told.value)


@pytest.mark.parametrize("text", ["", "{", "[]", '{"frames": {}}', "[" * 100_000])
def test_a_broken_file_is_told(tmp_path, text):
    (tmp_path / "transforms.json").write_text(text)
    with pytest.raises(InputError, match=r"transforms\.json: (is no JSON file|has no frames)"):
        import_views(tmp_path)


def test_depths_of_another_size_are_told(tmp_path):
    np.save(tmp_path / "d.npy", np.ones((3, 3)))
    write_frames(tmp_path, GRID, ANGLE, depth_file_path="d.npy")
    found = import_views(tmp_path)
    with pytest.raises(InputError, match=r"d\.npy: must be a depth for each of 7 x 5 pixels, is \(3, 3\)"):
        found.layers["depth"][0, 0]


def test_the_first_picture_is_read_once(tmp_path, monkeypatch):
    write_frames(tmp_path, GRID, {**ANGLE, "rt": {"rows": 2}})
    read, load = [], image_file.load
    monkeypatch.setattr(image_file, "load", lambda path: read.append(path) or load(path))
    assert import_views(tmp_path).radiance[0, 0].shape == (*SIZE, 3)
    assert len(read) == 1


def test_files_elsewhere_may_be_allowed(tmp_path):
    (tmp_path / "a").mkdir()
    write_frames(tmp_path, GRID, ANGLE)
    text = (tmp_path / "transforms.json").read_text().replace("./p", "../p")
    (tmp_path / "a" / "transforms.json").write_text(text)
    with pytest.raises(InputError, match="leads out of"):
        import_views(tmp_path / "a")
    assert import_views(tmp_path / "a", allow_files=[tmp_path]).radiance.shape == (2, 3, *SIZE, 3)


def test_what_has_no_metres_has_no_cameras(tmp_path):
    views = Views(np.zeros((1, 1, 2)), Plane(1.0, -3.5, 2.5), 7, 5)
    with pytest.raises(InputError, match="cameras need metres"):
        export(LightField(np.zeros((1, 1, 5, 7, 3)), views, settings={"units": "views"}), tmp_path / "transforms.json")
    write_frames(tmp_path, GRID, ANGLE)
    with pytest.raises(InputError, match="says where its cameras are"):
        import_views(tmp_path, spacing=0.1)
