"""Render on a disk that fills at a random moment, and check the messages and the files.

    python -m tests.reliability.full_disk --moments 50

The disk is a tmpfs of 2 MB, which takes the right to mount one.  A render writes checkpoints and images there; at a
random moment, while it does, the disk is filled, once or by who takes whatever room is made.  The process is to end
with the exit status 1 and one sentence, or 0 if all found room.  Whatever picture and checkpoint are there then are to
be whole, and one of them to be there; what else is on the disk is to be what it was; and once there is room again,
`--resume` is to end in the picture that nothing has disturbed.
"""

import argparse
import contextlib
import itertools
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from tests.reliability.processes import BALL, Process, asides, checkpoints, is_whole, run

SIZE = 2_000_000
"""Bytes of the disk: for four checkpoints and all images."""

OUTPUTS = ("out.png", "out.exr", "out.npy")

_SPP = "2000"

# How often another program takes all room at any time; else some bytes are left, for all of the images, or some.
_GREEDY = 0.75
_MOST_FREE = 80_000
_PROMPT_SECONDS = 0.001
_BLOCK = 4096

_STRANGER = "other.bin"
_FILLER = "filler"


@contextlib.contextmanager
def disk(folder: Path) -> Iterator[Path]:
    """A small disk, mounted at a folder.

    Raises
    ------
    PermissionError : nobody may mount one here.
    """
    folder.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", f"size={SIZE}", "tmpfs", str(folder)]
    try:
        done = subprocess.run(mount, capture_output=True, text=True, check=False)
    except FileNotFoundError as error:
        raise PermissionError("there is no mount") from error
    if done.returncode != 0:
        raise PermissionError(done.stderr.strip())
    try:
        yield folder
    finally:
        if subprocess.run(["umount", str(folder)], capture_output=True, check=False).returncode != 0:
            subprocess.run(["umount", "-l", str(folder)], check=True)


def fill(folder: Path, free: int = 0) -> None:
    """Fill a disk, but for so many bytes."""
    with (folder / _FILLER).open("ab", buffering=0) as file:
        with contextlib.suppress(OSError):
            while True:
                file.write(bytes(_BLOCK))
        if free:
            file.truncate(max(0, file.tell() - free))


@contextlib.contextmanager
def filling(folder: Path) -> Iterator[None]:
    """Fill a disk, and take at once whatever space others free on it."""
    stop = threading.Event()

    def target() -> None:
        while not stop.is_set():
            fill(folder)
            time.sleep(_PROMPT_SECONDS)

    worker = threading.Thread(target=target)
    worker.start()
    try:
        yield
    finally:
        stop.set()
        worker.join()


@dataclass
class Figures:
    """The outcomes of all moments; failures are sentences."""

    moments: int = 0
    statuses: Counter[int] = field(default_factory=Counter)
    left: Counter[str] = field(default_factory=Counter)
    said: Counter[str] = field(default_factory=Counter)
    resumed: int = 0
    failures: list[str] = field(default_factory=list)

    def table(self) -> str:
        rows: list[tuple[str, object]] = [("moments", self.moments)]
        rows += [(f"exit status {status}", count) for status, count in sorted(self.statuses.items())]
        rows += [(f"left, whole: {what}", count) for what, count in sorted(self.left.items())]
        rows += [("resumed to the same picture, with room", self.resumed), ("failures", len(self.failures))]
        return "\n".join(f"{name:<56} {value}" for name, value in rows)


def words(folder: Path, *more: str) -> list[str]:
    outputs = [word for name in OUTPUTS for word in ("-o", str(folder / name))]
    return ["render", "ball.yaml", *outputs, "--spp", _SPP, "--checkpoint", "0.1s", "--quiet", "--threads", "2", *more]


