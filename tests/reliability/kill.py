"""Kill and resume renders at any moment until they are done, and check that the picture is the same.

    python -m tests.reliability.kill --renders 200 --jobs 3

Each render is a process that SIGKILL ends at a random moment of its life, from the start of the interpreter to the
writing of files; a third of the times as soon as a file is being written.  It is resumed by any number of threads, and
killed again, up to so many times; then it runs to its end.  Its files are compared, byte by byte, with those of a
render that nobody has killed.  Meanwhile another process opens the outputs and both checkpoints without a pause, and
checks all that it reads.
"""

import argparse
import itertools
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from raytracer.cli.base.app import main
from tests.reliability.processes import (
    BALL,
    CHECKPOINT,
    CHECKPOINTS,
    OUTPUTS,
    Process,
    asides,
    looking,
    present,
    print_table,
)

KINDS = {
    "plain": ("--spp", "1504"),
    "noise": ("--spp", "6000", "--noise", "0.008%"),
    "layers": ("--spp", "2004", "--aov", "depth,normal", "--crop", "8,8,60,44"),
}
"""Renders by what decides on their samples: as many a pixel, where the error is, and with more on the film."""

MOST_KILLS = 3
"""Most times that a render is killed."""

# How often a render is killed while it writes, and which file of those it writes then, at most.
_ON_A_WRITE = 1 / 3
_MOST_WRITES = 8

# What a process takes beside others, against one by itself.
_SLOWER = 1.25


def start(folder, kind, *more):
    """Start a render in a folder, with outputs in `now`."""
    outputs = [word for name in OUTPUTS for word in ("-o", f"now/{name}")]
    return Process(["render", "ball.yaml", *outputs, *KINDS[kind], "--checkpoint", "0.1s", "-q", *more], folder)


def make(folder):
    """Make a folder to render in."""
    folder.mkdir()
    (folder / "ball.yaml").write_text(BALL)
    return folder


def kill_once(process, now, random, seconds):
    """Kill a process at a random moment, or while it writes; tell when that was, or None if it has ended before."""
    which = random.integers(1, _MOST_WRITES + 1) if random.uniform() < _ON_A_WRITE else None
    moment = random.uniform(0.0, 1.05 * seconds)
    left = set(asides(now))
    written = set(left)
    while process.is_running:
        written.update(asides(now))
        if process.seconds >= moment if which is None else len(written - left) >= which:
            break
        time.sleep(0.0005)
    has_picture, has_checkpoint = (now / OUTPUTS[-1]).exists(), (now / CHECKPOINT).exists()
    process.send(signal.SIGKILL)
    if process.popen.wait() != -signal.SIGKILL:
        return None
    if which is not None:
        return "while a file was written"
    return "with all outputs" if has_picture else "with a checkpoint" if has_checkpoint else "before any file"


def render(folder, kind, seed, seconds, expected):
    """Render, kill and resume until the picture is done; return counts of what happened, and failures.

    seconds : what a process takes that nobody kills.
    """
    random, now = np.random.default_rng(seed), folder / "now"
    shutil.rmtree(now, ignore_errors=True)
    counts, failures = Counter(renders=1), []
    for turn in range(MOST_KILLS + 1):
        counts["resumed"] += (now / CHECKPOINT).exists()
        process = start(folder, kind, *["--resume"][: turn > 0], "--threads", str(random.integers(1, 4)))
        when = kill_once(process, now, random, seconds) if turn < MOST_KILLS else None
        ended = process.end()
        if when is not None:
            counts.update({"killed": 1, f"killed {when}": 1})
            continue
        counts.update(f"said: {line}" for line in ended.err.splitlines())
        if ended.status != 0:
            failures.append(f"{kind} {seed}: status {ended.status}: {ended.err}")
        break
    found = present(now)
    failures += [f"{kind} {seed}: {name} differs" for name in OUTPUTS if found.get(name) != expected[name]]
    failures += [f"{kind} {seed}: {path.name} is left" for path in asides(now)]
    counts["equal"] += found == expected
    return counts, failures


def kill(renders, jobs, seed, folder, *, kinds=tuple(KINDS)):
    """Kill and resume so many renders, so many at a time; return counts of what happened, and failures."""
    whole, counts, failures = {}, Counter(), []
    for kind in kinds:
        place = make(folder / f"unbroken-{kind}")
        # This one compiles.
        compiled = ["render", str(place / "ball.yaml"), "-o", str(place / "compiled.exr"), "-q"]
        assert main([*compiled, *KINDS[kind], "--spp", "16"]) == 0
        process = start(place, kind)
        assert process.end().status == 0
        whole[kind] = (process.seconds * (1.0 if jobs == 1 else _SLOWER), present(place / "now"))

    def work(job):
        place, found = make(folder / f"job-{job}"), []
        with looking(place / "now", (*OUTPUTS, *CHECKPOINTS)) as ended:
            for number in range(job, renders, jobs):
                kind = kinds[number % len(kinds)]
                found.append(render(place, kind, seed + number, *whole[kind]))
            reads, broken = ended()
        return [*found, ({f"opened {name}": count for name, count in reads.items()}, broken)]

    with ThreadPoolExecutor(jobs) as pool:
        for more, wrong in itertools.chain(*pool.map(work, range(jobs))):
            counts.update(more)
            failures += wrong
    return counts, failures


def command():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--renders", type=int, default=200)
    parser.add_argument("--jobs", type=int, default=3)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        return print_table(*kill(given.renders, given.jobs, given.seed, Path(folder)))


if __name__ == "__main__":
    sys.exit(command())
