"""Hold what `rt cost`, `--noise` and `--time-limit` foretell against the clock.

    python bench/predictions.py
    python bench/predictions.py --references outputs/references

*Predictions*: five scenes, as they are but for the size of their pictures, are studied as `rt cost` does; then they are
rendered twice with the samples that were foretold. How far the two pictures are from each other tells their error, and
with it the samples and the time that the target really takes. With --references the pictures are smaller, and are
compared with references of 65,536 samples per pixel instead, which are rendered into that folder if they are not there.
*An effect that only takes time*: the cover with a medium that no ray enters.
*Noise*: a picture of which one half is a plain wall, to a noise target and with as many samples in every pixel, in
turns; the time to equal error is the product of time and squared error.
*Limits*: whole commands with `--time-limit`.
Prints Markdown, and writes every figure to outputs/predictions.json.
"""

from __future__ import annotations

import math
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from warm import QUICK_ROUNDS, ROUNDS, SCENES, Array, arguments_for, measured, publish, say, table, tiles_of

from raytracer.analysis.cost.results import Prediction, VariantResult
from raytracer.analysis.cost.study import study
from raytracer.analysis.cost.study_options import StudyOptions
from raytracer.core.error_estimate.intervals import Interval, ratio_interval
from raytracer.core.error_estimate.metric import error_weights, mse_by_tile
from raytracer.rendering.render import render
from raytracer.rendering.session import Rendered
from raytracer.scene.load import build, load
from raytracer.scene.spec import SceneSpec

REFERENCE_SPP = 65536
REFERENCE_SEED = 4_000_000_000

WITHIN, ENOUGH = 0.2, 4


class Case(NamedTuple):
    """A scene by its name, and the sizes of its picture: as a rule, for a quick look, and for references."""

    name: str
    usual: tuple[int, int]
    quick: tuple[int, int]
    small: tuple[int, int]


CASES = (
    Case("cover", (400, 225), (160, 90), (120, 68)),
    Case("cornell", (200, 200), (96, 96), (64, 64)),
    Case("million", (160, 160), (96, 96), (64, 64)),
    Case("lecture/bokeh", (60, 40), (60, 40), (96, 64)),
    Case("lecture/aperture", (150, 100), (96, 64), (96, 64)),
)

HALF_WALL = """
camera: {type: pinhole, look_from: [0, 1, 5], look_at: [0, 1, 0], vfov: 30}
film: {width: 256, height: 128}
render: {max_depth: 8}
environment: {type: gradient, horizon: [1, 1, 1], zenith: [0.5, 0.7, 1.0]}
objects:
  - {type: quad, corner: [-8, -4, -1], edges: [[16, 0, 0], [0, 12, 0]], material: {type: lambertian}}
  - {type: quad, corner: [0.1, -4, -1], edges: [[0, 12, 0], [0, 0, 2]], material: {type: lambertian, albedo: 0.1}}
  - {type: sphere, center: [1, 0.5, 0], radius: 0.45, material: {type: dielectric, ior: 1.5}}
  - {type: sphere, center: [2, 1.4, -0.4], radius: 0.5, material: {type: metal, albedo: 0.9, fuzz: 0.2}}
  - {type: sphere, center: [1.3, 1.7, 0.2], radius: 0.15, material: {type: emitter, radiance: 60}}
"""

# To be appended to the cover, whose last key is the list of objects: no path of it gets below its ground.
NEVER_ENTERED = """
  - {type: sphere, center: [0, -5000, 0], radius: 1, medium: mist}
media:
  mist: {type: homogeneous, scattering: 0.1}
"""

LIMITS, QUICK_LIMITS = (10.0, 30.0), (5.0,)


# ---- Predictions


def reference(spec: SceneSpec, name: str, folder: Path) -> Array:
    """Return the picture of 65,536 samples per pixel, from the folder or rendered into it."""
    path = folder / f"{name.replace('/', '_')}_{spec.film.width}x{spec.film.height}.npy"
    if not path.exists():
        say(f"  reference of {name}")
        folder.mkdir(parents=True, exist_ok=True)
        picture = render(spec, spp=REFERENCE_SPP, seed=REFERENCE_SEED).image.radiance
        np.save(path, picture)
    return np.asarray(np.load(path), dtype=np.float64)


def squared_error(pictures: list[Array], spp: int, truth: Array | None) -> float:
    """Average the relative squared error of renders with `spp` samples and different seeds.

    Against a reference, the part of the difference that is its own error is left out, as much as falls as 1 / N.
    """
    stack = np.stack(pictures)
    if truth is None:
        return float(np.mean(error_weights(stack.mean(axis=0)) * stack.var(axis=0, ddof=1)))
    share = REFERENCE_SPP / (REFERENCE_SPP + spp)
    return share * float(np.mean(error_weights(truth) * (stack - truth) ** 2))


