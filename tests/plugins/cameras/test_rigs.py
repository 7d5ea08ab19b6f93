"""Cameras on a sphere or a box: where each stands and looks, what it sees, and how deep that is."""

import itertools

import numpy as np
import pytest

from raytracer.plugins.cameras.base.interface import axial_depth, film_corner
from raytracer.plugins.cameras.base.moving import pack_camera
from raytracer.plugins.cameras.camera_box import FACES, CameraBox
from raytracer.plugins.cameras.camera_sphere import CameraSphere
from raytracer.plugins.cameras.pinhole import Pinhole
from raytracer.scene.load import build_plain
from raytracer.util.errors import InputError
from tests.plugins.cameras.kernels import camera_rays
from tests.vectorised import rows as as_rows
from tests.vectorised import vectorised

WIDTH, HEIGHT = 40, 30
LOOK = {"look_from": (1.0, 2.0, 3.0), "look_at": (0.2, 0.1, -1.0), "up": (0.1, 1.0, 0.2), "vfov": 50.0}
RADIUS = float(np.linalg.norm(np.subtract(LOOK["look_from"], LOOK["look_at"])))


def sphere(**keys):
    return CameraSphere.model_validate({**LOOK, "rows": 3, "columns": 5, **keys})


def box(**keys):
    return CameraBox.model_validate({**LOOK, "rows": 2, "columns": 3, "size": (1.0, 2.0, 4.0), **keys})


RIGS = {
    "sphere": sphere(),
    "part of a sphere": sphere(radius=0.7, elevation=(-20.0, 70.0), azimuth=(10.0, 130.0)),
    "outward": sphere(facing="outward", radius=0.3),
    "box": box(),
    "box outward": box(facing="outward"),
}


def rays_of(packed, row, column, x, y):
    left, top = film_corner(packed, column * WIDTH, row * HEIGHT)
    return camera_rays(packed, left + x, top + y)


def pixels(count):
    rng = np.random.default_rng(3)
    return rng.uniform(0.0, WIDTH, count), rng.uniform(0.0, HEIGHT, count)


@pytest.mark.parametrize("name", RIGS)
def test_rays_are_those_that_the_geometry_in_the_file_says(name):
    """The pose and the image plane of each view, by which others read the file, and the rays that were traced."""
    spec = RIGS[name]
    packed, views = spec.pack(WIDTH, HEIGHT), spec.layout(WIDTH, HEIGHT).views
    assert spec.picture(WIDTH, HEIGHT) == (views.columns * WIDTH, views.rows * HEIGHT)
    x, y = pixels(20)
    for row, column in itertools.product(range(views.rows), range(views.columns)):
        origins, directions = rays_of(packed, row, column, x, y)
        position, *axes = views.pose[row, column]
        pixel, left, top = views.plane[row, column]
        wanted = np.column_stack([left + pixel * x, top - pixel * y, np.ones(20)]) @ np.array(axes)
        wanted /= np.linalg.norm(wanted, axis=1)[:, None]
        np.testing.assert_allclose(origins, np.tile(position, (20, 1)), atol=1e-13)
        np.testing.assert_allclose(directions, wanted, atol=1e-13)


@pytest.mark.parametrize(("facing", "sign"), [("inward", 1.0), ("outward", -1.0)])
def test_cameras_on_a_sphere_stand_round_its_middle_and_look_along_its_radii(facing, sign):
    views = sphere(facing=facing, radius=2.0).layout(WIDTH, HEIGHT).views
    middle = np.array(LOOK["look_at" if facing == "inward" else "look_from"])
    to = middle - views.pose[..., 0, :]
    np.testing.assert_allclose(np.linalg.norm(to, axis=-1), 2.0)
    np.testing.assert_allclose(views.pose[..., 3, :], sign * to / 2.0, atol=1e-14)


@pytest.mark.parametrize("facing", ["inward", "outward"])
def test_the_middle_camera_is_the_one_that_a_pinhole_would_be(facing):
    """Odd rows and columns have one at azimuth and elevation 0, from `look_from` to `look_at`."""
    own = sphere(facing=facing, radius=RADIUS if facing == "inward" else 0.5)
    pose = own.layout(WIDTH, HEIGHT).views.pose[1, 2]
    pinhole = Pinhole.model_validate(LOOK).frame()
    np.testing.assert_allclose(pose[1:], [pinhole.right, pinhole.up, pinhole.forward], atol=1e-14)
    from_middle = 0.0 if facing == "inward" else 0.5
    np.testing.assert_allclose(pose[0], np.add(pinhole.origin, from_middle * np.array(pinhole.forward)), atol=1e-14)
    np.testing.assert_allclose(own.frame().origin, pose[0], atol=1e-14)


@pytest.mark.parametrize("facing", ["inward", "outward"])
def test_rows_go_down_and_columns_to_the_right(facing):
    """As in the picture of a camera array: the next camera of a row stands to the right of the one before."""
    pose = sphere(facing=facing, radius=1.0, azimuth=(-50.0, 50.0)).layout(WIDTH, HEIGHT).views.pose
    step_right = np.einsum("vui,vui->vu", np.diff(pose[..., 0, :], axis=1), pose[:, :-1, 1])
    step_down = np.einsum("vui,vui->vu", np.diff(pose[..., 0, :], axis=0), pose[:-1, :, 2])
    assert (step_right > 0.0).all()
    assert (step_down < 0.0).all()


