"""Time `rt compare` for two images of 3840 x 2160 pixels, part by part.

    python bench/compare.py [--rounds 3] [--width 3840] [--height 2160]

The images are random, which no file compresses well, so that reading them takes longer than that of pictures.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from raytracer.analysis.compare import compare, encode, flip, mse, ssim, z_test
from raytracer.film.image import Image
from raytracer.film.image_file import load_encoded, load_layers


def main() -> None:
    """Measure, and print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--width", type=int, default=3840)
    parser.add_argument("--height", type=int, default=2160)
    options = parser.parse_args()
    rng = np.random.default_rng(1)
    b = rng.random((options.height, options.width, 3))
    a = np.clip(b + 0.05 * rng.standard_normal(b.shape), 0.0, 1.0)
    variance = np.full(b.shape, 0.00125)
    with tempfile.TemporaryDirectory() as folder:
        files = {name: Path(folder) / name for name in ("a.exr", "b.exr", "a.png", "b.png")}
        for name, values in (("a", a), ("b", b)):
            for suffix in (".exr", ".png"):
                Image(values, variance, 64).save(files[name + suffix])
        found = compare(files["a.png"], files["b.png"], metrics=["mae"])
        parts: dict[str, Callable[[], object]] = {
            "read .exr with its variance": lambda: load_layers(files["a.exr"], {"radiance", "variance"}),
            "read .png": lambda: load_encoded(files["a.png"]),
            "MAE, MSE, RMSE, relMSE, MRSE, PSNR": lambda: mse(a, b),
            "SSIM": lambda: ssim(a, b),
            "z-test": lambda: z_test(a, variance, b, variance),
            "FLIP, one exposure": lambda: flip(a, b, "display"),
            "picture of the difference": lambda: encode(found, "signed"),
            "compare two .exr, all but FLIP": lambda: compare(files["a.exr"], files["b.exr"]),
            "compare two .png, all but FLIP": lambda: compare(files["a.png"], files["b.png"]),
        }
        for name, part in parts.items():
            print(f"{name:<36}{statistics.median(_seconds(part) for _ in range(options.rounds)):7.2f} s", flush=True)


def _seconds(work: Callable[[], object]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


if __name__ == "__main__":
    main()
