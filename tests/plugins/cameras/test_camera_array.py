"""Camera arrays and light slabs: many views of one scene, in one picture."""

import itertools
import math

import numpy as np
import pytest
import yaml
from numpy.typing import NDArray
from scipy import stats

from raytracer.analysis.compare import z_test
from raytracer.film.exposure import CropWindow, metering_weights
from raytracer.film.window import Window
from raytracer.optics.thin_lens import Metering
from raytracer.plugins.cameras.base.interface import film_corner, film_to_view
from raytracer.plugins.cameras.base.moving import MovingCamera, pack_camera
from raytracer.plugins.cameras.camera_array import CameraArray
from raytracer.plugins.cameras.light_slab import LightSlab
from raytracer.plugins.cameras.thin_lens import ThinLens
from raytracer.rendering.develop import _view_slices, light_field_layout
from raytracer.rendering.render import render
from raytracer.scene.load import build
from raytracer.util.errors import InputError, SceneError
from tests.moving import checked, moved
from tests.plugins.cameras.kernels import camera_rays, projected, weighted_rays

Array = NDArray[np.float64]

WIDTH, HEIGHT = 40, 30
ROWS, COLUMNS, SPACING = 3, 4, (0.05, 0.08)
VIEWS = list(itertools.product(range(ROWS), range(COLUMNS)))
LOOK = {"look_from": (1.0, 2.0, 3.0), "look_at": (0.2, 0.1, -1.0), "up": (0.1, 1.0, 0.2)}
GRID = {"rows": ROWS, "columns": COLUMNS, "spacing": SPACING}


def array(**keys):
    return CameraArray.model_validate({**LOOK, **GRID, "vfov": 50.0, "focus_distance": 2.5, **keys})


def in_frame(spec, points):
    """Points (n, 3) to the right, up and along the axis (m)."""
    frame = spec.frame()
    return (points - np.array(frame.origin)) @ np.array([frame.right, frame.up, frame.forward]).T


def slopes(spec, directions):
    """By how much rays go right and up per metre along the axis (n, 2)."""
    frame = spec.frame()
    turned = directions @ np.array([frame.right, frame.up, frame.forward]).T
    return turned[:, :2] / turned[:, 2:]


def places(packed, row, column, x, y):
    """Film positions of places (x, y) in the frame of one view."""
    left, top = film_corner(packed, column * WIDTH, row * HEIGHT)
    return left + x, top + y


def pixels(count):
    rng = np.random.default_rng(3)
    return rng.uniform(0.0, WIDTH, count), rng.uniform(0.0, HEIGHT, count)


# ---- Where views are, and what they see


@pytest.mark.parametrize("distance", [2.5, 0.7, math.inf])
def test_each_view_is_a_pinhole_in_its_place_that_sees_the_plane_of_convergence_as_the_middle_does(distance):
    """Rays start in the view, and go to where the ray of the middle at the same pixel is, at the distance of focus."""
    spec = array(focus_distance=distance)
    packed = spec.pack(WIDTH, HEIGHT)
    x, y = pixels(50)
    plane = packed.plane
    middle = np.column_stack([plane.left + plane.pixel * x, plane.top - plane.pixel * y])
    for row, column in VIEWS:
        origins, directions = camera_rays(packed, *places(packed, row, column, x, y))
        place = [SPACING[0] * (column - 0.5 * (COLUMNS - 1)), SPACING[1] * (0.5 * (ROWS - 1) - row)]
        np.testing.assert_allclose(in_frame(spec, origins), np.tile([*place, 0.0], (50, 1)), atol=1e-14)
        seen = slopes(spec, directions) + np.array(place) / distance
        np.testing.assert_allclose(seen, middle, atol=1e-12)


