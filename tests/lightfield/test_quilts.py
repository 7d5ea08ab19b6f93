"""Quilts for Looking Glass displays: which view is where, what stands still, and what the names say."""

import dataclasses
import math

import numpy as np
import PIL.Image
import pytest

from raytracer.cli.lightfield.base import LAYOUTS
from raytracer.cli.lightfield.export import DEVICES as OFFERED
from raytracer.cli.lightfield.export import SUFFIXES
from raytracer.film.formats.registry import picture_suffixes
from raytracer.film.light_field.field import LightField
from raytracer.film.light_field.views import Plane, Views
from raytracer.lightfield.formats.base.light_field_format import ExportOptions
from raytracer.lightfield.formats.base.quilt_plan import DEVICES, plan_quilt
from raytracer.lightfield.formats.exporter import export
from raytracer.lightfield.formats.importer import import_views
from raytracer.lightfield.formats.registry import light_field_formats
from raytracer.util.errors import InputError
from tests.lightfield.analytic import Surface, light_field, views, waves

WIDTH, HEIGHT = 12, 16


def row_of_views(columns=6, rows=1, spacing=0.02, inverse_focus=0.5):
    """Views that are each of one shade, which tells its number."""
    right = spacing * (np.arange(columns) - 0.5 * (columns - 1))
    up = spacing * (0.5 * (rows - 1) - np.arange(rows))
    position = np.stack(np.broadcast_arrays(right, up[:, None]), axis=-1)
    plane = Plane(0.01, -0.005 * WIDTH, 0.005 * HEIGHT)
    shades = np.arange(rows * columns, dtype=np.float32).reshape(rows, columns, 1, 1, 1) / 64.0
    radiance = np.broadcast_to(shades, (rows, columns, HEIGHT, WIDTH, 3))
    return LightField(radiance, Views(position, plane, WIDTH, HEIGHT, inverse_focus))


def test_the_layouts_of_the_command_are_the_formats_there_are():
    assert set(LAYOUTS) == set(light_field_formats())
    assert set(OFFERED) == set(DEVICES)
    assert tuple(f".{suffix}" for suffix in SUFFIXES) == picture_suffixes()


