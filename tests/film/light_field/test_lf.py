"""`.lf` files: what is written is read again, only what is needed is read, and what is wrong is told in a sentence."""

import contextlib
import dataclasses
import os
import subprocess
import sys
import textwrap
import zlib
from pathlib import Path

import h5py
import numpy as np
import pytest

from raytracer.film.light_field import lf
from raytracer.film.light_field.field import LightField, Rays
from raytracer.film.light_field.lf.stored_array import RAYS_PER_TILE
from raytracer.film.light_field.views import Plane, Pose, Views
from raytracer.util.errors import InputError, OutputError

POSE = Pose((1.0, 2.0, 3.0), (1.0, 0.0, 0.0), (0.0, 0.8, 0.6), (0.0, 0.6, -0.8))


def views(rows=2, columns=3, width=20, height=15, seed=0):
    position = np.random.default_rng(seed).normal(size=(rows, columns, 2))
    return Views(position, Plane(0.01, -0.1, 0.07), width, height, 0.4, (0.1, 0.2), 0.5, 50.0, POSE)


def light_field(**sizes):
    rng = np.random.default_rng(1)
    geometry = views(**sizes)
    size = (geometry.rows, geometry.columns, geometry.height, geometry.width)
    layers = {
        "depth": rng.uniform(1.0, 9.0, size),
        "normal": rng.normal(size=(*size, 3)),
        "object_id": rng.integers(0, 2**32, size, dtype=np.uint32),
    }
    rays = Rays(rng.normal(size=(50, 4)), rng.random((50, 3)), rng.random(50))
    settings = {"spp": 16, "noise": 0.25, "seed": 2**32 - 1, "scene": "käse.yaml", "empty": ""}
    return LightField(rng.random((*size, 3)), geometry, layers, rays, settings)


def same_views(a, b):
    assert np.array_equal(a.position, b.position)
    others = [field.name for field in dataclasses.fields(a) if field.name != "position"]
    assert [getattr(a, name) for name in others] == [getattr(b, name) for name in others]


@pytest.fixture
def written(tmp_path):
    path = tmp_path / "a.lf"
    lf.write(path, light_field())
    return path


@pytest.mark.parametrize("compress", [False, True])
@pytest.mark.parametrize("dtype", lf.TYPES)
def test_what_is_written_is_read_again(tmp_path, dtype, compress):
    field = light_field()
    lf.write(tmp_path / "a.lf", field, dtype=dtype, compress=compress)
    with lf.open(tmp_path / "a.lf") as found:
        same_views(found.views, field.views)
        assert np.array_equal(found.radiance, field.radiance.astype(dtype))
        assert found.radiance.dtype == dtype
        layer = np.promote_types(dtype, np.float32)
        assert np.array_equal(found.layers["depth"], field.layers["depth"].astype(layer))
        assert np.array_equal(found.layers["normal"], field.layers["normal"].astype(layer))
        assert np.array_equal(found.layers["object_id"], field.layers["object_id"])
        assert all(map(np.array_equal, found.rays, field.rays))
        assert found.settings == field.settings
        assert {key: type(value) for key, value in found.settings.items()} == {
            key: type(value) for key, value in field.settings.items()
        }


def test_more_rays_than_a_tile_holds_are_all_kept(tmp_path):
    count = 2 * RAYS_PER_TILE + 3
    rays = Rays(np.arange(4.0 * count).reshape(-1, 4), np.arange(3.0 * count).reshape(-1, 3), np.arange(1.0 * count))
    lf.write(tmp_path / "a.lf", dataclasses.replace(light_field(), rays=rays))
    with lf.open(tmp_path / "a.lf") as found:
        assert all(np.array_equal(a, b) for a, b in zip(found.rays, rays, strict=True))


def test_it_is_told_in_a_line(tmp_path):
    field = light_field()
    lf.write(tmp_path / "a.lf", field)
    with lf.open(tmp_path / "a.lf") as opened:
        for either in (field, opened):
            views = field.views
            assert f"{views.columns} x {views.rows} views of {views.width} x {views.height}" in repr(either)
            assert len(repr(either)) < 100


