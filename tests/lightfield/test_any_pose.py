"""Pictures from any pose, against what a pinhole there sees of two textured balls, computed by rays in NumPy."""

import dataclasses
import itertools

import numpy as np
import PIL.Image
import pytest

from raytracer.cli.base.app import main
from raytracer.cli.lightfield import base
from raytracer.film.light_field import lf
from raytracer.film.light_field.posed_field import PosedLightField
from raytracer.film.light_field.posed_views import PosedViews
from raytracer.film.light_field.views import Plane, Pose
from raytracer.lightfield.depth.depth_map import Depth
from raytracer.lightfield.views.free_camera import FreeCamera, free_camera, orbit, path_through
from raytracer.lightfield.views.unstructured import view_from, views_along
from raytracer.plugins.cameras.camera_sphere import CameraSphere
from raytracer.util.errors import InputError
from tests.lightfield.analytic import Surface, light_field, seen, views, waves

SIZE = 64
BALLS = [(np.array([-0.35, 0.0, 0.1]), 0.5), (np.array([0.5, 0.2, -0.2]), 0.35)]
FINE = 3
"""Rays in a row and in a column of a pixel."""


def color_at(points):
    """A smooth texture in space, and one of directions far away, all in 0..1."""
    x, y, z = np.moveaxis(points, -1, 0)
    return 0.5 + 0.4 * np.stack([np.sin(9.0 * x + 4.0 * z), np.sin(7.0 * y - 5.0 * x), np.sin(8.0 * z)], axis=-1)


def look(pose, plane, width, height, balls=BALLS):
    """What a view sees: radiance, the mean over a pixel, and depth, the mean over where something is; inf elsewhere."""
    pixel, left, top = plane
    right = left + pixel * (np.arange(FINE * width) + 0.5) / FINE
    up = top - pixel * (np.arange(FINE * height) + 0.5) / FINE
    ahead = pose[3] + right[:, None] * pose[1] + up[:, None, None] * pose[2]
    nearest = np.full(ahead.shape[:2], np.inf)
    for center, radius in balls:
        to = center - pose[0]
        a, b, c = (ahead**2).sum(-1), ahead @ to, to @ to - radius**2
        root = np.sqrt(np.where(b * b - a * c > 0.0, b * b - a * c, np.nan))
        near = np.where((b - root) / a > 0.0, (b - root) / a, (b + root) / a)
        nearest = np.fmin(nearest, np.where(near > 0.0, near, np.inf))
    is_hit = np.isfinite(nearest)
    points = pose[0] + np.where(is_hit, nearest, 0.0)[..., None] * ahead
    far = 0.5 + 0.1 * ahead / np.linalg.norm(ahead, axis=-1)[..., None]
    radiance = np.where(is_hit[..., None], color_at(points), far)

    def parts(values):
        return values.reshape(height, FINE, width, FINE, -1).swapaxes(1, 2).reshape(height, width, FINE**2, -1)

    hits = parts(is_hit)[..., 0].sum(axis=-1)
    total = parts(np.where(is_hit, nearest, 0.0))[..., 0].sum(axis=-1)
    depth = np.divide(total, hits, out=np.full(hits.shape, np.inf), where=hits > 0)
    return parts(radiance).mean(axis=2), depth


def captured(rig, balls=BALLS):
    return captured_by(rig.layout(SIZE, SIZE).views, balls)


def captured_by(geometry, balls=BALLS):
    size = (geometry.rows, geometry.columns)
    seen_by = [look(geometry.pose[v], geometry.plane[v], SIZE, SIZE, balls) for v in np.ndindex(size)]
    radiance, depth = (np.array(part).reshape(*size, *part[0].shape) for part in zip(*seen_by, strict=True))
    return PosedLightField(radiance, geometry, {"depth": depth})


def psnr(picture, exact):
    """In dB; a pixel of which nothing is known counts as black."""
    return -10.0 * np.log10(((np.nan_to_num(picture) - exact) ** 2).mean())


@pytest.fixture(scope="module")
def field():
    return captured(
        CameraSphere.model_validate(
            {"rows": 6, "columns": 12, "look_from": (0, 0, 3), "look_at": (0, 0, 0), "vfov": 64}
        )
    )


def camera_at(field, place, toward=(0.0, 0.0, 0.0), **keys):
    return free_camera(place, toward, field.views, **keys)


