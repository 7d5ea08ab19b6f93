"""Measure the renderer: speed against Mitsuba 3, start-up, compiling, memory.

    python bench/bench.py --peer .venv-peers/bin/python

Renderers stay warm in processes of their own and take turns, forwards in one round and backwards in the next, so that
whatever else the machine does meets all of them alike; only rendering is timed. What is compared is the median of the
ratios within a round. Start-up and compiling are measured from fresh processes.
Prints Markdown, and writes every figure to outputs/bench.json. Without Mitsuba, for which `make peers` makes an
environment, only the renderer itself is measured.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np

ROOT = Path(__file__).parents[1]
SCENES = ROOT / "scenes"
PEER_PROGRAM = ROOT / "peers" / "render_mitsuba.py"
PEER_PYTHON = ROOT / ".venv-peers" / "bin" / "python"
RT = "import sys; from raytracer.cli.main import main; sys.exit(main())"

ROUNDS, QUICK_ROUNDS = 9, 3
RESAMPLES, COVERAGE = 10_000, 95.0
TINY = ("--spp", "1", "--crop", "0,0,8,8")
MEGA = 1e6


class Task(NamedTuple):
    """A scene at a size."""

    scene: str
    width: int
    height: int
    spp: int

    @property
    def path(self) -> Path:
        """Its file."""
        return SCENES / f"{self.scene}.yaml"


TASKS = (Task("cover", 400, 225, 64), Task("million", 512, 512, 64))

OURS, OURS_INDEPENDENT, OURS_FAST, PEER = "rt", "rt, independent", "rt, independent, fast", "Mitsuba llvm_ad_rgb"
"""As the scene says; with the peer's kind of samples; and with its kind of intersections too: float32, not robust."""

TARGETS = {
    "cover, time / Mitsuba's": 0.9,
    "million, time / Mitsuba's": 1.0,
    "speed-up by all threads (at least)": 3.7,
    "cold compile, slowest scene (s)": 10.0,
    "warm rt render of 8 x 8 pixels (s)": 1.5,
    "rt --help (s)": 0.4,
    "peak memory, million (MB)": 400.0,
}
"""What the project asks of itself on four cores."""


class Failed(Exception):  # noqa: N818
    """A process did not do what it was asked; with its own words."""


