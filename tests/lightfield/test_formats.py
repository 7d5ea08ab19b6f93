"""Folders and arrays of other programs: who is where, how far it is, and what is wrong with them."""

import configparser
import dataclasses
import math
import os
import random

import numpy as np
import pytest

from raytracer.film.formats import pfm
from raytracer.film.image import Image
from raytracer.film.light_field.field import LightField
from raytracer.film.light_field.views import Plane, Pose, Views
from raytracer.lightfield.formats.exporter import export, export_array, export_views
from raytracer.lightfield.formats.importer import import_views
from raytracer.util.errors import InputError

HEIGHT, WIDTH = 6, 8
POSE = Pose((1.0, 2.0, 3.0), (1.0, 0.0, 0.0), (0.0, 0.8, 0.6), (0.0, 0.6, -0.8))


def light_field(rows=3, columns=3, spacing=0.02, inverse_focus=0.4):
    right = spacing * (np.arange(columns) - 0.5 * (columns - 1))
    up = spacing * (0.5 * (rows - 1) - np.arange(rows))
    position = np.stack(np.broadcast_arrays(right, up[:, None]), axis=-1)
    plane = Plane(0.01, -0.5 * WIDTH * 0.01, 0.5 * HEIGHT * 0.01)
    views = Views(position, plane, WIDTH, HEIGHT, inverse_focus, pose=POSE)
    rng = np.random.default_rng(3)
    # Values that 8 bits in sRGB hold exactly, and float32 too.
    radiance = rng.choice([0.0, 1.0], (rows, columns, HEIGHT, WIDTH, 3))
    depth = rng.uniform(1.0, 5.0, (rows, columns, HEIGHT, WIDTH)).astype(np.float32)
    return LightField(radiance, views, {"depth": depth})


def shade(row, column):
    """A view that tells its place."""
    return np.full((HEIGHT, WIDTH, 3), 0.1 + row + 0.01 * column)


def same(found, field, tolerance=1e-12):
    assert np.array_equal(np.asarray(found.radiance), field.radiance)
    assert np.allclose(found.views.position, field.views.position, rtol=0.0, atol=tolerance)
    assert np.allclose(found.views.plane, field.views.plane, rtol=tolerance, atol=tolerance)
    assert found.views.inverse_focus == pytest.approx(field.views.inverse_focus, abs=tolerance)
    assert "units" not in found.settings


@pytest.mark.parametrize("naming", ["grid", "stanford", "hci"])
@pytest.mark.parametrize("suffix", [".png", ".exr", ".npy", ".hdr"])
def test_views_are_taken_back(tmp_path, naming, suffix):
    field = light_field(rows=2, columns=4)
    exported = export_views(field, tmp_path / "views", naming=naming, suffix=suffix)
    assert exported.clipped == 0.0
    found = import_views(tmp_path / "views")
    same(found, field)
    assert found.views.pose == field.views.pose


def test_parameters_tell_the_whole_geometry_and_maps_the_depth(tmp_path):
    field = light_field()
    export_views(field, tmp_path, naming="hci")
    (tmp_path / "geometry.json").unlink()
    found = import_views(tmp_path)
    same(found, field)
    assert np.allclose(np.concatenate(found.views.pose), np.concatenate(POSE), rtol=0.0, atol=1e-12)
    assert np.array_equal(found.layers["depth"], field.layers["depth"])

    # Disparity says the same, to what float32 holds.
    for path in tmp_path.glob("gt_depth*"):
        path.unlink()
    assert np.allclose(import_views(tmp_path).layers["depth"], field.layers["depth"], rtol=1e-5, atol=0.0)


