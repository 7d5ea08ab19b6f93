"""Measure the time from a signal to the end of the process, in each phase of a render.

    python -m tests.reliability.signalling --times 20

A render is to end within two seconds of Ctrl-C or SIGTERM, with what is there written; and at once of a second one.
"""

import argparse
import os
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from tests.reliability.processes import BALL, FOREVER, Process, asides, is_whole

MOST_SECONDS = 2.0
"""Seconds that the end may take after the first signal."""

_HD = ("-D", "film.width=1280", "-D", "film.height=720", "--checkpoint", "3s")

_APART_SECONDS = 0.1


class Phase(NamedTuple):
    """A moment to send a signal: words of the command, and the files that must be in the folder before."""

    words: tuple[str, ...]
    is_there: Callable[[Path], bool]
    is_cold: bool = False
    again: bool = False


def _has_checkpoint(folder: Path) -> bool:
    return (folder / "out.npy.checkpoint").exists()


PHASES = {
    "starting": Phase((), lambda folder: True),
    "compiling": Phase((), lambda folder: any((folder / "cache").rglob("*.lock")), is_cold=True),
    "rendering, 64 x 48": Phase((), _has_checkpoint),
    "rendering, 64 x 48, to an error": Phase(("--noise", "0.0001%"), _has_checkpoint),
    "rendering, 1280 x 720": Phase(_HD, _has_checkpoint),
    "a second time, while it writes 1280 x 720": Phase(_HD, _has_checkpoint, again=True),
}


class Measured(NamedTuple):
    """Seconds from a signal to the end, in each of some processes; failures, sentences."""

    seconds: list[float]
    failures: list[str]


def measure(phase: Phase, times: int, random: np.random.Generator) -> Measured:
    """Start so many renders, and signal each in a phase, half of them by Ctrl-C and half by SIGTERM."""
    found = Measured([], [])
    for number in range(times):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            (folder / "ball.yaml").write_text(BALL)
            environment = {**os.environ, "RAYTRACER_CACHE_DIR": str(folder / "cache")} if phase.is_cold else None
            words = ["render", "ball.yaml", "-o", "out.npy", "-o", "out.exr", "-o", "out.png"]
            words += ["--checkpoint", "0.5s", *phase.words]
            process = Process([*words, *FOREVER, "-q"], folder, env=environment)
            process.until(lambda folder=folder: phase.is_there(folder))  # type: ignore[misc]
            # Somewhere within the phase; a process that has just been started has no handler yet.
            time.sleep(random.uniform(0.5, 1.5))
            sent = signal.SIGINT if number % 2 == 0 else signal.SIGTERM
            process.send(sent)
            begin = time.perf_counter()
            if phase.again:
                # Of two at once the system would make one.
                time.sleep(_APART_SECONDS)
                process.until(lambda folder=folder: bool(asides(folder)))  # type: ignore[misc]
                process.send(sent)
                begin = time.perf_counter()
            process.popen.wait()
            found.seconds.append(time.perf_counter() - begin)
            ended = process.end()
            if ended.status != 128 + sent or "Traceback" in ended.err or len(ended.err.splitlines()) != 1:
                found.failures.append(f"status {ended.status}, and said {ended.err}")
            for path in folder.glob("out.*"):
                if path.suffix != ".previous" and not is_whole(path, path.read_bytes()):
                    found.failures.append(f"{path.name} is broken")
            found.failures.extend(f"{path.name} is left" for path in asides(folder))
    return found


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--times", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args(arguments)
    random = np.random.default_rng(given.seed)
    failures: list[str] = []
    print(f"{'s from the signal to the end':<44} {'times':>6} {'median':>8} {'worst':>8}")
    for name, phase in PHASES.items():
        found = measure(phase, given.times, random)
        print(f"{name:<44} {given.times:>6} {np.median(found.seconds):>8.2f} {max(found.seconds):>8.2f}", flush=True)
        failures += [f"{name}: {failure}" for failure in found.failures]
        if max(found.seconds) > MOST_SECONDS:
            failures.append(f"{name}: took {max(found.seconds):.2f} s")
    for sentence in failures:
        print(sentence)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
