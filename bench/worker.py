"""Render on request, for the benchmark: stays warm, so that only rendering is timed.

    echo '{"seed": 1}' | python bench/worker.py scenes/cover.yaml --width 400 --height 225 --spp 64

Renders once and prints what it ran on, then renders again for every request that it reads: a line with a seed, and
perhaps with other samples per pixel, "spp", and a .npy file for the radiance, "out". All answers are JSON on one line.
"""

from __future__ import annotations

import argparse
import importlib.metadata
import json
import platform
import sys
from pathlib import Path
from typing import Any

import llvmlite.binding
import numpy as np
from numpy.typing import NDArray

import raytracer
from raytracer.rendering.render import render
from raytracer.rendering.worker_pool import available_threads
from raytracer.scene.load import load
from raytracer.scene.overrides import parse_overrides

INSTRUCTION_SETS = ("avx512f", "avx2", "avx", "sse4.2", "neon")
PACKAGES = ("numba", "llvmlite", "numpy", "embreex")


def parse_arguments() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", type=Path)
    parser.add_argument("--width", type=int, required=True)
    parser.add_argument("--height", type=int, required=True)
    parser.add_argument("--spp", type=int, required=True)
    parser.add_argument("--threads", type=int, default=available_threads())
    parser.add_argument("--sampler", help="default: the scene's")
    parser.add_argument("--accuracy", help="default: the scene's")
    parser.add_argument("--define", action="append", default=[], metavar="KEY=VALUE", help="as -D of rt render")
    return parser.parse_args()


def relative_noise(a: NDArray[Any], b: NDArray[Any]) -> float:
    """Estimate the relMSE of either of two renders that differ by their seeds: half the squared difference.

    Parameters
    ----------
    a, b : radiance of shape (height, width, 3).
    """
    return float(np.mean(0.5 * (a - b) ** 2 / ((0.5 * (a + b)) ** 2 + 0.01)))


def versions() -> dict[str, str]:
    """Return the versions and the hardware of the renderer."""
    features = llvmlite.binding.get_host_cpu_features()
    widest = next((name for name in INSTRUCTION_SETS if features.get(name)), "baseline")
    packages = {name: importlib.metadata.version(name) for name in PACKAGES}
    return {
        "rt": raytracer.__version__,
        "python": platform.python_version(),
        **packages,
        "target": f"{llvmlite.binding.get_host_cpu_name()}, {widest}",
    }


def main() -> None:
    """Load, render once, then serve."""
    arguments = parse_arguments()
    overrides: dict[str, Any] = {"film.width": arguments.width, "film.height": arguments.height}
    chosen = {"render.sampler": arguments.sampler, "render.accuracy": arguments.accuracy}
    overrides.update({key: value for key, value in chosen.items() if value})
    overrides.update(parse_overrides(arguments.define))
    spec = load(arguments.scene, overrides)
    before = render(spec, spp=arguments.spp, seed=0, threads=arguments.threads).image.radiance
    print(json.dumps({"threads": arguments.threads, "sampler": spec.render.sampler, **versions()}), flush=True)

    for line in sys.stdin:
        request = json.loads(line)
        spp = request.get("spp", arguments.spp)
        image, stats, *_ = render(spec, spp=spp, seed=request["seed"], threads=arguments.threads)
        answer = {
            "render": stats.seconds["render"],
            "rays": stats.rays,
            "samples": stats.samples,
            "noise": relative_noise(before, image.radiance),
        }
        before = image.radiance
        if "out" in request:
            np.save(request["out"], image.radiance)
        print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    main()
