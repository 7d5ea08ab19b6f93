"""What the benchmarks share: warm renderers that take turns, tables, and what the machine is.

Renderers stay warm in processes of their own and take turns, forwards in one round and backwards in the next, so that
whatever else the machine does meets all of them alike; only rendering is timed. Every round has seeds of its own.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import platform
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.analysis.cost.machine import load_average, processor
from raytracer.rendering.tile_scheduler import TILE_SIZE
from raytracer.rendering.worker_pool import available_threads
from raytracer.scene.load import load

ROOT = Path(__file__).parents[1]
SCENES = ROOT / "scenes"
OUTPUTS = ROOT / "outputs"
WORKER_PROGRAM = ROOT / "bench" / "worker.py"
PEER_PROGRAM = ROOT / "bench" / "peers" / "render_mitsuba.py"
PEER_PYTHON = ROOT / ".venv-peers" / "bin" / "python"

ROUNDS, QUICK_ROUNDS = 9, 3
MEGA = 1e6

Answer = dict[str, Any]
Array = NDArray[np.float64]


class Failed(Exception):  # noqa: N818
    """A process did not do what it was asked; with its own words."""


class Request(NamedTuple):
    """A render: its seed, its samples per pixel (None: those that the renderer was started with), and where to."""

    seed: int
    spp: int | None = None
    out: Path | None = None


class Worker:
    """A warm renderer in a process of its own, asked over its standard input.

    Raises
    ------
    Failed : the process ended.
    """

    def __init__(self, command: Sequence[str]) -> None:
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env={**os.environ, "PYTHONPATH": str(ROOT)},
        )
        self.about: Answer = self._answer()

    @staticmethod
    def _stream(stream: IO[str] | None) -> IO[str]:
        if stream is None:
            raise Failed("the process has no pipe")
        return stream

    def _answer(self) -> Answer:
        line = self._stream(self._process.stdout).readline()
        if not line:
            self._process.wait()
            words = self._stream(self._process.stderr).read().strip().splitlines()
            raise Failed(words[-1] if words else f"exit status {self._process.returncode}")
        return dict(json.loads(line))

    def render(self, request: Request) -> Answer:
        """Render once; what it took, "render" being the seconds."""
        stream = self._stream(self._process.stdin)
        stream.write(json.dumps({key: value for key, value in request._asdict().items() if value}, default=str) + "\n")
        stream.flush()
        return self._answer()

    def close(self) -> None:
        """End the process."""
        self._process.communicate()


class Renderers(dict[str, Worker]):
    """Warm renderers by name, ended when left as a context; `failed` says why others did not start."""

    def __init__(self) -> None:
        super().__init__()
        self.failed: dict[str, str] = {}

    def __enter__(self) -> Renderers:
        return self

    def __exit__(self, *_: object) -> None:
        for worker in self.values():
            worker.close()

    def start(self, name: str, command: Sequence[str]) -> None:
        """Add a renderer."""
        say(f"  {name} starts")
        try:
            self[name] = Worker(command)
        except (Failed, OSError) as error:
            self.failed[name] = str(error)
            say(f"  {name}: {error}")

    def check(self) -> None:
        """Make sure that all have started.

        Raises
        ------
        Failed : for the first that did not.
        """
        for name, reason in self.failed.items():
            raise Failed(f"{name}: {reason}")

    def take_turns(
        self, rounds: int, first_seed: int, spp: Mapping[str, int], *, pictures: bool = False
    ) -> dict[str, list[Answer]]:
        """Ask the named renderers in each round, by samples per pixel; with their "picture"s if asked for.

        Raises
        ------
        Failed : a process ended, or a picture holds values that are not finite.
        """
        names = list(spp)
        answers: dict[str, list[Answer]] = {name: [] for name in names}
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder) / "picture.npy" if pictures else None
            for turn in range(rounds):
                for name in names if turn % 2 == 0 else names[::-1]:
                    answer = self[name].render(Request(first_seed + turn, spp[name], out))
                    answers[name].append(answer if out is None else {**answer, "picture": picture(out)})
                say("  " + ", ".join(f"{name} {answers[name][-1]['render']:.3f} s" for name in names))
        return answers


def picture(path: Path) -> Array:
    """Read a picture (height, width, 3) that a renderer wrote.

    Raises
    ------
    Failed : it holds values that are not finite.
    """
    values: Array = np.load(path).astype(np.float64)
    if not np.isfinite(values).all():
        raise Failed("a picture holds values that are not finite")
    return values


def figures(answers: Sequence[Answer], of: str = "render") -> Array:
    """List a renderer's answers of all rounds: seconds, unless another figure is named."""
    return np.array([answer[of] for answer in answers], dtype=np.float64)