def seconds_of(run: Rendered) -> float:
    """Return the seconds of a render without compiling, which is done once for many."""
    return float(run.stats.seconds["total"] - run.stats.seconds["compile"])


def predict(case: Case, size: tuple[int, int], target: float, threads: int, folder: Path | None) -> dict[str, Any]:
    """Predict the samples and seconds to a target, and measure them."""
    say(f"{case.name} {size[0]} x {size[1]}")
    spec = load(SCENES / f"{case.name}.yaml", {"film.width": size[0], "film.height": size[1]})
    truth = None if folder is None else reference(spec, case.name, folder)
    foretold: Prediction = study(spec, StudyOptions(target, variants=[], threads=threads, seed=1)).prediction
    spp = max(8, round(foretold.target_spp.value))
    runs = [render(spec, spp=spp, seed=seed, threads=threads) for seed in (2, 3)]
    error = math.sqrt(squared_error([run.image.radiance for run in runs], spp, truth))

    # Near the target error falls as the root of the samples.
    fixed = foretold.fixed.value
    growth = (error / target) ** 2
    needed = fixed + growth * (float(np.mean([seconds_of(run) for run in runs])) - fixed)
    say(f"  foretold {foretold.target_seconds.value:.1f} s, needed {needed:.1f} s; error at {spp} spp {error:.3%}")
    return {
        "size": size,
        "target": target,
        "foretold_spp": list(foretold.target_spp),
        "needed_spp": growth * spp,
        "foretold_seconds": list(foretold.target_seconds),
        "needed_seconds": needed,
        "plain_seconds": foretold.plain_seconds,
        "power_seconds": foretold.power_seconds,
        "error_with_foretold": error,
    }


def report_predictions(found: dict[str, dict[str, Any]]) -> str:
    """Write predicted beside measured samples and seconds."""
    rows = []
    good = 0
    for name, one in found.items():
        value, low, high = one["foretold_seconds"]
        needed = one["needed_seconds"]
        off = value / needed - 1.0
        good += abs(off) <= WITHIN
        rows.append(
            [
                f"{name}, {one['size'][0]} x {one['size'][1]}, to {one['target']:.2g}",
                f"{value:.1f} s ({low:.1f} .. {high:.1f})",
                f"{needed:.1f} s",
                f"{off:+.1%}",
                "yes" if low <= needed <= high else "no",
                f"{one['foretold_spp'][0] / one['needed_spp'] - 1.0:+.1%}",
                f"{one['plain_seconds'] / needed - 1.0:+.1%}",
                f"{one['power_seconds'] / needed - 1.0:+.1%}",
            ]
        )
    head = ["scene", "foretold", "needed", "off", "interval holds", "samples off", "by slope -1", "by power law"]
    return f"{table(head, rows)}\nWithin {WITHIN:.0%}: {good} of {len(found)} (wanted: {ENOUGH}).\n"


# ---- An effect that only takes time


def never_entered(rounds: int, threads: int, quick: bool) -> dict[str, Any]:
    """Measure the variants of the cover with a medium far below the ground."""
    say("a medium that is never entered")
    size = {"film.width": 160, "film.height": 90} if quick else {"film.width": 480, "film.height": 270}
    text = (SCENES / "cover.yaml").read_text(encoding="utf-8").rstrip() + NEVER_ENTERED
    options = StudyOptions(variants=["media"], rounds=rounds, threads=threads, seed=1)
    variants = study(build(text, "cover with mist", size), options).variants
    return {
        "A/A" if variant.group == "control" else "without it": _row(variant)
        for variant in variants
        if variant.group != "scene"
    }


def _row(variant: VariantResult) -> dict[str, Any]:
    return {
        "time": list(variant.time),
        "time_differs": variant.time_differs,
        "noise_differs": variant.noise_differs,
        "bias": None if variant.bias is None else list(variant.bias),
        "bias_resolved": variant.bias_resolved,
    }


def report_never_entered(found: dict[str, dict[str, Any]]) -> str:
    """Report the variants of the cover with a medium."""
    rows = [
        [
            name,
            "{:.3f} ({:.3f} .. {:.3f})".format(*one["time"]),
            "yes" if one["time_differs"] else "no",
            "yes" if one["noise_differs"] else "no",
            "yes" if one["bias_resolved"] else "no",
        ]
        for name, one in found.items()
    ]
    return table(["variant", "time against the scene", "time differs", "noise differs", "bias resolved"], rows)


# ---- Noise


