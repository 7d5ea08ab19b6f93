"""Image files: what is written is read back, nothing is lost when writing fails, and broken files are one sentence."""

import contextlib
import errno
import os
import stat
import sys

import numpy as np
import pytest

from raytracer.film import Image, check_writable, load, load_layers
from raytracer.util.errors import InputError, OutputError

SUFFIXES = [".png", ".jpg", ".jpeg", ".exr", ".hdr", ".npy"]

posix_only = pytest.mark.skipif(sys.platform == "win32", reason="devices, links and modes of POSIX")
unless_root = pytest.mark.skipif(hasattr(os, "geteuid") and os.geteuid() == 0, reason="root may write anywhere")


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


def test_folders_are_made(image, tmp_path):
    image.save(tmp_path / "new" / "folder" / "a.png")
    assert [path.name for path in (tmp_path / "new" / "folder").iterdir()] == ["a.png"]


@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EDQUOT, errno.EACCES])
@pytest.mark.parametrize("call", ["fsync", "replace"])
def test_a_failure_leaves_the_old_file_whole_and_nothing_besides(code, call, image, tmp_path, monkeypatch):
    (tmp_path / "a.png").write_bytes(b"old")

    def fail(*args):
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(os, call, fail)
    with pytest.raises(OutputError, match=f"a.png: cannot be written: {os.strerror(code)}$"):
        image.save(tmp_path / "a.png")
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == {"a.png": b"old"}


def test_an_interrupt_leaves_nothing_behind(image, tmp_path, monkeypatch):
    def interrupt(*args):
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "fsync", interrupt)
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


@pytest.mark.parametrize("name", ["a.bmp", "a", "a.png.bak", ".png"])
def test_an_unknown_suffix_is_told_with_the_known_ones(name, image, tmp_path):
    for call in (check_writable, image.save, load):
        with pytest.raises(InputError, match=r"suffix.*known: \.png, .*\.exr, \.hdr, \.npy(, \.lf)?, \.pfm$"):
            call(tmp_path / name)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_checking_leaves_nothing_behind(suffix, tmp_path):
    check_writable(tmp_path / f"a{suffix}")
    check_writable(tmp_path / "new" / "folder" / f"a{suffix}")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("make", "name", "told"),
    [
        (lambda folder: (folder / "a.png").mkdir(), "a.png", "is a folder"),
        (lambda folder: (folder / "file").touch(), "file/a.png", "cannot be written"),
        (lambda folder: None, "x" * 300 + ".png", "cannot be written"),
        (lambda folder: None, "a\0b.png", "cannot be written"),
        pytest.param(
            lambda folder: (folder / "a.png").symlink_to(folder / "a.png"), "a.png", "a.png: ", marks=posix_only
        ),
    ],
    ids=["folder", "file for a folder", "long name", "null", "loop of links"],
)
def test_what_is_no_place_for_a_file(make, name, told, tmp_path):
    make(tmp_path)
    with pytest.raises(InputError, match=told):
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
    monkeypatch.setattr(os, "access", lambda checked, mode: str(checked) not in map(str, (path, tmp_path)))
    with pytest.raises(InputError, match="protected" if protected == "file" else "no permission"):
        check_writable(path)


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


def test_only_exr_has_layers(tmp_path):
    with pytest.raises(InputError, match=r"only \.exr"):
        load_layers(tmp_path / "a.png")