def exact_at(camera, balls=BALLS):
    return look(np.array(camera.pose), camera.plane, camera.width, camera.height, balls)


NEW_PLACES = [(1.6, 1.3, 1.9), (-2.0, -1.1, 1.2), (0.4, 3.1, -0.9), (1.1, -0.6, -4.0)]


@pytest.mark.parametrize("place", NEW_PLACES)
def test_a_picture_from_where_no_view_is(field, place):
    """Inside and outside of the sphere of cameras; with a plane in place of the surfaces, edges are doubled."""
    camera = camera_at(field, place, vfov=50.0)
    exact, depth = exact_at(camera)
    drawn = view_from(field, camera)
    assert drawn.unknown == 0.0
    assert psnr(drawn.radiance, exact) > 33.0
    is_inner = np.isfinite(depth) & np.isfinite(drawn.depth)
    assert np.median(np.abs(drawn.depth[is_inner] - depth[is_inner])) < 0.003
    by_plane = view_from(field, camera, distance=float(np.linalg.norm(place))).radiance
    assert psnr(by_plane, exact) < psnr(drawn.radiance, exact) - 6.0


def test_a_picture_from_the_place_of_a_view_is_that_view(field):
    """But for its subpixels: each is interpolated in the view."""
    geometry = field.views
    camera = FreeCamera(Pose.of(geometry.pose[2, 3]), Plane(*geometry.plane[2, 3]), SIZE, SIZE)
    assert psnr(view_from(field, camera).radiance, field.radiance[2, 3]) > 42.0


def test_what_is_hidden_from_some_views_is_taken_from_others(field):
    """The ball behind, beside the one before it: taken from views that see the near ball there, it would be wrong."""
    camera = camera_at(field, (-2.0, 0.3, 1.6))
    exact = exact_at(camera)[0]
    behind = exact_at(camera, BALLS[1:])[1]
    before = exact_at(camera, BALLS[:1])[1]
    is_behind = np.isfinite(behind) & np.isinf(before)
    assert is_behind.sum() > 15
    drawn = view_from(field, camera).radiance
    assert psnr(drawn[is_behind], exact[is_behind]) > 26.0


def test_a_picture_does_not_jump_as_the_camera_moves(field):
    """Weights fall to 0 at the view that is left out next (Buehler et al., sec. 4): steps stay small."""
    places = [(1.6 + 0.002 * i, 1.3, 1.9) for i in range(6)]
    drawn = [view.radiance for view in views_along(field, [camera_at(field, place) for place in places])]
    exact = [exact_at(camera_at(field, place))[0] for place in places]
    step = [np.sqrt(((b - a) ** 2).mean()) for a, b in itertools.pairwise(drawn)]
    true_step = [np.sqrt(((b - a) ** 2).mean()) for a, b in itertools.pairwise(exact)]
    assert max(step) < 3.0 * max(true_step)


def test_a_room_is_seen_from_places_beside_the_cameras():
    """From inside a ball, looking out."""
    room = [(np.zeros(3), 2.0)]
    keys = {"rows": 4, "columns": 9, "facing": "outward", "radius": 0.3, "look_from": (0, 0, 0), "look_at": (0, 0, -1)}
    rig = CameraSphere.model_validate({**keys, "vfov": 70, "elevation": (-80, 80)})
    field = captured(rig, room)
    camera = camera_at(field, (0.15, 0.1, 0.2), (0.5, 0.2, -1.0))
    drawn = view_from(field, camera)
    assert drawn.unknown == 0.0
    assert psnr(drawn.radiance, exact_at(camera, room)[0]) > 35.0


def test_pixels_that_no_view_sees_are_not_known(field):
    """A single view does not see the back of what it sees."""
    one = PosedLightField(
        field.radiance[2:3, 3:4], field.views.part(slice(2, 3), slice(3, 4)), {"depth": field.layers["depth"][2:3, 3:4]}
    )
    behind = -np.array(field.views.pose[2, 3, 0])
    drawn = view_from(one, camera_at(field, tuple(behind.tolist())))
    assert drawn.unknown == 1.0


def test_pixels_without_light_are_left_out(field):
    """A stripe of wrong numbers in all views but one, marked as not lit, changes nothing of what others know."""
    radiance, lit = np.array(field.radiance), np.ones(field.radiance.shape[:4], np.uint8)
    radiance[:, :, 30:34], lit[:, :, 30:34] = 9.0, 0
    marked = PosedLightField(radiance, field.views, {"depth": field.layers["depth"], "lit": lit})
    assert np.nanmax(view_from(marked, camera_at(field, NEW_PLACES[0])).radiance) < 1.1