# What an option says, and what it replaces.
REPLACED = {
    "spacing": ({"spacing": 0.03}, lambda views: dataclasses.replace(views, position=1.5 * views.position)),
    "focus": ({"focus_distance": 5.0}, lambda views: dataclasses.replace(views, inverse_focus=0.2)),
    "parallel": ({"focus_distance": math.inf}, lambda views: dataclasses.replace(views, inverse_focus=0.0)),
    "vfov": (
        {"vfov": math.degrees(2.0 * math.atan(0.06))},
        lambda views: dataclasses.replace(views, plane=Plane(0.02, -0.08, 0.06)),
    ),
    "lens": (
        {"focal_length": 100.0, "sensor": 16.0},
        lambda views: dataclasses.replace(views, plane=Plane(0.02, -0.08, 0.06)),
    ),
}


@pytest.mark.parametrize("name", REPLACED)
@pytest.mark.parametrize("source", ["grid", "parameters", "array", "multiview"])
def test_an_option_replaces_what_a_file_says(tmp_path, source, name):
    options, change = REPLACED[name]
    field = light_field()
    path = tmp_path / {"array": "a.npy", "multiview": "a.exr"}.get(source, "views")
    export(field, path, layout="hci" if source == "parameters" else source)
    if source == "parameters":
        (path / "geometry.json").unlink()
    found = import_views(path, **options)
    same(found, LightField(field.radiance, change(field.views)))
    assert np.allclose(np.concatenate(found.views.pose), np.concatenate(POSE), rtol=0.0, atol=1e-12)


def test_half_a_lens_replaces_nothing(tmp_path):
    export_views(light_field(), tmp_path)
    with pytest.raises(InputError, match="--focal-length and --sensor go together"):
        import_views(tmp_path, sensor=36.0)


@pytest.mark.parametrize(
    ("name", "layout"),
    [("a.webp", None), ("a.txt", None), ("a.png", "grid"), ("a.cfg", "hci"), ("a.png", "transforms")],
)
def test_a_name_of_a_file_makes_no_folder(tmp_path, name, layout):
    with pytest.raises(InputError, match=f"{name}: .* writes a file for each view, and the output names their folder"):
        export(light_field(), tmp_path / name, layout=layout)
    assert list(tmp_path.iterdir()) == []
    (tmp_path / name).mkdir()
    assert export(light_field(), tmp_path / name, layout=layout or "grid").files


def test_one_map_is_that_of_the_middle(tmp_path):
    field = light_field()
    export_views(field, tmp_path, naming="hci")
    for path in [*tmp_path.glob("gt_*_Cam*"), tmp_path / "geometry.json"]:
        path.unlink()
    depth = import_views(tmp_path).layers["depth"]
    assert np.array_equal(depth[1, 1], field.layers["depth"][1, 1])
    assert np.isnan(depth).sum() == 8 * HEIGHT * WIDTH


def test_an_array_is_taken_back(tmp_path):
    field = light_field(rows=2, columns=3)
    export_array(field, tmp_path / "a.npy")
    assert np.array_equal(np.load(tmp_path / "a.npy"), field.radiance)
    same(import_views(tmp_path / "a.npy"), field)


@pytest.mark.parametrize("interleaved", [False, True])
def test_one_picture_of_all_views(tmp_path, interleaved):
    field = light_field(rows=2, columns=3)
    order = (2, 0, 3, 1, 4) if interleaved else (0, 2, 1, 3, 4)
    Image(field.radiance.transpose(order).reshape(2 * HEIGHT, 3 * WIDTH, 3)).save(tmp_path / "all.png")
    found = import_views(
        tmp_path / "all.png",
        rows=2,
        columns=3,
        interleaved=interleaved,
        spacing=0.02,
        focus_distance=2.5,
        vfov=math.degrees(2.0 * math.atan(0.03)),
    )
    same(found, field)


