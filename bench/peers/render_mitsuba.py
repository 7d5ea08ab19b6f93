"""Render one of our scene files with Mitsuba 3 and print what it took, as JSON.

    python bench/peers/render_mitsuba.py scenes/cover.yaml --width 400 --height 225 --spp 64 -o cover.npy

Needs mitsuba, numpy and pyyaml, in an environment of their own. The `llvm_*` variants also need LLVM's shared library,
16 or later: Debian's package libllvm19, or any at DRJIT_LIBLLVM_PATH. Dr.Jit keeps compiled kernels in ~/.drjit:
`first_seconds` holds a compilation only where that folder is new.

With --serve the process stays warm: it renders once, prints the report on one line, and then renders again for every
request that it reads, answering with the seconds and the noise: a line of JSON with a seed from 1 on, and perhaps with
other samples per pixel, "spp", and a .npy file for the radiance, "out".
"""

from __future__ import annotations

import argparse
import json
import resource
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from llvm import OLDEST, VARIABLE, use_llvm
from numpy.typing import NDArray

HAS_LLVM = use_llvm()

import drjit as dr  # noqa: E402  (reads the environment when imported)
import mitsuba as mi  # noqa: E402

WAVEFRONT = 1 << 25  # samples in flight at once; more only costs memory

NO_LLVM = 3
"""Exit status: the variant needs LLVM, and there is none."""

REFUSED = 4
"""Exit status: the scene asks for what Mitsuba has no exact equal of."""


def parse_arguments() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", type=Path)
    parser.add_argument("--variant", choices=["llvm_ad_rgb", "scalar_rgb"], default="llvm_ad_rgb")
    parser.add_argument("--width", type=int, help="default: the scene's")
    parser.add_argument("--height", type=int, help="default: the scene's")
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument("--depth", type=int, help="max_depth; default: the scene's")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--sampler", default="independent", help="Mitsuba's name of it (default independent)")
    parser.add_argument("--threads", type=int, default=0, help="default: one a core")
    parser.add_argument("--rough", action="store_true", help="fuzzy metal as roughconductor: for timing only")
    parser.add_argument("-o", "--out", type=Path, help="radiance, float32 .npy of (height, width, 3), row 0 at the top")
    parser.add_argument("--variance", type=Path, help="variance of that mean, from --batches renders of other seeds")
    parser.add_argument("--batches", type=int, default=2, help="renders to split spp over for --variance (default 2)")
    parser.add_argument("--png", type=Path, help="an sRGB picture to look at")
    parser.add_argument("--serve", action="store_true", help="render again for every seed on standard input")
    return parser.parse_args()


def synchronised_render(scene: Any, spp: int, seed: int) -> Any:
    """Render and wait until the pixels are in memory."""
    image = mi.render(scene, spp=spp, seed=seed)
    dr.eval(image)
    dr.sync_thread()
    return image