@pytest.mark.parametrize("keys", [{}, {"convergence_distance": 0.9}, {"convergence_distance": math.inf}])
def test_points_are_seen_where_the_geometry_of_the_light_field_says(keys):
    """A point at the distance 1 / w, which the middle sees at x, is at x - u (w - w0) in the view at u."""
    spec = array(**keys)
    packed, views = spec.pack(WIDTH, HEIGHT), spec.layout(WIDTH, HEIGHT).views
    rng = np.random.default_rng(4)
    depth = rng.uniform(0.5, 20.0)
    slope = rng.uniform(-0.2, 0.2, 2)
    axes = np.array([views.pose.right, views.pose.up, views.pose.forward])
    point = np.array(views.pose.origin) + depth * np.array([*slope, 1.0]) @ axes
    middle = projected(packed, point)[0]
    assert middle[2] == pytest.approx(depth, rel=1e-13)
    shifts = views.shift(1.0 / depth)
    for row, column in VIEWS:
        x, y = places(packed, row, column, *(middle[:2, None] + shifts[row, column][:, None]))
        origins, directions = camera_rays(packed, x, y)
        along = (point - origins[0]) @ directions[0]
        np.testing.assert_allclose(origins[0] + along * directions[0], point, atol=1e-11)


def test_the_highest_row_comes_first_and_the_leftmost_column():
    spec = array()
    views = spec.layout(WIDTH, HEIGHT).views
    assert (views.rows, views.columns, views.width, views.height) == (ROWS, COLUMNS, WIDTH, HEIGHT)
    assert spec.picture(WIDTH, HEIGHT) == (COLUMNS * WIDTH, ROWS * HEIGHT)
    np.testing.assert_allclose(views.position[0, 0], [-1.5 * SPACING[0], SPACING[1]])
    np.testing.assert_allclose(views.position[2, 3], [1.5 * SPACING[0], -SPACING[1]])
    np.testing.assert_allclose(views.position.mean(axis=(0, 1)), [0.0, 0.0], atol=1e-16)


@pytest.mark.parametrize("size", [(40, 30), (1, 1), (7, 300)])
def test_film_positions_of_one_view_never_reach_another(size):
    """Film positions up to the margin beyond the edges of a view, where filters draw."""
    spec, (width, height) = array(), size
    packed, margin = spec.pack(*size), spec.film_margin(*size)
    for row, column in VIEWS:
        left, top = film_corner(packed, column * width, row * height)
        for x in (-margin + 0.5, -0.25, 0.0, width - 1.0, width + margin - 0.5):
            for y in (-margin + 0.5, 0.5, height + margin - 0.5):
                assert film_to_view(packed, left + x, top + y) == (x, y)
        # Pixels of a view are beside one another.
        last = film_corner(packed, (column + 1) * width - 1, (row + 1) * height - 1)
        assert last == (left + width - 1, top + height - 1)


# ---- Openings


def test_every_lens_is_focused_at_the_distance_of_focus():
    """All rays of a place on the film go through one point, the middle's at that distance."""
    spec = array(aperture=20.0, convergence_distance=1.5)
    packed = spec.pack(WIDTH, HEIGHT)
    view = spec.layout(WIDTH, HEIGHT).views.position[2, 1]
    x, y = places(packed, 2, 1, np.full(500, 11.25), np.full(500, 20.5))
    origins, directions = camera_rays(packed, x, y)
    starts = in_frame(spec, origins)
    away = np.hypot(*(starts[:, :2] - view).T)
    # Evenly over a disc of 20 mm.
    assert stats.kstest((away / 0.01) ** 2, "uniform").pvalue > 1e-3
    plane = packed.plane
    slope = np.array([plane.left + plane.pixel * 11.25, plane.top - plane.pixel * 20.5])
    point = view + 2.5 * (slope - view / 1.5)
    np.testing.assert_allclose(starts[:, :2] + 2.5 * slopes(spec, directions), np.tile(point, (500, 1)), atol=1e-12)


