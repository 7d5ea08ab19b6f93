"""One picture of all views: side by side or interleaved, in any type, written and read in parts."""

import dataclasses
import struct
import zlib

import numpy as np
import OpenEXR
import PIL.Image
import pytest

from raytracer.film import image_file
from raytracer.film.light_field import lf
from raytracer.film.light_field.field import LightField
from raytracer.film.light_field.views import Plane, Pose, Views
from raytracer.lightfield.formats.base import picture_rows
from raytracer.lightfield.formats.base.stored_picture import open_stored
from raytracer.lightfield.formats.exporter import export, export_views
from raytracer.lightfield.formats.importer import import_views
from raytracer.util import srgb
from raytracer.util.errors import InputError

ROWS, COLUMNS, HEIGHT, WIDTH = 3, 4, 5, 7
POSE = Pose((1.0, 2.0, 3.0), (1.0, 0.0, 0.0), (0.0, 0.8, 0.6), (0.0, 0.6, -0.8))


def light_field(dtype=np.float32, **layers):
    right = 0.02 * (np.arange(COLUMNS) - 1.5)
    up = 0.03 * (1.0 - np.arange(ROWS))
    position = np.stack(np.broadcast_arrays(right, up[:, None]), axis=-1)
    views = Views(position, Plane(0.01, -0.035, 0.025), WIDTH, HEIGHT, 0.4, cell=(0.02, 0.03), pose=POSE)
    radiance = np.random.default_rng(3).uniform(0.0, 1.0, (ROWS, COLUMNS, HEIGHT, WIDTH, 3)).astype(dtype)
    return LightField(radiance, views, layers)


def read_back(path, layout):
    return import_views(path, rows=ROWS, columns=COLUMNS, interleaved=layout == "interleaved")


def same_geometry(found, field):
    a, b = found.views, field.views
    assert np.array_equal(a.position, b.position)
    assert (a.plane, a.inverse_focus, a.cell, a.pose) == (b.plane, b.inverse_focus, b.cell, b.pose)


@pytest.mark.parametrize("memory", [1, 3000, None])
@pytest.mark.parametrize("layout", ["mosaic", "interleaved"])
@pytest.mark.parametrize(("suffix", "dtype"), [(".npy", np.float64), (".npy", np.float16), (".exr", np.float32)])
def test_linear_light_is_taken_back_with_all_its_bits(tmp_path, layout, suffix, dtype, memory):
    field = light_field(dtype)
    result = export(field, tmp_path / f"a{suffix}", layout=layout, memory=memory)
    found = read_back(result.files[0], layout)
    assert np.array_equal(np.asarray(found.radiance), field.radiance)
    assert np.array_equal(found.radiance[1, ::2, 1:4, ::-3, 1], field.radiance[1, ::2, 1:4, ::-3, 1])
    same_geometry(found, field)


@pytest.mark.parametrize("name", ["a.npy", "a.exr", "a.png", "a_qs3x4a1.npy"])
@pytest.mark.parametrize("layout", ["mosaic", "interleaved"])
def test_a_picture_is_taken_back_by_the_file_beside_it(tmp_path, layout, name):
    field = light_field()
    export(field, tmp_path / name, layout=layout)
    found = import_views(tmp_path / name)
    same_geometry(found, field)
    # Half a step of 8 bits in sRGB, where it is widest.
    assert np.abs(np.asarray(found.radiance) - field.radiance).max() <= (0.0045 if name == "a.png" else 0.0)


@pytest.mark.parametrize(
    ("layout", "options", "sentence"),
    [
        (
            "interleaved",
            {"layout": "mosaic"},
            "says that a.npy is of the layout interleaved, and it is to be read as mo",
        ),
        (
            "mosaic",
            {"interleaved": True},
            "says that a.npy is of the layout mosaic, and it is to be read as interleaved",
        ),
        ("array", {"rows": ROWS, "columns": COLUMNS}, "--columns is of other layouts than array"),
        ("mosaic", {"rows": HEIGHT}, r"is the geometry of views \(rows, .*\) \(3, 4, 5, 7\); there are \(5, 4, 3, 7\)"),
        ("mosaic", {"layout": "mosaic", "interleaved": True}, "--interleaved is of other layouts than mosaic"),
    ],
)
def test_options_that_contradict_the_file_beside_are_refused(tmp_path, layout, options, sentence):
    field = light_field()
    export(field, tmp_path / "a.npy", layout=layout)
    with pytest.raises(InputError, match=sentence):
        import_views(tmp_path / "a.npy", **options)