# ---- Views in one plane


SURFACES = [Surface(3.0, waves(0, 0.15)), Surface(1.7, waves(2, 0.1), bounds=(-0.2, -0.2, 0.15, 0.2))]
PLANAR = views(5, 5, spacing=0.06, width=72, height=60)


@pytest.fixture(scope="module")
def planar():
    return light_field(PLANAR, SURFACES)


@pytest.mark.parametrize("ahead", [0.25, -0.0, -0.3])
def test_views_in_one_plane_show_what_is_seen_before_and_behind_it(planar, ahead):
    """Surfaces are nearer by as much as the camera is before the plane; parts that it sees alone are left out."""
    plane = Plane(*PLANAR.plane)
    camera = FreeCamera(Pose((0.02, 0.01, -ahead), *Pose.of(PosedViews.of(PLANAR).pose[0, 0])[1:]), plane, 72, 60)
    moved = [
        dataclasses.replace(surface, distance=surface.distance - ahead, texture=surface.texture) for surface in SURFACES
    ]
    flat = dataclasses.replace(PLANAR, inverse_focus=0.0)
    exact = seen(flat, moved, (0.02, 0.01))[0]
    drawn = view_from(planar, camera)
    is_known = ~np.isnan(drawn.radiance[..., 0])
    assert is_known.mean() > 0.8
    assert psnr(drawn.radiance[is_known], exact[is_known]) > 23.0


def test_what_all_views_see_as_well_is_seen():
    """The sky, by views that look the same way, where a pixel of the picture is smaller than theirs."""
    field = captured_by(PosedViews.of(views(3, 3, spacing=0.1, width=SIZE, height=SIZE)), [(np.array([0, 0, -2]), 0.3)])
    camera = camera_at(field, (0.02, 0.01, -0.1), (0.02, 0.01, -2.0), vfov=20.0)
    exact, depth = exact_at(camera, [(np.array([0, 0, -2]), 0.3)])
    drawn = view_from(field, camera)
    assert drawn.unknown == 0.0
    assert psnr(drawn.radiance[np.isinf(depth)], exact[np.isinf(depth)]) > 30.0


def test_an_estimate_serves_where_no_depth_is_known(planar):
    without = dataclasses.replace(planar, layers={})
    camera = FreeCamera(Pose.of(PosedViews.of(PLANAR).pose[2, 2]), Plane(*PLANAR.plane), 72, 60)
    moved = camera._replace(pose=camera.pose._replace(origin=(0.02, 0.01, 0.1)))
    estimate = Depth(1.0 / planar.layers["depth"][2, 2], np.ones((60, 72)), 2, 2)
    by_layer = view_from(planar, moved).radiance
    by_estimate = view_from(without, moved, depth=estimate).radiance
    by_plane = view_from(without, moved).radiance
    known = ~np.isnan(by_layer + by_estimate + by_plane).any(axis=-1)
    assert psnr(by_estimate[known], by_layer[known]) > psnr(by_plane[known], by_layer[known]) + 2.0


def test_parallel_views_without_depth_need_a_distance():
    parallel = light_field(views(2, 2, width=16, height=12, focus_distance=np.inf), SURFACES[:1])
    unknown = dataclasses.replace(parallel, layers={})
    camera = camera_at(PosedLightField.of(unknown), (0.0, 0.0, 0.1), (0.0, 0.0, -1.0))
    with pytest.raises(InputError, match="look at no point: give a distance"):
        view_from(unknown, camera)
    assert view_from(unknown, camera, distance=3.1).unknown < 0.5


# ---- Cameras and paths


def test_the_place_looked_at_is_in_the_middle(field):
    camera = free_camera((1.0, 2.0, 3.0), (0.3, -0.2, 0.1), field.views, vfov=40.0, size=(30, 20))
    to = np.array(camera.pose[1:]) @ (np.array([0.3, -0.2, 0.1]) - camera.pose.origin)
    assert to[:2] == pytest.approx([0.0, 0.0], abs=1e-14)
    assert camera.plane.left + 15 * camera.plane.pixel == pytest.approx(0.0)
    assert camera.plane.top == pytest.approx(np.tan(np.radians(20.0)))


