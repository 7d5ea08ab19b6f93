"""Containers of Lytro's, written by `lytro_files`: what is in them is read, and decoded it is the scene."""

import json
import struct
import tarfile

import numpy as np
import pytest

from raytracer.lightfield.decoding.lytro.container import Container, is_container
from raytracer.lightfield.decoding.lytro.decode import decode_photo
from raytracer.lightfield.decoding.lytro.export import write_raw
from raytracer.lightfield.decoding.lytro.metadata import read_metadata
from raytracer.lightfield.decoding.lytro.optics import PupilOptics, focus_from_metadata, optics_from_metadata
from raytracer.lightfield.decoding.lytro.packing import unpack_pixels
from raytracer.lightfield.decoding.lytro.photo import open_photo
from raytracer.lightfield.decoding.lytro.white_pictures import choose_white_picture, find_white_pictures
from raytracer.lightfield.decoding.microlens_grid import Grid, Optics
from raytracer.util.errors import InputError
from raytracer.util.safe_open import BrokenFileError
from tests.lightfield import lytro_files
from tests.lightfield.lenslet_pictures import Camera, lattice, texture
from tests.lightfield.lytro_files import F01, ILLUM

SLOPE = 0.5
PITCH = 10.02
SIZE = (420, 330)


@pytest.fixture(scope="module")
def drawn():
    """A camera, its light from something white, and from a scene in three colours."""
    camera = Camera(lattice(PITCH, 0.05, (5.3, 4.1), hexagonal=True), *SIZE)
    return camera, camera.picture(), camera.picture(lambda x, y: texture(x, y, 12.0 * PITCH), SLOPE)


def _codes(drawn, camera, colors):
    _, white, scene = drawn
    grey = np.repeat(0.8 * white[..., None], 3, axis=2)
    return (
        lytro_files.mosaic(0.7 * scene, camera, colors=colors),
        lytro_files.mosaic(grey * np.array([0.7, 1.0, 0.6]), camera),
    )


def _relative_rms(decoded, row, column):
    """Of a view against the scene as it was drawn, but for one factor of brightness."""
    resampler = decoded.resampler
    x = resampler.first[0] + resampler.pixel * np.arange(resampler.width)
    y = resampler.first[1] + resampler.pixel * np.arange(resampler.height)
    right, down = resampler.offset(row, column)
    true = texture(*np.meshgrid(x + SLOPE * right, y + SLOPE * down), 12.0 * PITCH)
    seen = decoded.view(row, column)[2:-2, 2:-2]
    true = true[2:-2, 2:-2]
    seen = seen * ((seen * true).sum() / (seen * seen).sum())
    return float(np.sqrt(((seen - true) ** 2).mean() / (true**2).mean()))


# ---- Pixels


def test_packed_pixels_of_the_descriptions():
    # miloush, "The File Format": a white pixel and a black one are FF F0 00; 12 34 56 is 123, 456.
    assert unpack_pixels(bytes.fromhex("fff000123456"), 2, 2, 12, "big").tolist() == [[0xFFF, 0], [0x123, 0x456]]
    # LFToolbox: the lower two bits of four pixels are in the fifth byte, the first pixel's lowest.
    assert unpack_pixels(bytes([255, 0, 1, 2, 0b11_10_01_00]), 2, 2, 10, "little").tolist() == [[1020, 1], [6, 11]]


@pytest.mark.parametrize(("bits", "endianness"), [(12, "big"), (10, "little")])
@pytest.mark.parametrize("shape", [(3, 5), (4, 6), (1, 1)])
def test_packed_pixels_are_unpacked(bits, endianness, shape):
    codes = np.random.default_rng(1).integers(0, 1 << bits, shape).astype(np.uint16)
    data = lytro_files.packed(codes, bits)
    assert np.array_equal(unpack_pixels(data, shape[1], shape[0], bits, endianness), codes)
    with pytest.raises(BrokenFileError, match="bytes of pixels"):
        unpack_pixels(data[:-3], shape[1], shape[0], bits, endianness)


def test_whole_words_are_pixels_too():
    assert unpack_pixels(b"\x01\x02", 1, 1, 16, "big").tolist() == [[0x102]]
    assert unpack_pixels(b"\x01\x02", 1, 1, 16, "little").tolist() == [[0x201]]
    assert unpack_pixels(b"\x01\x02", 2, 1, 8, "").tolist() == [[1, 2]]
    with pytest.raises(BrokenFileError, match="12 bits, little-endian"):
        unpack_pixels(b"\x01\x02", 1, 1, 12, "little")