@pytest.mark.parametrize("pose", [POSE, None])
@pytest.mark.parametrize("cell", [None, (0.02, 0.02)])
def test_the_benchmarks_own_readers_find_all_their_keys(tmp_path, pose, cell):
    # Those that read_parameters of the benchmark's python-tools asks for; without any one of them it gives up.
    numbers = {
        "intrinsics": "image_resolution_x_px image_resolution_y_px focal_length_mm sensor_size_mm fstop",
        "extrinsics": "num_cams_x num_cams_y baseline_mm focus_distance_m center_cam_x_m center_cam_y_m center_cam_z_m "
        "center_cam_rx_rad center_cam_ry_rad center_cam_rz_rad",
        "meta": "disp_min disp_max frustum_disp_min frustum_disp_max depth_map_scale",
    }
    field = light_field()
    views = dataclasses.replace(field.views, pose=pose, cell=cell, focal_length=50.0)
    export_views(dataclasses.replace(field, views=views), tmp_path, naming="hci")
    parser = configparser.ConfigParser()
    parser.read(tmp_path / "parameters.cfg")
    found = {key: parser.getfloat(section, key) for section, keys in numbers.items() for key in keys.split()}
    for key in ("scene", "category", "date", "version", "authors", "contact"):
        parser.get("meta", key)
    # A square of 20 mm is as large as a disc of 22.568 mm.
    assert found["fstop"] == pytest.approx(100.0 if cell is None else 50.0 / 22.5676, rel=1e-5)
    nearest, farthest = field.layers["depth"][1, 1].min(), field.layers["depth"][1, 1].max()
    assert found["disp_max"] == pytest.approx(0.02 * (1.0 / nearest - 0.4) / 0.01, rel=1e-5)
    assert found["disp_min"] == pytest.approx(0.02 * (1.0 / farthest - 0.4) / 0.01, rel=1e-5)


def test_the_benchmarks_own_numbers_give_its_own_disparity(tmp_path):
    # parameters.cfg of its scene cotton: d = b f W (1/z - 1/F) / s, so that at 3 m, with b = 25 mm, f = 100 mm,
    # W = 512 px, s = 35 mm and F = 4.25 m, a point moves by 3.58543 px to the left in the view to the right.
    (tmp_path / "parameters.cfg").write_text(
        "[intrinsics]\nfocal_length_mm = 100.0\nimage_resolution_x_px = 512\nimage_resolution_y_px = 512\n"
        "sensor_size_mm = 35.0\nfstop = 100.0\n\n"
        "[extrinsics]\nnum_cams_x = 3\nnum_cams_y = 3\nbaseline_mm = 25.0\nfocus_distance_m = 4.25\n"
        "center_cam_x_m = 1\ncenter_cam_y_m = 2\ncenter_cam_z_m = 3\n"
        "center_cam_rx_rad = 1.5707963267948966\ncenter_cam_ry_rad = 0\ncenter_cam_rz_rad = 0\n"
    )
    for number in range(9):
        Image(np.full((512, 512, 3), 0.1 * number)).save(tmp_path / f"input_Cam{number:03d}.hdr")
    (tmp_path / "gt_disp_lowres.pfm").write_bytes(pfm.encode(np.full((512, 512), 3.5854341736694675)))
    found = import_views(tmp_path)
    moved = found.views.shift(1.0 / 3.0)
    assert moved[1, 2] - moved[1, 1] == pytest.approx([-3.5854341736694675, 0.0], abs=1e-9)
    # Further down in the image what is near goes up, in a view that is lower.
    assert moved[2, 1] - moved[1, 1] == pytest.approx([0.0, -3.5854341736694675], abs=1e-9)
    assert found.layers["depth"][1, 1] == pytest.approx(3.0, abs=1e-6)
    # A camera that looks down with its top to +y, turned up by 90 degrees, looks to +y with its top to +z.
    assert np.allclose(found.views.pose, [[1, 2, 3], [1, 0, 0], [0, 0, 1], [0, 1, 0]], rtol=0.0, atol=1e-12)
    assert np.asarray(found.radiance[1, 2, 0, 0, 0]) == pytest.approx(0.5, rel=0.01)


