"""Measure the renderer: speed against Mitsuba 3, start-up, compiling, memory, and what accuracy costs.

    python bench/bench.py --peer .venv-peers/bin/python

Eight parts, of which --only takes some:

- speed: equal samples in equal scenes, by us, by Mitsuba and by a plain path tracer in C++ (plain.cpp), with all
  threads and with one;
- start: fresh processes, with a warm cache and with none, and the memory of a large scene;
- equal_time: error against Mitsuba's at equal time, on all scenes that both can show (equal_time.py);
- convergence: a plot of error against time, with all of Mitsuba's samplers (convergence.py);
- accuracies: the time of `accuracy: exact | robust | fast` on every scene (accuracies.py);
- samplers: time to equal error by sampler on every scene (samplers.py);
- sweeps: a sweep against the renders that it is made of (sweeps.py);
- lenses: a lens of glass against the ideal one (lenses.py).

Renderers are warm and take turns (warm.py); what is compared is the median of the ratios within a round.
Prints Markdown, and writes every figure to outputs/bench.json. Without Mitsuba, for which `make peers` makes an
environment, only the renderer itself is measured.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import accuracies
import convergence
import equal_time
import lenses
import plain
import samplers
import sweeps
from warm import (
    MEGA,
    PEER_PYTHON,
    QUICK_ROUNDS,
    ROOT,
    ROUNDS,
    SCENES,
    Failed,
    Renderers,
    arguments_for,
    figures,
    measured,
    our_command,
    peer_command,
    plain_command,
    publish,
    say,
    table,
    with_interval,
)

from raytracer.core.error_estimate.intervals import median_interval

RT = "import sys; from raytracer.cli.main import main; sys.exit(main())"
TINY = ("--spp", "1", "--crop", "0,0,8,8")
STUDIES = {
    "equal_time": equal_time,
    "convergence": convergence,
    "accuracies": accuracies,
    "samplers": samplers,
    "sweeps": sweeps,
    "lenses": lenses,
}
PARTS = ("speed", "start", *STUDIES)


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

PLAIN, PLAIN_ROBUST = "plain C++", "plain C++, robust"

TARGETS = {
    "cover, time / Mitsuba's": 0.9,
    "cover, time / plain C++": 0.9,
    "million, time / Mitsuba's": 1.1,
    "million, time / plain C++": 1.1,
    "million, fast, time / Mitsuba's": 0.95,
    "million, fast, time / plain C++": 0.95,
    "speed-up by all threads (at least)": 3.7,
    "cold compile, slowest scene (s)": 10.0,
    "warm rt render of 8 x 8 pixels (s)": 0.7,
    "rt --help (s)": 0.4,
    "peak memory, million (MB)": 400.0,
    "relMSE / Mitsuba's at equal time, its default sampler, worst scene": 1.0,
    "relMSE / Mitsuba's at equal time, its best sampler, worst scene": 1.0,
    "cover, time to equal error by Sobol / independent": 0.5,
    "cover by 7 x 5 apertures and distances, sweep / its renders alone": 1.1,
    "cover through the double Gauss / through a thin lens": 1.35,
}
"""What the project asks of itself on four cores."""


def commands(task: Task, threads: int, peer: str | None) -> dict[str, list[str]]:
    """Return the command that starts each renderer for a task."""
    size = (task.path, task.width, task.height, task.spp, threads)
    players = {
        OURS: our_command(*size),
        OURS_INDEPENDENT: our_command(*size, sampler="independent"),
        OURS_FAST: our_command(*size, sampler="independent", accuracy="fast"),
    }
    if plain.has_compiler():
        players |= {PLAIN: plain_command(*size), PLAIN_ROBUST: plain_command(*size, "--robust")}
    return players if peer is None else {**players, PEER: peer_command(peer, *size)}


def interleave(task: Task, threads: int, rounds: int, peer: str | None) -> dict[str, Any]:
    """Warm renders of every renderer in turn: seconds, rates and noise of each, and ratios to the peer."""
    say(f"{task.scene}, {threads} threads")
    with Renderers() as workers:
        for name, command in commands(task, threads, peer).items():
            workers.start(name, command)
        answers = workers.take_turns(rounds, 1, dict.fromkeys(workers, task.spp))
    renderers = {name: digest(task, workers[name].about, answers[name]) for name in workers}
    if PLAIN in workers:
        for name in workers:
            renderers[name]["plain_ratio"] = median_interval(figures(answers[name]) / figures(answers[PLAIN]))
    if PEER in workers:
        for name in workers:
            times, noises = (figures(answers[name], of) / figures(answers[PEER], of) for of in ("render", "noise"))
            renderers[name]["time_ratio"] = median_interval(times)
            renderers[name]["equal_noise_ratio"] = median_interval(times * noises)
    about = {**task._asdict(), "threads": threads, "rounds": rounds}
    return {**about, "renderers": renderers, "failed": workers.failed}


def digest(task: Task, about: dict[str, Any], runs: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Summarize the runs of one renderer."""
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
    """Run a command in a fresh process, and return its wall time (s).

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
    """Compute medians by key."""
    return {key: statistics.median(item[key] for item in dictionaries) for key in dictionaries[0]}


def start_up(rounds: int) -> dict[str, Any]:
    """Time fresh processes with a warm cache."""
    say("start-up")
    helps = [timed([sys.executable, "-c", RT, "--help"]) for _ in range(rounds)]
    tiny = {}
    for task in TASKS:
        rt_render(task.path, *TINY)
        tiny[task.scene] = median_of([rt_render(task.path, *TINY) for _ in range(rounds)])
    return {"help": statistics.median(helps), "tiny": tiny}


def cold_compiles() -> dict[str, Any]:
    """Compile every scene in scenes/, each with a cache folder of its own."""
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


# Report


def speed_table(renders: Sequence[dict[str, Any]]) -> str:
    """Write the table of warm renders."""
    rows = []
    for item in renders:
        for name, it in item["renderers"].items():
            compared = [
                with_interval(it[key]) if key in it and name != PEER else ""
                for key in ("time_ratio", "equal_noise_ratio")
            ]
            compared.append(with_interval(it["plain_ratio"]) if "plain_ratio" in it and name != PLAIN else "")
            rows.append(
                [
                    f"{item['scene']}, {item['threads']} thread" + "s" * (item["threads"] > 1),
                    f"{name}, {it['about']['sampler']}" if name == OURS else name,
                    f"{it['minimum']:.3f} / {it['median']:.3f} / {it['maximum']:.3f}",
                    f"{it['samples_per_second'] / MEGA:.2f}",
                    f"{it['rays_per_second'] / MEGA:.1f}" if "rays_per_second" in it else "",
                    f"{it['noise']:.2e}",
                    *compared,
                ]
            )
        for name, reason in item["failed"].items():
            rows.append([f"{item['scene']}, {item['threads']} threads", name, f"not measured: {reason}", *[""] * 6])
    head = ("scene", "renderer", "seconds: min / median / max", "M samples/s", "M rays/s", "relMSE")
    return table((*head, "time / Mitsuba's", "the same at equal noise", "time / plain C++"), rows)


def start_table(start: dict[str, Any]) -> str:
    """Write the table of a fresh process's phases."""
    phases = list(next(iter(start["tiny"].values())))
    rows = [
        [scene, *(f"{taken[phase]:.0f}" if phase == "memory" else f"{taken[phase]:.3f}" for phase in phases)]
        for scene, taken in start["tiny"].items()
    ]
    return table(["scene", *phases[:-1], "memory (MB)"], rows)