@pytest.mark.parametrize("first", ["r", "gr", "gb", "b"])
def test_levels_of_filters_lie_where_the_filters_are(first):
    values = lytro_files.metadata(4, 4, {**F01, "first": first})
    names = np.array([["r", "gr"], ["gb", "b"]])
    at = np.argwhere(names == first)[0]
    turned = np.roll(names, -at, axis=(0, 1))
    details = values["image"]["rawDetails"] if "rawDetails" in values["image"] else values["image"]
    details["pixelFormat"]["black"] = {"r": 1, "gr": 2, "gb": 3, "b": 4}
    told = read_metadata(values)
    assert told.bayer == "".join(name[0] for name in turned.ravel())
    expected = [[details["pixelFormat"]["black"][name] for name in row] for row in turned]
    assert told.filter_levels(told.black).tolist() == expected


# ---- Containers


def test_sections_of_a_container(tmp_path):
    path = tmp_path / "a.lfp"
    parts = (b"one", b"", bytes(16), b"\x89LF in the data")
    path.write_bytes(lytro_files.container({"generator": "test"}, *parts))
    assert is_container(path)
    with Container(path) as held:
        assert held.contents == {"generator": "test"}
        assert [held.read(lytro_files.name_of(part)) for part in parts] == list(parts)
        with pytest.raises(InputError, match="has no section 'sha1-0'"):
            held.read("sha1-0")
    # Without the zeros between sections, as some writers leave them out.
    data = path.read_bytes()
    (tmp_path / "b.lfp").write_bytes(data.rstrip(b"\0"))
    with Container(tmp_path / "b.lfp") as held:
        assert len(held.sections) == 1 + len(parts)


def _broken():
    good = lytro_files.container({"a": 1}, b"0123456789")
    long = bytearray(good)
    long[16 + 12 : 16 + 16] = struct.pack(">I", 2**31)
    return {
        "no.lfp": (b"\x89PNG\r\n\x1a\n" + bytes(200), "is no container"),
        "short.lfp": (good[:10], "is cut off"),
        "cut.lfp": (good[:-10], "its section 2 claims 10 bytes"),
        "header.lfp": (good[:150], "is cut off in its section 2"),
        "claims.lfp": (bytes(long), "its section 1 claims 2,147,483,648 bytes"),
        "middle.lfp": (good[:128] + b"garbage!" * 20, "no section begins at byte 128"),
        "empty.lfp": (lytro_files.container({})[:16], "without contents"),
        "list.lfp": (lytro_files.container([1]), "no JSON object"),
        "nan.lfp": (lytro_files.container({"a": float("nan")}), "no JSON"),
        "large.lfp": (lytro_files.container({"a": 10000}).replace(b"10000", b"1e999"), "no JSON"),
        "deep.lfp": (lytro_files.container({}).replace(b"{}", b"[["), "no JSON"),
        "storage.lfp": (lytro_files.package({"a": b"b"}), "holds no photograph, but files of a camera"),
        "stack.lfp": (lytro_files.container({"picture": {"frameArray": []}}), "holds no photograph, but others"),
    }


@pytest.mark.parametrize(("name", "data", "told"), [(name, *case) for name, case in _broken().items()], ids=_broken())
def test_broken_containers(tmp_path, name, data, told):
    (tmp_path / name).write_bytes(data)
    with pytest.raises(InputError, match=told) as error:
        open_photo(tmp_path / name)
    assert str(error.value).startswith(str(tmp_path / name))


