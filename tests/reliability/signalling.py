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
from pathlib import Path

import numpy as np

from tests.reliability.processes import BALL, CHECKPOINT, FOREVER, OUTPUTS, Process, asides, is_whole

MOST_SECONDS = 2.0
"""Seconds that the end may take after the first signal."""

_HD = ("-D", "film.width=1280", "-D", "film.height=720", "--checkpoint", "3s")
_APART_SECONDS = 0.1


def has_checkpoint(folder):
    return (folder / CHECKPOINT).exists()


def is_compiling(folder):
    return any((folder / "cache").rglob("*.lock"))


# Moments to send a signal: more words of the command, and what is to be there before.
PHASES = {
    "starting": ((), lambda folder: True),
    "compiling": ((), is_compiling),
    "rendering, 64 x 48": ((), has_checkpoint),
    "rendering, 64 x 48, to an error": (("--noise", "0.0001%"), has_checkpoint),
    "rendering, 1280 x 720": (_HD, has_checkpoint),
    "a second time, while it writes 1280 x 720": (_HD, has_checkpoint),
}


def measure(name, number, random, folder):
    """Start a render, and signal it in a phase; return the seconds that its end took, and what was wrong."""
    more, is_there = PHASES[name]
    (folder / "ball.yaml").write_text(BALL)
    cache = {"RAYTRACER_CACHE_DIR": str(folder / "cache")} if is_there is is_compiling else {}
    words = ["render", "ball.yaml", *(word for output in OUTPUTS for word in ("-o", output)), "--checkpoint", "0.5s"]
    process = Process([*words, *more, *FOREVER, "-q"], folder, env={**os.environ, **cache})
    process.until(lambda: is_there(folder))
    # Somewhere within the phase; a process that has just been started has no handler yet.
    time.sleep(random.uniform(0.5, 1.5))
    sent = (signal.SIGINT, signal.SIGTERM)[number % 2]
    process.send(sent)
    begin = time.perf_counter()
    if name.startswith("a second time"):
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
    files = [path for path in folder.glob("out.*") if path.suffix != ".previous"]
    failures += [f"{path.name} is broken" for path in files if not is_whole(path, path.read_bytes())]
    return seconds, [f"{name}: {failure}" for failure in failures]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--times", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    random, failures = np.random.default_rng(given.seed), []
    print(f"{'s from the signal to the end':<44} {'times':>6} {'median':>8} {'worst':>8}")
    for name in PHASES:
        taken = []
        for number in range(given.times):
            with tempfile.TemporaryDirectory() as folder:
                seconds, wrong = measure(name, number, random, Path(folder))
            taken.append(seconds)
            failures += wrong
        print(f"{name:<44} {given.times:>6} {np.median(taken):>8.2f} {max(taken):>8.2f}", flush=True)
        if max(taken) > MOST_SECONDS:
            failures.append(f"{name}: took {max(taken):.2f} s")
    print(*failures, sep="\n")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
