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
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from tests.reliability.processes import BALL, CHECKPOINTS, FOREVER, OUTPUTS, Process, asides, is_whole, present

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


def _has_checkpoint(folder):
    return (folder / CHECKPOINTS[0]).exists()


PHASES = {
    "starting": Phase((), lambda folder: True),
    "compiling": Phase((), lambda folder: any((folder / "cache").rglob("*.lock")), is_cold=True),
    "rendering, 64 x 48": Phase((), _has_checkpoint),
    "rendering, 64 x 48, to an error": Phase(("--noise", "0.0001%"), _has_checkpoint),
    "rendering, 1280 x 720": Phase(_HD, _has_checkpoint),
    "a second time, while it writes 1280 x 720": Phase(_HD, _has_checkpoint, again=True),
}


def end(phase, sent, delay):
    """Start a render, and signal it in a phase; return the seconds from the signal to the end, and failures."""
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        (folder / "ball.yaml").write_text(BALL)
        environment = {**os.environ, "RAYTRACER_CACHE_DIR": str(folder / "cache")} if phase.is_cold else None
        words = ["render", "ball.yaml", *(word for name in OUTPUTS for word in ("-o", name))]
        process = Process([*words, "--checkpoint", "0.5s", *phase.words, *FOREVER, "-q"], folder, env=environment)
        process.until(lambda: phase.is_there(folder))
        # Somewhere within the phase; a process that has just been started has no handler yet.
        time.sleep(delay)
        process.send(sent)
        if phase.again:
            # Of two at once the system would make one.
            time.sleep(_APART_SECONDS)
            process.until(lambda: bool(asides(folder)))
            process.send(sent)
        begin = time.perf_counter()
        process.popen.wait()
        seconds, ended = time.perf_counter() - begin, process.end()
        failures = [f"{path.name} is left" for path in asides(folder)]
        if ended.status != 128 + sent or "Traceback" in ended.err or len(ended.err.splitlines()) != 1:
            failures.append(f"status {ended.status}, and said {ended.err}")
        for name, data in present(folder, (*OUTPUTS, CHECKPOINTS[0])).items():
            failures += [] if is_whole(folder / name, data) else [f"{name} is broken"]
    return seconds, failures + ([f"took {seconds:.2f} s"] if seconds > MOST_SECONDS else [])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--times", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    random, failures = np.random.default_rng(given.seed), []
    print(f"{'s from the signal to the end':<44} {'times':>6} {'median':>8} {'worst':>8}")
    for name, phase in PHASES.items():
        # Half of them by Ctrl-C and half by SIGTERM.
        signals = [signal.SIGINT if number % 2 == 0 else signal.SIGTERM for number in range(given.times)]
        found = [end(phase, sent, random.uniform(0.5, 1.5)) for sent in signals]
        seconds = [one for one, _ in found]
        print(f"{name:<44} {given.times:>6} {np.median(seconds):>8.2f} {max(seconds):>8.2f}", flush=True)
        failures += [f"{name}: {failure}" for _, wrong in found for failure in wrong]
    print(*failures, sep="\n")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