@pytest.mark.parametrize(
    ("key", "value", "told"),
    [
        ("image.width", None, "has no image.width"),
        ("image.width", 1.5, "image.width: must be an integer"),
        ("image.width", 1e9, "image.width: must be an integer"),
        ("image.height", "many", "image.height: must be a number"),
        ("image.rawDetails.pixelPacking.bitsPerPixel", 33, "must be an integer from 1 to 16"),
        ("image.rawDetails.pixelPacking.endianness", 3, "must be a string"),
        ("image.rawDetails.pixelFormat.black.gr", 4095, "black of gr, 4095, must be less than white"),
        ("image.rawDetails.mosaic.tile", "c,m:y,k", "are not known"),
        ("image.rawDetails.mosaic.tile", "r,b:gr,gb", "not those of Bayer"),
        ("image.rawDetails.mosaic.upperLeftPixel", "x", "are not known"),
        ("image.color.ccmRgbToSrgbArray", [1, 2], "must be 9 numbers"),
        ("image.color.whiteBalanceGain.r", 0, "must be greater than 0"),
        ("devices.lens.focalLength", -1, "must not be less than 0"),
        ("devices.lens.zoomStep", True, "must be a number"),
        ("image.orientation", 9, "must be an integer from 1 to 8"),
    ],
)
def test_wrong_metadata(tmp_path, key, value, told):
    values = lytro_files.metadata(4, 4, F01, colors=True)
    *parents, last = key.split(".")
    inside = values
    for part in parents:
        inside = inside[part]
    inside[last] = value
    (tmp_path / "a.lfp").write_bytes(lytro_files.photo(np.zeros((4, 4), np.uint16), values))
    with pytest.raises(InputError, match=f"a.lfp: .*{told}"):
        open_photo(tmp_path / "a.lfp")


# ---- White pictures

PLACES = [(0, 0, 0.1), (600, 100, 0.1), (620, 690, 0.001), (620, 690, 0.1), (620, 900, 0.1)]


def _whites(camera=F01, serial="A303134643"):
    whites = []
    for number, (zoom, focus, exposure) in enumerate(PLACES):
        values = lytro_files.metadata(6, 4, camera, zoomStep=zoom, focusStep=focus)
        values["devices"]["shutter"]["pixelExposureDuration"] = exposure
        whites.append((np.full((4, 6), 300 + number, np.uint16), values))
    return lytro_files.white_files(whites, serial)


@pytest.mark.parametrize("place", ["folder", "package", "archive", "raw"])
def test_the_white_picture_nearest_in_zoom_and_focus(tmp_path, place):
    files = _whites()
    folder = tmp_path / "caldata"
    (folder / "below").mkdir(parents=True)
    if place in ("folder", "raw"):
        for name, data in files.items():
            (folder / "below" / name).write_bytes(data)
    else:
        name = "data.C.0" if place == "package" else "caldata-A303134643.tar"
        (folder / "below" / name).write_bytes(
            (lytro_files.package if place == "package" else lytro_files.archive)(files)
        )
    source = folder / "below" / "MOD_0003.RAW" if place == "raw" else folder
    wanted = read_metadata(
        lytro_files.metadata(6, 4, F01, zoomStep=615, focusStep=700), {"camera": {"serialNumber": "A303134643"}}
    )
    chosen = choose_white_picture(find_white_pictures(source), wanted, source)
    assert (chosen.read().codes == 303).all()
    assert chosen.serial == "A303134643"
    if place != "raw":
        near = read_metadata(lytro_files.metadata(6, 4, F01, zoomStep=300, focusStep=0))
        chosen = choose_white_picture(find_white_pictures(source), near, source)
        # Zoom steps 0 and 600 are as near; of these the focus decides.
        assert (chosen.read().codes == 300).all()
        far = read_metadata(lytro_files.metadata(6, 4, F01, zoomStep=601, focusStep=900))
        assert (choose_white_picture(find_white_pictures(source), far, source).read().codes == 301).all()


def test_white_pictures_of_another_camera(tmp_path):
    (tmp_path / "caldata-B1.tar").write_bytes(lytro_files.archive(_whites(ILLUM, serial="B1")))
    pictures = find_white_pictures(tmp_path)
    values = lytro_files.metadata(6, 4, ILLUM)
    with pytest.raises(InputError, match="white pictures of B1, and the photograph is of B2"):
        choose_white_picture(pictures, read_metadata(values, {"camera": {"serialNumber": "B2"}}), tmp_path)
    with pytest.raises(InputError, match="holds no white picture of 8 x 4 pixels"):
        choose_white_picture(pictures, read_metadata(lytro_files.metadata(8, 4, ILLUM)), tmp_path)
    (tmp_path / "none").mkdir()
    with pytest.raises(InputError, match="none: holds no white pictures"):
        find_white_pictures(tmp_path / "none")
    (tmp_path / "none" / "broken.tar").write_bytes(b"no archive" * 100)
    with pytest.raises(InputError, match="is no archive"):
        find_white_pictures(tmp_path / "none")
    name = tarfile.TarInfo("././@LongLink")
    name.type, name.size = tarfile.GNUTYPE_LONGNAME, 2
    (tmp_path / "none" / "broken.tar").write_bytes((name.tobuf() + b"a".ljust(512, b"\0")) * 2000)
    with pytest.raises(InputError, match="is no archive"):
        find_white_pictures(tmp_path / "none")
    cut = lytro_files.archive(_whites())[:1800]
    (tmp_path / "none" / "broken.tar").write_bytes(cut)
    with pytest.raises(InputError, match="holds no white pictures"):
        find_white_pictures(tmp_path / "none" / "broken.tar")