def test_what_is_not_known_stays_unknown(tmp_path):
    geometry = Views(np.zeros((1, 1, 2)), Plane(1.0, 0.0, 0.0), 2, 3)
    lf.write(tmp_path / "a.lf", LightField(np.ones((1, 1, 3, 2, 3)), geometry))
    found = lf.open(tmp_path / "a.lf")
    same_views(found.views, geometry)
    assert (found.layers, found.rays, found.settings) == ({}, None, {})


def test_views_may_come_in_any_order_and_a_missing_one_leaves_nothing(tmp_path):
    field = light_field()
    places = [(1, 2), (0, 0), (1, 0), (0, 1), (0, 2), (1, 1)]
    with lf.Writer(tmp_path / "a.lf", field.views) as writer:
        for row, column in places:
            assert not (tmp_path / "a.lf").exists()
            writer.put_view(row, column, field.radiance[row, column])
        writer.settings["spp"] = 4
    found = lf.open(tmp_path / "a.lf")
    assert np.array_equal(found.radiance, field.radiance.astype(np.float32))
    assert found.settings == {"spp": 4}

    def all_but_one():
        with lf.Writer(tmp_path / "b.lf", field.views) as writer:
            for row, column in places[:-1]:
                writer.put_view(row, column, field.radiance[row, column])

    with pytest.raises(ValueError, match="1 views were not written"):
        all_but_one()
    assert os.listdir(tmp_path) == ["a.lf"]


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (lambda w, f: w.put(0, f.radiance[:, :2]), "must be rows of views"),
        (lambda w, f: w.put_view(0, 0, f.radiance[0, 0, :5]), r"must be a view of \(15, 20\)"),
        (lambda w, f: w.put_view(0, 0, f.radiance[0, 0, ..., :2]), "must be a view of"),
        (lambda w, f: w.put_view(2, 0, f.radiance[0, 0]), "is written already, or is not there"),
        (lambda w, f: (w.put(0, f.radiance), w.put(0, f.radiance)), "is written already"),
        (
            lambda w, f: (w.put(0, f.radiance[:1]), w.put(1, f.radiance[1:], {"depth": f.layers["depth"][1:]})),
            "layers must be",
        ),
    ],
)
def test_what_does_not_fit_is_told_to_who_writes(tmp_path, call, sentence):
    field = light_field()
    with pytest.raises(ValueError, match=sentence), lf.Writer(tmp_path / "a.lf", field.views) as writer:
        call(writer, field)
    assert os.listdir(tmp_path) == []


def test_rt_lightfield_has_it(written):
    import raytracer as rt

    with rt.lightfield.open(written) as field:
        assert field.views.rows == 2
    with pytest.raises(AttributeError):
        _ = rt.lightfield.nothing


def test_names_are_not_hidden_by_modules():
    # Once imported, a module is an attribute of its package, in the place of a function of that name.
    import raytracer.lightfield

    folder = Path(raytracer.lightfield.__file__).parent
    modules = {path.stem for path in folder.iterdir()}
    assert not modules & set(raytracer.lightfield.__all__)
    assert set(raytracer.lightfield.__all__) == set(raytracer.lightfield._HOMES)
    for name in raytracer.lightfield.__all__:
        assert getattr(raytracer.lightfield, name) is not None


KEYS = [
    (1, 2),
    (..., 0),
    (slice(None), 1),
    (-1, slice(None, None, -1)),
    (0, 0, slice(12, 2, -3), slice(5, 9)),
    ([1, 0], slice(1, 3)),
    (slice(None), [0, 2], [3, 4]),
    (np.array([True, False]),),
    (0, slice(2, 1)),
    (np.int64(1), np.uint8(0), ..., slice(0, 2)),
]


@pytest.mark.parametrize("key", KEYS, ids=str)
def test_parts_are_those_of_the_array(written, key):
    field = lf.open(written)
    assert np.array_equal(field.radiance[key], np.asarray(field.radiance)[key])