def test_the_leftmost_view_is_at_the_bottom_left(tmp_path):
    field = row_of_views()
    result = export(field, tmp_path / "a_qs3x2a0.75.npy", layout="quilt")
    picture = np.load(result.files[0])
    assert picture.shape == (2 * HEIGHT, 3 * WIDTH, 3)
    shade = 64.0 * picture[HEIGHT // 2 :: HEIGHT, WIDTH // 2 :: WIDTH, 0]
    assert shade.tolist() == [[3.0, 4.0, 5.0], [0.0, 1.0, 2.0]]
    assert result.notes == ()
    found = import_views(result.files[0])
    assert np.array_equal(np.asarray(found.radiance), field.radiance)
    assert np.allclose(found.views.position, field.views.position, rtol=0.0, atol=1e-15)
    assert np.allclose(found.views.plane, field.views.plane, rtol=0.0, atol=1e-15)
    assert found.views.inverse_focus == field.views.inverse_focus


# Half a step of 8 bits in sRGB, where it is widest, at white; blocks of JPEG reach over the edges of views.
TOLERANCE = {".exr": 0.0, ".png": 0.5 / 255.0 * 2.4 / 1.055, ".jpg": 0.05}


@pytest.mark.parametrize("suffix", TOLERANCE)
def test_pictures_of_any_format_hold_a_quilt(tmp_path, suffix):
    field = row_of_views()
    result = export(field, tmp_path / f"a{suffix}", layout="quilt", columns=2, rows=3)
    assert result.files[0].name == f"a_qs2x3a0.75{suffix}"
    found = np.asarray(import_views(result.files[0]).radiance[0, :, 8, 6, 0])
    assert np.allclose(found, np.arange(6) / 64.0, rtol=0.0, atol=TOLERANCE[suffix])


def test_what_converges_elsewhere_stands_still_there(tmp_path):
    # A wall of waves at 1 m; the views converge at 2.5 m, and there move by 0.02 (1 - 0.4) / 0.01 pixels.
    surfaces = [Surface(1.0, waves(0, 0.3))]
    planar = light_field(views(1, 5, spacing=0.02, width=60, height=20), surfaces)
    field = dataclasses.replace(planar, radiance=np.asarray(planar.radiance))
    result = export(field, tmp_path / "a_qs5x1a2.npy", layout="quilt", convergence=1.0)
    found = import_views(result.files[0])
    seen = np.asarray(found.radiance[0])
    assert found.views.inverse_focus == 1.0
    assert np.abs(seen - seen[2]).max() < 0.01 * np.ptp(seen)
    own = np.asarray(field.radiance[0])
    assert np.abs(own - own[2]).max() > 0.1 * np.ptp(own)
    # The geometry says so, too: points of the wall are at the same place, and those at infinity are not.
    assert np.abs(found.views.shift(1.0)).max() == 0.0
    assert "cropped" in result.notes[0]


def test_a_view_of_the_quilt_sees_along_the_same_rays(tmp_path):
    """A horizontal ramp is a function of the slope alone: at infinity, whose slopes geometry has to keep."""
    geometry = dataclasses.replace(row_of_views(columns=4, rows=3).views)
    slope = geometry.plane.left + geometry.plane.pixel * (np.arange(WIDTH) + 0.5)
    slopes = slope - geometry.inverse_focus * geometry.position[..., :1]
    ramp = np.broadcast_to(slopes[:, :, None, :, None], (3, 4, HEIGHT, WIDTH, 3))
    field = LightField(0.5 + ramp, geometry)
    result = export(field, tmp_path / "a_qs2x2a0.75.npy", layout="quilt", convergence=4.0, size=(24, 32), row=1)
    found = import_views(result.files[0])
    plane = found.views.plane
    across = plane.left + plane.pixel * (np.arange(found.views.width) + 0.5)
    expected = 0.5 + across - 0.25 * found.views.position[0, :, :1]
    middle = slice(3, -3)
    got = np.asarray(found.radiance[0, :, 8, middle, 0])
    assert np.allclose(got, expected[:, middle], rtol=0.0, atol=2e-4)


def test_more_views_than_there_are_stand_between_them(tmp_path):
    field = row_of_views()
    plan = plan_quilt(field, tmp_path / "a.png", ExportOptions(columns=11, rows=1))
    assert np.allclose(plan.places[:, 0], np.linspace(-0.05, 0.05, 11), rtol=0.0, atol=1e-15)
    narrow = plan_quilt(field, tmp_path / "a.png", ExportOptions(columns=3, rows=1, view_cone=2.0))
    # At the convergence of 2 m, 2 degrees are 69.8 mm.
    assert np.ptp(narrow.places[:, 0]) == pytest.approx(4.0 * math.tan(math.radians(1.0)))
    result = export(field, tmp_path / "b_qs11x1a0.75.npy", layout="quilt")
    shade = 64.0 * np.load(result.files[0])[8, WIDTH // 2 :: WIDTH, 0]
    # A wall of one shade each: between two views their mean.
    assert np.allclose(shade, np.linspace(0.0, 5.0, 11), rtol=0.0, atol=1e-5)


def test_depths_that_are_known_put_points_between_views_where_they_are(tmp_path):
    # A wall at 1.2 m, where views that converge at 2 m differ by 3 pixels: a view between is that of a camera there.
    surfaces = [Surface(1.2, waves(0, 0.1))]
    field = light_field(views(1, 3, spacing=0.24, width=60, height=20, focus_distance=2.0), surfaces)
    true = light_field(views(1, 5, spacing=0.12, width=60, height=20, focus_distance=2.0), surfaces)
    known = LightField(field.radiance, field.views, {"depth": np.full((1, 3, 20, 60), 1.2)})
    middle = np.s_[0, 1, 4:-4, 8:-8]
    errors = []
    for each, depth in ((known, True), (field, None)):
        result = export(each, tmp_path / "a_qs5x1a3.npy", layout="quilt", depth=depth)
        error = np.asarray(import_views(result.files[0]).radiance)[middle] - np.asarray(true.radiance)[middle]
        errors.append(np.sqrt((error**2).mean()))
    assert errors[0] < 0.02
    assert errors[1] > 5.0 * errors[0]


@pytest.mark.parametrize("name", DEVICES)
def test_displays_have_the_quilts_of_their_manual(tmp_path, name):
    device = DEVICES[name]
    plan = plan_quilt(row_of_views(), tmp_path / "a.png", ExportOptions(device=name))
    assert plan.size == device.size
    assert plan.tile == (device.size[0] // device.columns, device.size[1] // device.rows)
    assert len(plan.places) == device.columns * device.rows
    # What a view shows has the display's shape, whatever its pixels are.
    assert plan.box[2] / plan.box[3] == pytest.approx(device.aspect, rel=1e-12)


@pytest.mark.parametrize(
    ("name", "device"), [("a_qs11x6a0.56", "go"), ("a_qs7x7a1.78", "16-landscape"), ("a_qs7x7a1.77778", "16-landscape")]
)
def test_names_say_the_aspect_in_the_digits_that_they_have(tmp_path, name, device):
    plan = plan_quilt(row_of_views(), tmp_path / f"{name}.png", ExportOptions(device=device))
    assert plan.aspect == DEVICES[device].aspect


def test_what_does_not_divide_is_empty_at_the_top_and_the_right(tmp_path):
    # 5 columns and 9 rows of 819 x 455 in 4096 x 4096 (HoloPlay Core SDK): here of 4 x 3 in 22 x 29.
    result = export(row_of_views(), tmp_path / "a_qs5x9a1.3333.png", layout="quilt", size=(22, 29))
    with PIL.Image.open(result.files[0]) as picture:
        pixels = np.asarray(picture)
    assert pixels.shape == (29, 22, 3)
    assert (pixels[:2] == 0).all()
    assert (pixels[:, 20:] == 0).all()
    assert (pixels[2, 4:20] > 0).all()
    found = import_views(result.files[0])
    assert found.radiance.shape == (1, 45, 3, 4, 3)
    shades = np.asarray(found.radiance[0, :, 1, 1, 0])
    assert (np.diff(shades) > -1e-12).all()


def test_a_quilt_of_another_program_counts_in_views(tmp_path):
    tiles = np.repeat(np.repeat(np.arange(6, dtype=np.uint8).reshape(2, 3)[::-1], 8, axis=0), 4, axis=1)
    PIL.Image.fromarray(np.stack([40 * tiles] * 3, axis=-1)).save(tmp_path / "x_qs3x2a0.75.png")
    found = import_views(tmp_path / "x_qs3x2a0.75.png")
    assert found.settings["units"] == "views"
    # Four of eight pixels are shown as wide as three quarters of the height.
    assert found.settings["pixel_aspect"] == 1.5
    values = np.asarray(found.radiance[0, :, 0, 0, 0])
    assert (np.diff(values) > 0.0).all()
    again = export(found, tmp_path / "y_qs3x2a0.75.png", layout="quilt")
    with PIL.Image.open(again.files[0]) as picture, PIL.Image.open(tmp_path / "x_qs3x2a0.75.png") as first:
        assert np.array_equal(np.asarray(picture), np.asarray(first))
    metric = import_views(tmp_path / "x_qs3x2a0.75.png", spacing=0.01, focus_distance=2.0, vfov=30.0)
    assert metric.views.position[0, 5, 0] == pytest.approx(0.025)
    (tmp_path / "x_qs3x2a0.75.png").rename(tmp_path / "z.png")
    named = import_views(tmp_path / "z.png", layout="quilt", rows=2, columns=3)
    assert np.array_equal(np.asarray(named.radiance), np.asarray(found.radiance))


WRONG = {
    "no layout": ("a.png", {}, "needs --device, or --columns and --rows, or a name"),
    "another name": ("a_qs3x2a1.png", {"columns": 4}, "its name says 3 x 2 views, and it is to have 4 x 2"),
    "no row": ("a_qs3x2a1.png", {"row": 1}, "--row 1: views are in rows 0 to 0"),
    "two widths": ("a_qs3x2a1.png", {"baseline": 0.1, "view_cone": 2.0}, "give one of them"),
    "too wide": ("a_qs3x2a1.png", {"baseline": 0.2}, "a baseline of 0.2 m is wider than that of the views, 0.1 m"),
    "a wide cone": ("a_qs3x2a1.png", {"view_cone": 60.0}, "wider than that of the views"),
    "nothing in common": ("a_qs3x2a1.png", {"convergence": 0.2}, "have nothing in common"),
    "no room": ("a_qs3x2a1.png", {"size": (2, 9)}, "a quilt of 2 x 9 pixels cannot hold 3 x 2 views"),
    "no device": ("a_qs3x2a1.png", {"device": "tv"}, "--device tv: must be portrait, go"),
    "16 bits of a jpg": ("a_qs3x2a1.jpg", {"bits": 16}, "--bits are of .png"),
    "another layout's": ("a_qs3x2a1.png", {"suffix": ".png"}, "--format is of other layouts than quilt"),
    "memory for nothing": ("a_qs3x2a1.png", {"memory": 1}, "--memory is that of --depth"),
    "another aspect": ("a_qs3x2a0.75.png", {"aspect": 1.5}, "its name says an aspect of 0.75, and it is to have 1.5"),
    "half an aspect": ("a_qs3x2a1.png", {"aspect": 1.5}, "its name says an aspect of 1, and it is to have 1.5"),
    "another display": ("a_qs8x6a1.5.png", {"device": "portrait"}, "says an aspect of 1.5, and it is to have 0.75"),
    "no memory": ("a_qs3x2a1.png", {"depth": True, "memory": 1000}, "memory: .* 1e-06 GB are given"),
    "a text": ("a.txt", {}, "unknown suffix '.txt' for a quilt"),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_quilt_that_cannot_be_is_refused_in_a_sentence(tmp_path, name):
    file, options, sentence = WRONG[name]
    with pytest.raises(InputError, match=sentence):
        export(row_of_views(), tmp_path / file, layout="quilt", **options)
    assert list(tmp_path.iterdir()) == []


def test_a_picture_smaller_than_its_name_says_is_refused(tmp_path):
    PIL.Image.new("RGB", (2, 2)).save(tmp_path / "x_qs3x2a0.75.png")
    with pytest.raises(InputError, match="2 x 2 pixels have no room for 3 x 2 views"):
        import_views(tmp_path / "x_qs3x2a0.75.png")
    PIL.Image.new("RGB", (2, 2)).save(tmp_path / "y.png")
    with pytest.raises(InputError, match="name does not say columns and rows"):
        import_views(tmp_path / "y.png", layout="quilt")
