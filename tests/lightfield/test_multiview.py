"""OpenEXR files of several views: parts, layers, stereo pictures of other programs, and broken ones."""

import json
import os
import struct

import numpy as np
import OpenEXR
import pytest

from raytracer.film.light_field import lf
from raytracer.film.light_field.field import LightField
from raytracer.film.light_field.views import Plane, Views
from raytracer.lightfield.formats.exporter import export
from raytracer.lightfield.formats.importer import import_views
from raytracer.util.errors import InputError
from tests.lightfield.test_mosaics import COLUMNS, HEIGHT, ROWS, WIDTH, light_field, same_geometry

SHAPE = (ROWS, COLUMNS, HEIGHT, WIDTH)


def layers():
    rng = np.random.default_rng(8)
    return {
        "depth": rng.random(SHAPE).astype(np.float32),
        "lit": rng.integers(0, 2, SHAPE).astype(np.uint8),
        "id": rng.integers(0, 2**32, SHAPE, dtype=np.uint32),
        "normal": rng.random((*SHAPE, 3)).astype(np.float32),
    }


@pytest.mark.parametrize("dtype", [np.float16, np.float32])
def test_all_views_are_taken_back_with_all_their_bits(tmp_path, dtype):
    field = light_field(dtype, **layers())
    result = export(field, tmp_path / "a.exr")
    assert result.notes == ()
    found = import_views(tmp_path / "a.exr")
    assert found.radiance.dtype == dtype
    assert np.array_equal(np.asarray(found.radiance), field.radiance)
    assert np.array_equal(found.radiance[1, ::2, 1:4, ::-3, 1], field.radiance[1, ::2, 1:4, ::-3, 1])
    assert set(found.layers) == set(field.layers)
    for name, layer in field.layers.items():
        assert np.array_equal(np.asarray(found.layers[name]), layer), name
    same_geometry(found, field)
    lf.write(tmp_path / "b.lf", found)
    with lf.open(tmp_path / "b.lf") as stored:
        assert np.array_equal(np.asarray(stored.radiance), field.radiance)
        same_geometry(stored, field)


def test_the_library_reads_a_part_for_each_view(tmp_path):
    field = light_field(**layers())
    export(field, tmp_path / "a.exr")
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        assert [part.header["view"] for part in file.parts] == [
            f"view_{r:02d}_{c:02d}" for r in range(3) for c in range(4)
        ]
        part = file.parts[6]
        assert sorted(part.channels) == ["B", "G", "R", "depth", "id", "lit", "normal.0", "normal.1", "normal.2"]
        for number, name in enumerate("RGB"):
            assert np.array_equal(part.channels[name].pixels, field.radiance[1, 2, ..., number])
        assert np.array_equal(part.channels["id"].pixels, field.layers["id"][1, 2])


def write_again(old, new, window):
    """Write a file as another program does, with a data window of the last view."""
    with OpenEXR.File(str(old), separate_channels=True) as file:
        parts = [
            OpenEXR.Part(
                {
                    **{k: v for k, v in part.header.items() if k in ("view", "rt.lightfield")},
                    "compression": OpenEXR.PIZ_COMPRESSION,
                    "displayWindow": ((0, 0), (WIDTH, HEIGHT)),
                    "dataWindow": window if part is file.parts[-1] else ((0, 0), (WIDTH - 1, HEIGHT - 1)),
                },
                {name: channel.pixels for name, channel in part.channels.items()},
                part.name(),
            )
            for part in file.parts
        ]
        OpenEXR.File(parts).write(str(new))


def test_a_file_that_another_program_wrote_again_keeps_its_geometry(tmp_path):
    field = light_field(**layers())
    export(field, tmp_path / "a.exr")
    write_again(tmp_path / "a.exr", tmp_path / "b.exr", ((0, 0), (WIDTH - 1, HEIGHT - 1)))
    write_again(tmp_path / "a.exr", tmp_path / "c.exr", ((1, 0), (WIDTH, HEIGHT - 1)))
    with pytest.raises(InputError, match=r"c\.exr: holds views of different sizes, or parts of them"):
        import_views(tmp_path / "c.exr")
    found = import_views(tmp_path / "b.exr")
    assert np.array_equal(np.asarray(found.radiance), field.radiance)
    assert np.array_equal(np.asarray(found.layers["id"]), field.layers["id"])
    same_geometry(found, field)


def test_what_the_format_cannot_hold_is_told(tmp_path):
    far, red = np.ones(SHAPE, np.int64), np.ones(SHAPE)
    field = light_field(np.float64, depth=np.ones(SHAPE), far=far, R=red)
    result = export(field, tmp_path / "a.exr")
    assert result.notes == ("left out, which the format cannot hold: far, R",)
    found = import_views(tmp_path / "a.exr")
    assert np.array_equal(np.asarray(found.radiance), field.radiance.astype(np.float32))


# ---- Files of other programs


