"""Kill and resume renders at any moment until they are done, and check that the picture is the same.

    python -m tests.reliability.kill --renders 200 --jobs 3

Each render is a process that SIGKILL ends at a random moment of its life, from the start of the interpreter to the
writing of files; a third of the times as soon as a file is being written.  It is resumed by any number of threads, and
killed again, up to so many times; then it runs to its end.  Its files are compared, byte by byte, with those of a
render that nobody has killed.  Meanwhile another process opens the outputs and both checkpoints without a pause, and
checks all that it reads.
"""

import argparse
import shutil
import signal
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from tests.reliability.processes import BALL, Process, asides, checkpoints, looking, run

OUTPUTS = ("out.png", "out.exr", "out.npy")

KINDS = {
    "plain": ("--spp", "3004"),
    "noise": ("--spp", "6000", "--noise", "0.008%"),
    "layers": ("--spp", "2004", "--aov", "depth,normal", "--crop", "8,8,60,44"),
}
"""Renders by what decides on their samples: as many a pixel, where the error is, and with more on the film."""

MOST_KILLS = 3
"""Most times that a render is killed."""

# How often a render is killed while it writes, and which file of those it writes then, at most.
_ON_A_WRITE = 1 / 3
_MOST_WRITES = 8

_PROMPT_SECONDS = 0.0005

# What a process takes beside others, against one by itself.
_SLOWER = 1.25


@dataclass
class Figures:
    """The outcomes of all renders.

    kills, by what was there when they came; failures, sentences.
    """

    renders: int = 0
    equal: int = 0
    attempts: int = 0
    resumed: int = 0
    kills: Counter[str] = field(default_factory=Counter)
    reads: Counter[str] = field(default_factory=Counter)
    broken: list[str] = field(default_factory=list)
    failures: list[str] = field(default_factory=list)
    said: Counter[str] = field(default_factory=Counter)

    def table(self) -> str:
        """Format the outcomes, in lines of a name and a number."""
        rows: list[tuple[str, object]] = [("renders", self.renders), ("equal, byte by byte", self.equal)]
        rows += [("processes", self.attempts), ("killed", sum(self.kills.values()))]
        rows += [(f"  {what}", count) for what, count in sorted(self.kills.items())]
        rows += [("resumed from a checkpoint", self.resumed)]
        rows += [("files opened by the watcher", sum(self.reads.values()))]
        rows += [(f"  {name}", count) for name, count in sorted(self.reads.items())]
        rows += [("of these broken", len(self.broken)), ("failures", len(self.failures))]
        rows += [(f"  said: {sentence}", count) for sentence, count in sorted(self.said.items())]
        return "\n".join(f"{name:<44} {value}" for name, value in rows)


def words(kind: str, *more: str) -> list[str]:
    outputs = [word for name in OUTPUTS for word in ("-o", f"now/{name}")]
    return ["render", "ball.yaml", *outputs, *KINDS[kind], "--checkpoint", "0.1s", "--quiet", *more]