def test_lenses_that_fill_the_plane_are_one_lens_together():
    """Rays of one place of the film, from all views: evenly over the rectangle of all, through one point in focus."""
    spec = array(fill=True)
    packed = spec.pack(WIDTH, HEIGHT)
    starts, ends = [], []
    for number, (row, column) in enumerate(VIEWS):
        x, y = places(packed, row, column, np.full(400, 31.0), np.full(400, 3.5))
        origins, directions = camera_rays(packed, x, y, seed=number)
        starts.append(in_frame(spec, origins)[:, :2])
        ends.append(starts[-1] + 2.5 * slopes(spec, directions))
        own = spec.layout(WIDTH, HEIGHT).views.position[row, column]
        assert np.all(np.abs(starts[-1] - own) <= 0.5 * np.array(SPACING) * (1.0 + 1e-12))
    whole = np.concatenate(starts) / (np.array(SPACING) * [COLUMNS, ROWS]) + 0.5
    assert stats.kstest(whole[:, 0], "uniform").pvalue > 1e-3
    assert stats.kstest(whole[:, 1], "uniform").pvalue > 1e-3
    together = np.concatenate(ends)
    np.testing.assert_allclose(together, np.broadcast_to(together[0], together.shape), atol=1e-12)


def test_a_camera_of_an_array_is_exposed_as_a_single_one_is():
    keys = {"focal_length": 50, "f_number": 2, "iso": 100, "shutter": 0.01, "focus_distance": 2.5}
    spec = CameraArray.model_validate({**LOOK, **GRID, **keys, "rows": 1, "columns": 1})
    lens = ThinLens.model_validate({**LOOK, **keys})
    x, y = pixels(100)
    ours, theirs = (weighted_rays(each.pack(WIDTH, HEIGHT), x, y) for each in (spec, lens))
    for one, other in zip(ours, theirs, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-12)
    assert spec.exposure_settings(WIDTH, HEIGHT) == lens.exposure_settings(WIDTH, HEIGHT)


def test_the_cell_of_a_view_is_what_its_opening_gathers_from():
    assert array().layout(WIDTH, HEIGHT).views.cell is None
    assert array(fill=True).layout(WIDTH, HEIGHT).views.cell == SPACING
    round_one = array(aperture=20.0).layout(WIDTH, HEIGHT).views.cell
    assert round_one == pytest.approx([0.01 * math.sqrt(math.pi)] * 2)


def test_derived_numbers():
    """A pixel of 1 mm at 1 m, 20 mm from view to view: a pixel of disparity is 0.05 / m in inverse distance."""
    vfov = math.degrees(2.0 * math.atan(0.5 * HEIGHT * 1e-3))
    numbers = array(vfov=vfov, spacing=0.02, focus_distance=2.0).describe(WIDTH, HEIGHT)
    assert numbers["views"] == ROWS * COLUMNS
    assert numbers["baseline_mm"] == pytest.approx(60.0)
    assert numbers["disparity_at_infinity_px"] == pytest.approx(10.0)
    assert numbers["refocus_near_m"] == pytest.approx(1.0 / 0.55)
    assert numbers["refocus_far_m"] == pytest.approx(1.0 / 0.45)


# ---- Slabs


@pytest.mark.parametrize("fill", [False, True])
def test_rays_of_a_slab_meet_both_planes_where_they_say(fill):
    planes = {"uv": [0.4, 0.3], "st": [2.0, 1.5], "separation": 3.0}
    spec = LightSlab.model_validate({**LOOK, "rows": ROWS, "columns": COLUMNS, **planes, "fill": fill})
    packed = spec.pack(WIDTH, HEIGHT)
    x, y = pixels(200)
    for row, column in VIEWS:
        origins, directions = camera_rays(packed, *places(packed, row, column, x, y))
        starts = in_frame(spec, origins)
        cell = np.array([(column + 0.5) * 0.1 - 0.2, 0.15 - (row + 0.5) * 0.1])
        away = np.abs(starts[:, :2] - cell)
        assert np.all(away <= (0.05 + 1e-12 if fill else 1e-14))
        assert (away.max() > 0.045) == fill
        ends = starts[:, :2] + 3.0 * slopes(spec, directions)
        expected = np.column_stack([-1.0 + 2.0 * x / WIDTH, 0.75 - 1.5 * y / HEIGHT])
        np.testing.assert_allclose(ends, expected, atol=1e-12)
    views = spec.layout(WIDTH, HEIGHT).views
    assert (views.cell is not None) == fill
    assert views.focus_distance == pytest.approx(3.0)