def planes(*values):
    return {name: np.full((4, 6), value, np.float32) for name, value in zip("RGB", values, strict=True)}


def write_views(path, names, default):
    """Views as layers of one part, of which the first has no name; each of one shade."""
    channels = {}
    for number, name in enumerate(names):
        prefix = "" if name == default else f"{name}."
        channels |= {f"{prefix}{c}": plane for c, plane in planes(number, number + 0.25, number + 0.5).items()}
        channels[f"{prefix}Z"] = np.full((4, 6), 2.0 + number, np.float32)
    order = [default, *(name for name in names if name != default)]
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, "multiView": order}
    OpenEXR.File(header, channels).write(str(path))


@pytest.mark.parametrize("default", ["left", "center", "right"])
def test_views_as_layers_go_from_the_left_to_the_right(tmp_path, default):
    write_views(tmp_path / "a.exr", ["left", "center", "right"], default)
    found = import_views(tmp_path / "a.exr", spacing=0.065, focus_distance=2.0, vfov=40.0)
    assert np.asarray(found.radiance[0, :, 0, 0, 1]).tolist() == [0.25, 1.25, 2.25]
    assert np.asarray(found.layers["depth"][0, :, 0, 0]).tolist() == [2.0, 3.0, 4.0]
    assert np.allclose(found.views.position[0, :, 0], [-0.065, 0.0, 0.065])
    assert import_views(tmp_path / "a.exr").settings["units"] == "views"


def test_a_stereo_picture_in_parts(tmp_path):
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    parts = [
        OpenEXR.Part({**header, "view": "right"}, planes(1, 2, 3), "rgb.right"),
        OpenEXR.Part({**header, "view": "left"}, planes(4, 5, 6), "rgb.left"),
        OpenEXR.Part({**header, "view": "left"}, {"Z": np.ones((4, 6), np.float32)}, "depth.left"),
    ]
    OpenEXR.File(parts).write(str(tmp_path / "a.exr"))
    found = import_views(tmp_path / "a.exr")
    assert np.asarray(found.radiance[0, :, 0, 0]).tolist() == [[4.0, 5.0, 6.0], [1.0, 2.0, 3.0]]
    # The depth of one eye alone is no layer.
    assert found.layers == {}


def test_a_picture_of_one_view_is_no_light_field(tmp_path):
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, planes(1, 2, 3)).write(str(tmp_path / "a.exr"))
    with pytest.raises(InputError, match="is one picture: say --rows and --columns"):
        import_views(tmp_path / "a.exr")
    with pytest.raises(InputError, match="fewer than two views"):
        import_views(tmp_path / "a.exr", layout="multiview")
    OpenEXR.File({**header, "multiView": ["left", "right"]}, planes(1, 2, 3)).write(str(tmp_path / "b.exr"))
    with pytest.raises(InputError, match="fewer than two views"):
        import_views(tmp_path / "b.exr")


def test_views_of_different_sizes_are_refused(tmp_path):
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    # One picture for all, of which each view has a part.
    header["displayWindow"] = ((0, 0), (5, 3))
    small = {name: np.zeros((2, 2), np.float32) for name in "RGB"}
    parts = [
        OpenEXR.Part({**header, "view": "left"}, planes(1, 2, 3), "left"),
        OpenEXR.Part({**header, "view": "right"}, small, "right"),
    ]
    OpenEXR.File(parts).write(str(tmp_path / "a.exr"))
    with pytest.raises(InputError, match="views of different sizes"):
        import_views(tmp_path / "a.exr")


WINDOW = {"dataWindow": ((0, 0), (5, 3)), "displayWindow": ((0, 0), (9, 9))}
OTHER_WINDOWS = {
    "a small depth": ({"Z": np.ones((2, 6), np.float32)}, ((0, 0), (5, 1))),
    "a small colour": ({"B": np.ones((4, 2), np.float32)}, ((0, 0), (1, 3))),
    "a moved colour": ({"B": np.ones((4, 6), np.float32)}, ((1, 0), (6, 3))),
}


@pytest.mark.parametrize("name", OTHER_WINDOWS)
def test_parts_of_a_view_with_other_data_windows_are_refused(tmp_path, name):
    """Compositing programs crop each part to what is not empty."""
    channels, window = OTHER_WINDOWS[name]
    parts = []
    for view in ("left", "right"):
        header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **WINDOW, "view": view}
        rest = {each: plane for each, plane in planes(1, 2, 3).items() if each not in channels}
        parts.append(OpenEXR.Part(header, rest, f"{view}.rgb"))
        parts.append(OpenEXR.Part({**header, "dataWindow": window}, channels, f"{view}.more"))
    OpenEXR.File(parts).write(str(tmp_path / "a.exr"))
    with pytest.raises(InputError, match=r"a\.exr: holds views of different sizes, or parts of them: the data windows"):
        import_views(tmp_path / "a.exr")