class Worker:
    """A warm renderer in a process of its own, asked by seed over its standard input.

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
        self.about: dict[str, Any] = self._answer()

    @staticmethod
    def _stream(stream: IO[str] | None) -> IO[str]:
        if stream is None:
            raise Failed("the process has no pipe")
        return stream

    def _answer(self) -> dict[str, Any]:
        line = self._stream(self._process.stdout).readline()
        if not line:
            self._process.wait()
            words = self._stream(self._process.stderr).read().strip().splitlines()
            raise Failed(words[-1] if words else f"exit status {self._process.returncode}")
        return dict(json.loads(line))

    def render(self, seed: int) -> dict[str, Any]:
        """Render once; what it took."""
        stream = self._stream(self._process.stdin)
        stream.write(f"{seed}\n")
        stream.flush()
        return self._answer()

    def close(self) -> None:
        """End the process."""
        self._process.communicate()


def ratio_interval(ratios: Sequence[float]) -> tuple[float, float, float]:
    """Median of paired ratios, and a percentile bootstrap interval of it.

    References: Efron, Tibshirani 1993, "An Introduction to the Bootstrap", sec. 13.3.
    """
    values = np.asarray(ratios)
    draws = np.random.default_rng(0).choice(values, (RESAMPLES, len(values)))
    tail = (100.0 - COVERAGE) / 2.0
    low, high = np.percentile(np.median(draws, axis=1), [tail, 100.0 - tail])
    return float(np.median(values)), float(low), float(high)


def commands(task: Task, threads: int, peer: str | None) -> dict[str, list[str]]:
    """How each renderer is started for a task."""
    size = [str(task.path), "--width", str(task.width), "--height", str(task.height), "--spp", str(task.spp)]
    size += ["--threads", str(threads)]
    ours = [sys.executable, str(ROOT / "bench" / "worker.py"), *size]
    independent = [*ours, "--sampler", "independent"]
    players = {OURS: ours, OURS_INDEPENDENT: independent, OURS_FAST: [*independent, "--accuracy", "fast"]}
    return players if peer is None else {**players, PEER: [peer, str(PEER_PROGRAM), *size, "--serve"]}


def interleave(task: Task, threads: int, rounds: int, peer: str | None) -> dict[str, Any]:
    """Warm renders of every renderer in turn: seconds, rates and noise of each, and ratios to the peer."""
    workers: dict[str, Worker] = {}
    result: dict[str, Any] = {**task._asdict(), "threads": threads, "rounds": rounds, "renderers": {}, "failed": {}}
    try:
        for name, command in commands(task, threads, peer).items():
            say(f"{task.scene}, {threads} threads: {name} starts")
            try:
                workers[name] = Worker(command)
            except (Failed, OSError) as error:
                result["failed"][name] = str(error)
                say(f"{name}: {error}")
        runs: dict[str, list[dict[str, Any]]] = {name: [] for name in workers}
        for turn in range(rounds):
            order = list(workers) if turn % 2 == 0 else list(workers)[::-1]
            for name in order:
                runs[name].append(workers[name].render(seed=1 + turn))
            say(", ".join(f"{name} {runs[name][-1]['render']:.3f} s" for name in workers))
        result["renderers"] = {name: digest(task, workers[name].about, runs[name]) for name in workers}
    finally:
        for worker in workers.values():
            worker.close()
    if PEER in runs:
        for name, answers in runs.items():
            pairs = list(zip(answers, runs[PEER], strict=True))
            times = [ours["render"] / theirs["render"] for ours, theirs in pairs]
            efforts = [ours["render"] * ours["noise"] / (theirs["render"] * theirs["noise"]) for ours, theirs in pairs]
            result["renderers"][name]["time_ratio"] = ratio_interval(times)
            result["renderers"][name]["equal_noise_ratio"] = ratio_interval(efforts)
    return result


def digest(task: Task, about: dict[str, Any], runs: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Figures of one renderer's runs."""
    seconds = [run["render"] for run in runs]
    median = statistics.median(seconds)
    out = {
        "about": about,
        "seconds": seconds,
        "minimum": min(seconds),
        "median": median,
        "maximum": max(seconds),
        "samples_per_second": task.width * task.height * task.spp / median,
        "noise": statistics.median(run["noise"] for run in runs),
    }
    if "rays" in runs[0]:
        out["rays_per_second"] = statistics.median(run["rays"] / run["render"] for run in runs)
    return out


def timed(command: Sequence[str], cache: str | None = None) -> float:
    """Wall seconds of a fresh process.

    Raises
    ------
    Failed : it did not exit with 0.
    """
    environment = {**os.environ, "PYTHONPATH": str(ROOT), **({"RAYTRACER_CACHE_DIR": cache} if cache else {})}
    begin = time.perf_counter()
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    seconds = time.perf_counter() - begin
    if done.returncode:
        raise Failed((done.stderr.strip().splitlines() or [f"exit status {done.returncode}"])[-1])
    return seconds


def rt_render(scene: Path, *options: str, cache: str | None = None) -> dict[str, float]:
    """Seconds by phase of `rt render` in a fresh process, its wall time and its peak memory in MB."""
    with tempfile.TemporaryDirectory() as folder:
        stats = Path(folder) / "stats.json"
        files = ["-o", str(Path(folder) / "image.png"), "--stats", str(stats), "--quiet"]
        wall = timed([sys.executable, "-c", RT, "render", str(scene), *options, *files], cache)
        written = json.loads(stats.read_text(encoding="utf-8"))
    phases: dict[str, float] = written["seconds"]
    total = phases.pop("total")
    return {"start and imports": wall - total, **phases, "wall": wall, "memory": written["peak_rss_bytes"] / MEGA}


def median_of(dictionaries: Sequence[dict[str, float]]) -> dict[str, float]:
    """Medians by key."""
    return {key: statistics.median(item[key] for item in dictionaries) for key in dictionaries[0]}


def start_up(rounds: int) -> dict[str, Any]:
    """Fresh processes with a warm cache."""
    say("start-up")
    helps = [timed([sys.executable, "-c", RT, "--help"]) for _ in range(rounds)]
    tiny = {}
    for task in TASKS:
        rt_render(task.path, *TINY)
        tiny[task.scene] = median_of([rt_render(task.path, *TINY) for _ in range(rounds)])
    return {"help": statistics.median(helps), "tiny": tiny}