def names_of(places, *, numbering=None, end="_"):
    """Names in Stanford's way; `places` (rows, columns) of (X, Y), rows from the top."""
    rows, columns = len(places), len(places[0])
    numbering = numbering or {(r, c): (r, c) for r in range(rows) for c in range(columns)}
    for r in range(rows):
        for c in range(columns):
            x, y = places[r][c]
            i, j = numbering[r, c]
            yield (r, c), f"out_{i:02d}_{j:02d}_{y:.6f}_{x:.6f}{end}.npy"


def place(row, column, seed):
    """Places that are not on a grid, in an image's axes: right and down."""
    rng = random.Random(f"{row} {column} {seed}")
    return 12.0 * column - 700.0 + rng.uniform(-3.0, 3.0), 12.0 * row + 1100.0 + rng.uniform(-3.0, 3.0)


@pytest.mark.parametrize(
    "order",
    [
        lambda rows, columns, r, c: (r, c),
        lambda rows, columns, r, c: (r, columns - 1 - c),
        lambda rows, columns, r, c: (rows - 1 - r, c),
        lambda rows, columns, r, c: divmod(7 * (columns * r + c) % (rows * columns), columns),
    ],
    ids=["as they are", "right to left", "upside down", "at random"],
)
def test_a_stanford_folder_in_any_order(tmp_path, order):
    rows, columns = 4, 5
    cells = [(r, c) for r in range(rows) for c in range(columns)]
    numbered = {cell: order(rows, columns, *cell) for cell in cells}
    places = [[place(r, c, 0) for c in range(columns)] for r in range(rows)]
    names = list(names_of(places, numbering=numbered))
    random.Random(2).shuffle(names)
    for (r, c), name in names:
        np.save(tmp_path / name, shade(r, c))
    (tmp_path / "readme.txt").write_text("not a view")

    found = import_views(tmp_path)
    assert found.settings == {"naming": "stanford", "units": "views"}
    for r, c in cells:
        assert np.array_equal(found.radiance[r, c], shade(r, c))
    # In steps of one view, from the middle: right as X is, up against Y.
    x = np.array(places)[..., 0]
    y = np.array(places)[..., 1]
    step = 0.5 * ((x[:, -1] - x[:, 0]).mean() / (columns - 1) + (y[-1] - y[0]).mean() / (rows - 1))
    expected = np.stack([x - 0.5 * (x.min() + x.max()), 0.5 * (y.min() + y.max()) - y], axis=-1) / step
    assert np.allclose(found.views.position, expected, rtol=0.0, atol=1e-6)

    metric = import_views(tmp_path, spacing=0.012, focus_distance=1.5, vfov=30.0)
    assert np.allclose(metric.views.position, 0.012 * expected, rtol=0.0, atol=1e-8)
    assert metric.views.focus_distance == 1.5
    assert metric.views.plane.pixel == pytest.approx(2.0 * math.tan(math.radians(15.0)) / HEIGHT)


def test_places_that_run_the_other_way(tmp_path):
    # To the left, and up, without a `_` at the end, as of the Knights.
    places = [[(-10.0 * c, -10.0 * r) for c in range(3)] for r in range(2)]
    for (r, c), name in names_of(places, end=""):
        np.save(tmp_path / name, shade(r, c))
    found = import_views(tmp_path, flip="xy")
    assert np.array_equal(found.radiance[0, 0], shade(0, 0))
    assert np.array_equal(found.radiance[1, 2], shade(1, 2))
    turned = import_views(tmp_path)
    assert np.array_equal(turned.radiance[0, 0], shade(1, 2))