def test_the_file_beside_a_picture_means_no_file_of_another_suffix(tmp_path):
    field = light_field()
    export(field, tmp_path / "a.npy")
    export(field, tmp_path / "a.png", layout="interleaved")
    assert np.array_equal(np.asarray(import_views(tmp_path / "a.npy").radiance), field.radiance)


# Layout, and options of imports that it has not.
NOT_TAKEN = [
    ("array", {"rows": 3}),
    ("array", {"flip": "x"}),
    ("transforms", {"rows": 3}),
    ("transforms", {"interleaved": True}),
    ("multiview", {"rows": 3, "columns": 4}),
    ("multiview", {"flip": "y"}),
    ("grid", {"interleaved": True}),
    ("grid", {"allow_files": ["."]}),
    ("mosaic", {"flip": "x"}),
    ("quilt", {"flip": "x"}),
]
FILES = {"array": "a.npy", "multiview": "a.exr", "mosaic": "a.png", "interleaved": "a.png", "quilt": "a_qs2x2a1.png"}


@pytest.mark.parametrize(("layout", "options"), NOT_TAKEN)
def test_an_import_refuses_options_of_other_layouts(tmp_path, layout, options):
    path = tmp_path / FILES.get(layout, "views")
    export(light_field(), path, layout=layout)
    flag = next(iter(options)).replace("_", "-")
    with pytest.raises(InputError, match=f"--({flag}|columns) is of other layouts than {layout}"):
        import_views(path, **options)


@pytest.mark.parametrize("layout", ["grid", "stanford", "hci", "array", "mosaic", "interleaved", "transforms"])
def test_layers_that_are_left_out_are_told(tmp_path, layout):
    shape = (ROWS, COLUMNS, HEIGHT, WIDTH)
    field = light_field(depth=np.ones(shape), lit=np.ones(shape, np.uint8))
    # The benchmark's grids are of one spacing.
    square = dataclasses.replace(field.views, position=field.views.position * [1.5, 1.0])
    result = export(dataclasses.replace(field, views=square), tmp_path / FILES.get(layout, "a"), layout=layout)
    names = "lit" if layout in ("hci", "transforms") else "depth, lit"
    assert result.notes == (f"left out, which the format cannot hold: {names}",)


# The curve of sRGB is steepest at white, 2.4 / 1.055: half a step of its values.
@pytest.mark.parametrize(("bits", "tolerance"), [(8, 0.5 / 255.0 * 2.275), (16, 0.5 / 65535.0 * 2.275)])
@pytest.mark.parametrize("layout", ["mosaic", "interleaved"])
def test_display_values_are_taken_back_within_half_a_step(tmp_path, layout, bits, tolerance):
    field = light_field()
    result = export(field, tmp_path / "a.png", layout=layout, bits=bits, memory=1000)
    assert result.clipped == 0.0
    found = read_back(result.files[0], layout)
    assert np.abs(np.asarray(found.radiance) - field.radiance).max() <= tolerance


def test_each_pixel_is_where_its_layout_says(tmp_path):
    field = light_field()
    for layout in ("mosaic", "interleaved"):
        export(field, tmp_path / f"{layout}.npy", layout=layout)
    mosaic, interleaved = np.load(tmp_path / "mosaic.npy"), np.load(tmp_path / "interleaved.npy")
    assert mosaic.shape == interleaved.shape == (ROWS * HEIGHT, COLUMNS * WIDTH, 3)
    for v, u, t, s in [(0, 0, 0, 0), (1, 3, 2, 5), (2, 1, 4, 6)]:
        assert np.array_equal(mosaic[v * HEIGHT + t, u * WIDTH + s], field.radiance[v, u, t, s])
        assert np.array_equal(interleaved[t * ROWS + v, s * COLUMNS + u], field.radiance[v, u, t, s])


