"""Raw pictures behind microlenses: the grid is found again, and the views are what was drawn."""

import dataclasses
import json

import numpy as np
import pytest

from raytracer.film.light_field.lattice import Lattice
from raytracer.film.light_field.resampling import Resampler
from raytracer.lightfield.decoding.calibration import find_grid
from raytracer.lightfield.decoding.decoder import decode
from raytracer.lightfield.decoding.microlens_grid import Optics, grid_from_dict
from raytracer.lightfield.decoding.raw_image import find_defects
from raytracer.lightfield.memory import memory_limit
from raytracer.util.errors import InputError
from tests.lightfield.lenslet_pictures import Camera, lattice, spoiled, texture

PITCH = 14.297
SPOILT = {"photons": 4000.0, "dust": 12, "hot": 0.0005, "half_lit": 60, "clip": 0.8}
SLOPE = 0.5


def _scene(x, y):
    return texture(x, y, 10.0 * PITCH)


def _camera(hexagonal, pitch=PITCH, degrees=0.7, size=(490, 370), **options):
    return Camera(lattice(pitch, degrees, (5.3, 9.1), hexagonal=hexagonal), *size, **options)


@pytest.fixture(scope="module", params=[False, True], ids=["square", "hexagonal"])
def pictures(request):
    camera = _camera(request.param)
    return camera, camera.picture(), camera.picture(_scene, SLOPE)


@pytest.fixture(scope="module")
def decoded(pictures):
    return decode(pictures[2], pictures[1])


@pytest.fixture(scope="module")
def without_white(pictures):
    return decode(pictures[2])


@pytest.fixture(scope="module")
def small():
    return _camera(False, size=(280, 210)).picture()


def _check_grid(grid, camera, *, pitch=0.02, offset=0.05):
    found, true = grid.lattice, camera.lattice
    assert found.hexagonal == true.hexagonal
    assert found.pitch == pytest.approx(true.pitch, abs=pitch)
    middle = (0.5 * camera.width, 0.5 * camera.height)
    assert np.hypot(*np.subtract(true.near(found.near(middle).origin).origin, found.near(middle).origin)) < offset


def _relative_rms(decoded, row, column):
    """Of a view against the scene, seen directly at the same places."""
    resampler = decoded.resampler
    x = resampler.first[0] + resampler.pixel * np.arange(resampler.width)
    y = resampler.first[1] + resampler.pixel * np.arange(resampler.height)
    right, down = resampler.offset(row, column)
    true = _scene(*np.meshgrid(x + SLOPE * right, y + SLOPE * down))
    return float(np.sqrt(((decoded.view(row, column) - true) ** 2).mean() / (true**2).mean()))


def test_grid_of_a_spoilt_white_picture(pictures):
    # Rotated by 0.7 degrees, dust, hot pixels, clipped, one side and the bottom in half-light, photon and read noise.
    camera, white, _ = pictures
    grid = find_grid(spoiled(white, 3, **SPOILT).astype(np.float32))
    _check_grid(grid, camera)
    assert grid.lattice.rotation == pytest.approx(0.7, abs=0.01)
    # A sub-image is drawn 0.94 pitches wide; what is at least half as bright as its middle is a little less.
    assert 0.85 * PITCH < grid.diameter < PITCH


@pytest.mark.parametrize("hexagonal", [False, True], ids=["square", "hexagonal"])
@pytest.mark.parametrize(("pitch", "degrees"), [(5.03, 0.7), (7.4, 90.0), (21.3, -3.0), (40.4, 14.9)])
def test_grids_of_all_sizes_and_rotations(hexagonal, pitch, degrees):
    camera = _camera(hexagonal, pitch, degrees, (720, 560) if pitch > 30.0 else (320, 270))
    grid = find_grid(spoiled(camera.picture(supersampling=1 if pitch > 20.0 else 2), 1, dust=4))
    # 0.02 of 14 pixels; a picture that holds but twenty microlenses tells as much of them in proportion.
    _check_grid(grid, camera, pitch=max(0.02, 0.001 * pitch), offset=max(0.05, 0.002 * pitch))