def test_a_slab_keeps_pixels_square():
    """A second plane that is not of the film's shape shows the largest part that is."""
    wide = LightSlab.model_validate({**LOOK, "rows": 1, "columns": 1, "uv": 0.1, "st": [9.0, 1.5], "separation": 3.0})
    plane = wide.pack(WIDTH, HEIGHT).plane
    assert (plane.pixel, plane.left, plane.top) == pytest.approx((1.5 / HEIGHT / 3.0, -1.0 / 3.0, 0.25))


# ---- Pictures

SCENE = """
camera: {{type: camera_array, look_from: [0, 0.5, 3], look_at: [0, 0.3, 0], vfov: 40, rows: 3, columns: 2,
  spacing: [0.6, 0.4]{camera}}}
film: {{width: 24, height: 20{film}}}
render: {{spp: {spp}, max_depth: 2, sampler: independent}}
environment: {{type: gradient, horizon: [1, 1, 1], zenith: [0.2, 0.4, 1.0]}}
objects:
  - {{type: quad, corner: [-5, 0, 5], edges: [[10, 0, 0], [0, 0, -20]], material: {{type: lambertian, albedo: 0.5}}}}
  - {{type: sphere, center: [0, 0.4, 0], radius: 0.3, material: {{type: lambertian, albedo: [0.8, 0.2, 0.1]}}}}
  - {{type: sphere, center: [0.5, 0.4, 1.2], radius: 0.15, material: {{type: lambertian, albedo: [0.1, 0.8, 0.1]}}}}
"""


def scene(camera="", film="", spp=32):
    return build(SCENE.format(camera=camera, film=film, spp=spp), "test.yaml")


@pytest.fixture(scope="module")
def whole():
    return render(scene(), threads=2)


def views_of(image):
    return image.layout.light_field(image)


def test_a_picture_is_the_light_field_of_its_views(whole):
    field = views_of(whole.image)
    assert whole.image.radiance.shape == (60, 48, 3)
    assert field.radiance.shape == (3, 2, 20, 24, 3)
    assert np.shares_memory(field.radiance, whole.image.radiance)
    np.testing.assert_array_equal(field.view(2, 1), whole.image.radiance[40:60, 24:48])


def test_a_near_ball_goes_left_as_the_camera_goes_right_and_the_one_in_focus_stays(whole):
    """Middles of what is green, 1.8 m away, and of what is red, in the plane of convergence, 3 m away."""
    field = views_of(whole.image)
    axis = np.linalg.norm([0.0, 0.2, 3.0])
    forward = np.array([0.0, -0.2, -3.0]) / axis
    away = {name: float((np.array(at) - [0, 0.5, 3]) @ forward) for name, at in BALLS.items()}
    for name, tells in TELLS.items():
        middles = np.array([[_middle(tells(field.view(r, c))) for c in range(2)] for r in range(3)])
        moved = middles - middles.mean(axis=(0, 1))
        expected = field.views.shift(1.0 / away[name])
        # Pixels are whole, and a ball's outline is not quite an ellipse about its middle.
        np.testing.assert_allclose(moved, expected - expected.mean(axis=(0, 1)), atol=0.35)
    assert np.ptp(field.views.shift(1.0 / away["green"])[0, :, 0]) > 3.0