def cold_compiles() -> dict[str, Any]:
    """Every scene in scenes/, each with a cache folder of its own."""
    out: dict[str, Any] = {}
    for path in sorted(SCENES.glob("*.yaml")):
        say(f"cold compile of {path.stem}")
        with tempfile.TemporaryDirectory() as cache:
            try:
                phases = rt_render(path, *TINY, cache=cache)
                out[path.stem] = {"compile": phases["compile"], "wall": phases["wall"]}
            except Failed as error:
                out[path.stem] = {"failed": str(error)}
    return out


def processor() -> str:
    """The processor's name."""
    information = Path("/proc/cpuinfo")
    if information.exists():
        for line in information.read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def load_average() -> list[float]:
    """Runnable processes over 1, 5 and 15 minutes; empty where the system does not tell."""
    return [round(value, 2) for value in os.getloadavg()] if hasattr(os, "getloadavg") else []


def revision() -> str:
    """The commit that is measured, with a plus if the tree has changed since."""
    words = ("git", "-C", str(ROOT))
    try:
        commit, status = (
            subprocess.run([*words, *more], capture_output=True, text=True, check=True).stdout.strip()
            for more in (("rev-parse", "--short", "HEAD"), ("status", "--porcelain", "--untracked-files=no"))
        )
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    return commit + "+" * bool(status)


def cores() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def say(text: str) -> None:
    """Tell how far the benchmark is."""
    print(text, file=sys.stderr, flush=True)


# Report


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines) + "\n"


def speed_table(renders: Sequence[dict[str, Any]]) -> str:
    """The warm renders."""
    rows = []
    for item in renders:
        for name, it in item["renderers"].items():
            ratios = [
                "{:.2f} ({:.2f} .. {:.2f})".format(*it[key]) if key in it and name != PEER else ""
                for key in ("time_ratio", "equal_noise_ratio")
            ]
            rows.append(
                [
                    f"{item['scene']}, {item['threads']} thread" + "s" * (item["threads"] > 1),
                    f"{name}, {it['about']['sampler']}" if name == OURS else name,
                    f"{it['minimum']:.3f} / {it['median']:.3f} / {it['maximum']:.3f}",
                    f"{it['samples_per_second'] / MEGA:.2f}",
                    f"{it['rays_per_second'] / MEGA:.1f}" if "rays_per_second" in it else "",
                    f"{it['noise']:.2e}",
                    *ratios,
                ]
            )
        for name, reason in item["failed"].items():
            rows.append([f"{item['scene']}, {item['threads']} threads", name, f"not measured: {reason}", *[""] * 5])
    head = ("scene", "renderer", "seconds: min / median / max", "M samples/s", "M rays/s", "relMSE")
    return table((*head, "time / Mitsuba's", "the same at equal noise"), rows)


def start_table(start: dict[str, Any]) -> str:
    """The split of a fresh process."""
    phases = list(next(iter(start["tiny"].values())))
    rows = [
        [scene, *(f"{taken[phase]:.0f}" if phase == "memory" else f"{taken[phase]:.3f}" for phase in phases)]
        for scene, taken in start["tiny"].items()
    ]
    return table(["scene", *phases[:-1], "memory (MB)"], rows)


def compile_table(cold: dict[str, Any]) -> str:
    """Compiling without a cache."""
    rows = [
        [scene, f"{it['compile']:.2f}", f"{it['wall']:.2f}"] if "compile" in it else [scene, it["failed"], ""]
        for scene, it in cold.items()
    ]
    return table(("scene", "cold compile (s)", "whole process (s)"), rows)