@pytest.mark.parametrize("layout", ["multiview", "mosaic"])
def test_a_width_that_is_not_in_the_file_is_refused(tmp_path, layout):
    """A few bytes may claim 2^29 pixels, and NumPy has no type for a row of them."""
    export(light_field(), tmp_path / "a.exr", layout=layout)
    parts = (1, 1) if layout == "multiview" else (ROWS, COLUMNS)
    height, width = parts[0] * HEIGHT, parts[1] * WIDTH
    kind = b"box2i\0" + struct.pack("<iii", 16, 0, 0)
    whole = (tmp_path / "a.exr").read_bytes()
    wide = whole.replace(
        kind + struct.pack("<ii", width - 1, height - 1), kind + struct.pack("<ii", 2**29 - 1, height - 1)
    )
    assert wide != whole
    if layout == "multiview":
        wide = wide.replace(b'"width": 7, ', b'"width": 536870912, ')
        at = wide.index(b"rt.lightfield\0string\0") + len(b"rt.lightfield\0string\0")
        (size,) = struct.unpack("<i", wide[at : at + 4])
        wide = wide[:at] + struct.pack("<i", size + len(wide) - len(whole)) + wide[at + 4 :]
    (tmp_path / "a.exr").write_bytes(wide)
    views = {"rows": ROWS, "columns": COLUMNS} if layout == "mosaic" else {}
    with pytest.raises(InputError, match=r"a\.exr") as told:
        import_views(tmp_path / "a.exr", layout=layout, **views)
    assert "\n" not in str(told.value)


@pytest.mark.skipif(not os.path.isdir("/dev/fd"), reason="lists the files of a process")
def test_a_file_of_many_views_takes_one_descriptor(tmp_path):
    export(light_field(), tmp_path / "a.exr")
    before = len(os.listdir("/dev/fd"))
    found = import_views(tmp_path / "a.exr")
    assert len(os.listdir("/dev/fd")) <= before + 1
    assert found.radiance.shape[:2] == (ROWS, COLUMNS)


def test_a_broken_file_is_told_in_a_sentence(tmp_path):
    field = light_field()
    export(field, tmp_path / "a.exr")
    whole = (tmp_path / "a.exr").read_bytes()
    for length in (0, 3, 100, 700, len(whole) // 2, len(whole) - 1):
        (tmp_path / "a.exr").write_bytes(whole[:length])
        with pytest.raises(InputError, match=r"a\.exr") as told:
            np.asarray(import_views(tmp_path / "a.exr").radiance)
        assert "\n" not in str(told.value)


def test_a_geometry_that_lies_is_refused(tmp_path):
    """Sizes are those of the file, whatever its own attribute says."""
    field = light_field()
    export(field, tmp_path / "a.exr")
    whole = (tmp_path / "a.exr").read_bytes()
    at = whole.index(b"rt.lightfield\0string\0") + len(b"rt.lightfield\0string\0")
    (size,) = struct.unpack("<i", whole[at : at + 4])
    stated = json.loads(whole[at + 4 : at + 4 + size])
    lies = {
        "is the geometry of 11 views, and there are 12": {
            "position": [stated["position"][0] + stated["position"][1] + stated["position"][2][:3]]
        },
        r"is the geometry of views .*; there are": {"width": WIDTH + 1},
        "does not say the types of its channels": {"channels": {"R": "f8"}},
        "has other channels than it says": {"channels": {**stated["channels"], "X": "f4"}},
        "has not the channels of its layers": {"layers": {"depth": ["Z"]}},
        "is no geometry of a light field": {"pixel": "wide"},
        "layer lit must have one number a pixel": {"layers": {"lit": ["R", "G", "B"]}},
        "layer depth must have one number a pixel": {"layers": {"depth": ["R", "G", "B"]}},
        "no layer can be called 'a/b'": {"layers": {"a/b": ["R"]}},
        r"no layer can be called '\.'": {"layers": {".": ["R"]}},
        "no layer can be called ''": {"layers": {"": ["R"]}},
        r"no layer can be called 'a\\x00b'": {"layers": {"a\0b": ["R"]}},
    }
    for sentence, keys in lies.items():
        # As long as it was: its end is blanks.
        text = json.dumps({**stated, **keys}, separators=(",", ":")).encode()
        assert len(text) <= size
        (tmp_path / "a.exr").write_bytes(whole[: at + 4] + text.ljust(size) + whole[at + 4 + size :])
        with pytest.raises(InputError, match=sentence):
            np.asarray(import_views(tmp_path / "a.exr").radiance)


def test_a_light_field_of_one_view_is_a_picture(tmp_path):
    views = Views(np.zeros((1, 1, 2)), Plane(0.1, -0.3, 0.2), 6, 4)
    field = LightField(np.random.default_rng(0).random((1, 1, 4, 6, 3)).astype(np.float32), views)
    export(field, tmp_path / "a.exr")
    found = import_views(tmp_path / "a.exr", layout="multiview")
    assert np.array_equal(np.asarray(found.radiance), field.radiance)
