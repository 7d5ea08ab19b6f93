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
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from tests.reliability.processes import (
    BALL,
    CHECKPOINT,
    CHECKPOINTS,
    OUTPUTS,
    Process,
    asides,
    is_whole,
    present,
    print_table,
)

SIZE = 2_000_000
"""Bytes of the disk: for four checkpoints and all images."""

# How often another program takes all room at any time; else some bytes are left, for all of the images, or some.
_GREEDY = 0.75
_MOST_FREE = 80_000


@contextlib.contextmanager
def disk(folder):
    """A small disk, mounted at a folder.

    Raises
    ------
    PermissionError : nobody may mount one here.
    """
    folder.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", f"size={SIZE}", "tmpfs", str(folder)]
    try:
        subprocess.run(mount, capture_output=True, text=True, check=True)
    except (FileNotFoundError, subprocess.CalledProcessError) as error:
        raise PermissionError(getattr(error, "stderr", "there is no mount").strip()) from error
    try:
        yield folder
    finally:
        if subprocess.run(["umount", str(folder)], capture_output=True, check=False).returncode != 0:
            subprocess.run(["umount", "-l", str(folder)], check=True)


def fill(folder, free=0):
    """Fill a disk, but for so many bytes."""
    with (folder / "filler").open("ab", buffering=0) as file:
        with contextlib.suppress(OSError):
            while True:
                file.write(bytes(4096))
        if free:
            file.truncate(max(0, file.tell() - free))


@contextlib.contextmanager
def filling(folder):
    """Fill a disk, and take at once whatever space others free on it."""
    stop = threading.Event()

    def target():
        while not stop.is_set():
            fill(folder)
            time.sleep(0.001)

    worker = threading.Thread(target=target)
    worker.start()
    try:
        yield
    finally:
        stop.set()
        worker.join()


def start(place, *more):
    """Start a render that writes there, and wait for its first checkpoint."""
    outputs = [word for name in OUTPUTS for word in ("-o", str(place / name))]
    words = ["render", "ball.yaml", *outputs, "--spp", "2000", "--checkpoint", "0.1s", "-q", "--threads", "2", *more]
    process = Process(words, place.parent)
    process.until((place / CHECKPOINT).exists)
    return process


def trial(place, seed, expected, seconds):
    """Fill a disk while a process runs that writes there; return counts of what happened, and failures.

    seconds : time of a process on a disk with space, from its first checkpoint on.  Returns None if it ends before.
    """
    random = np.random.default_rng(seed)
    stranger = random.bytes(int(random.integers(1, 100_000)))
    (place / "other.bin").write_bytes(stranger)
    # Now and then there is an older picture, which is not to be lost.
    older = random.uniform() < 0.5
    if older:
        (place / OUTPUTS[0]).write_bytes(expected[OUTPUTS[0]])
    process = start(place)
    time.sleep(random.uniform(0.0, 0.9 * seconds))
    if not process.is_running:
        process.end()
        return None
    if random.uniform() < _GREEDY:
        with filling(place):
            ended = process.end()
    else:
        fill(place, int(random.integers(0, _MOST_FREE)))
        ended = process.end()
    left = present(place, (*OUTPUTS, *CHECKPOINTS))
    counts = Counter({"moments": 1, f"exit status {ended.status}": 1, **{f"left {name}": 1 for name in left}})
    failures = [f"{path.name} is left" for path in asides(place)]
    if ended.status not in (0, 1) or len(ended.sentences) != ended.status:
        failures.append(f"status {ended.status}, and said {ended.sentences}")
    counts.update(f"said: {line.replace(str(place), 'DISK')}" for line in ended.sentences)
    look = place.parent / f"look-{place.name}"
    failures += [f"{name} is broken" for name in left if not is_whole(Path(f"{look}-{name}"), left[name])]
    if not left:
        failures.append("nothing is left")
    if (place / "other.bin").read_bytes() != stranger:
        failures.append("another file is damaged")
    if older and OUTPUTS[0] not in left:
        failures.append("an older picture is lost")
    (place / "filler").unlink()
    again = start(place, "--resume").end()
    counts["resumed"] = again.status == 0 and present(place) == expected
    if not counts["resumed"]:
        failures.append(f"it does not go on: status {again.status}: {again.err}")
    return counts, [f"{seed}: {failure}" for failure in failures]


def trials(moments, jobs, seed, home):
    """Fill so many disks, so many at a time."""
    (home / "ball.yaml").write_text(BALL)
    counts, failures = Counter(), []
    with disk(home / "whole") as place:
        # The first one compiles.
        for _ in range(2):
            process = start(place)
            begin = time.perf_counter()
            ended = process.end()
            assert ended.status == 0, ended.err
            seconds, expected = time.perf_counter() - begin, present(place)

    def take(number):
        found, tries = None, itertools.count(seed + number, moments)
        while found is None:
            with disk(home / f"disk-{(tried := next(tries))}") as place:
                found = trial(place, tried, expected, seconds)
        return found

    with ThreadPoolExecutor(jobs) as pool:
        for more, wrong in pool.map(take, range(moments)):
            counts.update(more)
            failures += wrong
    return counts, failures


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--moments", type=int, default=50)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        try:
            return print_table(*trials(given.moments, given.jobs, given.seed, Path(folder)))
        except PermissionError as error:
            print(f"a small disk cannot be mounted here: {error}", file=sys.stderr)
            return 2


if __name__ == "__main__":
    sys.exit(main())