def most_samples(scene: Any) -> int:
    """Return the samples per pixel that one render may take."""
    width, height = scene.sensors()[0].film().size()
    return max(WAVEFRONT // int(width * height), 1)


def passes(spp: int, at_most: int, at_least: int) -> list[int]:
    """Split `spp` into at least `at_least` nearly equal parts, none above `at_most`."""
    count = max(-(-spp // at_most), at_least)
    return [spp // count + (i < spp % count) for i in range(count)]


def mean_and_variance(images: list[NDArray[Any]], weights: list[int]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return the mean of renders weighted by their spp, and the variance of that mean (zero of a single render)."""
    stack = np.stack(images)
    mean = np.average(stack, axis=0, weights=weights)
    share = np.asarray(weights, float)[:, None, None, None] / sum(weights)
    spread = (share * (stack - mean) ** 2).sum(axis=0) / max(len(images) - 1, 1)
    return mean, spread


def peak_rss_bytes() -> int:
    """Return the largest resident memory that this process has had."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else 1024 * peak


def relative_noise(a: NDArray[Any], b: NDArray[Any]) -> float:
    """Estimate the relMSE of either of two renders that differ by their seeds: half the squared difference."""
    return float(np.mean(0.5 * (a - b) ** 2 / ((0.5 * (a + b)) ** 2 + 0.01)))


def serve(scene: Any, spp: int, before: NDArray[Any]) -> None:
    """Answer each request on standard input with seconds of a render and its noise, as JSON on a line."""
    for line in sys.stdin:
        request = json.loads(line)
        parts = passes(request.get("spp", spp), most_samples(scene), 1)
        begin = time.perf_counter()
        seeds = range(request["seed"] * len(parts), (request["seed"] + 1) * len(parts))
        rendered = [synchronised_render(scene, part, seed) for part, seed in zip(parts, seeds, strict=True)]
        seconds = time.perf_counter() - begin
        images = [np.array(image, dtype=np.float64).reshape(before.shape) for image in rendered]
        mean, _ = mean_and_variance(images, parts)
        if "out" in request:
            np.save(request["out"], mean)
        print(json.dumps({"render": seconds, "noise": relative_noise(before, mean)}), flush=True)
        before = mean


def main() -> None:
    """Load, render once for the picture, write files, print the report, serve."""
    arguments = parse_arguments()
    if arguments.variant.startswith("llvm") and not HAS_LLVM:
        print(
            f"{arguments.variant} needs LLVM {OLDEST} or later: install Debian's libllvm19, or set {VARIABLE}",
            file=sys.stderr,
        )
        raise SystemExit(NO_LLVM)
    mi.set_variant(arguments.variant)
    if arguments.threads:
        dr.set_thread_count(arguments.threads)
    from export import UnsupportedError, scene_dict  # its classes derive from the chosen variant's

    begin = time.perf_counter()
    size = {"width": arguments.width, "height": arguments.height}
    try:
        spec = scene_dict(arguments.scene, **size, max_depth=arguments.depth, fuzzy_as_rough=arguments.rough)
        spec["sensor"]["sampler"] = {"type": arguments.sampler, "sample_count": arguments.spp}
    except (UnsupportedError, FileNotFoundError) as error:
        print(f"{arguments.scene}: {error}", file=sys.stderr)
        raise SystemExit(REFUSED) from None
    scene = mi.load_dict(spec)
    dr.sync_thread()
    load_seconds = time.perf_counter() - begin

    width, height = (int(v) for v in scene.sensors()[0].film().size())
    batches = min(arguments.batches, arguments.spp) if arguments.variance else 1
    parts = passes(arguments.spp, most_samples(scene), batches)

    begin = time.perf_counter()
    seeds = range(arguments.seed, arguments.seed + len(parts))
    rendered = [synchronised_render(scene, spp, seed) for spp, seed in zip(parts, seeds, strict=True)]
    first_seconds = time.perf_counter() - begin
    images = [np.array(image, dtype=np.float64).reshape(height, width, 3) for image in rendered]
    mean, variance = mean_and_variance(images, parts)

    if arguments.out:
        np.save(arguments.out, mean.astype(np.float32))
    if arguments.variance:
        np.save(arguments.variance, variance.astype(np.float32))
    if arguments.png:
        mi.util.write_bitmap(str(arguments.png), mi.Bitmap(mean.astype(np.float32)), write_async=False)

    report = {
        "scene": arguments.scene.name,
        "mitsuba": mi.__version__,
        "variant": arguments.variant,
        "sampler": arguments.sampler,
        "threads": arguments.threads or dr.thread_count(),
        "width": width,
        "height": height,
        "spp": arguments.spp,
        "passes": len(parts),
        "fuzzy_metal": "roughconductor" if arguments.rough else "exact",
        "load_seconds": load_seconds,
        "first_seconds": first_seconds,
        "peak_rss_bytes": peak_rss_bytes(),
        "mean_radiance": mean.mean(axis=(0, 1)).tolist(),
    }
    print(json.dumps(report), flush=True)
    if arguments.serve:
        serve(scene, arguments.spp, mean)


if __name__ == "__main__":
    main()