def test_eight_bits_are_enough(pictures):
    camera, white, _ = pictures
    _check_grid(find_grid(np.rint(255.0 * np.clip(white, 0.0, 1.0)) / 255.0), camera)


def test_a_raw_picture_shows_its_own_grid(pictures, without_white):
    _check_grid(without_white.grid, pictures[0], offset=0.1)
    assert "no white picture" in without_white.notes[0]


def test_grid_in_a_file_is_the_same_grid(decoded):
    assert decoded.grid.microlenses != (0, 0)
    again = grid_from_dict(json.loads(json.dumps(decoded.grid.as_dict())), "grid.json")
    assert again == dataclasses.replace(decoded.grid, microlenses=(0, 0))


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"along": [1.0]}, "along: must be two numbers"),
        ({"across": None}, "across: must be two numbers"),
        ({"offset": ["a", 1]}, "offset: must be a number"),
        ({"along": [0.0, 0.0]}, "must lead to different sides"),
        ({"along": [0.1, 0.0]}, "at least a pixel apart"),
        ({"width": True}, "width: must be a number"),
    ],
)
def test_grid_in_a_wrong_file(change, told):
    values = {"offset": [1, 2], "along": [10, 0], "across": [0, 10], "width": 100, "height": 100}
    assert grid_from_dict(values, "g.json").layout == "square"
    with pytest.raises(InputError, match=told):
        grid_from_dict({**values, **change}, "g.json")


@pytest.mark.parametrize(
    ("picture", "told"),
    [
        (np.zeros((200, 300)), "is black"),
        (np.ones((200, 300)), "clipped"),
        (np.random.default_rng(1).random((400, 300)), "no regular grid"),
        (0.5 + 0.4 * np.sin(np.mgrid[:400, :300][1] / 2.3), "no regular grid"),
        (0.5 + 0.4 * np.sin(np.mgrid[:400, :300][0] / 60.0), "no regular grid"),
        (np.eye(3), "too few"),
        (_camera(False, size=(90, 90)).picture(), "too few to measure"),
    ],
    ids=["black", "clipped", "noise", "stripes", "smooth", "tiny", "small"],
)
def test_pictures_without_a_grid(picture, told):
    with pytest.raises(InputError, match=f"w.png: .*{told}"):
        find_grid(picture, "w.png")


def test_views_are_what_is_seen_directly(decoded, without_white):
    # Waves of ten microlenses: cubic interpolation is right to 0.3 %, linear at the borders.
    middle = decoded.views.rows // 2
    for row, column in ((middle, middle), (middle, middle + 4), (middle - 3, middle - 3)):
        assert _relative_rms(decoded, row, column) < 0.005
    # Without the division by the white picture a view is as much too dark as vignetting makes it.
    assert _relative_rms(without_white, middle, middle) > 0.1


def test_views_of_spoilt_pictures(pictures):
    camera, white, raw = pictures
    spoilt = {**SPOILT, "photons": 20_000.0, "clip": None}
    dark = np.full(white.shape, 0.02)
    decoded = decode(spoiled(raw, 5, **spoilt), spoiled(white, 6, **spoilt), dark=dark)
    _check_grid(decoded.grid, camera)
    middle = decoded.views.rows // 2
    # Two pictures of 20 000 photons at most, of which 4 pixels are averaged: noise of 1 % and more in the half-light.
    assert _relative_rms(decoded, middle, middle) < 0.02
    assert any("defective" in note for note in decoded.notes)


