"""The user's own key, which signs what is kept for later runs."""

import os
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from raytracer.core.compiler.signing_key import FILE_NAME, KEY_BYTES, NoKeyError, key_folder, signing_key

_POSIX = pytest.mark.skipif(sys.platform == "win32", reason="modes say nothing there")


def test_a_key_is_made_once_and_is_its_owners_alone(tmp_path):
    folder = tmp_path / "state" / "raytracer"
    before = os.umask(0)
    try:
        made = signing_key(folder)
    finally:
        os.umask(before)
    assert len(made) == KEY_BYTES
    assert signing_key(folder) == made
    assert signing_key(tmp_path / "another") != made
    assert [path.name for path in folder.iterdir()] == [FILE_NAME]
    if sys.platform != "win32":
        assert (folder / FILE_NAME).stat().st_mode & 0o777 == 0o600
        assert folder.stat().st_mode & 0o777 == 0o700


def test_all_who_make_it_at_once_have_the_same(tmp_path):
    together = threading.Barrier(16)

    def make(folder):
        together.wait()
        return signing_key(folder)

    with ThreadPoolExecutor(together.parties) as pool:
        for turn in range(8):
            folder = tmp_path / f"{turn}"
            keys = {*pool.map(make, [folder] * together.parties)}
            assert keys == {(folder / FILE_NAME).read_bytes()}
            assert len(list(folder.iterdir())) == 1


def _link(path):
    path.rename(path.with_name("elsewhere"))
    path.symlink_to(path.with_name("elsewhere"))


def _instead(make):
    return lambda path: (path.unlink(), make(path))


@_POSIX
@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda path: path.chmod(0o640), "is open to other users"),
        pytest.param(
            lambda path: os.chown(path, 12345, -1),
            "belongs to another user",
            marks=pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root gives away"),
        ),
        (_link, "is a link"),
        (_instead(lambda path: path.symlink_to("nowhere")), "is a link"),
        (lambda path: path.write_bytes(bytes(KEY_BYTES - 1)), "does not hold 32 bytes"),
        (lambda path: path.write_bytes(bytes(KEY_BYTES + 1)), "does not hold 32 bytes"),
        (_instead(lambda path: path.mkdir(mode=0o700)), "is not a regular file"),
        (_instead(lambda path: os.mkfifo(path, 0o600)), "is not a regular file"),
    ],
)
def test_a_key_that_others_may_know_or_have_put_there_is_none(spoil, words, tmp_path):
    signing_key(tmp_path)
    path = tmp_path / FILE_NAME
    spoil(path)
    before = path.lstat()
    with pytest.raises(NoKeyError, match=f"{FILE_NAME} {words}"):
        signing_key(tmp_path)
    # It is the user's to remove.
    assert path.lstat().st_ino == before.st_ino


def test_where_none_can_be_kept_there_is_none(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(NoKeyError, match=r"no signing key can be kept in .*file: "):
        signing_key(tmp_path / "file")


def test_where_files_cannot_be_linked_a_key_is_kept_all_the_same(tmp_path, monkeypatch):
    def refuse(*_):
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr("os.link", refuse)
    assert signing_key(tmp_path) == signing_key(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == [FILE_NAME]


def test_the_key_lies_where_each_system_keeps_what_programs_know(tmp_path, monkeypatch):
    for name in ("RAYTRACER_KEY_DIR", "XDG_STATE_HOME", "LOCALAPPDATA"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(Path, "home", lambda: tmp_path)
    for platform, place in (
        ("linux", tmp_path / ".local" / "state"),
        ("darwin", tmp_path / "Library" / "Application Support"),
        ("win32", tmp_path / "AppData" / "Local"),
    ):
        monkeypatch.setattr("sys.platform", platform)
        assert key_folder() == place / "raytracer"
    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.setenv("XDG_STATE_HOME", "relative")
    assert key_folder() == tmp_path / ".local" / "state" / "raytracer"
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    assert key_folder() == tmp_path / "state" / "raytracer"
    monkeypatch.setenv("RAYTRACER_KEY_DIR", str(tmp_path / "given"))
    assert key_folder() == tmp_path / "given"


def test_a_user_without_a_home_has_no_key(monkeypatch):
    def no_home():
        raise RuntimeError("Could not determine home directory.")

    for name in ("RAYTRACER_KEY_DIR", "XDG_STATE_HOME", "LOCALAPPDATA"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(Path, "home", no_home)
    with pytest.raises(NoKeyError, match="the user has no home folder"):
        key_folder()
