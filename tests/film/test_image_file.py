"""Image files: what is written is read back, nothing is lost when writing fails, and broken files are one sentence."""

import contextlib
import errno
import os
import stat
import sys

import numpy as np
import OpenEXR
import PIL.Image
import pytest

from raytracer.errors import InputError, OutputError
from raytracer.film import Image, check_writable, load, load_layers, output, save, srgb
from raytracer.film.output import load_encoded

SUFFIXES = [".png", ".jpg", ".jpeg", ".exr", ".hdr", ".npy"]
SETTINGS = {"scene": "Köln, 東京", "spp": 64, "seed": 2**63, "f_number": 0.1}

posix_only = pytest.mark.skipif(sys.platform == "win32", reason="devices, links and modes of POSIX")
unless_root = pytest.mark.skipif(hasattr(os, "geteuid") and os.geteuid() == 0, reason="root may write anywhere")


@pytest.fixture
def image():
    rng = np.random.default_rng(7)
    return Image(rng.random((6, 9, 3)) * 1.2, rng.random((6, 9, 3)), 64, SETTINGS)


# ---- what is written is read back ----


def test_npy_holds_every_bit(image, tmp_path):
    image.save(tmp_path / "a.npy")
    np.testing.assert_array_equal(load(tmp_path / "a.npy"), image.radiance)


def test_exr_holds_float32_variance_and_settings(image, tmp_path):
    save(image, tmp_path / "a.exr", {"depth": image.radiance[..., 0], "normal": -image.radiance})
    layers, settings = load_layers(tmp_path / "a.exr")
    single = image.radiance.astype(np.float32)
    np.testing.assert_array_equal(layers["radiance"], single)
    np.testing.assert_array_equal(layers["variance"], image.variance.astype(np.float32))
    np.testing.assert_array_equal(layers["depth"], single[..., 0])
    np.testing.assert_array_equal(layers["normal"], -single)
    assert layers.keys() == {"radiance", "variance", "depth", "normal"}
    assert settings == {**{key: str(value) for key, value in SETTINGS.items()}, "samples": "64"}
    np.testing.assert_array_equal(load(tmp_path / "a.exr"), single)


def test_exr_is_what_other_programs_expect(image, tmp_path):
    image.save(tmp_path / "a.exr")
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        assert set(file.channels()) == {"R", "G", "B", "variance.R", "variance.G", "variance.B"}
        assert file.header()["compression"] == OpenEXR.ZIP_COMPRESSION
        # Rec. 709: ITU-R BT.709-6, table 1.
        np.testing.assert_allclose(
            file.header()["chromaticities"], [0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329], rtol=1e-6
        )


def test_exr_holds_what_is_not_finite_or_too_large(tmp_path):
    values = np.array([[[np.nan, np.inf, -np.inf], [1e300, -1e300, 0]]])
    Image(values).save(tmp_path / "a.exr")
    expected = [[[np.nan, np.inf, -np.inf], [np.inf, -np.inf, 0]]]
    np.testing.assert_array_equal(load(tmp_path / "a.exr"), expected)


def test_a_grey_exr_has_equal_channels(tmp_path):
    grey = np.random.default_rng(8).random((3, 4)).astype(np.float16)
    OpenEXR.File({}, {"Y": grey}).write(str(tmp_path / "a.exr"))
    np.testing.assert_array_equal(load(tmp_path / "a.exr"), np.repeat(grey[..., None], 3, axis=2))


def test_hdr_keeps_eight_bits_of_the_largest_component(image, tmp_path):
    image.save(tmp_path / "a.hdr")
    error = np.abs(load(tmp_path / "a.hdr") - image.radiance)
    assert (error <= image.radiance.max(axis=2, keepdims=True) / 256).all()


def test_png_holds_the_display_and_the_settings(image, tmp_path):
    image.save(tmp_path / "a.png")
    with PIL.Image.open(tmp_path / "a.png") as file:
        np.testing.assert_array_equal(np.asarray(file), image.display())
        assert {key: file.text[key] for key in SETTINGS} == {key: str(value) for key, value in SETTINGS.items()}
        assert file.text["samples"] == "64"
    np.testing.assert_array_equal(srgb.to_uint8(load(tmp_path / "a.png")), image.display())


def test_jpeg_keeps_the_colour_of_single_pixels(tmp_path):
    # Red and blue in turns: with subsampled chroma they would become one purple.
    values = np.zeros((16, 16, 3))
    values[:, 0::2, 0] = values[:, 1::2, 2] = 1
    Image(values).save(tmp_path / "a.jpg")
    with PIL.Image.open(tmp_path / "a.jpg") as file:
        shown = np.asarray(file).astype(int)
    assert np.abs(shown - Image(values).display()).max() < 40