def achieved(report: dict[str, Any]) -> dict[str, float]:
    """The figure for each target that was measured."""
    by_scene: dict[str, dict[int, dict[str, Any]]] = {}
    for item in report["renders"]:
        by_scene.setdefault(item["scene"], {})[item["threads"]] = item["renderers"]
    out = {}
    for scene, by_threads in by_scene.items():
        best = by_threads[max(by_threads)]
        if OURS_INDEPENDENT in best and "time_ratio" in best[OURS_INDEPENDENT]:
            out[f"{scene}, time / Mitsuba's"] = best[OURS_INDEPENDENT]["time_ratio"][0]
        if 1 in by_threads and len(by_threads) > 1 and OURS in best:
            speed_up = by_threads[1][OURS]["minimum"] / best[OURS]["minimum"]
            key = "speed-up by all threads (at least)"
            out[key] = min(out.get(key, speed_up), speed_up)
    compiles = [it["compile"] for it in report.get("cold", {}).values() if "compile" in it]
    if compiles:
        out["cold compile, slowest scene (s)"] = max(compiles)
    if "start" in report:
        out["warm rt render of 8 x 8 pixels (s)"] = report["start"]["tiny"]["cover"]["wall"]
        out["rt --help (s)"] = report["start"]["help"]
    if "memory" in report:
        out["peak memory, million (MB)"] = report["memory"]["memory"]
    return out


def target_table(figures: dict[str, float]) -> str:
    """Targets beside what was measured."""
    rows = []
    for name, target in TARGETS.items():
        if name in figures:
            met = figures[name] >= target if "at least" in name else figures[name] <= target
            rows.append([name, f"{target:g}", f"{figures[name]:.3g}", "met" if met else "missed"])
    return table(("target", "wanted", "measured", ""), rows)


def print_report(report: dict[str, Any]) -> None:
    """Write the report as Markdown."""
    machine = report["machine"]
    print(f"{machine['processor']}, {machine['cores']} cores, {machine['system']}; rt at {report['revision']};")
    print(f"load average {machine['load_before']} before, {machine['load_after']} after; seeds 1 and up.\n")
    for item in report["renders"]:
        for name in (OURS, PEER):
            about = item["renderers"].get(name, {}).get("about", {})
            if about and item is report["renders"][0]:
                known = ("rt", "python", "numba", "llvmlite", "numpy", "embreex", "target", "mitsuba", "variant")
                print(f"{name}: " + ", ".join(f"{key} {about[key]}" for key in known if key in about) + "\n")
    print(speed_table(report["renders"]))
    if "start" in report:
        print(f"`rt --help`: {report['start']['help']:.3f} s. A fresh process for 8 x 8 pixels, 1 spp, cache warm:\n")
        print(start_table(report["start"]))
        print(compile_table(report["cold"]))
    print(target_table(achieved(report)))


def parse_arguments() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--peer",
        default=str(PEER_PYTHON) if PEER_PYTHON.exists() else None,
        help="Python of the environment that has mitsuba (default: that of .venv-peers, where it exists)",
    )
    parser.add_argument("--quick", action="store_true", help=f"{QUICK_ROUNDS} rounds instead of {ROUNDS}")
    parser.add_argument("--rounds", type=int, help="rounds with all threads; with one thread a third of them")
    parser.add_argument("--scene", choices=[task.scene for task in TASKS], help="only this scene's speed")
    parser.add_argument("--only-speed", action="store_true", help="no start-up, compiling or memory")
    parser.add_argument("--all-threads", action="store_true", help="no runs with a single thread")
    parser.add_argument("--out", type=Path, default=ROOT / "outputs" / "bench.json")
    return parser.parse_args()


def main() -> None:
    """Measure, write, print."""
    arguments = parse_arguments()
    rounds = arguments.rounds or (QUICK_ROUNDS if arguments.quick else ROUNDS)
    report: dict[str, Any] = {
        "revision": revision(),
        "machine": {
            "processor": processor(),
            "cores": cores(),
            "system": platform.platform(),
            "load_before": load_average(),
        },
        "renders": [],
    }
    for task in TASKS:
        if arguments.scene not in (None, task.scene):
            continue
        report["renders"].append(interleave(task, cores(), rounds, arguments.peer))
        if not arguments.all_threads and cores() > 1:
            report["renders"].append(interleave(task, 1, max(QUICK_ROUNDS, rounds // 3), arguments.peer))
    if not arguments.only_speed:
        report["start"] = start_up(rounds)
        report["cold"] = cold_compiles()
        say("memory")
        report["memory"] = rt_render(SCENES / "million.yaml")
    report["machine"]["load_after"] = load_average()

    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    arguments.out.write_text(json.dumps(report, indent=2) + "\n", encoding="utf-8")
    print_report(report)


if __name__ == "__main__":
    main()