@pytest.mark.parametrize(
    ("keys", "sentence"),
    [
        ({"look_at": (0.0, 0.0, 3.0)}, "both are the same"),
        ({"up": (0.0, 0.0, -2.0)}, "up is along the view"),
        ({"vfov": 180.0}, "between 0 and 180 deg"),
    ],
)
def test_what_makes_no_camera_is_told(field, keys, sentence):
    keys = {"look_at": (0.0, 0.0, 0.0), **keys}
    with pytest.raises(InputError, match=sentence):
        free_camera((0.0, 0.0, 3.0), views=field.views, **keys)


def test_an_orbit_goes_round_the_axis():
    places = orbit((1.0, 2.0, 0.0), (0.0, 0.0, 0.0), frames=4)
    assert places == pytest.approx(np.array([[1, 2, 0], [0, 2, -1], [-1, 2, 0], [0, 2, 1]]), abs=1e-12)
    with pytest.raises(InputError, match="begins on it"):
        orbit((0.0, 2.0, 0.0), (0.0, 0.0, 0.0))


def test_a_path_goes_through_its_places():
    places = [(0.0, 0.0, 1.0), (1.0, 0.5, 1.0), (2.0, 0.0, 3.0)]
    assert path_through(places, frames=5)[::2] == pytest.approx(np.array(places))
    with pytest.raises(InputError, match="at least 2 places"):
        path_through(places[:1])


def test_a_path_without_a_place_has_no_pictures(field):
    assert list(views_along(field, [])) == []


# ---- Commands


def run(*arguments):
    return main(["lightfield", *map(str, arguments)])


@pytest.fixture(scope="module")
def file(field, tmp_path_factory):
    path = tmp_path_factory.mktemp("posed") / "balls.lf"
    lf.write(path, field)
    return path


FROM_ABOVE = ("--from", "1.6,1.3,1.9", "--toward", "0,0,0")


def test_views_draws_from_a_place(file, field, tmp_path):
    out = tmp_path / "a.npy"
    assert run("views", file, *FROM_ABOVE, "--vfov", "40 deg", "--size", "32x24", "-o", out, "-q") == 0
    camera = camera_at(field, (1.6, 1.3, 1.9), vfov=40.0, size=(32, 24))
    drawn = view_from(field, camera).radiance
    assert np.load(out) == pytest.approx(np.nan_to_num(drawn), abs=1e-5)


def test_views_extracts_one_and_all(file, field, tmp_path):
    assert run("views", file, "--view", "1,2", "-o", tmp_path / "v.npy", "-q") == 0
    assert np.load(tmp_path / "v.npy") == pytest.approx(field.radiance[1, 2], abs=1e-6)
    assert run("views", file, "-o", tmp_path / "m.png", "-q") == 0
    with PIL.Image.open(tmp_path / "m.png") as montage:
        assert montage.size == (12 * (SIZE + 2) - 2, 6 * (SIZE + 2) - 2)