def test_indices_that_are_not_there_are_index_errors(written):
    radiance = lf.open(written).radiance
    for key in (2, (0, 3), (0, 0, 0, 0, 0, 0), None, "a", (0, 1.5)):
        with pytest.raises(IndexError):
            radiance[key]


@pytest.mark.skipif(not Path("/proc/self/io").exists(), reason="counts by Linux's own")
def test_a_crop_reads_its_own_tiles_only(tmp_path):
    geometry = views(rows=3, columns=3, width=512, height=384)
    rng = np.random.default_rng(0)
    with lf.Writer(tmp_path / "a.lf", geometry) as writer:
        for place in np.ndindex(3, 3):
            writer.put_view(*place, rng.random((384, 512, 3)))
    field = lf.open(tmp_path / "a.lf")

    def read(act):
        def count():
            return int(Path("/proc/self/io").read_text().split()[1])

        before = count()
        act()
        return count() - before

    # Tiles of 128 x 128 pixels of three float32: what a window touches, and a little for their index.
    tile = 128 * 128 * 3 * 4
    assert read(lambda: field.radiance[1, 1, 130:200, 260:380]) < 1.1 * tile
    assert read(lambda: field.radiance[:, :, 0:100, 0:100]) < 9 * 1.1 * tile
    assert read(lambda: field.radiance[2, 2]) < 12 * 1.1 * tile
    assert read(lambda: lf.open(tmp_path / "a.lf")) < 0.2 * tile


def test_the_file_is_what_its_document_says(written):
    with h5py.File(written) as file:
        radiance = file["radiance"]
        assert [axis.label for axis in radiance.dims] == ["v", "u", "t", "s", "channel"]
        assert radiance.dims[2][0].name == "/t"
        assert radiance.dims[3][0].name == "/s"
        # Middles of pixels, from the left and the top edge.
        assert np.allclose(file["s"][()], -0.1 + 0.01 * (np.arange(20) + 0.5), rtol=0.0, atol=1e-15)
        assert np.allclose(file["t"][()], 0.07 - 0.01 * (np.arange(15) + 0.5), rtol=0.0, atol=1e-15)
        assert file.attrs["format"] == b"rt light field"
        assert file.attrs["version"] == 1
        assert file.attrs["focus_distance"] == 2.5
        assert file.attrs["aperture_unit"] == b"m"
        assert np.array_equal(file.attrs["pose"], np.array(POSE))


def test_tiles_waste_little(tmp_path):
    # 320 x 288 pixels in tiles of 128 x 128 would take 1.6 times as much as they hold.
    geometry = views(rows=1, columns=2, width=320, height=288)
    lf.write(tmp_path / "a.lf", LightField(np.zeros((1, 2, 288, 320, 3)), geometry))
    assert (tmp_path / "a.lf").stat().st_size < 1.05 * 2 * 288 * 320 * 3 * 4


@contextlib.contextmanager
def plain(path, position):
    """A file with no more than a light field has to have, but for its radiance."""
    with h5py.File(path, "w") as file:
        file["position"] = position
        file.attrs["format"] = np.bytes_("rt light field")
        file.attrs.update({"version": 1, "pixel": 0.5, "left": -1, "top": 0.75, "inverse_focus": 0})
        yield file


def test_a_file_of_another_program_may_be_plain(tmp_path):
    with plain(tmp_path / "a.lf", np.array([[[-1, 0], [1, 0]]], dtype=np.float32)) as file:
        file["radiance"] = np.arange(72, dtype=">f8").reshape(1, 2, 3, 4, 3)
    found = lf.open(tmp_path / "a.lf")
    assert found.radiance[0, 1, 2, 3].tolist() == [69.0, 70.0, 71.0]
    assert found.views.focus_distance == np.inf


def dataset(name, data=None, **options):
    def act(file):
        del file[name]
        file.create_dataset(name, data=data, **options)

    return act


def attribute(name, value):
    return lambda file: file.attrs.__setitem__(name, value)