def compile_table(cold: dict[str, Any]) -> str:
    """Write the table of compile times without a cache."""
    rows = [
        [scene, f"{it['compile']:.2f}", f"{it['wall']:.2f}"] if "compile" in it else [scene, it["failed"], ""]
        for scene, it in cold.items()
    ]
    return table(("scene", "cold compile (s)", "whole process (s)"), rows)


def achieved(report: dict[str, Any]) -> dict[str, float]:
    """Return the figure for each target that was measured."""
    by_scene: dict[str, dict[int, dict[str, Any]]] = {}
    for item in report["renders"]:
        by_scene.setdefault(item["scene"], {})[item["threads"]] = item["renderers"]
    out = {}
    for scene, by_threads in by_scene.items():
        best = by_threads[max(by_threads)]
        for name, label in ((OURS, ""), (OURS_FAST, ", fast")):
            for key, rival in (("time_ratio", "Mitsuba's"), ("plain_ratio", "plain C++")):
                if key in best[name]:
                    out[f"{scene}{label}, time / {rival}"] = best[name][key][0]
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
    for item in report.get("equal_time", ()):
        for match in item.get("matches", ()):
            which = "default" if match["rival"] == equal_time.INDEPENDENT else "best"
            key = f"relMSE / Mitsuba's at equal time, its {which} sampler, worst scene"
            out[key] = max(out.get(key, 0.0), match["error_ratio"][0])
    for item in report.get("samplers", ()):
        if item["scene"] == "cover" and "samplers" in item:
            sobol = item["samplers"]["sobol"]
            out["cover, time to equal error by Sobol / independent"] = sobol["time_to_equal_error"][0]
    if "sweeps" in report:
        out["cover by 7 x 5 apertures and distances, sweep / its renders alone"] = report["sweeps"]["to_alone"][0]
    variants = report.get("lenses", {}).get("arms", {})
    if lenses.DISPERSING in variants:
        out["cover through the double Gauss / through a thin lens"] = variants[lenses.DISPERSING]["time_ratio"][0]
    return out


