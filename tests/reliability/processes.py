"""Run `rt` as processes that are killed, signalled, and watched from outside."""

import io
import multiprocessing
import os
import subprocess
import sys
import time
import zipfile
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from multiprocessing.synchronize import Event
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

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

FOREVER = ("--spp", "100000000")
"""More samples than any test waits for."""

_PROMPT_SECONDS = 0.001


class Ended(NamedTuple):
    """The end of a process: exit status, minus the signal's number if one has killed it; and its output."""

    status: int
    out: str
    err: str

    @property
    def sentences(self) -> list[str]:
        """Return the lines on stderr but warnings."""
        return [line for line in self.err.splitlines() if not line.startswith("rt: warning: ")]


class Process:
    """A running command of `rt`."""

    def __init__(self, words: Sequence[str], cwd: Path, **settings: Any) -> None:
        self.began = time.perf_counter()
        self.popen = subprocess.Popen(
            [sys.executable, "-c", RT, *words],
            cwd=cwd,
            stdin=subprocess.DEVNULL,
            text=True,
            **{"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, **settings},
        )

    @property
    def seconds(self) -> float:
        """Return the seconds since its start."""
        return time.perf_counter() - self.began

    @property
    def is_running(self) -> bool:
        return self.popen.poll() is None

    def until(self, condition: Callable[[], bool]) -> bool:
        """Wait for a condition, or the end; return True if it holds."""
        end = time.perf_counter() + PATIENCE
        while self.is_running and time.perf_counter() < end:
            if condition():
                return True
            time.sleep(_PROMPT_SECONDS)
        return condition()

    def send(self, number: int) -> None:
        self.popen.send_signal(number)

    def end(self) -> Ended:
        """Wait for the end."""
        try:
            out, err = self.popen.communicate(timeout=PATIENCE)
        except subprocess.TimeoutExpired:
            self.popen.kill()
            out, err = self.popen.communicate()
            raise AssertionError(f"did not end within {PATIENCE:g} s, and has said: {out}{err}") from None
        return Ended(self.popen.returncode, out, err)


def run(words: Sequence[str], cwd: Path, **settings: Any) -> Ended:
    """Run a command of `rt` to its end."""
    return Process(words, cwd, **settings).end()


def asides(folder: Path) -> list[Path]:
    """List the files that are being written in a folder, or were when a process was killed."""
    return [path for path in _entries(folder) if path.name.endswith(".tmp")]


def _entries(folder: Path) -> Iterator[Path]:
    try:
        yield from [Path(entry.path) for entry in os.scandir(folder)]
    except FileNotFoundError:
        return


# ---- Files that are looked at while they are written


def is_whole(path: Path, data: bytes) -> bool:
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


class Seen(NamedTuple):
    """Counts of files that were opened, and read whole or not; and the names of those that were not."""

    reads: Counter[str]
    broken: list[str]


def _look(folder: str, names: Sequence[str], stop: Event, answers: "multiprocessing.Queue[Seen]") -> None:
    """Open files again and again, read them, and check what is new."""
    reads: Counter[str] = Counter()
    broken: list[str] = []
    known: dict[str, int] = {}
    scratch = Path(folder).with_name(f"{Path(folder).name}-looked-at")
    scratch.mkdir(exist_ok=True)
    parent = multiprocessing.parent_process()
    while not stop.is_set() and parent is not None and parent.is_alive():
        for name in names:
            try:
                data = (Path(folder) / name).read_bytes()
            except FileNotFoundError:
                continue
            reads[name] += 1
            if known.get(name) == hash(data):
                continue
            known[name] = hash(data)
            if not is_whole(scratch / name, data):
                broken.append(f"{name}, {len(data)} bytes")
        time.sleep(_PROMPT_SECONDS)
    answers.put(Seen(reads, broken))


@contextmanager
def looking(folder: Path, names: Sequence[str]) -> Iterator[Callable[[], Seen]]:
    """Have a process open these files of a folder all the time; call the result to end it and get its counts."""
    context = multiprocessing.get_context("spawn")
    stop, answers = context.Event(), context.Queue()
    watcher = context.Process(target=_look, args=(str(folder), list(names), stop, answers), daemon=True)
    watcher.start()

    def ended() -> Seen:
        stop.set()
        found = answers.get(timeout=PATIENCE)
        watcher.join(PATIENCE)
        return found

    try:
        yield ended
    finally:
        stop.set()
        watcher.join(PATIENCE)
        if watcher.is_alive():
            watcher.kill()


def checkpoints(output: str) -> tuple[str, str]:
    """Name the checkpoint of a picture, and the one before it."""
    return f"{output}{SUFFIX}", f"{output}{SUFFIX}.previous"