class Trial:
    """A disk that is filled at one moment."""

    def __init__(self, home: Path, expected: dict[str, bytes], seconds: float) -> None:
        """seconds : time of a process on a disk with space, from its first checkpoint on."""
        self._home, self._expected, self._seconds = home, expected, seconds

    def take(self, seed: int, figures: Figures, lock: threading.Lock) -> bool:
        """Fill a disk while a process runs that writes there; return False if the process has ended before."""
        random = np.random.default_rng(seed)
        stranger = random.bytes(int(random.integers(1, 100_000)))
        place = self._home / f"disk-{seed}"
        with disk(place):
            (place / _STRANGER).write_bytes(stranger)
            # Now and then there is an older picture, which is not to be lost.
            older = self._expected[OUTPUTS[0]] if random.uniform() < 0.5 else None
            if older is not None:
                (place / OUTPUTS[0]).write_bytes(older)
            process = Process(words(place), self._home)
            process.until((place / checkpoints(OUTPUTS[0])[0]).exists)
            time.sleep(random.uniform(0.0, 0.9 * self._seconds))
            if not process.is_running:
                process.end()
                return False
            if random.uniform() < _GREEDY:
                with filling(place):
                    ended = process.end()
            else:
                fill(place, int(random.integers(0, _MOST_FREE)))
                ended = process.end()
            failures = self._failures(place, ended.status, ended.sentences)
            if (place / _STRANGER).read_bytes() != stranger:
                failures.append("another file is damaged")
            if older is not None and not (place / OUTPUTS[0]).exists():
                failures.append("an older picture is lost")
            left = [name for name in (*OUTPUTS, *checkpoints(OUTPUTS[0])) if (place / name).exists()]

            (place / _FILLER).unlink()
            again = run(words(place, "--resume"), self._home)
            found = {name: (place / name).read_bytes() for name in OUTPUTS if (place / name).exists()}
            is_same = again.status == 0 and found == self._expected
            if not is_same:
                failures.append(f"it does not go on: status {again.status}: {again.err}")
        with lock:
            figures.moments += 1
            figures.statuses[ended.status] += 1
            figures.said.update(line.replace(str(place), "DISK") for line in ended.err.splitlines())
            figures.left.update(left)
            figures.resumed += is_same
            figures.failures += [f"{seed}: {failure}" for failure in failures]
        return True

    def _failures(self, place: Path, status: int, sentences: list[str]) -> list[str]:
        """List what is wrong after a process has ended."""
        failures = []
        if status not in (0, 1) or len(sentences) != status:
            failures.append(f"status {status}, and said {sentences}")
        whole = {
            name: is_whole(self._home / f"look-{place.name}-{name}", (place / name).read_bytes())
            for name in (*OUTPUTS, *checkpoints(OUTPUTS[0]))
            if (place / name).exists()
        }
        failures += [f"{name} is broken" for name, is_good in whole.items() if not is_good]
        if not whole:
            failures.append("nothing is left")
        failures += [f"{path.name} is left" for path in asides(place)]
        return failures


def trials(moments: int, jobs: int, seed: int, home: Path, say: bool = False) -> Figures:
    """Fill so many disks, so many at a time."""
    (home / "ball.yaml").write_text(BALL)
    figures, lock = Figures(), threading.Lock()
    with disk(home / "whole") as place:
        # The first one compiles.
        for _ in range(2):
            begin = time.perf_counter()
            process = Process(words(place), home)
            process.until((place / checkpoints(OUTPUTS[0])[0]).exists)
            begin = time.perf_counter()
            ended = process.end()
            assert ended.status == 0, ended.err
            seconds = time.perf_counter() - begin
            expected = {name: (place / name).read_bytes() for name in OUTPUTS}
    trial = Trial(home, expected, seconds)

    def take(number: int) -> None:
        tries = itertools.count(seed + number, moments)
        while not trial.take(next(tries), figures, lock):
            pass
        if say:
            print(f"{figures.moments} of {moments}, {len(figures.failures)} failures", file=sys.stderr)

    with ThreadPoolExecutor(jobs) as pool:
        for done in [pool.submit(take, number) for number in range(moments)]:
            done.result()
    return figures


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--moments", type=int, default=50)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args(arguments)
    begin = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        try:
            figures = trials(given.moments, given.jobs, given.seed, Path(folder), say=True)
        except PermissionError as error:
            print(f"a small disk cannot be mounted here: {error}", file=sys.stderr)
            return 2
    print(figures.table())
    print(f"{'seconds':<56} {time.perf_counter() - begin:.0f}")
    for sentence, count in figures.said.most_common():
        print(f"said {count} times: {sentence}")
    for sentence in figures.failures:
        print(sentence)
    return 1 if figures.failures else 0


if __name__ == "__main__":
    sys.exit(main())