def without(name):
    return lambda file: file.attrs.__delitem__(name) if name in file.attrs else file.__delitem__(name)


def linked(file):
    del file["radiance"]
    file["radiance"] = h5py.ExternalLink("other.h5", "/radiance")


def virtual(file):
    del file["radiance"]
    layout = h5py.VirtualLayout(SHAPE, "f4")
    layout[...] = h5py.VirtualSource("other.h5", "r", SHAPE)
    file.create_virtual_dataset("radiance", layout)


SHAPE = (2, 3, 15, 20, 3)
HUGE, TILES = (1000, 1000, 100_000, 100_000, 3), (10, 10, 100, 100, 3)
ELSEWHERE = [("/etc/passwd", 0, 21600)]

WRONG = {
    "another HDF5 file": (without("format"), "is an HDF5 file, but no light field"),
    "a newer version": (attribute("version", 7), "is of version 7 of the format; this program reads versions 1 and 2"),
    "no version": (without("version"), "has no attribute version"),
    "no radiance": (without("radiance"), "has no dataset radiance"),
    "another format": (attribute("format", np.bytes_("netcdf")), "no light field"),
    "no positions": (without("position"), "has no dataset position"),
    "nan positions": (dataset("position", np.full((*SHAPE[:2], 2), np.nan)), "must be finite"),
    "negative pixels": (attribute("pixel", -1.0), "have a size"),
    "strings": (dataset("radiance", np.zeros(SHAPE, "S4")), "must be of floating-point numbers"),
    "compounds": (dataset("radiance", np.zeros(SHAPE, [("a", "f4")])), "must be of floating-point numbers"),
    "a layer that is a group": (
        lambda file: (file.__delitem__("layers/depth"), file.create_group("layers/depth")),
        "has no dataset layers/depth",
    ),
    "no pixel": (without("pixel"), "has no attribute pixel"),
    "a text for a number": (attribute("pixel", np.bytes_("wide")), "its attribute pixel must be a number"),
    "an array for a number": (attribute("left", [1.0, 2.0]), "its attribute left must be a number"),
    "a wrong cell": (attribute("cell", [1.0, 2.0, 3.0]), r"its attribute cell must be numbers of shape \(2,\)"),
    "nan geometry": (attribute("inverse_focus", np.nan), "must be finite"),
    "nan pose": (attribute("pose", np.full((4, 3), np.nan)), "its pose must be of finite numbers"),
    "pixels without a size": (attribute("pixel", 0.0), "have a size"),
    "integers": (dataset("radiance", np.zeros(SHAPE, int)), "must be of floating-point numbers, not of int64"),
    "four axes": (dataset("radiance", np.zeros(SHAPE[:4])), "radiance must have 5 axes"),
    "four channels": (dataset("radiance", np.zeros((*SHAPE[:4], 4))), "must have 3 channels .*, not 4"),
    "other positions": (dataset("position", np.zeros((3, 2, 2))), r"position must be of shape \(2, 3, 2\)"),
    "other layers": (dataset("layers/depth", np.zeros((2, 3, 15, 21))), "layer depth must be of shape"),
    "a depth with channels": (dataset("layers/depth", np.zeros(SHAPE)), "layer depth must have one number a pixel"),
    "layers that are an array": (dataset("layers", np.zeros(3)), "layers must be a group"),
    "uneven rays": (dataset("rays/weight", np.zeros(51)), "rays must be of shapes"),
    "half of the rays": (without("rays/value"), "has no dataset rays/value"),
    "an empty axis": (dataset("radiance", np.zeros((2, 3, 0, 20, 3))), "none of them empty"),
    "no values": (dataset("radiance", h5py.Empty("f4")), "must have 5 axes"),
    "a huge array, never written": (dataset("radiance", shape=HUGE, dtype="f4"), "claims to be .*the file holds 0"),
    "huge tiles, never written": (
        dataset("radiance", shape=HUGE, dtype="f4", chunks=TILES, compression="gzip"),
        "claims to be of shape",
    ),
    "a link": (linked, "radiance must be in the file itself, and is a link"),
    "parts of other files": (virtual, "must be in the file itself"),
    "another file's bytes": (
        dataset("radiance", shape=SHAPE, dtype="f4", external=ELSEWHERE),
        "must be in the file itself",
    ),
    "strings that HDF5 may hang in": (attribute("format", "rt light field"), "format must be of fixed length"),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_file_is_told_in_a_sentence(written, name):
    act, sentence = WRONG[name]
    with h5py.File(written, "r+") as file:
        act(file)
    with pytest.raises(InputError, match=sentence) as told:
        lf.open(written)
    assert str(told.value).startswith(f"{written}: ")
    assert "\n" not in str(told.value)


def test_some_views_that_were_never_written(tmp_path):
    with plain(tmp_path / "a.lf", np.zeros((2, 2, 2))) as file:
        made = file.create_dataset("radiance", (2, 2, 8, 8, 3), "f4", chunks=(1, 1, 8, 8, 3), compression="gzip")
        made[0] = 1.0
    with pytest.raises(InputError, match="radiance has 2 of 4 tiles"):
        lf.open(tmp_path / "a.lf")


def packed(path, tile, compression="gzip", **options):
    """A light field of one view, whose radiance is this one tile."""
    shape = (1, 1, 8, 8, 3)
    with plain(path, np.zeros((1, 1, 2))) as file:
        made = file.create_dataset("radiance", shape, "f4", chunks=shape, compression=compression, **options)
        made.id.write_direct_chunk((0, 0, 0, 0, 0), tile)


# 8 x 8 pixels of 3 numbers of 4 bytes.  HDF5 gives back whatever follows in memory where a tile unpacks to less, and
# makes room for all of it where it unpacks to more.
@pytest.mark.parametrize("size", [0, 767, 769, 10_000_000])
def test_a_tile_that_unpacks_to_another_size_is_told(tmp_path, size):
    packed(tmp_path / "a.lf", zlib.compress(bytes(size), 9)[: None if size < 10_000 else 800])
    with pytest.raises(InputError, match=r"a\.lf: radiance is damaged"), lf.open(tmp_path / "a.lf") as field:
        field.radiance[0, 0]
    packed(tmp_path / "b.lf", zlib.compress(bytes(768)))
    with lf.open(tmp_path / "b.lf") as field:
        assert not field.radiance[0, 0].any()


def test_a_bomb_is_told_by_the_room_that_it_takes_or_by_what_it_unpacks_to(tmp_path):
    bomb = zlib.compress(bytes(10_000_000), 9)
    assert len(bomb) > 768 + 64 + 12
    packed(tmp_path / "a.lf", bomb)
    with pytest.raises(InputError, match=r"radiance has a tile of 97.. bytes, which is not what 768 bytes take"):
        lf.open(tmp_path / "a.lf")


def test_tiles_that_cannot_be_checked_are_refused(tmp_path):
    packed(tmp_path / "a.lf", b"x", fletcher32=True)
    with pytest.raises(InputError, match="a tile of 1 bytes, which is not what 768 bytes take"):
        lf.open(tmp_path / "a.lf")
    packed(tmp_path / "b.lf", bytes(500), compression="lzf")
    with pytest.raises(InputError, match="plain or compressed by deflate"):
        lf.open(tmp_path / "b.lf")


@pytest.mark.parametrize("compress", [False, True])
def test_a_truncated_file_is_told(tmp_path, compress):
    lf.write(tmp_path / "a.lf", light_field(), compress=compress)
    whole = (tmp_path / "a.lf").read_bytes()
    for length in np.linspace(0, len(whole) - 1, 20).astype(int):
        (tmp_path / "cut.lf").write_bytes(whole[:length])
        with pytest.raises(InputError, match=r"cut.lf: is (truncated: its end is missing|no \.lf file|damaged)"):
            lf.open(tmp_path / "cut.lf")


@pytest.mark.parametrize("compress", [False, True])
def test_flipped_bits_are_told_or_change_nothing(tmp_path, compress):
    field = light_field()
    lf.write(tmp_path / "a.lf", field, compress=compress)
    whole = (tmp_path / "a.lf").read_bytes()
    rng = np.random.default_rng(5)
    told = []
    for place in rng.integers(0, len(whole), 100):
        data = bytearray(whole)
        data[place] ^= 1 << rng.integers(0, 8)
        (tmp_path / "b.lf").write_bytes(data)
        try:
            with lf.open(tmp_path / "b.lf") as found:
                # NumPy's array_equal takes what cannot be read for unequal.
                assert np.array_equal(np.asarray(found.radiance), field.radiance.astype(np.float32))
                same_views(found.views, field.views)
                for array in (*found.layers.values(), *found.rays):
                    np.asarray(array)
        except InputError as error:
            told.append(str(error))
    assert len(told) > 30
    assert not any("\n" in sentence for sentence in told)


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda path: None, "no such file"),
        (lambda path: path.mkdir(), "is a folder, not an .lf file"),
        (lambda path: path.write_bytes(b""), r"is no \.lf file \(not HDF5\)"),
        (lambda path: path.write_text("radiance: 3"), r"is no \.lf file \(not HDF5\)"),
        (os.mkfifo, "is no regular file"),
        (lambda path: path.symlink_to(path), "cannot be read: "),
    ],
)
@pytest.mark.skipif(os.name != "posix", reason="pipes and links")
def test_what_is_no_file_is_told(tmp_path, make, sentence):
    make(tmp_path / "a.lf")
    with pytest.raises(InputError, match=sentence):
        lf.open(tmp_path / "a.lf")