def to_equal_error(rounds: int, threads: int, target: float) -> dict[str, Any]:
    """Render to a noise target, and with as many samples in every pixel, in turns."""
    say(f"half a picture is a plain wall, to {target:.2%}")
    spec = build(HALF_WALL, "halves")
    # Compile, and see how many samples it takes.
    spp = round(render(spec, noise=target, seed=100, threads=threads).stats.spp["mean"])
    adaptive: list[Rendered] = []
    even: list[Rendered] = []
    for turn in range(rounds):
        for which in ("adaptive", "even") if turn % 2 == 0 else ("even", "adaptive"):
            if which == "adaptive":
                adaptive.append(render(spec, noise=target, seed=turn, threads=threads))
            else:
                even.append(render(spec, spp=spp, seed=1000 + turn, threads=threads))
    pictures = [np.stack([run.image.radiance.reshape(-1, 3) for run in runs]) for runs in (adaptive, even)]
    weight = error_weights(np.concatenate(pictures).mean(axis=0))
    owner = tiles_of(spec.film.width, spec.film.height)
    own, other = (mse_by_tile(stack, weight, owner).mean for stack in pictures)
    seconds = [np.array([run.stats.seconds["render"] for run in runs]) for runs in (adaptive, even)]
    rays = [float(np.mean([run.stats.rays for run in runs])) for runs in (adaptive, even)]
    time_ratio: Interval = ratio_interval(seconds[0], seconds[1])
    return {
        "target": target,
        "spp": [adaptive[0].stats.spp["fewest"], spp, adaptive[0].stats.spp["most"]],
        "error": math.sqrt(own),
        "even_error": math.sqrt(other),
        "time_to_equal_error": [ratio * own / other for ratio in time_ratio],
        "rays_to_equal_error": rays[0] * own / (rays[1] * other),
    }


def report_equal_error(found: dict[str, Any]) -> str:
    """Write the time that adaptive sampling saves."""
    value, low, high = found["time_to_equal_error"]
    fewest, mean, most = found["spp"]
    return (
        f"Noise target {found['target']:.2%}: error {found['error']:.3%} with {fewest} to {most} samples per pixel, "
        f"{found['even_error']:.3%} with {mean} in each; time to equal error {value:.2f} ({low:.2f} .. {high:.2f}), "
        f"rays {found['rays_to_equal_error']:.2f} (wanted: at most 0.7).\n"
    )


# ---- Limits


def limit(seconds: float, threads: int) -> dict[str, float]:
    """Time a whole `rt render --time-limit` (s), compiled before."""
    with tempfile.TemporaryDirectory() as folder:
        command = [
            sys.executable,
            "-c",
            "import sys; from raytracer.cli.base.app import main; sys.exit(main())",
            "render",
        ]
        command += [str(SCENES / "cover.yaml"), "--quiet", "--threads", str(threads), "-o", f"{folder}/cover.png"]
        subprocess.run([*command, "--spp", "1"], check=True)
        start = time.perf_counter()
        subprocess.run([*command, "--time-limit", f"{seconds}s"], check=True)
        took = time.perf_counter() - start
    say(f"  limit {seconds:g} s: {took:.2f} s")
    return {"limit": seconds, "took": took}


def report_limits(found: list[dict[str, float]]) -> str:
    """Compare the times of commands with their limits."""
    rows = [[f"{x['limit']:g} s", f"{x['took']:.2f} s", f"{x['took'] / x['limit'] - 1.0:+.1%}"] for x in found]
    return table(["time limit", "whole command", "off"], rows)


# ---- All of it


def measure(rounds: int, threads: int, quick: bool, folder: Path | None) -> dict[str, Any]:
    """Measure every figure."""
    predictions = {}
    for case in CASES:
        size = case.small if folder is not None else case.quick if quick else case.usual
        target = 0.02 if quick else 0.01
        predictions[case.name] = predict(case, size, target, threads, folder)
    return {
        "predictions": predictions,
        "never_entered": never_entered(ROUNDS, threads, quick),
        "to_equal_error": to_equal_error(rounds, threads, 0.04 if quick else 0.02),
        "limits": [limit(seconds, threads) for seconds in (QUICK_LIMITS if quick else LIMITS)],
    }


def report(found: dict[str, Any]) -> str:
    """Write the figures as Markdown."""
    parts = [
        report_predictions(found["predictions"]),
        report_never_entered(found["never_entered"]),
        report_equal_error(found["to_equal_error"]),
        report_limits(found["limits"]),
    ]
    return "\n".join(parts)


def main() -> None:
    """Measure, write, print."""
    parser = arguments_for(__doc__, "predictions")
    parser.add_argument("--references", type=Path, help="folder of pictures of 65,536 samples per pixel")
    arguments = parser.parse_args()
    rounds = arguments.rounds or (QUICK_ROUNDS if arguments.quick else ROUNDS)
    result = measured(lambda: measure(rounds, arguments.threads, arguments.quick, arguments.references))
    publish(result, report(result), arguments.out)


if __name__ == "__main__":
    main()