def pixels_of(path):
    """Unpack a .png file of 16 bits with rows filtered by the row above, by the standard alone."""
    data = path.read_bytes()
    assert data.startswith(b"\x89PNG\r\n\x1a\n")
    chunks, at = [], 8
    while at < len(data):
        (size,) = struct.unpack(">I", data[at : at + 4])
        kind, body = data[at + 4 : at + 8], data[at + 8 : at + 8 + size]
        assert struct.unpack(">I", data[at + 8 + size : at + 12 + size])[0] == zlib.crc32(kind + body)
        chunks.append((kind, body))
        at += 12 + size
    assert chunks[0][0] == b"IHDR"
    assert chunks[-1] == (b"IEND", b"")
    width, height, bits, colour, *others = struct.unpack(">IIBBBBB", chunks[0][1])
    assert (bits, colour, others) == (16, 2, [0, 0, 0])
    rows = np.frombuffer(zlib.decompress(b"".join(body for kind, body in chunks if kind == b"IDAT")), np.uint8)
    rows = rows.reshape(height, 1 + 6 * width)
    assert (rows[:, 0] == 2).all()
    return np.cumsum(rows[:, 1:], axis=0, dtype=np.uint8).view(">u2").reshape(height, width, 3)


def test_a_png_of_16_bits_is_what_the_standard_says(tmp_path):
    field = light_field()
    export(field, tmp_path / "a.png", layout="mosaic", bits=16, memory=500)
    whole = field.radiance.swapaxes(1, 2).reshape(ROWS * HEIGHT, COLUMNS * WIDTH, 3)
    assert np.array_equal(pixels_of(tmp_path / "a.png"), np.rint(65535.0 * srgb.encode(whole)))
    with PIL.Image.open(tmp_path / "a.png") as picture:
        assert picture.size == (COLUMNS * WIDTH, ROWS * HEIGHT)
        picture.load()


@pytest.mark.parametrize("naming", ["grid", "stanford", "hci"])
def test_views_of_16_bits_are_taken_back(tmp_path, naming):
    field = light_field()
    position = field.views.position * [1.0, 2.0 / 3.0]
    even = LightField(field.radiance, Views(position, Plane(0.01, -0.035, 0.025), WIDTH, HEIGHT, 0.4, pose=POSE))
    result = export_views(even, tmp_path, naming=naming, bits=16)
    first = pixels_of(result.files[0])
    assert np.array_equal(first, np.rint(65535.0 * srgb.encode(field.radiance[0, 0])))
    found = import_views(tmp_path)
    assert np.abs(np.asarray(found.radiance) - field.radiance).max() <= 0.5 / 65535.0 * 2.275
    assert np.allclose(found.views.position, position, rtol=0.0, atol=1e-12)
    with pytest.raises(InputError, match=r"--bits are of \.png, and views are \.exr"):
        export_views(even, tmp_path / "b", suffix=".exr", bits=16)


def test_exr_files_in_parts_are_read_by_the_library(tmp_path):
    field = light_field(np.float16)
    export(field, tmp_path / "a.exr", layout="mosaic", memory=700)
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        planes = {name: channel.pixels for name, channel in file.channels().items()}
    whole = field.radiance.swapaxes(1, 2).reshape(ROWS * HEIGHT, COLUMNS * WIDTH, 3)
    for number, name in enumerate("RGB"):
        assert planes[name].dtype == np.float16
        assert np.array_equal(planes[name], whole[..., number])
    # Another program's file, compressed, is read as well.
    image = {name: np.ascontiguousarray(whole[..., i], np.float32) for i, name in enumerate("RGB")}
    header = {"compression": OpenEXR.PIZ_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, image).write(str(tmp_path / "b.exr"))
    assert np.array_equal(np.asarray(read_back(tmp_path / "b.exr", "mosaic").radiance), field.radiance)


