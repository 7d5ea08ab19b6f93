"""Run `rt` as processes that are killed, signalled, and watched from outside."""

import contextlib
import io
import math
import multiprocessing
import os
import subprocess
import sys
import time
import zipfile
from collections import Counter
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import numpy as np
import psutil

from raytracer.film import load
from raytracer.rendering.checkpoint import SUFFIX
from raytracer.util.errors import InputError

RT = "import sys; from raytracer.cli.base.app import main; sys.exit(main())"
"""The code of the command `rt`."""

PATIENCE = 120.0
"""Seconds after which a process that should have ended has failed; nothing is measured by it."""

BALL = """\
camera: {type: pinhole, look_from: [0, 0, 4], look_at: [0, 0, 0], vfov: 40}
film: {width: 64, height: 48}
render: {spp: 64, max_depth: 5}
environment: {type: constant, radiance: 0.5}
objects:
  - {type: sphere, center: [0, 0, 0], radius: 1, material: {type: lambertian, albedo: 0.8}}
"""

OUTPUTS = ("out.png", "out.exr", "out.npy")
CHECKPOINT = f"{OUTPUTS[0]}{SUFFIX}"
CHECKPOINTS = (CHECKPOINT, f"{CHECKPOINT}.previous")

FOREVER = ("--spp", "100000000")
"""More samples than any test waits for."""

_PROMPT_SECONDS = 0.001


class Ended(NamedTuple):
    """The end of a process: exit status, minus the signal's number if one has killed it; and its output."""

    status: int
    out: str
    err: str

    @property
    def sentences(self):
        """Return the lines on stderr but warnings."""
        return [line for line in self.err.splitlines() if not line.startswith("rt: warning: ")]


class Process:
    """A running command of `rt`."""

    def __init__(self, words, cwd, **settings):
        self.began = time.perf_counter()
        settings = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, **settings}
        command = [sys.executable, "-c", RT, *words]
        self.popen = subprocess.Popen(command, cwd=cwd, stdin=subprocess.DEVNULL, text=True, **settings)
        self.send = self.popen.send_signal

    @property
    def seconds(self):
        """Return the seconds since its start."""
        return time.perf_counter() - self.began

    @property
    def busy_seconds(self):
        """Return the processor time that it has taken."""
        try:
            return sum(psutil.Process(self.popen.pid).cpu_times()[:2])
        except psutil.NoSuchProcess:
            return math.inf

    @property
    def is_running(self):
        return self.popen.poll() is None

    def until(self, condition):
        """Wait for a condition, or the end; return True if it holds."""
        end = time.perf_counter() + PATIENCE
        while self.is_running and time.perf_counter() < end:
            if condition():
                return True
            time.sleep(_PROMPT_SECONDS)
        return condition()

    def end(self):
        """Wait for the end."""
        try:
            out, err = self.popen.communicate(timeout=PATIENCE)
        except subprocess.TimeoutExpired:
            self.popen.kill()
            out, err = self.popen.communicate()
            raise AssertionError(f"did not end within {PATIENCE:g} s, and has said: {out}{err}") from None
        return Ended(self.popen.returncode, out, err)


def run(words, cwd, **settings):
    """Run a command of `rt` to its end."""
    return Process(words, cwd, **settings).end()


def present(folder, names=OUTPUTS):
    """Read those of these files that are there; one may be renamed at any time."""
    found = {}
    for name in names:
        with contextlib.suppress(FileNotFoundError):
            found[name] = (folder / name).read_bytes()
    return found


def asides(folder):
    """List the files that are being written in a folder, or were when a process was killed."""
    try:
        return [Path(entry.path) for entry in os.scandir(folder) if entry.name.endswith(".tmp")]
    except FileNotFoundError:
        return []


def print_table(figures, failures):
    """Print names and numbers, and failures; return the exit status."""
    for name, value in sorted(figures.items()):
        print(f"{name:<60} {value}")
    print(*failures, sep="\n")
    return 1 if failures else 0


# ---- Files that are looked at while they are written


def is_whole(path, data):
    """Tell if the bytes of an image, or of a checkpoint, are all there and as they were written."""
    if SUFFIX in path.name:
        try:
            with zipfile.ZipFile(io.BytesIO(data)) as archive:
                return archive.testzip() is None and bool(archive.namelist())
        except (zipfile.BadZipFile, EOFError, ValueError):
            return False
    copy = Path(f"{path}.copy{os.getpid()}").with_suffix(path.suffix)
    try:
        copy.write_bytes(data)
        return bool(np.isfinite(load(copy)).all())
    except InputError:
        return False
    finally:
        copy.unlink(missing_ok=True)


def _look(folder, names, stop, answers):
    """Open files again and again, read them, and check what is new."""
    reads, broken, known = Counter(), [], {}
    scratch = folder.with_name(f"{folder.name}-looked-at")
    scratch.mkdir(exist_ok=True)
    parent = multiprocessing.parent_process()
    is_last = False
    while not is_last:
        # What is there at the end is looked at, too.
        is_last = stop.is_set() or not parent.is_alive()
        for name, data in present(folder, names).items():
            reads[name] += 1
            if known.get(name) != hash(data):
                known[name] = hash(data)
                if not is_whole(scratch / name, data):
                    broken.append(f"{name}, {len(data)} bytes")
        time.sleep(_PROMPT_SECONDS)
    answers.put((reads, broken))


@contextmanager
def looking(folder, names):
    """Have a process open these files of a folder all the time.

    Call the result to end it, and to get how often each was opened, and the names of those that were not whole.
    """
    context = multiprocessing.get_context("spawn")
    stop, answers = context.Event(), context.Queue()
    watcher = context.Process(target=_look, args=(folder, names, stop, answers), daemon=True)
    watcher.start()

    def ended():
        stop.set()
        return answers.get(timeout=PATIENCE)

    try:
        yield ended
    finally:
        stop.set()
        watcher.join(PATIENCE)
        if watcher.is_alive():
            watcher.kill()