@pytest.mark.parametrize(
    ("names", "options"),
    [
        ("view_{r:02d}_{c:02d}.npy", {}),
        ("{r}-{c}.npy", {}),
        ("scene12_r{r}_c{c}_final.npy", {}),
        ("{n:03d}.npy", {"columns": 3}),
        ("cam0_{n:03d}.npy", {"rows": 2, "columns": 3}),
    ],
)
def test_plain_names(tmp_path, names, options):
    for r in range(2):
        for c in range(3):
            np.save(tmp_path / names.format(r=r, c=c, n=3 * r + c + 7), shade(r, c))
    found = import_views(tmp_path, **options)
    assert found.radiance.shape == (2, 3, HEIGHT, WIDTH, 3)
    for r in range(2):
        for c in range(3):
            assert np.array_equal(found.radiance[r, c], shade(r, c))
    assert found.views.position[0, 0].tolist() == [-1.0, 0.5]


def test_every_second_view_is_two_steps_away(tmp_path):
    for c in (1, 3, 7):
        np.save(tmp_path / f"view_00_{c:02d}.npy", shade(0, c))
    assert import_views(tmp_path).views.position[0, :, 0].tolist() == [-3.0, -1.0, 3.0]


def test_whole_numbers_of_arrays_are_what_displays_show(tmp_path):
    np.save(tmp_path / "a.npy", np.full((1, 2, 2, 2, 3), 188, dtype=np.uint8))
    # IEC 61966-2-1: 188 of 255 is 0.5029.
    assert import_views(tmp_path / "a.npy").radiance[0, 0] == pytest.approx(0.5029, abs=1e-4)
    np.save(tmp_path / "b.npy", np.full((1, 2, 2, 2), 0.25, dtype=np.float16))
    assert import_views(tmp_path / "b.npy").radiance[0, 1].tolist() == np.full((2, 2, 3), 0.25).tolist()


def text(name, words):
    return lambda folder: (folder / name).write_text(words)


CFG = (
    "[intrinsics]\nfocal_length_mm = 100\nimage_resolution_x_px = 8\nimage_resolution_y_px = 6\nsensor_size_mm = 35\n"
    "[extrinsics]\nnum_cams_x = 1\nnum_cams_y = 1\nbaseline_mm = 25\nfocus_distance_m = 4\n"
)


def cfg(old="", new=""):
    return text("parameters.cfg", CFG.replace(old, new) if old else CFG)


def mapped(data):
    return lambda folder: (cfg()(folder), (folder / "gt_depth_lowres.pfm").write_bytes(data))