def target_table(figures: dict[str, float]) -> str:
    """Write the table of targets beside measured figures."""
    rows = []
    for name, target in TARGETS.items():
        if name in figures:
            met = figures[name] >= target if "at least" in name else figures[name] <= target
            rows.append([name, f"{target:g}", f"{figures[name]:.3g}", "met" if met else "missed"])
    return table(("target", "wanted", "measured", ""), rows)


def versions(renders: Sequence[dict[str, Any]]) -> str:
    """Return the versions and the hardware of the renderers."""
    known = ("rt", "python", "numba", "llvmlite", "numpy", "embreex", "target", "mitsuba", "variant")
    renderers = renders[0]["renderers"] if renders else {}
    return "".join(
        f"{name}: " + ", ".join(f"{key} {it['about'][key]}" for key in known if key in it["about"]) + "\n\n"
        for name, it in renderers.items()
        if name in (OURS, PEER)
    )


def report(result: dict[str, Any]) -> str:
    """Write all figures as Markdown."""
    parts = [versions(result["renders"]), speed_table(result["renders"])]
    if "start" in result:
        parts.append(
            f"`rt --help`: {result['start']['help']:.3f} s. A fresh process for 8 x 8 pixels, 1 spp, cache warm:\n"
        )
        parts += [start_table(result["start"]), compile_table(result["cold"])]
    parts += [study.report(result[name]) for name, study in STUDIES.items() if name in result]
    parts.append(target_table(achieved(result)))
    return "\n".join(parts)


def parse_arguments() -> argparse.Namespace:
    """Read the command line."""
    parser = arguments_for(__doc__, "bench")
    parser.add_argument(
        "--peer",
        default=str(PEER_PYTHON) if PEER_PYTHON.exists() else None,
        help="Python of the environment that has mitsuba (default: that of .venv-peers, where it exists)",
    )
    parser.add_argument("--only", nargs="+", choices=PARTS, default=PARTS, help="only these parts")
    parser.add_argument("--scene", choices=[task.scene for task in TASKS], help="only this scene's speed")
    parser.add_argument("--all-threads", action="store_true", help="no runs with a single thread")
    return parser.parse_args()


def measure(arguments: argparse.Namespace) -> dict[str, Any]:
    """Measure all parts that are wanted."""
    rounds = arguments.rounds or (QUICK_ROUNDS if arguments.quick else ROUNDS)
    threads, peer, quick = arguments.threads, arguments.peer, arguments.quick
    result: dict[str, Any] = {"renders": []}
    if "speed" in arguments.only:
        for task in TASKS:
            if arguments.scene in (None, task.scene):
                result["renders"].append(interleave(task, threads, rounds, peer))
                if not arguments.all_threads and threads > 1:
                    result["renders"].append(interleave(task, 1, max(QUICK_ROUNDS, rounds // 3), peer))
    if "start" in arguments.only:
        result |= {"start": start_up(rounds), "cold": cold_compiles()}
        say("memory")
        result["memory"] = rt_render(SCENES / "million.yaml")
    if "equal_time" in arguments.only and peer is not None:
        result |= equal_time.measure(peer, rounds, threads, quick)
    if "convergence" in arguments.only and peer is not None:
        result |= convergence.measure(peer, arguments.rounds, threads, quick)
        convergence.plot(result["convergence"], arguments.out.with_name("convergence"))
    if "accuracies" in arguments.only:
        result |= accuracies.measure(rounds, threads, quick)
    if "samplers" in arguments.only:
        result |= samplers.measure(rounds, threads, quick)
    if "sweeps" in arguments.only:
        result |= sweeps.measure(rounds, threads, quick)
    if "lenses" in arguments.only:
        result |= lenses.measure(rounds, threads, quick)
    return result


def main() -> None:
    """Measure, write, print."""
    arguments = parse_arguments()
    result = measured(lambda: measure(arguments))
    publish(result, report(result), arguments.out)


if __name__ == "__main__":
    main()