def test_disparity_has_the_sign_and_size_of_the_formula(decoded):
    # Views tell a scene's plane apart: it moves by SLOPE raw pixels a view, against where the view is.
    field = decoded.light_field()
    with memory_limit(field.radiance.nbytes), pytest.raises(InputError, match="memory: keeping all views of raw takes"):
        decoded.light_field()
    assert field.settings["units"] == "views"
    middle = field.views.rows // 2
    left, right = (field.view(middle, middle + step)[4:-4, 4:-4, 0] for step in (-4, 4))
    slope = np.gradient(field.view(middle, middle)[..., 0], axis=1)[4:-4, 4:-4]
    moved = float((slope * (left - right)).sum() / (slope**2).sum())
    pixel = np.sqrt(decoded.grid.lattice.area)
    # Differences over two pixels are short of the slope of waves of ten pixels by 6 %.
    assert moved == pytest.approx(8.0 * -SLOPE / pixel, rel=0.08)
    # position (w0 - w) / pixel, with w in pixels from view to view: see `Views`.
    w = SLOPE / pixel
    assert field.views.shift(w)[middle, middle + 4, 0] == pytest.approx(4.0 * -w)


def test_metres_of_a_known_camera():
    # f = 50 mm focused at 2 m: image at 51.282 mm. 10 um pixels 0.5 mm behind the microlenses see 1.02564 mm of the
    # lens each; sub-images are 1 + 0.5 / 51.282 as far apart as microlenses.
    camera = _camera(False, 12.0, 0.0, (360, 300))
    optics = Optics(pixel_pitch=10.0, focal_length=50.0, microlens_distance=500.0, focus_distance=2.0)
    decoded = decode(camera.picture(), camera.picture(), optics=optics, views=11)
    views = decoded.views
    assert views.position[5, 6] == pytest.approx((1.02564e-3, 0.0), rel=1e-4)
    assert views.position[4, 5] == pytest.approx((0.0, 1.02564e-3), rel=1e-4)
    pitch = decoded.grid.lattice.pitch
    assert views.plane.pixel == pytest.approx(pitch * 10e-6 / (1.0 + 0.5 / 51.282) / 51.282e-3, rel=1e-4)
    assert views.inverse_focus == 0.5
    assert "units" not in decoded.settings
    # By the f-number instead: the aperture is as wide as a sub-image.
    by_number = Optics(pixel_pitch=10.0, focal_length=50.0, f_number=4.0, focus_distance=2.0)
    seen = by_number.views(decoded.grid, decoded.resampler)
    assert seen.aperture == pytest.approx(12.5e-3)
    assert decoded.grid.diameter * seen.position[5, 6, 0] == pytest.approx(12.5e-3)
    with pytest.raises(InputError, match="more than the focal length"):
        decode(camera.picture(), optics=dataclasses.replace(optics, focus_distance=0.04))


def test_bayer_mosaic_becomes_colours():
    pytest.importorskip("cv2")
    camera = _camera(True, size=(420, 315))
    white, raw = camera.picture(), camera.picture(_scene, SLOPE)
    colors = np.array([[0, 1], [1, 2]])[np.arange(315)[:, None] % 2, np.arange(420) % 2]
    gains = np.array([0.6, 1.0, 0.7])[colors]
    mosaic = gains * np.take_along_axis(raw, colors[..., None], axis=2)[..., 0]
    decoded = decode(mosaic, gains * white, bayer="rggb")
    _check_grid(decoded.grid, camera)
    middle = decoded.views.rows // 2
    assert _relative_rms(decoded, middle, middle) < 0.03
    plain = decode(mosaic, gains * white)
    assert any("--bayer" in note for note in plain.notes)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ({"white": np.ones((210, 150))}, "white: has 150 x 210 pixels, and raw has 280 x 210"),
        ({"white": np.ones((280, 210))}, "turned by 90 degrees"),
        ({"dark": np.ones((10, 10))}, "dark: has 10 x 10 pixels"),
        ({"white": np.full((210, 280), 0.5)}, "one value everywhere"),
        ({"views": 0}, "--views 0: must be from 1 to 14"),
        ({"views": 15}, "--views 15: must be from 1 to 14"),
        ({"bayer": "rgb"}, "--bayer rgb: must be one of rggb"),
        ({"white": "nowhere.png"}, "nowhere.png: no such file"),
    ],
)
def test_what_does_not_go_together(small, arguments, told):
    with pytest.raises(InputError, match=told):
        decode(small, **arguments)


