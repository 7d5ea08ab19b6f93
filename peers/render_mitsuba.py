"""Render one of our scene files with Mitsuba 3 and print what it took, as JSON.

    python peers/render_mitsuba.py scenes/cover.yaml --width 400 --height 225 --spp 64 -o cover.npy

Needs mitsuba, numpy and pyyaml, in an environment of their own. The `llvm_*` variants also need LLVM's shared library,
16 or later, at DRJIT_LIBLLVM_PATH. Dr.Jit keeps compiled kernels in ~/.drjit: `first_seconds` holds a compilation only
where that folder is new.
"""

from __future__ import annotations

import argparse
import json
import resource
import statistics
import time
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

WAVEFRONT = 1 << 25  # samples in flight at once; more only costs memory


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
    parser.add_argument("--repeat", type=int, default=0, metavar="N", help="render N more times, warm, and time each")
    parser.add_argument("--threads", type=int, default=0, help="default: one a core")
    parser.add_argument("--rough", action="store_true", help="fuzzy metal as roughconductor: for timing only")
    parser.add_argument("-o", "--out", type=Path, help="radiance, float32 .npy of (height, width, 3), row 0 at the top")
    parser.add_argument("--variance", type=Path, help="variance of that mean, from --batches renders of other seeds")
    parser.add_argument("--batches", type=int, default=2, help="renders to split spp over for --variance (default 2)")
    parser.add_argument("--png", type=Path, help="an sRGB picture to look at")
    return parser.parse_args()


def synchronised_render(scene: Any, spp: int, seed: int) -> Any:
    """Render and wait until the pixels are in memory."""
    image = mi.render(scene, spp=spp, seed=seed)
    dr.eval(image)
    dr.sync_thread()
    return image


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


def main() -> None:
    """Load, render once for the picture and then for the clock, write files, print the report."""
    arguments = parse_arguments()
    mi.set_variant(arguments.variant)
    if arguments.threads:
        dr.set_thread_count(arguments.threads)
    from export import UnsupportedError, scene_dict  # its classes derive from the chosen variant's

    begin = time.perf_counter()
    size = {"width": arguments.width, "height": arguments.height}
    try:
        spec = scene_dict(arguments.scene, **size, max_depth=arguments.depth, fuzzy_as_rough=arguments.rough)
    except (UnsupportedError, FileNotFoundError) as error:
        raise SystemExit(f"{arguments.scene}: {error}") from None
    scene = mi.load_dict(spec)
    dr.sync_thread()
    load_seconds = time.perf_counter() - begin

    width, height = (int(v) for v in scene.sensors()[0].film().size())
    batches = min(arguments.batches, arguments.spp) if arguments.variance else 1
    parts = passes(arguments.spp, max(WAVEFRONT // (width * height), 1), batches)

    begin = time.perf_counter()
    seeds = range(arguments.seed, arguments.seed + len(parts))
    rendered = [synchronised_render(scene, spp, seed) for spp, seed in zip(parts, seeds, strict=True)]
    first_seconds = time.perf_counter() - begin
    images = [np.array(image, dtype=np.float64).reshape(height, width, 3) for image in rendered]
    mean, variance = mean_and_variance(images, parts)

    warm_seconds, cpu_seconds = [], []
    for repeat in range(arguments.repeat):
        begin, cpu = time.perf_counter(), time.process_time()
        for i, spp in enumerate(parts):
            synchronised_render(scene, spp, arguments.seed + (repeat + 1) * len(parts) + i)
        warm_seconds.append(time.perf_counter() - begin)
        cpu_seconds.append(time.process_time() - cpu)

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
        "threads": arguments.threads or dr.thread_count(),
        "width": width,
        "height": height,
        "spp": arguments.spp,
        "passes": len(parts),
        "fuzzy_metal": "roughconductor" if arguments.rough else "exact",
        "load_seconds": load_seconds,
        "first_seconds": first_seconds,
        "warm_seconds": warm_seconds,
        "warm_cpu_seconds": cpu_seconds,
        "warm_median": statistics.median(warm_seconds) if warm_seconds else None,
        "warm_minimum": min(warm_seconds, default=None),
        "peak_rss_bytes": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024,
        "mean_radiance": mean.mean(axis=(0, 1)).tolist(),
    }
    print(json.dumps(report, indent=1))


if __name__ == "__main__":
    main()