def pictures_of(answers: Sequence[Answer]) -> Array:
    """Stack the pictures of all rounds, (rounds, pixels, 3)."""
    return np.stack([answer["picture"].reshape(-1, 3) for answer in answers])


def tiles_of(width: int, height: int) -> NDArray[np.int64]:
    """Number the tile of each pixel, row by row; intervals of a picture's error are a bootstrap over these."""
    x, y = np.arange(width) // TILE_SIZE, np.arange(height) // TILE_SIZE
    return np.asarray((y[:, None] * (x[-1] + 1) + x[None, :]).ravel(), dtype=np.int64)


def our_command(scene: Path, width: int, height: int, spp: int, threads: int, **options: str) -> list[str]:
    """Return the command that starts our warm renderer; options are those of worker.py."""
    more = [word for name, value in options.items() for word in (f"--{name}", value)]
    return [sys.executable, str(WORKER_PROGRAM), *_size(scene, width, height, spp, threads), *more]


def peer_command(peer: str, scene: Path, width: int, height: int, spp: int, threads: int, **options: str) -> list[str]:
    """Return the command that starts Mitsuba's warm renderer; options are those of render_mitsuba.py."""
    more = [word for name, value in options.items() for word in (f"--{name}", value)]
    return [peer, str(PEER_PROGRAM), *_size(scene, width, height, spp, threads), *more, "--serve"]


def plain_command(scene: Path, width: int, height: int, spp: int, threads: int, *options: str) -> list[str]:
    """Return the command that starts the plain path tracer in C++; options are those of plain.py."""
    return [sys.executable, str(ROOT / "bench" / "plain.py"), *_size(scene, width, height, spp, threads), *options]


def reduced(scene: Path, pixels: int) -> tuple[int, int]:
    """Reduce the width and height of a scene's picture to about that many pixels."""
    film = load(scene).film
    scale = min(1.0, math.sqrt(pixels / (film.width * film.height)))
    return round(film.width * scale), round(film.height * scale)


def _size(scene: Path, width: int, height: int, spp: int, threads: int) -> list[str]:
    numbers = {"width": width, "height": height, "spp": spp, "threads": threads}
    return [str(scene), *(word for name, value in numbers.items() for word in (f"--{name}", str(value)))]


# ---- The machine


def revision() -> str:
    """Return the commit that is measured, with a plus if the tree has changed since."""
    words = ("git", "-C", str(ROOT))
    try:
        commit, status = (
            subprocess.run([*words, *more], capture_output=True, text=True, check=True).stdout.strip()
            for more in (("rev-parse", "--short", "HEAD"), ("status", "--porcelain", "--untracked-files=no"))
        )
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    return commit + "+" * bool(status)


def measured(work: Callable[[], Mapping[str, Any]]) -> dict[str, Any]:
    """Return the result of `work`, and under "machine" what it was measured on."""
    about = {
        "processor": processor(),
        "cores": available_threads(),
        "system": platform.platform(),
        "revision": revision(),
    }
    loads = [load_average()]
    result = work()
    loads.append(load_average())
    return {**result, "machine": {**about, "load": loads}}


# ---- Reports


def say(text: str) -> None:
    """Tell how far the benchmark is."""
    print(text, file=sys.stderr, flush=True)


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Format a Markdown table."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines) + "\n"


def with_interval(ratio: Sequence[float]) -> str:
    """Format a ratio and its interval."""
    return "{:.2f} ({:.2f} .. {:.2f})".format(*ratio)


def introduction(about: Mapping[str, Any]) -> str:
    """Write the lines that begin a report: on what it was measured."""
    before, after = ("unknown" if load is None else f"{load:.2f}" for load in about["load"])
    return (
        f"{about['processor']}, {about['cores']} cores, {about['system']}; rt at {about['revision']};\n"
        f"load average {before} before, {after} after; seeds 1 and up.\n"
    )


def publish(result: Mapping[str, Any], text: str, path: Path) -> None:
    """Print a report, and write all figures as JSON."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")
    print(introduction(result["machine"]))
    print(text)


def arguments_for(doc: str | None, name: str) -> argparse.ArgumentParser:
    """Make the parser of what every benchmark takes on its command line."""
    parser = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="a look: few rounds and samples")
    parser.add_argument("--rounds", type=int, help=f"default: {ROUNDS}, or {QUICK_ROUNDS} if quick")
    parser.add_argument("--threads", type=int, default=available_threads(), help="default: all processors")
    parser.add_argument("--out", type=Path, default=OUTPUTS / f"{name}.json")
    return parser


def scene_files(names: Sequence[str]) -> list[Path]:
    """List the scenes of scenes/ so named, or all."""
    return [path for path in sorted(SCENES.glob("*.yaml")) if not names or path.stem in names]