# ---- Decoded


@pytest.mark.parametrize("camera", [F01, ILLUM], ids=["F01", "Illum"])
@pytest.mark.parametrize("colors", ["camera", "white"])
def test_decoded_photographs_are_the_scene(tmp_path, drawn, camera, colors):
    pytest.importorskip("cv2")
    raw, white = _codes(drawn, camera, colors == "camera")
    values = lytro_files.metadata(*SIZE, camera, colors=True)
    name, whites = tmp_path / "a.lfp", tmp_path / "caldata"
    name.write_bytes(lytro_files.photo(raw, values))
    whites.mkdir()
    for file, data in lytro_files.white_files([(white, values)]).items():
        (whites / file).write_bytes(data)
    if colors == "white":
        # The white picture's colour is what the scene is lit by.
        tinted = lytro_files.mosaic(0.7 * drawn[2] * np.array([0.7, 1.0, 0.6]), camera)
        name.write_bytes(lytro_files.photo(tinted, values))
    decoded = decode_photo(name, whites, colors=colors)
    assert "MOD_0000.RAW, zoom step 600 for 600, focus step 700 for 700" in decoded.notes[0]
    assert decoded.grid.lattice.pitch == pytest.approx(PITCH, abs=0.01)
    assert decoded.settings["camera"] == ("Lytro, Inc. F01" if camera is F01 else "Lytro, Inc. ILLUM")
    assert _relative_rms(decoded, 4, 4) < 0.012
    assert _relative_rms(decoded, 2, 5) < 0.02


def test_the_white_picture_in_the_container(tmp_path, drawn):
    pytest.importorskip("cv2")
    raw, white = _codes(drawn, ILLUM, True)
    values = lytro_files.metadata(*SIZE, ILLUM, colors=True)
    (tmp_path / "a.lfr").write_bytes(lytro_files.photo(raw, values, white=white))
    assert _relative_rms(decode_photo(tmp_path / "a.lfr"), 4, 4) < 0.012
    (tmp_path / "w.lfr").write_bytes(lytro_files.photo(white, values))
    (tmp_path / "b.lfr").write_bytes(lytro_files.photo(raw, values))
    by_photo = decode_photo(tmp_path / "b.lfr", tmp_path / "w.lfr")
    assert np.array_equal(by_photo.view(4, 4), decode_photo(tmp_path / "a.lfr").view(4, 4))
    assert "no white picture" in " ".join(decode_photo(tmp_path / "b.lfr").notes)


@pytest.mark.parametrize("camera", [F01, ILLUM], ids=["F01", "Illum"])
def test_the_white_picture_in_files_of_other_programs(tmp_path, drawn, camera):
    """It is the picture that the container holds: its black level is taken off, and colours are left to the gains."""
    pytest.importorskip("cv2")
    raw, white = _codes(drawn, camera, True)
    white[:30] = camera["white"]
    values = lytro_files.metadata(*SIZE, camera, colors=True)
    (tmp_path / "a.lfr").write_bytes(lytro_files.photo(raw, values, white=white))
    (tmp_path / "b.lfr").write_bytes(lytro_files.photo(raw, values))
    grid = Grid(drawn[0].lattice, *SIZE, diameter=9.0)
    inside = decode_photo(tmp_path / "a.lfr", grid=grid)
    for suffix in (".png", ".npy"):
        write_raw(tmp_path / f"white{suffix}", open_photo(tmp_path / "a.lfr").read_white())
    light = (white - float(camera["black"])) / (camera["white"] - camera["black"])
    np.save(tmp_path / "light.npy", (0.3 * light).astype(np.float32))
    for name, is_scale in (("white.png", True), ("white.npy", True), ("light.npy", False)):
        decoded = decode_photo(tmp_path / "b.lfr", tmp_path / name, grid=grid)
        assert decoded.matrix == pytest.approx(inside.matrix)
        assert decoded.scale == pytest.approx(inside.scale, rel=1e-5)
        away = np.abs(decoded.light.astype(np.int64) - inside.light)
        # Demosaicing interpolates along edges, of which rounding turns a few.
        assert (away > 1).mean() < (1e-12 if is_scale else 2e-4)
        # Light has no end of its scale.
        assert any("9.1% of it is clipped" in note and name in note for note in decoded.notes) == is_scale
    np.save(tmp_path / "large.npy", 16 * white)
    with pytest.raises(InputError, match=r"large\.npy: holds codes of up to .*, and the camera's end at"):
        decode_photo(tmp_path / "b.lfr", tmp_path / "large.npy", grid=grid)
    for wrong, told in ((white[:1], "white.npy: has 420 x 1 pixels"), (white[..., None] + [0, 1, 2], "three colours")):
        np.save(tmp_path / "white.npy", wrong.astype(np.float32))
        with pytest.raises(InputError, match=told):
            decode_photo(tmp_path / "b.lfr", tmp_path / "white.npy", grid=grid)