BALLS = {"red": (0.0, 0.4, 0.0), "green": (0.5, 0.4, 1.2)}
TELLS = {"red": lambda view: view[..., 0] > 1.5 * view[..., 2], "green": lambda view: view[..., 1] > 1.5 * view[..., 2]}


def _middle(inside):
    rows, columns = np.nonzero(inside)
    return float(columns.mean()), float(rows.mean())


def test_noise_of_views_is_independent(whole):
    """Return the differences of two seeds in the same pixels of two views, over their standard deviations."""
    other = render(scene(), threads=2, seed=9).image
    spread = np.sqrt(whole.image.variance + other.variance)
    score = np.divide(whole.image.radiance - other.radiance, spread, out=np.zeros(spread.shape), where=spread > 0.0)
    apart = np.swapaxes(score[..., 1].reshape(3, 20, 2, 24), 1, 2).reshape(6, -1)
    likeness = np.corrcoef(apart)[np.triu_indices(6, 1)]
    # Of 480 pixels each, and 15 pairs of views.
    assert np.abs(likeness).max() < 4.0 / math.sqrt(480.0)


def test_threads_and_crops_leave_the_bits_of_all_views(whole):
    alone = render(scene(), threads=1)
    np.testing.assert_array_equal(alone.image.radiance, whole.image.radiance)
    # Across the edges of views.
    part = render(scene(), threads=2, crop=(20, 15, 40, 50)).image
    np.testing.assert_array_equal(part.radiance, whole.image.radiance[15:50, 20:40])
    assert part.layout is None


@pytest.mark.slow
def test_the_mean_of_views_that_fill_a_lens_is_its_photograph():
    """4 x 4 square lenses of 50 mm against one of 200 mm: the same picture, sharp at the distance of convergence."""
    text = SCENE.replace("rows: 3, columns: 2,\n  spacing: [0.6, 0.4]", "{lens}")
    views = text.format(lens="rows: 4, columns: 4, spacing: 0.05, fill: true", camera="", film="", spp=128)
    lens = f"aperture: {400.0 / math.sqrt(math.pi)}, aperture_shape: {{type: polygon, blades: 4, rotation: 45}}"
    single = text.format(lens=lens, camera="", film="", spp=2048).replace("camera_array", "thin_lens")
    field = render(build(views, "views.yaml"), threads=2).image
    together = views_of(field).radiance.mean(axis=(0, 1))
    noise = np.swapaxes(field.variance.reshape(4, 20, 4, 24, 3), 1, 2).mean(axis=(0, 1)) / 16.0
    photograph = render(build(single, "lens.yaml"), threads=2, seed=3).image
    verdict = z_test(together, noise, photograph.radiance, photograph.variance)
    assert verdict.passed, verdict.reason


@pytest.mark.slow
def test_an_array_a_million_metres_away_sees_the_same(tmp_path):
    result = yaml.safe_load(SCENE.format(camera="", film="", spp=128))
    here, there = (render(checked(each, tmp_path), threads=2) for each in (result, moved(result, (1e6, -1e6, 1e6))))
    one, other = here.image, there.image
    assert "recentring" in there.stats.effects
    verdict = z_test(one.radiance, one.variance, other.radiance, other.variance)
    assert verdict.passed, verdict.reason
    np.testing.assert_allclose(other.layout.views.pose.origin, [1e6, -1e6 + 0.5, 1e6 + 3.0])


# ---- Photographs of many cameras


def test_each_view_has_its_own_metering_circle():
    spot = Metering("spot", 0.25, 0.5, 0.3)
    one = metering_weights(spot, CropWindow(24, 20, 0, 0), 20, 24)
    many = metering_weights(spot, CropWindow(48, 60, 0, 0, (24, 20)), 60, 48)
    np.testing.assert_allclose(many, np.tile(one, (3, 2)) / 6.0, atol=1e-18)