def test_a_picture_is_written_in_rows_that_fit_into_memory(tmp_path, monkeypatch):
    """The rows that are asked for at a time are those of `--memory`, whichever layout the picture has."""
    asked = []

    class Watched:
        shape, dtype = (ROWS, COLUMNS, 400, WIDTH, 3), np.dtype(np.float32)

        def __getitem__(self, index):
            part = np.broadcast_to(np.float32(0.5), self.shape)[index]
            asked.append(part.size * 16)
            return part

    views = Views(light_field().views.position, Plane(0.01, -0.035, 0.025), WIDTH, 400, 0.4)
    for layout in ("mosaic", "interleaved"):
        asked.clear()
        export(LightField(Watched(), views), tmp_path / "a.npy", layout=layout, memory=100_000)
        assert len(asked) > 10
        assert max(asked) <= 100_000
        assert sum(asked) == 16 * np.prod(Watched.shape)


def test_an_array_is_mapped_and_integers_are_display_values(tmp_path):
    values = np.random.default_rng(1).integers(0, 65536, (4, 6, 3), dtype=np.uint16)
    np.save(tmp_path / "a.npy", values)
    assert isinstance(open_stored(tmp_path / "a.npy").pixels, np.memmap)
    found = import_views(tmp_path / "a.npy", rows=2, columns=3)
    assert np.allclose(found.radiance[1, 2], srgb.decode(values[2:, 4:] / 65535.0), rtol=0.0, atol=1e-15)


def test_a_light_field_in_a_file_goes_to_a_picture_and_back(tmp_path):
    field = light_field()
    lf.write(tmp_path / "a.lf", field)
    with lf.open(tmp_path / "a.lf") as stored:
        export(stored, tmp_path / "a.exr", layout="interleaved")
    lf.write(tmp_path / "b.lf", read_back(tmp_path / "a.exr", "interleaved"))
    with lf.open(tmp_path / "b.lf") as found:
        assert np.array_equal(np.asarray(found.radiance), field.radiance)
        same_geometry(found, field)


WRONG = {
    "a suffix": ("a.bmp", "mosaic", {}, r"unknown suffix '.bmp' for a picture of all views; known: .png, .exr, .npy"),
    "bits": ("a.exr", "mosaic", {"bits": 16}, r"--bits are of \.png"),
    "a device": ("a.png", "interleaved", {"device": "go"}, "--device is of other layouts than interleaved"),
    "a layout": ("a.png", "lytro", {}, "layout must be one of transforms, quilt, interleaved"),
    "no format": ("a.lf", None, {}, "names no format of light fields: choose one by --layout: transforms"),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_picture_that_cannot_be_is_refused(tmp_path, name):
    file, layout, options, sentence = WRONG[name]
    with pytest.raises(InputError, match=sentence):
        export(light_field(), tmp_path / file, layout=layout, **options)
    assert list(tmp_path.iterdir()) == []


def test_a_broken_picture_is_told_in_a_sentence(tmp_path):
    export(light_field(), tmp_path / "a.exr", layout="mosaic")
    export(light_field(), tmp_path / "a.npy", layout="mosaic")
    export(light_field(), tmp_path / "a.png", layout="mosaic")
    for name in ("a.exr", "a.npy", "a.png"):
        whole = (tmp_path / name).read_bytes()
        # Pillow does not miss the last bytes of a .png file, which hold no pixel.
        for length in (0, 9, 100, len(whole) // 2, len(whole) - 1)[: 4 if name == "a.png" else 5]:
            (tmp_path / name).write_bytes(whole[:length])
            with pytest.raises(InputError, match=name) as told:
                np.asarray(read_back(tmp_path / name, "mosaic").radiance)
            assert "\n" not in str(told.value)
    np.save(tmp_path / "c.npy", np.zeros((2, 2, 2)))
    with pytest.raises(InputError, match=r"must be \(height, width, 3\) of floating-point numbers"):
        import_views(tmp_path / "c.npy", rows=1, columns=1)


def test_rows_of_a_png_are_packed_as_they_come(tmp_path):
    values = np.random.default_rng(5).random((9, 4, 3))
    for number, parts in enumerate(([9], [1] * 9, [4, 5])):
        path = tmp_path / f"{number}.png"
        with picture_rows.open_picture(path, 4, 9, bits=8, dtype=np.dtype(np.float32)) as put:
            for part in np.split(values, np.cumsum(parts)[:-1]):
                put(part)
        assert np.array_equal(image_file.load(path), srgb.decode(srgb.to_uint8(values) / 255.0))