def test_an_exit_pupil_at_the_sensor(tmp_path, drawn):
    pytest.importorskip("cv2")
    raw, _ = _codes(drawn, ILLUM, False)
    lens = {"focalLength": 0.024, "fNumber": 2.0, "exitPupilOffset": {"z": -3e-5}}
    values = lytro_files.metadata(*SIZE, ILLUM, **lens)
    values["devices"]["mla"] = {"lensPitch": 1.4e-5, "sensorOffset": {"z": 3e-5}}
    (tmp_path / "a.lfr").write_bytes(lytro_files.photo(raw, values))
    grid = Grid(drawn[0].lattice, *SIZE, diameter=9.0)
    with pytest.raises(InputError, match=r"a\.lfr: exitPupilOffset\.z of its metadata.* -3e-05 m before"):
        decode_photo(tmp_path / "a.lfr", grid=grid)


def test_what_is_unusual_is_said(tmp_path, drawn):
    pytest.importorskip("cv2")
    raw, white = _codes(drawn, ILLUM, True)
    values = lytro_files.metadata(*SIZE, ILLUM)
    values["devices"]["mla"] = {"lensPitch": 2e-5}
    values["image"]["orientation"] = 6
    raw[:20] = 1023
    (tmp_path / "a.lfr").write_bytes(lytro_files.photo(raw, values, white=white))
    notes = " ".join(decode_photo(tmp_path / "a.lfr").notes)
    assert "a.lfr: 6.1% of it is clipped" in notes
    assert "10.02 pixels apart, and 14.29 by the metadata" in notes
    assert "the camera was turned" in notes


# ---- Metres


def _lens(focal_length, pupils, away):
    """A lens of two planes of pupils: by Newton's equation, places and sizes, all about the focal points (m)."""
    return {"f": focal_length, "P": pupils, "d": away, "z": pupils * focal_length + away}


@pytest.mark.parametrize(
    "lens", [_lens(0.00684, 32.6, 0.000485), _lens(0.0242, 3.96, 0.00149), _lens(0.05, 1.0, 0.003)]
)
def test_metres_are_those_of_a_lens_with_pupils(lens):
    """Rays of two views through the entrance pupil, followed by Gauss's matrices, end in the pixels that saw them."""
    f, pupils, away, exit_pupil = lens["f"], lens["P"], lens["d"], lens["z"]
    behind, pixel = 25e-6, 1.4e-6
    values = lytro_files.metadata(600, 450, F01, focalLength=f, fNumber=2.0, exitPupilOffset={"z": exit_pupil})
    values["devices"]["lens"]["infinityLambda"] = away / (2.0 * 14e-6)
    values["devices"]["mla"] = {"lensPitch": 14e-6, "sensorOffset": {"z": behind}}
    told = read_metadata(values)
    optics = optics_from_metadata(told, Optics())
    assert optics.exit_pupil == exit_pupil

    from raytracer.film.light_field.resampling import Resampler

    grid = Grid(lattice(10.0, 0.0, (300.0, 225.0)), 600, 450, diameter=9.0)
    resampler = Resampler(grid.lattice, 600, 450)
    views = optics.views(grid, resampler)
    assert views.focus_distance == pytest.approx(focus_from_metadata(told))
    # From the front focal point the entrance pupil lies f / P behind, and f^2 / x = away.
    assert views.focus_distance == pytest.approx(f * f / away + f / pupils)

    # Forward from the place u of the entrance pupil, f / P to the front focal plane; light comes the other way.
    row, column, i, j = 2, 5, 7, 30
    u, plane = views.position[row, column], views.plane
    slope = np.array([plane.left + (j + 0.5) * plane.pixel, plane.top - (i + 0.5) * plane.pixel])
    slope = slope - views.inverse_focus * u
    front = u + slope * f / pupils
    # From focal plane to focal plane: a slope becomes a place, a place a slope; the microlenses are `away` behind.
    turned = -front / f
    array = -f * slope + away * turned
    on_sensor = array + behind * turned
    # The picture is upright: turned by 180 degrees.
    upright = np.array([-1.0, 1.0]) / pixel
    offset = np.array(resampler.offset(row, column))
    seen = np.array(resampler.first) + resampler.pixel * np.array([j, i]) + offset
    assert seen == pytest.approx(np.array([300.0, 225.0]) + on_sensor * upright, abs=1e-6)
    # Sub-images lie as much farther out as the exit pupil is near.
    middle = np.array([300.0, 225.0]) + array * (1.0 + behind / exit_pupil) * upright
    assert seen - offset == pytest.approx(middle, abs=1e-6)