def test_elevation_and_azimuth_are_angles_from_the_equator_and_from_where_they_look_from():
    spec = sphere(rows=1, columns=1, elevation=(30.0, 30.0), azimuth=(60.0, 60.0))
    frame = spec.sight()
    out = spec.layout(WIDTH, HEIGHT).views.pose[0, 0, 0] - np.array(LOOK["look_at"])
    right, up, back = out @ np.array([frame.right, frame.up, frame.forward]).T / RADIUS
    assert (right, up, back) == pytest.approx((0.75, 0.5, -0.25 * np.sqrt(3.0)))


@pytest.mark.parametrize("facing", ["inward", "outward"])
def test_cameras_on_a_box_stand_on_its_faces_and_look_at_right_angles_to_them(facing):
    spec = box(facing=facing)
    views = spec.layout(WIDTH, HEIGHT).views
    sight, half = spec.sight(), np.array([0.5, 1.0, 2.0])
    axes = np.array([sight.right, sight.up, sight.forward])
    places = (views.pose[..., 0, :] - spec.center()) @ axes.T
    forwards = views.pose[..., 3, :] @ axes.T
    inward = facing == "inward"
    normals = {"right": (1, 0, 0), "left": (-1, 0, 0), "top": (0, 1, 0), "bottom": (0, -1, 0)}
    normals |= {"front": (0, 0, -1 if inward else 1), "back": (0, 0, 1 if inward else -1)}
    for number, face in enumerate(FACES):
        rows, normal = slice(2 * number, 2 * number + 2), np.array(normals[face], float)
        np.testing.assert_allclose(places[rows] @ normal, half @ np.abs(normal), atol=1e-13)
        np.testing.assert_allclose(forwards[rows], np.tile(-normal if inward else normal, (2, 3, 1)), atol=1e-13)
        # Middles of equal parts of the face.
        for axis in np.flatnonzero(normal == 0.0):
            spread = np.unique(np.round(places[rows][..., axis] / half[axis], 9))
            assert spread.tolist() in ([-0.5, 0.5], pytest.approx([-2 / 3, 0.0, 2 / 3]))


def test_cameras_on_a_box_have_its_middle_in_the_middle_of_their_pictures():
    spec = box()
    packed = spec.pack(WIDTH, HEIGHT)
    for row, column in itertools.product(range(12), range(3)):
        origin, direction = rays_of(packed, row, column, 0.5 * WIDTH, 0.5 * HEIGHT)
        to = spec.center() - origin[0]
        np.testing.assert_allclose(direction[0], to / np.linalg.norm(to), atol=1e-13)


@pytest.mark.parametrize("name", RIGS)
def test_depth_is_along_the_axis_of_the_view_that_sees_the_point(name):
    spec = RIGS[name]
    views = spec.layout(WIDTH, HEIGHT).views
    poses = views.pose.reshape(-1, 4, 3)
    points = np.random.default_rng(1).normal(size=(len(poses), 3))
    found = vectorised(axial_depth)(spec.pack(WIDTH, HEIGHT), as_rows(points), as_rows(poses[:, 0]), None)
    wanted = np.einsum("ni,ni->n", points - poses[:, 0], poses[:, 3])
    np.testing.assert_allclose(np.ravel(found), wanted, atol=1e-13)


def test_a_rig_is_moved_as_a_whole():
    still = sphere()
    keys = [{"time": time, "transform": [{"translate": [1.0, 2.0, 3.0]}]} for time in (0.0, 1.0)]
    moved = sphere(motion={"keyframes": keys})
    x, y = pixels(10)
    (origin, direction), (moved_origin, moved_direction) = (
        rays_of(pack_camera(spec, WIDTH, HEIGHT), 2, 3, x, y) for spec in (still, moved)
    )
    np.testing.assert_allclose(moved_origin - origin, np.tile([1.0, 2.0, 3.0], (10, 1)), atol=1e-13)
    np.testing.assert_allclose(moved_direction, direction, atol=1e-13)


@pytest.mark.parametrize(
    ("keys", "sentence"),
    [
        ({"facing": "outward"}, "camera.radius: cameras that look outward need the radius"),
        ({"elevation": [30, -30]}, "camera.elevation: must rise"),
        ({"elevation": [10, 20, 30]}, "elevation: must be one number, or two, the lowest and the highest angle, got a"),
        ({"azimuth": [-300, 300]}, "camera.azimuth: must be at most a full circle"),
        ({"elevation": 20}, "camera.elevation: is one angle, at which 3 cameras"),
        ({"type": "camera_box", "size": 1, "faces": ["top", "top"]}, "camera.faces: must name each face once"),
        ({"type": "camera_box", "size": 1, "faces": []}, "camera.faces"),
        (
            {"type": "camera_box", "size": [2, 2]},
            r"camera.size: must be a size of three numbers \(or one for all three\),",
        ),
    ],
)
def test_what_makes_no_rig_is_told_in_a_sentence(keys, sentence):
    camera = {"type": "camera_sphere", "rows": 3, "columns": 5, "look_from": [0, 0, 4], **keys}
    with pytest.raises(InputError, match=sentence):
        build_plain({"camera": camera, "objects": [{"type": "sphere", "center": [0, 0, 0], "radius": 1}]})


def test_numbers_say_how_far_apart_cameras_stand():
    """Two at the equator, 90 degrees apart on a sphere of 2 m: 2 sqrt(2) m."""
    numbers = sphere(rows=1, columns=2, azimuth=(-90.0, 90.0), elevation=(0.0, 0.0), radius=2.0).describe(40, 30)
    assert numbers["views"] == 2.0
    assert numbers["view_angle_deg"] == pytest.approx(90.0)
    assert numbers["view_spacing_mm"] == pytest.approx(2e3 * np.sqrt(2.0))