def test_a_grey_png_of_16_bits_is_read_to_its_full_precision(tmp_path):
    codes = np.array([[0, 1, 32768, 65535]], dtype=np.uint16)
    PIL.Image.fromarray(codes).save(tmp_path / "a.png")
    np.testing.assert_allclose(load(tmp_path / "a.png")[..., 1], srgb.decode(codes / 65535), rtol=1e-12)


def test_display_values_are_read_as_they_are_held(tmp_path):
    shades = np.arange(256, dtype=np.uint8).reshape(16, 16)
    PIL.Image.fromarray(np.dstack([shades, shades[::-1], shades.T])).save(tmp_path / "a.png")
    found = load_encoded(tmp_path / "a.png")
    np.testing.assert_array_equal(found[..., 0] * 255, shades)
    np.testing.assert_array_equal(load(tmp_path / "a.png"), srgb.decode(found))
    with pytest.raises(InputError, match=r"only \.png, \.jpg, \.jpeg files hold display values"):
        load_encoded(tmp_path / "a.exr")


def test_only_the_layers_that_are_wanted_are_read(image, tmp_path):
    save(image, tmp_path / "a.exr", {"depth": image.radiance[..., 0], "normal": -image.radiance})
    layers, settings = load_layers(tmp_path / "a.exr", {"variance", "depth"})
    assert layers.keys() == {"variance", "depth"}
    assert settings["samples"] == "64"


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_one_pixel_and_an_upper_case_suffix(suffix, tmp_path):
    path = tmp_path / f"a{suffix.upper()}"
    Image(np.full((1, 1, 3), 0.5)).save(path)
    np.testing.assert_allclose(load(path), 0.5, atol=0.01)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_the_same_image_gives_the_same_bytes(suffix, image, tmp_path):
    for name in "ab":
        image.save(tmp_path / (name + suffix))
    assert (tmp_path / f"a{suffix}").read_bytes() == (tmp_path / f"b{suffix}").read_bytes()


# ---- writing ----


def test_folders_are_made(image, tmp_path):
    image.save(tmp_path / "new" / "folder" / "a.png")
    assert [path.name for path in (tmp_path / "new" / "folder").iterdir()] == ["a.png"]


@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EDQUOT, errno.EACCES])
@pytest.mark.parametrize("call", ["fsync", "replace"])
def test_a_failure_leaves_the_old_file_whole_and_nothing_besides(code, call, image, tmp_path, monkeypatch):
    (tmp_path / "a.png").write_bytes(b"old")

    def fail(*args):
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(output.os, call, fail)
    with pytest.raises(OutputError, match=f"a.png: cannot be written: {os.strerror(code)}$"):
        image.save(tmp_path / "a.png")
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == {"a.png": b"old"}


def test_an_interrupt_leaves_nothing_behind(image, tmp_path, monkeypatch):
    def interrupt(*args):
        raise KeyboardInterrupt

    monkeypatch.setattr(output.os, "fsync", interrupt)
    with pytest.raises(KeyboardInterrupt):
        image.save(tmp_path / "a.png")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no /dev/full")
def test_a_full_device_is_reported_and_stays_what_it_is(image, tmp_path):
    (tmp_path / "a.exr").symlink_to("/dev/full")
    for path in (tmp_path / "a.exr", "/dev/full"):
        check_writable(path)
        with pytest.raises(OutputError, match="No space left on device"):
            image.save(path)
    assert (tmp_path / "a.exr").is_symlink()
    assert stat.S_ISCHR(os.stat("/dev/full").st_mode)


@posix_only
def test_a_device_without_a_suffix_takes_png(image, tmp_path):
    image.save("/dev/null")
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    image.save(pipe)
    assert os.read(reader, 8) == b"\x89PNG\r\n\x1a\n"
    os.close(reader)
    assert stat.S_ISFIFO(pipe.stat().st_mode)


@posix_only
def test_a_link_keeps_pointing_at_its_file_and_the_file_keeps_its_mode(image, tmp_path):
    target = tmp_path / "target.png"
    target.write_bytes(b"old")
    target.chmod(0o640)
    (tmp_path / "link.png").symlink_to(target)
    image.save(tmp_path / "link.png")
    assert (tmp_path / "link.png").is_symlink()
    assert target.read_bytes().startswith(b"\x89PNG")
    assert stat.S_IMODE(target.stat().st_mode) == 0o640


@posix_only
def test_a_new_file_has_the_mode_that_the_umask_gives(image, tmp_path):
    (tmp_path / "plain").touch()
    image.save(tmp_path / "a.png")
    assert (tmp_path / "a.png").stat().st_mode == (tmp_path / "plain").stat().st_mode


def test_an_image_that_the_format_cannot_hold(tmp_path):
    # JPEG counts its pixels in 16 bits.
    with pytest.raises(OutputError, match=r"a.jpg: an image of 70000 x 1 pixels cannot be written as .jpg"):
        Image(np.zeros((1, 70000, 3))).save(tmp_path / "a.jpg")


# ---- checking before ----