def test_a_thin_lens_is_that_of_other_pictures():
    from raytracer.film.light_field.resampling import Resampler

    grid = Grid(lattice(10.0, 0.0, (300.0, 225.0)), 600, 450, diameter=9.0)
    resampler = Resampler(grid.lattice, 600, 450)
    for rest in ({"f_number": 2.0}, {"microlens_distance": 25.0}, {"f_number": 2.0, "microlens_distance": 30.0}):
        plain = Optics(1.4, 50.0, focus_distance=1.5, **rest)
        image = 0.05 * 1.5 / (1.5 - 0.05)
        pupil = PupilOptics(1.4, 50.0, focus_distance=1.5, exit_pupil=image, **rest)
        one, other = (optics.views(grid, resampler) for optics in (plain, pupil))
        assert other.position == pytest.approx(one.position)
        assert other.plane == pytest.approx(one.plane)
        assert (other.inverse_focus, other.aperture) == pytest.approx((one.inverse_focus, one.aperture))
    with pytest.raises(ValueError, match="too near"):
        PupilOptics(1.4, 50.0, 2.0, focus_distance=0.05, exit_pupil=0.06).views(grid, resampler)


def test_metadata_of_the_cameras(tmp_path):
    """Numbers of photographs of both cameras, as imageio's tests have them: focused as near as such lenses can be."""
    f01 = lytro_files.metadata(
        8, 6, F01, focalLength=0.00684, fNumber=1.92, infinityLambda=18.033, exitPupilOffset={"z": 0.223577}
    )
    f01["devices"]["mla"] = {"lensPitch": 1.4e-5, "sensorOffset": {"z": 2.5e-5}}
    assert focus_from_metadata(read_metadata(f01)) == pytest.approx(0.0967, abs=1e-4)
    illum = lytro_files.metadata(
        8, 6, ILLUM, focalLength=0.0241995, fNumber=2.19978, infinityLambda=33.89, exitPupilOffset={"z": 0.0972856}
    )
    illum["devices"]["mla"] = {"lensPitch": 2e-5, "sensorOffset": {"z": 3.7e-5}}
    assert focus_from_metadata(read_metadata(illum)) == pytest.approx(0.3989, abs=1e-4)
    assert optics_from_metadata(read_metadata(illum), Optics()).focus_distance == pytest.approx(0.3989, abs=1e-4)
    assert optics_from_metadata(read_metadata(illum), Optics(focus_distance=np.inf)).focus_distance == np.inf
    illum["devices"]["lens"]["infinityLambda"] = 0
    told = read_metadata(illum)
    assert np.isinf(focus_from_metadata(told))
    # What is known better has precedence.
    optics = optics_from_metadata(told, Optics(1.5, f_number=4.0, focus_distance=2.0))
    assert (optics.pixel_pitch, optics.focal_length, optics.f_number) == pytest.approx((1.5, 24.1995, 4.0))
    assert (optics.microlens_distance, optics.focus_distance, optics.missing) == (pytest.approx(37.0), 2.0, "")
    assert json.dumps(illum)