class Job:
    """One render after another in a folder of its own."""

    def __init__(self, folder: Path, figures: Figures, lock: threading.Lock) -> None:
        self._folder, self._figures, self._lock = folder, figures, lock
        folder.mkdir()
        (folder / "ball.yaml").write_text(BALL)
        self._now = folder / "now"

    def render(self, kind: str, seed: int, seconds: float, expected: dict[str, bytes]) -> None:
        """Render, kill and resume until the picture is done.

        seconds : what a process takes that nobody kills.
        """
        random = np.random.default_rng(seed)
        shutil.rmtree(self._now, ignore_errors=True)
        failures: list[str] = []
        kills: Counter[str] = Counter()
        attempts = resumed = 0
        for turn in range(MOST_KILLS + 1):
            attempts += 1
            had = (self._now / checkpoints(OUTPUTS[0])[0]).exists()
            resumed += had
            more = [*(["--resume"] if turn else []), "--threads", str(random.integers(1, 4))]
            process = Process(words(kind, *more), self._folder)
            if turn < MOST_KILLS:
                self._kill(process, random, seconds, kills)
            ended = process.end()
            if ended.status == -signal.SIGKILL:
                continue
            said = [line.replace("now/", "") for line in ended.err.splitlines()]
            with self._lock:
                self._figures.said.update(said)
            if ended.status != 0:
                failures.append(f"{kind} {seed}: status {ended.status}: {ended.err}")
            break
        found = {name: (self._now / name).read_bytes() for name in OUTPUTS if (self._now / name).exists()}
        failures += [f"{kind} {seed}: {name} differs" for name in OUTPUTS if found.get(name) != expected[name]]
        failures += [f"{kind} {seed}: {path.name} is left" for path in asides(self._now)]
        with self._lock:
            self._figures.renders += 1
            self._figures.equal += found == expected
            self._figures.attempts += attempts
            self._figures.resumed += resumed
            self._figures.kills.update(kills)
            self._figures.failures += failures

    def _kill(self, process: Process, random: np.random.Generator, seconds: float, kills: Counter[str]) -> None:
        """Kill a process at a random moment, or while it writes; note the files that were there."""
        which = random.integers(1, _MOST_WRITES + 1) if random.uniform() < _ON_A_WRITE else None
        moment = process.began + random.uniform(0.0, 1.05 * seconds)
        written: set[Path] = set(asides(self._now))
        left = len(written)
        while process.is_running:
            if which is None:
                if time.perf_counter() >= moment:
                    break
            else:
                written.update(asides(self._now))
                if len(written) - left >= which:
                    break
            time.sleep(_PROMPT_SECONDS)
        if not process.is_running:
            return
        has_picture = (self._now / OUTPUTS[-1]).exists()
        has_checkpoint = (self._now / checkpoints(OUTPUTS[0])[0]).exists()
        process.send(signal.SIGKILL)
        if process.popen.wait() != -signal.SIGKILL:
            return
        if which is not None:
            kills["while a file was written"] += 1
        elif has_picture:
            kills["with all outputs there"] += 1
        elif has_checkpoint:
            kills["with a checkpoint there"] += 1
        else:
            kills["before the first checkpoint"] += 1


def unbroken(folder: Path, kinds: Sequence[str]) -> dict[str, tuple[dict[str, bytes], float]]:
    """Make the files of each kind of render without kills, and measure the seconds of its process."""
    folder.mkdir()
    (folder / "ball.yaml").write_text(BALL)
    found: dict[str, tuple[dict[str, bytes], float]] = {}
    for kind in kinds:
        # The first one compiles.
        for _ in range(2):
            shutil.rmtree(folder / "now", ignore_errors=True)
            begin = time.perf_counter()
            ended = run(words(kind), folder)
            assert ended.status == 0, ended.err
            seconds = time.perf_counter() - begin
        found[kind] = {name: (folder / "now" / name).read_bytes() for name in OUTPUTS}, seconds
    return found


def kill(
    renders: int, jobs: int, seed: int, folder: Path, *, kinds: Sequence[str] = tuple(KINDS), say: bool = False
) -> Figures:
    """Kill and resume so many renders, so many at a time."""
    whole = unbroken(folder / "unbroken", kinds)
    figures, lock = Figures(), threading.Lock()
    names = [name for output in OUTPUTS for name in (output, *checkpoints(output))]

    def work(job: int) -> None:
        place = folder / f"job-{job}"
        work = Job(place, figures, lock)
        with looking(place / "now", names) as ended:
            for number in range(job, renders, jobs):
                kind = kinds[number % len(kinds)]
                expected, seconds = whole[kind]
                work.render(kind, seed + number, seconds * (1.0 if jobs == 1 else _SLOWER), expected)
                if say:
                    print(f"{figures.renders} of {renders}, {len(figures.failures)} failures", file=sys.stderr)
            seen = ended()
        with lock:
            figures.reads.update(seen.reads)
            figures.broken += seen.broken

    with ThreadPoolExecutor(jobs) as pool:
        for done in [pool.submit(work, job) for job in range(jobs)]:
            done.result()
    return figures


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--renders", type=int, default=200)
    parser.add_argument("--jobs", type=int, default=3)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args(arguments)
    begin = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        figures = kill(given.renders, given.jobs, given.seed, Path(folder), say=True)
    print(figures.table())
    print(f"{'seconds':<44} {time.perf_counter() - begin:.0f}")
    for sentence in [*figures.failures, *figures.broken]:
        print(sentence)
    return 1 if figures.failures or figures.broken or figures.equal < given.renders else 0


if __name__ == "__main__":
    sys.exit(main())
