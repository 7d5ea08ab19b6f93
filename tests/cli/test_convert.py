"""`rt convert`: what becomes of the numbers of an image."""

from pathlib import Path

import numpy as np
import pytest

from raytracer.film.image import Image
from raytracer.film.image_file import load, load_encoded
from raytracer.film.tone import Filmic
from raytracer.film.white_balance import balance_gains
from raytracer.util import srgb


@pytest.fixture
def pixels(here):
    """Values of a.npy, a.exr and a.pfm: from 0 to 4, of different colours."""
    values = np.linspace(0.0, 4.0, 6 * 8 * 3).reshape(6, 8, 3).astype(np.float32).astype(np.float64)
    for suffix in ("npy", "exr", "pfm"):
        Image(values).save(here / f"a.{suffix}")
    return values


@pytest.mark.parametrize("source", ["npy", "exr", "pfm"])
@pytest.mark.parametrize("target", ["npy", "exr", "pfm"])
def test_linear_files_keep_their_numbers(source, target, pixels, rt):
    rt(f"convert a.{source} b.{target} -q")
    np.testing.assert_array_equal(load(f"b.{target}"), pixels)


def test_exposure_balance_and_curve_are_those_of_a_film(pixels, rt):
    assert rt("convert a.exr b.npy --exposure -1 --white-balance 3200K").err == "wrote b.npy\n"
    expected = 0.5 * pixels * balance_gains(3200.0, pixels)
    np.testing.assert_allclose(np.load("b.npy"), expected, rtol=1e-12)
    rt("convert a.exr b.png -q --exposure 1 --tone-curve '{type: filmic, white: 8}'")
    shown = srgb.encode(Filmic(8.0)(2.0 * pixels))
    np.testing.assert_allclose(load_encoded("b.png"), shown, atol=0.5 / 255 + 1e-9)
    # A curve is for a display alone.
    rt("convert a.exr c.npy -q --tone-curve filmic")
    np.testing.assert_array_equal(np.load("c.npy"), pixels)


def test_cropping_comes_before_scaling_which_keeps_the_light(pixels, rt):
    rt("convert a.npy b.npy -q --crop 2,1,6,5 --size 2x2")
    part = pixels[1:5, 2:6]
    small = np.load("b.npy")
    assert small.shape == (2, 2, 3)
    np.testing.assert_allclose(small.mean(axis=(0, 1)), part.mean(axis=(0, 1)), rtol=1e-6)
    assert part.min() <= small.min() <= small.max() <= part.max()
    rt("convert a.npy c.npy -q --scale 50%")
    assert np.load("c.npy").shape == (3, 4, 3)


def test_numbered_images_go_to_a_folder_by_their_names(pixels, rt):
    for number in (1, 2, 10):
        Path(f"f_{number:02}.exr").write_bytes(Path("a.exr").read_bytes())
    rt("convert f_*.exr pngs/ -q")
    assert sorted(path.name for path in Path("pngs").iterdir()) == ["f_01.png", "f_02.png", "f_10.png"]
    rt("convert f_01.exr f_10.exr pngs --format npy -q")
    np.testing.assert_array_equal(np.load("pngs/f_10.npy"), pixels)


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ("a.exr b.xyz", "b.xyz: unknown suffix '.xyz'"),
        ("none.exr b.png", "none.exr: no such file"),
        ("none*.exr b/", "none*.exr: no such files"),
        ("a.exr a.npy b.png", "a.exr and a.npy would both be written to b.png; a folder, FOLDER/, takes many"),
        ("a.exr b.png --exposure inf", "--exposure inf: must be stops, from -100 to 100"),
        ("a.exr b.png --white-balance blue", "--white-balance blue: must be auto, a colour temperature"),
        ("a.exr b.png --tone-curve aces", "--tone-curve aces: "),
        ("a.exr b.png --crop 0,0,9,9", "crop 0,0,9,9 must lie within a.exr, 0,0,8,6"),
    ],
)
def test_what_cannot_be_converted_is_refused(words, sentence, pixels, refused):
    assert refused(f"convert {words}").startswith(f"rt: {sentence}")