def test_every_view_is_denoised_by_itself():
    # All of the picture, and a crop across the edges of views.
    spec = scene()
    for window, sizes in (
        (Window(0, 0, *spec.picture()), [(20, 24)] * 6),
        (Window(20, 15, 40, 50), [(5, 4), (5, 16), (20, 4), (20, 16), (10, 4), (10, 16)]),
    ):
        seen = np.zeros((window.bottom - window.top, window.right - window.left), dtype=int)
        parts = _view_slices(spec, window)
        assert [seen[part].shape for part in parts] == sizes
        for part in parts:
            seen[part] += 1
        assert np.all(seen == 1)


def test_lines_of_a_rolling_shutter_are_those_of_each_view():
    spec = array(shutter={"duration": 0.01, "readout": 0.1}, motion={"velocity": [1, 0, 0]})
    packed = pack_camera(spec, WIDTH, HEIGHT)
    assert isinstance(packed, MovingCamera)
    left, top = film_corner(packed, 3 * WIDTH + 7, 2 * HEIGHT + 29)
    assert film_to_view(packed, left + 0.5, top + 0.25) == (7.5, 29.25)


def test_the_pose_is_where_a_moving_array_is_in_the_middle_of_the_exposure():
    layout = light_field_layout(scene(", shutter: {open: 0, close: 2}, motion: {velocity: [0.1, 0, 0]}"))
    np.testing.assert_allclose(layout.views.pose.origin, [0.1, 0.5, 3.0], atol=1e-15)


# ---- What is refused


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ("rows: 0, columns: 2, spacing: 1", "camera.rows: must be at least 1, got 0"),
        ("rows: 2, columns: 2000, spacing: 1", "camera.columns: must be at most 1024, got 2000"),
        ("rows: 2, columns: 2, spacing: [1, 2, 3]", "camera.spacing: must be one number, or two"),
        ("rows: 2, columns: 2, spacing: [1, -2]", "camera.spacing[1]: must be greater than 0"),
    ],
)
def test_wrong_keys_are_told(keys, message):
    with pytest.raises(SceneError) as caught:
        build(f"camera: {{type: camera_array, {keys}}}\nfilm: {{width: 4, height: 4}}\n", "test.yaml")
    assert message in str(caught.value)


def test_crops_are_counted_in_pixels_of_the_whole_picture():
    with pytest.raises(InputError, match="0,0,48,60"):
        render(scene(), crop=(0, 0, 49, 60))


NOISY = "sensor: {format: full_frame, noise: true, bayer: rggb}, f_number: 2, iso: 100, shutter: 1"


@pytest.mark.parametrize(
    ("camera", "film", "message"),
    [
        ("fill: true, f_number: 2, focal_length: 50", "", "camera.f_number: f_number and fill both say what the"),
        ("convergence_distance: 0", "", "camera.convergence_distance: must be greater than 0"),
        ("", "filter: {type: gaussian, radius: 25}", "film.filter: reaches 25 pixels far, beyond views of so few: 24"),
        ("", "filter: {type: box, width: 60}", "film.filter: reaches 30 pixels far"),
        (NOISY, "", "camera.sensor.bayer: colours are interpolated over the edges of views"),
        ("iso: 100, shutter: 1, focal_length: 50", "", "give a finite f_number, or aperture or defocus_angle, or fill"),
    ],
)
def test_what_does_not_go_together_is_refused(camera, film, message):
    with pytest.raises(SceneError) as caught:
        scene(camera and f", {camera}", film and f", {film}")
    assert message in str(caught.value)


def test_a_picture_that_cannot_be_held_is_refused_before_it_is_rendered():
    text = SCENE.format(camera="", film="", spp=1).replace("rows: 3, columns: 2", "rows: 1024, columns: 1024")
    text = text.replace("{width: 24, height: 20}", "{width: 64, height: 64}")
    with pytest.raises(
        InputError, match=r"(65536 x 65536 is 4,294,967,296 pixels|GB of memory), .* rt lightfield render"
    ):
        render(build(text, "test.yaml"))