METRES = {"spacing": 0.1, "focus_distance": 1.0}
# Views of a folder, what else is done to it, options, and what is told.
WRONG = {
    "no views": ("", text("readme.txt", "hello"), {}, "holds no views"),
    "a missing view": ("v_0_0 v_0_1 v_1_0", None, {}, "the view of row 1, column 1 is missing"),
    "two for one place": ("v_0_0 v_00_0", None, {}, "v_0_0.npy and v_00_0.npy are both|are both view 0, 0"),
    "names without numbers": ("a", None, {}, "must end in row and column, as view_03_05.png; a.npy does not"),
    "a count that is no square": ("1 2 3", None, {}, "say --rows or --columns"),
    "another count": ("1 2 3", None, {"rows": 2}, "holds 3 views, not 2 rows of 1"),
    "two light fields": ("a_0_0 b_0_0", None, {}, "more than one light field"),
    "not enough for metres": ("v_0_0", None, {"spacing": 0.1}, r"need also --focus-distance .* and --vfov"),
    "half a lens": ("v_0_0", None, {**METRES, "sensor": 36.0}, "need also --vfov, or --focal-length with --sensor"),
    "two spacings for places": (
        "out_0_0_0_0_ out_0_1_0_5_",
        None,
        {**METRES, "spacing": (0.1, 0.2), "vfov": 30.0},
        "--spacing is one length",
    ),
    "a flip of no places": ("v_0_0", None, {"flip": "x"}, "--flip is of places in Stanford names"),
    "a flip of places that a file says": (
        "out_0_0_0_0_ out_0_1_0_5_",
        text("geometry.json", "{}"),
        {"flip": "x"},
        "--flip is of places in names, and geometry.json says where views are",
    ),
    "other rows than places": ("out_0_0_0_0_ out_0_1_0_5_", None, {"rows": 2}, "names say 1 rows of 2 views, not"),
    "all at one place": ("out_0_0_5_5_ out_0_1_5_5_", None, {}, "all views are at the same place"),
    "a broken view": ("v_0_0", text("v_0_1.npy", "hello"), {}, "v_0_1.npy: is no NumPy file"),
    "a view of another size": (
        "v_0_0",
        lambda folder: np.save(folder / "v_0_1.npy", np.zeros((HEIGHT, 9, 3))),
        {},
        "v_0_1.npy: is of 9 x 6 pixels, and must be 8 x 6 as v_0_0.npy is",
    ),
    "a broken geometry": ("v_0_0", text("geometry.json", "{"), {}, "is no geometry of a light field"),
    "a list for a geometry": ("v_0_0", text("geometry.json", "[1]"), {}, "is no geometry"),
    "an empty geometry": ("v_0_0", text("geometry.json", "{}"), {}, "has no 'position'"),
    "no parameters": ("input_Cam000", text("parameters.cfg", "hello"), {}, "is no file of parameters"),
    "too few": ("input_Cam000", text("parameters.cfg", "[intrinsics]\n"), {}, "has no image_resolution_x_px"),
    "a text": ("input_Cam000", cfg("= 25", "= wide"), {}, "baseline_mm must be a number, not 'wide'"),
    "no baseline": ("input_Cam000", cfg("= 25", "= 0"), {}, "baseline_mm must be greater than 0"),
    "nan for a baseline": ("input_Cam000", cfg("= 25", "= nan"), {}, "baseline_mm must be greater than 0, not nan"),
    "half a camera": ("input_Cam000", cfg("x = 1", "x = 1.5"), {}, "num_cams_x must be an integer"),
    "more cameras than views": ("input_Cam000", cfg("x = 1", "x = 9"), {}, "holds 1 views, not 1 rows of 9"),
    "other pixels": ("input_Cam000", cfg("= 8", "= 512"), {}, "says 512 x 6 pixels a view; they have 8 x 6"),
    "a broken map": ("input_Cam000", mapped(b"Pf\n"), {}, "is truncated, or no .pfm file"),
    "a small map": ("input_Cam000", mapped(pfm.encode(np.ones((2, 2)))), {}, "must be of 8 x 6 pixels as the views"),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_folder_is_told_in_a_sentence(tmp_path, name):
    names, act, options, sentence = WRONG[name]
    for view in names.split():
        np.save(tmp_path / f"{view}.npy", shade(0, 0))
    if act is not None:
        act(tmp_path)
    with pytest.raises(InputError, match=sentence) as told:
        np.asarray(import_views(tmp_path, **options).radiance[:])
    assert str(tmp_path) in str(told.value)
    assert "\n" not in str(told.value)


@pytest.mark.parametrize(
    ("data", "sentence"),
    [
        (lambda: np.zeros((2, 2, 3)), r"must be \(rows, columns, height, width, 3\)"),
        (lambda: np.zeros((2, 2, 3, 3, 2)), r"must be \(rows, columns, height, width, 3\)"),
        (lambda: np.zeros((2, 2, 0, 3, 3)), r"must be \(rows, columns, height, width, 3\)"),
        (lambda: np.zeros((1, 1, 2, 2, 3), complex), "it is .* of complex128"),
        (lambda: np.zeros((1, 1, 2, 2, 3), object), "is truncated, or no .npy file"),
    ],
)
def test_a_wrong_array_is_told(tmp_path, data, sentence):
    np.save(tmp_path / "a.npy", data(), allow_pickle=True)
    with pytest.raises(InputError, match=sentence):
        import_views(tmp_path / "a.npy")


def test_arrays_that_are_not_whole(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        import_views(tmp_path / "a.npy")
    np.save(tmp_path / "a.npy", np.zeros((2, 2, 20, 20, 3)))
    whole = (tmp_path / "a.npy").read_bytes()
    for length in (0, 5, 60, 128, len(whole) - 1):
        (tmp_path / "a.npy").write_bytes(whole[:length])
        with pytest.raises(InputError, match=r"a.npy: is truncated, or no \.npy file"):
            import_views(tmp_path / "a.npy")


def test_pictures_that_do_not_divide(tmp_path):
    Image(np.zeros((6, 8, 3))).save(tmp_path / "a.png")
    with pytest.raises(InputError, match="8 x 6 pixels do not divide into 3 columns and 2 rows"):
        import_views(tmp_path / "a.png", rows=2, columns=3)
    with pytest.raises(InputError, match="is one picture: say --rows and --columns"):
        import_views(tmp_path / "a.png")
    with pytest.raises(InputError, match="no such file"):
        import_views(tmp_path / "b.png")
    (tmp_path / "b.lf").touch()
    with pytest.raises(InputError, match=r"is an \.lf file already"):
        import_views(tmp_path / "b.lf")


def test_what_names_cannot_tell_is_not_exported(tmp_path):
    field = light_field()
    moved = field.views.position.copy()
    moved[0, 0, 0] += 0.01
    uneven = LightField(field.radiance, Views(moved, field.views.plane, WIDTH, HEIGHT))
    with pytest.raises(InputError, match=r"not on a grid of one spacing, .*: export as stanford or grid"):
        export_views(uneven, tmp_path / "a", naming="hci")
    shifted = LightField(field.radiance, Views(field.views.position, Plane(0.01, 0.0, 0.1), WIDTH, HEIGHT))
    with pytest.raises(InputError, match="look past the middle of their images"):
        export_views(shifted, tmp_path / "a", naming="hci")
    unitless = LightField(field.radiance, field.views, settings={"units": "views"})
    with pytest.raises(InputError, match="needs metres"):
        export_views(unitless, tmp_path / "a", naming="hci")
    assert not (tmp_path / "a").exists()

    np.save(tmp_path / "other.npy", shade(0, 0))
    with pytest.raises(InputError, match=r"holds other pictures \(other.npy\)"):
        export_views(field, tmp_path)
    with pytest.raises(InputError, match=r"unknown suffix '.tiff'"):
        export_views(field, tmp_path, suffix=".tiff")
    with pytest.raises(InputError, match=r"unknown suffix '.lf' for views"):
        export_views(field, tmp_path, suffix=".lf")
    with pytest.raises(InputError, match="naming must be one of grid, stanford, hci, got 'lytro'"):
        export_views(field, tmp_path, naming="lytro")


def test_what_is_too_bright_is_counted(tmp_path):
    field = light_field(rows=1, columns=1)
    bright = LightField(1.5 * field.radiance, field.views)
    assert export_views(bright, tmp_path / "a").clipped == field.radiance.mean()
    assert export_views(bright, tmp_path / "b", suffix=".exr").clipped == 0.0


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="pipes with names are POSIX's")
@pytest.mark.parametrize("name", ["geometry.json", "parameters.cfg"])
def test_a_pipe_is_not_waited_for(tmp_path, name):
    for number in range(4):
        np.save(tmp_path / f"input_Cam{number:03d}.npy", shade(0, 0))
    os.mkfifo(tmp_path / name)
    with pytest.raises(InputError, match=f"{name}: .*no regular file"):
        import_views(tmp_path)


def test_an_archive_of_arrays_is_no_array(tmp_path):
    np.savez(tmp_path / "a.npz", np.zeros((1, 1, 2, 2, 3)))
    (tmp_path / "a.npz").rename(tmp_path / "a.npy")
    with pytest.raises(InputError, match=r"is truncated, or no \.npy file"):
        import_views(tmp_path / "a.npy")
