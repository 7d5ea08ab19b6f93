"""Files of Lytro's cameras: containers of photographs, packages and archives of white pictures."""

import math

import numpy as np

from raytracer.lightfield.decoding.lytro.optics import focus_from_metadata, optics_from_metadata
from raytracer.lightfield.decoding.lytro.photo import open_photo
from raytracer.lightfield.decoding.lytro.summary import summarize
from raytracer.lightfield.decoding.lytro.white_pictures import choose_white_picture, find_white_pictures
from raytracer.lightfield.decoding.microlens_grid import Optics
from tests.fuzz.harness import target
from tests.lightfield import lytro_files

_LENS = {"focalLength": 0.00684, "fNumber": 1.92, "infinityLambda": 18.0, "exitPupilOffset": {"z": 0.22}}


def _values(camera):
    values = lytro_files.metadata(6, 4, camera, colors=True, **_LENS)
    values["devices"]["mla"] = {"lensPitch": 1.4e-5, "sensorOffset": {"z": 2.5e-5}}
    return values


def _photos():
    codes = np.arange(24, dtype=np.uint16).reshape(4, 6)
    yield lytro_files.photo(codes, _values(lytro_files.F01))
    yield lytro_files.photo(codes, _values(lytro_files.ILLUM), white=codes)


_WORDS = '\udc89LFM\r\n\x1a\n~\udc89LFC\r\n\x1a\n~"imageRef"~"bitsPerPixel"~"width"~"upperLeftPixel"~NaN~1e999~[[[~-1'


@target("lytro", seeds=_photos, file="a.lfp", max_length=8192, words=_WORDS)
def load_lytro(path):
    photo = open_photo(path)
    summarize(photo)
    told = photo.metadata
    assert 1 <= told.width <= 2**16
    assert focus_from_metadata(told) > 0.0
    optics = optics_from_metadata(told, Optics())
    assert all(math.isfinite(length) and length > 0.0 for length in (optics.pixel_pitch or 1.0, optics.f_number or 1.0))
    for read in (photo.read, *((photo.read_white,) if photo.has_white else ())):
        light = read().light()
        assert light.shape == (told.height, told.width)
        assert np.isfinite(light).all()
        assert light.max() <= 1.0


def _whites():
    codes = np.arange(24, dtype=np.uint16).reshape(4, 6)
    files = lytro_files.white_files([(codes, _values(lytro_files.ILLUM))])
    yield b"t" + lytro_files.archive(files)
    yield b"c" + lytro_files.package(files)


@target("lytro_whites", seeds=_whites, max_length=16384, words=f"{_WORDS}~MOD_0000.TXT~MOD_0000.RAW~ustar")
def load_lytro_whites(data, folder):
    """The first byte says what the others are."""
    name = "caldata-A1.tar" if data[:1] == b"t" else "data.C.0"
    (folder / name).write_bytes(data[1:])
    pictures = find_white_pictures(folder)
    for picture in pictures:
        assert choose_white_picture(pictures, picture.metadata, folder).metadata.width == picture.metadata.width
        assert np.isfinite(picture.read().light()).all()
