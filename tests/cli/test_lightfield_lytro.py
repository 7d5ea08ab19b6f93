"""Photographs of Lytro's cameras on the command line: `rt lightfield decode`, `info` and `extract`."""

import json

import numpy as np
import pytest
from PIL import Image

from raytracer.film.light_field import lf
from tests.lightfield import lytro_files
from tests.lightfield.lenslet_pictures import Camera, lattice, texture
from tests.lightfield.lytro_files import ILLUM

SIZE = (300, 240)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("lytro")
    camera = Camera(lattice(11.3, 0.1, (5.3, 9.1), hexagonal=True), *SIZE)
    white = 0.8 * np.repeat(camera.picture()[..., None], 3, axis=2)
    scene = 0.7 * camera.picture(lambda x, y: texture(x, y, 120.0))
    lens = {"focalLength": 0.024, "fNumber": 2.0, "infinityLambda": 30.0, "exitPupilOffset": {"z": 0.1}}
    values = lytro_files.metadata(*SIZE, ILLUM, colors=True, **lens)
    values["devices"]["mla"] = {"lensPitch": 11.3 * 1.4e-6, "sensorOffset": {"z": 3e-5}}
    raw, flat = (lytro_files.mosaic(light, ILLUM, colors=True) for light in (scene, white))
    np.save(path / "codes.npy", raw)
    (path / "a.lfr").write_bytes(lytro_files.photo(raw, values, serial="B1", white=flat))
    (path / "b.lfp").write_bytes(lytro_files.photo(raw, values, serial="B1"))
    whites = lytro_files.white_files([(flat, values)], serial="B1")
    (path / "caldata-B1.tar").write_bytes(lytro_files.archive(whites))
    (path / "caldata-B2.tar").write_bytes(lytro_files.archive(lytro_files.white_files([(flat, values)], serial="B2")))
    (path / "package.lfp").write_bytes(lytro_files.package(whites))
    (path / "text.lfp").write_text("no container")
    (path / "cut.lfr").write_bytes((path / "a.lfr").read_bytes()[:9000])
    return path


@pytest.fixture(autouse=True)
def _inside(folder, monkeypatch):
    monkeypatch.chdir(folder)


def test_a_photograph_becomes_a_light_field_in_metres(tmp_path, rt):
    pytest.importorskip("cv2")
    out = tmp_path / "shot.lf"
    told = rt(f"lightfield decode b.lfp --white caldata-B1.tar -o {out}")
    assert "hexagonal, 11.3" in told.out
    assert "MOD_0000.RAW, zoom step 600 for 600" in told.err
    with lf.open(out) as field:
        assert "units" not in field.settings
        assert field.settings["camera"] == "Lytro, Inc. ILLUM"
        assert field.views.aperture == pytest.approx(12e-3)
        assert field.views.focus_distance == pytest.approx(0.024**2 / 949.2e-6 + 0.024**2 / (0.1 - 949.2e-6))
        assert field.views.position[5, 6, 0] - field.views.position[5, 5, 0] == pytest.approx(
            1.4 / 30 * (0.024 + 949.2e-6 * 0.024 / (0.1 - 949.2e-6))
        )
    package = rt("lightfield decode b.lfp --white package.lfp")
    assert "MOD_0000.RAW, zoom step 600 for 600" in package.err
    other = tmp_path / "own.lf"
    rt(f"lightfield decode a.lfr -o {other} --views 5 --focus-distance 2m --colors white")
    with lf.open(other) as field:
        assert field.views.focus_distance == pytest.approx(2.0)
        assert field.views.rows == 5
    rt(f"lightfield decode a.lfr -o {other} --views 3 --focus-distance inf")
    with lf.open(other) as field:
        assert field.views.inverse_focus == 0.0


def test_metadata_are_shown(rt):
    told = rt("lightfield info b.lfp").out
    lines = {line.split("  ")[0]: line.split("  ", 1)[1].strip() for line in told.splitlines()}
    assert lines["camera"] == "Lytro, Inc. ILLUM B1"
    assert lines["raw picture"] == "300 x 240 pixels of 10 bits, little-endian"
    assert lines["colour filters"] == "grbg"
    assert lines["levels"] == "64 is black, 1023 white"
    assert lines["white balance"] == "1.4 red, 1 green, 1.6 blue"
    assert lines["lens"] == "24 mm, f/2, zoom step 600, focus step 700, exit pupil 100 mm away"
    assert lines["focused at"] == "0.6126 m"
    assert "in the file" in rt("lightfield info a.lfr --check").out
    assert json.loads(rt("lightfield info b.lfp --json").out)["devices"]["lens"]["zoomStep"] == 600


def test_the_raw_picture_is_extracted(tmp_path, rt):
    codes = np.load("codes.npy")
    names = {suffix: tmp_path / f"raw{suffix}" for suffix in (".png", ".npy", ".json")}
    rt("lightfield extract a.lfr " + " ".join(f"-o {path}" for path in names.values()))
    assert np.array_equal(np.load(names[".npy"]), codes)
    stored = np.asarray(Image.open(names[".png"]))
    assert np.array_equal(stored.astype(np.int64), 64 * codes.astype(np.int64))
    assert json.loads(names[".json"].read_text())["image"]["width"] == SIZE[0]
    white = tmp_path / "white.png"
    rt(f"lightfield extract a.lfr --white -o {white}")
    # What was extracted can be decoded as any other raw picture.
    pytest.importorskip("cv2")
    told = rt(f"lightfield decode {names['.png']} --white {white} --bayer grbg")
    assert "hexagonal, 11.3" in told.out


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("decode text.lfp", "text.lfp: is no container of Lytro's (.lfp, .lfr)"),
        ("decode none.lfr", "none.lfr: no such file"),
        ("decode cut.lfr", "cut.lfr: is cut off: its section 4 claims"),
        ("decode package.lfp", "package.lfp: holds no photograph, but files of a camera"),
        ("decode b.lfp --bayer rggb", "--bayer: b.lfp is a container, whose metadata say that"),
        (
            "decode b.lfp --white caldata-B2.tar",
            "caldata-B2.tar: holds white pictures of B2, and the photograph is of B1",
        ),
        ("decode b.lfp --white none.tar", "none.tar: no such file"),
        ("decode b.lfp --focus-distance 1cm", "b.lfp: the focus distance, 0.01 m, is too near"),
        ("decode codes.npy --colors white", "--colors: is for photographs of a Lytro, .lfp and .lfr, and codes.npy is"),
        ("decode codes.npy --white .", ".: folders, archives and containers of white pictures go with photographs"),
        ("decode codes.npy --white b.lfp", "b.lfp: folders, archives and containers of white pictures go with"),
        ("decode b.lfp --white array.lf", "array.lf: is a light field already"),
        ("decode array.lf", "array.lf: is a light field already"),
        ("info text.lfp", "text.lfp: is no container"),
        ("extract b.lfp -o raw.tif", "raw.tif: unknown suffix '.tif' for what a photograph holds"),
        ("extract b.lfp --white -o white.png", "--white: b.lfp holds no white picture"),
    ],
)
def test_wrong_files_and_options(rt, line, told):
    if "focus" in line:
        pytest.importorskip("cv2")
    assert told in rt(f"lightfield {line}", status=2).err
