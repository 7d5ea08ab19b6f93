"""Atomic writes: leftovers of a process that is killed while it writes, and their removal."""

import os
import re
import subprocess
import sys
import tempfile
from contextlib import contextmanager

import pytest

from raytracer.util import atomic_write
from raytracer.util.atomic_write import TEMPORARY_NAME
from raytracer.util.atomic_write import atomic_write as write_aside

WRITING = """
import sys, time
from raytracer.util.atomic_write import atomic_write

with atomic_write(sys.argv[1]) as aside:
    aside.write_bytes(b"half")
    print(aside, flush=True)
    time.sleep(600)
"""

RENDERING = """
import sys, time
import numpy as np
from raytracer.film.light_field.lf import Writer
from raytracer.film.light_field.views import Plane, Views

views = Views(np.zeros((1, 2, 2)), Plane(0.1, -0.1, 0.1), 2, 2)
with Writer(sys.argv[1], views) as writer:
    writer.put_view(0, 0, np.ones((2, 2, 3)))
    print(flush=True)
    time.sleep(600)
"""


@contextmanager
def writing(path, program=WRITING, **settings):
    """A process that has written half of a file, and does not go on."""
    command = [sys.executable, "-c", program, str(path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env={**os.environ, **settings}) as process:
        try:
            assert process.stdout is not None
            process.stdout.readline()
            yield process
        finally:
            process.kill()


def left(folder):
    return [path for path in folder.iterdir() if TEMPORARY_NAME.fullmatch(path.name)]


def renamed(path, process):
    """A file aside as if it were that of another process."""
    return path.rename(path.with_name(re.sub(r"\d+", str(process), path.name, count=1)))


def write(path):
    """As the first thing that a process does."""
    atomic_write._swept.clear()
    with write_aside(path) as aside:
        aside.write_bytes(b"all")
    assert path.read_bytes() == b"all"


@pytest.mark.parametrize("program", [WRITING, RENDERING], ids=["file", "light field"])
def test_what_a_killed_process_left_goes_whoever_has_its_number_now(tmp_path, program):
    """As in containers, where the next process mostly has the number of the one before."""
    with writing(tmp_path / "a.lf", program):
        pass
    (aside,) = left(tmp_path)
    renamed(aside, os.getpid())
    # What others have named stays.
    (tmp_path / ".mine.tmp").write_bytes(b"x")
    write(tmp_path / "b")
    assert {path.name for path in tmp_path.iterdir()} == {".mine.tmp", "b"}


@pytest.mark.skipif(sys.platform == "win32", reason="what is open cannot be renamed there")
def test_what_is_being_written_stays_wherever_its_process_is(tmp_path):
    """In another container, or on another machine, its number is nobody's here."""
    with writing(tmp_path / "a"):
        (aside,) = left(tmp_path)
        aside = renamed(aside, 999_999_999)
        write(tmp_path / "b")
        assert aside.read_bytes() == b"half"
    write(tmp_path / "b")
    assert not left(tmp_path)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no such pipes")
def test_what_a_killed_process_wrote_for_a_pipe_goes_too(tmp_path, monkeypatch):
    pipe, folder = tmp_path / "pipe", tmp_path / "folder"
    os.mkfifo(pipe)
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    with writing(pipe, TMPDIR=str(folder)):
        pass
    (aside,) = left(folder)
    assert aside.stat().st_mode & 0o077 == 0
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    atomic_write._swept.clear()
    with write_aside(pipe) as written:
        assert left(folder) == [written]
        written.write_bytes(b"all")
    assert os.read(reader, 8) == b"all"
    os.close(reader)
    assert not list(folder.iterdir())


def test_a_file_that_is_swept_before_it_is_held_is_made_anew(tmp_path, monkeypatch):
    taken = []

    def swept(file, lock=atomic_write._lock):
        if not taken:
            (aside,) = left(tmp_path)
            taken.append(aside)
            aside.unlink()
        return lock(file)

    monkeypatch.setattr(atomic_write, "_lock", swept)
    write(tmp_path / "a")
    assert taken