def test_move_goes_round(file, tmp_path):
    out = tmp_path / "a.gif"
    assert run("move", file, *FROM_ABOVE, "--size", "24x24", "--frames", 4, "-o", out, "-q") == 0
    with PIL.Image.open(out) as animation:
        assert (animation.n_frames, animation.size) == (4, (24, 24))


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("views", "--from", "1,2,3"), "--from and --toward"),
        (("views", "--from", "1,2", "--toward", "0,0,0"), "--from 1,2: must be three lengths"),
        (("views", "--size", "3x3"), "--vfov and --size"),
        (("views", "--up", "0,0,1"), "--up, --vfov and --size are those of pictures from points in the scene: give"),
        (("views", *FROM_ABOVE, "--depth"), "--depth says how a view between others is made: give --at too"),
        (("views", "--from", "inf,0,0", "--toward", "0,0,0"), "--from inf: must be finite"),
        (("views", "--from", "0,0,0", "--toward", "0,-0,0"), "balls.lf: --from and --toward: must be two places"),
        (("views", *FROM_ABOVE, "--vfov", "200"), "--vfov 200: must be greater than 0 and less than 180 deg"),
        (("views", *FROM_ABOVE, "--size", "999999999x999999999"), "memory: a picture of 999999999 x 999999999 pixels"),
        (("views", *FROM_ABOVE, "--memory", "1MB", "--size", "2000x1500"), "a smaller --size takes less, or give more"),
        (("views", "--at", "0,0"), "--at needs views in one plane"),
        (("views", "--view", "1,2", "--scale", "2"), "--scale needs views in one plane"),
        (("views", *FROM_ABOVE, "--up", "1.6,1.3,1.9"), "balls.lf: --up: up is along the view"),
        (("move",), "these have poses of their own: give --from and --toward"),
        (("move", *FROM_ABOVE, "--up", "0,0,0"), "--up 0,0,0: must be a direction, and 0,0,0 is none"),
        (("move", *FROM_ABOVE, "--up", "1.6,1.3,1.9"), "balls.lf: --up: up is along the view"),
        (("move", *FROM_ABOVE, "--from", "1e200,0,0"), "--from 1e200: must be 0, or of a magnitude between 1e-30"),
        (("move", "--from", "1e-200,0,0", "--toward", "0,0,0"), "--from 1e-200: must be 0, or of a magnitude"),
        (("move", "--from", "1,2,3", "--toward", "1,2,3"), "balls.lf: --from and --toward: must be two places"),
        (("move", *FROM_ABOVE, "--no-depth"), "--path, --radius and --depth are those of a path among the views"),
        (("move", *FROM_ABOVE, "--path", "circle"), "--path, --radius and --depth are those of a path among the views"),
        (("move", *FROM_ABOVE, "--radius", "1mm"), "--path, --radius and --depth are those of a path among the views"),
        (("move", "--depth", "--distance", "3"), "--depth and --distance: give one of them"),
        (("move", *FROM_ABOVE, "--memory", "0.5MB"), "memory: an animation of 24 frames takes"),
        (("move", *FROM_ABOVE, "--memory", "1MB"), "GB are left, as 0.001 GB are given"),
        (("move", "--toward", "0,0,0"), "--from and --toward"),
        (("move", "--vfov", "30"), "--vfov and --size"),
    ],
)
def test_what_cannot_be_drawn_is_told_in_a_sentence(file, tmp_path, capsys, arguments, sentence):
    command, *options = arguments
    out = tmp_path / ("a.gif" if command == "move" else "a.png")
    assert run(command, file, *options, "-o", out) == 2
    said = capsys.readouterr().err
    assert sentence in said
    assert said.count("\n") == 1
    assert not out.exists()


def test_a_place_from_which_nothing_is_known_is_told(field, tmp_path, capsys):
    """Behind the only view, looking back."""
    x, y, z = field.views.pose[2, 3, 0]
    one = slice(2, 3), slice(3, 4)
    alone = PosedLightField(field.radiance[one], field.views.part(*one), {"depth": field.layers["depth"][one]})
    lf.write(tmp_path / "one.lf", alone)
    places = f"--from={2 * x},{2 * y},{2 * z}", f"--toward={3 * x},{3 * y},{3 * z}"
    assert run("views", tmp_path / "one.lf", *places, "-o", tmp_path / "a.png") == 2
    assert "one.lf: nothing is known of what is seen from there" in capsys.readouterr().err
    # Of ten frames, too: ten tenths of them, added up, are less than all.
    farther = f"--from={2.1 * x},{2.1 * y},{2.1 * z}", "--frames", "10", "--size", "4x4"
    assert run("move", tmp_path / "one.lf", *places, *farther, "-o", tmp_path / "a.gif") == 2
    assert "one.lf: nothing is known of what is seen from there" in capsys.readouterr().err


@pytest.mark.parametrize(("share", "told"), [(0.9987, "99.9 %"), (0.0063, "0.630 %")])
def test_a_share_that_is_not_known_is_told_in_percent(capsys, share, told):
    base.report_unknown(share, quiet=False)
    assert capsys.readouterr().err.startswith(f"nothing is known of {told} of the pixels")


def test_info_tells_where_views_stand(file, capsys):
    assert run("info", file, "--check") == 0
    told = capsys.readouterr().out
    assert "poses          72, of its own for each view" in told
    assert "all look at    0, 0, 0 m, or away from it, 3 off" in told


@pytest.mark.parametrize("command", ["refocus --distance 2", "depth", "epi --line 3", "all-in-focus"])
def test_commands_for_views_in_one_plane_say_so(file, tmp_path, capsys, command):
    name, *options = command.split()
    assert run(name, file, *options, "-o", tmp_path / "a.png") == 2
    assert "balls.lf: its views have poses of their own" in capsys.readouterr().err