@pytest.mark.parametrize("name", ["a.tiff", "a", "a.png.bak", ".png"])
def test_an_unknown_suffix_is_told_with_the_known_ones(name, image, tmp_path):
    for call in (check_writable, image.save, load):
        with pytest.raises(InputError, match=r"suffix.*known: \.png, \.jpg, \.jpeg, \.exr, \.hdr, \.npy(, \.lf)?$"):
            call(tmp_path / name)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_checking_leaves_nothing_behind(suffix, tmp_path):
    check_writable(tmp_path / f"a{suffix}")
    check_writable(tmp_path / "new" / "folder" / f"a{suffix}")
    assert list(tmp_path.iterdir()) == []


def test_a_folder_is_no_image_file(tmp_path):
    (tmp_path / "a.png").mkdir()
    with pytest.raises(InputError, match="is a folder"):
        check_writable(tmp_path / "a.png")


def test_a_file_is_no_folder(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="cannot be written"):
        check_writable(tmp_path / "file" / "a.png")


@pytest.mark.parametrize("name", ["x" * 300 + ".png", "a\0b.png"])
def test_a_name_that_no_file_can_have(name, tmp_path):
    with pytest.raises(InputError, match="cannot be written"):
        check_writable(tmp_path / name)


@posix_only
@unless_root
def test_a_folder_or_file_without_permission(tmp_path):
    (tmp_path / "a.png").touch(mode=0o444)
    with pytest.raises(InputError, match="protected"):
        check_writable(tmp_path / "a.png")
    tmp_path.chmod(0o555)
    try:
        with pytest.raises(InputError, match="no permission"):
            check_writable(tmp_path / "b.png")
    finally:
        tmp_path.chmod(0o755)


@pytest.mark.parametrize("protected", ["file", "folder"])
def test_what_the_system_says_may_not_be_written(protected, tmp_path, monkeypatch):
    # As above, for a user who may do anything.
    path = tmp_path / "a.png"
    if protected == "file":
        path.touch()
    monkeypatch.setattr(output.os, "access", lambda checked, mode: str(checked) not in map(str, (path, tmp_path)))
    with pytest.raises(InputError, match="protected" if protected == "file" else "no permission"):
        check_writable(path)


@posix_only
def test_a_loop_of_links(tmp_path):
    (tmp_path / "a.png").symlink_to(tmp_path / "b.png")
    (tmp_path / "b.png").symlink_to(tmp_path / "a.png")
    with pytest.raises(InputError):
        check_writable(tmp_path / "a.png")


# ---- reading what is broken ----


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("part", [0.0, 0.02, 0.3, 0.6, 0.9])
def test_a_file_that_ends_early_is_one_sentence_and_prints_nothing(suffix, part, image, tmp_path, capfd):
    path = tmp_path / f"a{suffix}"
    image.save(path)
    data = path.read_bytes()
    path.write_bytes(data[: int(part * len(data))])
    with pytest.raises(InputError, match=r"^[^\n]*a\.[a-z]+: (broken, or no \.[a-z]+ image|is [a-zA-Z ,]+)$"):
        load(path)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_damage_anywhere_is_an_input_error_at_worst(suffix, image, tmp_path):
    image.save(tmp_path / f"a{suffix}")
    data = np.frombuffer((tmp_path / f"a{suffix}").read_bytes(), dtype=np.uint8)
    rng = np.random.default_rng(9)
    for _ in range(100):
        damaged = data.copy()
        damaged[rng.integers(0, min(len(data), 300), 3)] = rng.integers(0, 256, 3)
        (tmp_path / f"a{suffix}").write_bytes(damaged.tobytes())
        with contextlib.suppress(InputError):
            assert load(tmp_path / f"a{suffix}").shape[2] == 3


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_missing_file_and_a_folder(suffix, tmp_path):
    with pytest.raises(InputError, match="no such file"):
        load(tmp_path / f"a{suffix}")
    (tmp_path / f"a{suffix}").mkdir()
    with pytest.raises(InputError, match="cannot be read"):
        load(tmp_path / f"a{suffix}")


@pytest.mark.parametrize("array", [np.zeros((3, 4)), np.zeros((3, 4, 4)), np.zeros((3, 4, 3), complex), np.array("x")])
def test_an_npy_file_that_is_no_image(array, tmp_path):
    np.save(tmp_path / "a.npy", array)
    with pytest.raises(InputError, match=r"is no array of numbers of the shape|must hold real numbers"):
        load(tmp_path / "a.npy")


def test_an_npy_file_that_would_run_code(tmp_path):
    np.save(tmp_path / "a.npy", np.array([print], dtype=object), allow_pickle=True)
    with pytest.raises(InputError):
        load(tmp_path / "a.npy")


def test_only_exr_has_layers(tmp_path):
    with pytest.raises(InputError, match=r"only \.exr"):
        load_layers(tmp_path / "a.png")