def test_names_that_no_system_takes():
    for name in ("a\0b.lf", "x" * 5000 + ".lf"):
        with pytest.raises(InputError, match="cannot be read"):
            lf.open(name)


def test_a_closed_file_says_so(written):
    with lf.open(written) as field:
        pass
    with pytest.raises(InputError, match="has been closed"):
        field.view(0, 0)


def test_an_error_on_the_way_leaves_what_was_there(tmp_path):
    (tmp_path / "a.lf").write_text("old")
    field = light_field()
    with contextlib.suppress(RuntimeError), lf.Writer(tmp_path / "a.lf", field.views) as writer:
        writer.put(0, field.radiance[:1])
        raise RuntimeError
    assert (tmp_path / "a.lf").read_text() == "old"
    assert os.listdir(tmp_path) == ["a.lf"]


@pytest.mark.skipif(sys.platform == "win32", reason="limits of processes")
@pytest.mark.parametrize("compress", [False, True])
def test_a_full_disk_is_told_and_nothing_is_left(tmp_path, compress):
    # HDF5 ends a process at its exit that could not write a file, so that the process's end is of interest too.
    (tmp_path / "a.lf").write_text("old")
    script = f"""
        import resource
        import numpy as np
        from raytracer.util.errors import OutputError
        from raytracer.film.light_field import lf
        from raytracer.film.light_field.field import LightField
        from raytracer.film.light_field.views import Plane, Views

        views = Views(np.zeros((2, 2, 2)), Plane(0.1, 0.0, 0.0), 200, 200)
        resource.setrlimit(resource.RLIMIT_FSIZE, (300_000, 300_000))
        field = LightField(np.random.default_rng(0).random((2, 2, 200, 200, 3)), views)
        try:
            lf.write({str(tmp_path / "a.lf")!r}, field, compress={compress})
        except OutputError as error:
            print(error)
    """
    ended = subprocess.run([sys.executable, "-c", textwrap.dedent(script)], capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stderr) == (0, "")
    assert ended.stdout == f"{tmp_path / 'a.lf'}: cannot be written: File too large\n"
    assert (tmp_path / "a.lf").read_text() == "old"
    assert os.listdir(tmp_path) == ["a.lf"]


def test_a_folder_that_cannot_be_made(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match="cannot be written"):
        lf.write(tmp_path / "file" / "a.lf", light_field())