def test_white_no_brighter_than_dark(small):
    with pytest.raises(InputError, match="white: is black: nowhere brighter than dark"):
        decode(small, small, dark=small)


@pytest.mark.parametrize(
    ("most", "dtype", "is_told"),
    [(4095, "u2", True), (65520, "u2", True), (255, "u1", True), (3000, "u2", False), (1, "f8", False)],
)
def test_a_white_picture_is_clipped_where_a_sensors_numbers_end(small, most, dtype, is_told):
    # A flat top alone is what even light without noise makes, as in a rendered picture.
    cut = np.minimum(small / np.quantile(small, 0.7), 1.0)
    notes = decode(cut, (most * cut).astype(dtype)).notes
    assert any("clipped" in note for note in notes) == is_told


def test_whole_pixels_are_taken_as_they_are():
    # A grid of 5 pixels: every view is every fifth pixel, bit for bit.
    raw = np.random.default_rng(0).random((35, 50, 3))
    resampler = Resampler(Lattice((2.5, 2.5), (5.0, 0.0), (0.0, 5.0)), 50, 35)
    assert (resampler.count, resampler.width, resampler.height) == (5, 10, 7)
    for row in range(5):
        for column in range(5):
            assert np.array_equal(resampler.view(raw, row, column), raw[row::5, column::5])


@pytest.mark.parametrize("hexagonal", [False, True], ids=["square", "hexagonal"])
@pytest.mark.parametrize("degrees", [0.0, 0.7, 17.0, 90.0])
def test_a_slope_stays_what_it_is(hexagonal, degrees):
    # Linear and cubic interpolation are both exact for a plane, wherever microlenses are.
    grid = lattice(9.3, degrees, (3.1, 4.7), hexagonal=hexagonal)
    y, x = np.mgrid[:150, :200] + 0.5
    raw = 0.3 * x - 0.7 * y
    resampler = Resampler(grid, 200, 150, count=7)
    seen = resampler.view(raw, 1, 5)
    columns = resampler.first[0] + resampler.pixel * np.arange(resampler.width)
    rows = resampler.first[1] + resampler.pixel * np.arange(resampler.height)
    right, down = resampler.offset(1, 5)
    true = 0.3 * (columns + right) - 0.7 * (rows[:, None] + down)
    assert np.allclose(seen, true, atol=1e-9)


def test_bad_pixels_are_left_out_and_what_is_unseen_is_black():
    grid = lattice(9.3, 0.7, (3.1, 4.7))
    raw, weight = np.full((150, 200), 0.25), np.ones((150, 200))
    raw[70:75, 90:95], weight[70:75, 90:95] = 1e6, 0.0
    resampler = Resampler(grid, 200, 150, count=7)
    assert np.allclose(resampler.view(raw, 3, 3, weight), 0.25)
    weight[:, :100] = 0.0
    seen = resampler.weighted(raw, 3, 3, weight)
    assert not seen.seen[:, 0].any()
    assert (seen.values[~seen.seen] == 0.0).all()
    assert np.allclose(seen.values[seen.seen], 0.25)


def test_too_small_for_microlenses():
    with pytest.raises(ValueError, match="fewer than two whole microlenses"):
        Resampler(lattice(30.0, 0.7, (1.0, 2.0)), 50, 50)


@pytest.mark.parametrize("mosaic", [False, True])
def test_single_pixels_that_stand_out_are_defects(mosaic):
    # A hot and a dead one; in a mosaic their neighbours of other colours are other pictures.
    even = np.full((40, 60), 0.5, np.float32)
    if mosaic:
        even[::2, ::2] = 0.1
    spoilt = even.copy()
    spoilt[9, 31], spoilt[20, 14] = 10.0, 0.0
    assert not find_defects(even, mosaic, dead=True).any()
    assert list(zip(*np.nonzero(find_defects(spoilt, mosaic)), strict=True)) == [(9, 31)]
    assert list(zip(*np.nonzero(find_defects(spoilt, mosaic, dead=True)), strict=True)) == [(9, 31), (20, 14)]
