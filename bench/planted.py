"""Measure which planted differences `rt compare` finds, and how often it fails honest pairs.

    python bench/planted.py [--renders outputs/planted] [--pairs 12] [--repeats 4]

*Honest pairs* are renders of one scene with other seeds, none of them in two pairs: four scenes, three samplers, three
numbers of samples. *Planted differences* are between renders with other seeds: brightness, tiles, channels and single
pixels are changed in the finished picture, with its variances; camera and objects before it is rendered. "Four tests"
are those of means, tiles, pixels and of how many pixels are far off, which judged alone before patterns, neighbours and
squares were tested: what they find stands in brackets. Prints Markdown. Renders are kept in a folder, so that a run
that was stopped goes on.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import raytracer as rt
from raytracer.analysis.compare import Verdict, z_test

Array = NDArray[np.float64]

SCENES = Path(__file__).parents[1] / "scenes"
SIZES = {"cover": (96, 54), "metals": (96, 54), "cornell": (48, 48), "glass": (64, 36)}
SAMPLERS, LEVELS = ("independent", "stratified", "sobol"), (16, 64, 256)
LARGE, LARGE_SPP = (240, 135), 64
ALPHA = 1e-3

# Relative standard deviation of a pixel below which it counts as free of noise, as skies and lamps are.
NOISE_FREE = 1e-3

# A ball of the cover scene, 2.7 px wide in a picture of 96, that nothing hides; it is taken below the ground.
SMALL = "objects.15.center"

# Tile that is made brighter: of the checkered ground's pixels, from this row and column on.
TILE = (slice(32, 48), slice(32, 48))


class Picture(NamedTuple):
    """A render: mean and variance of its pixels, (height, width, 3)."""

    mean: Array
    variance: Array


class Renders:
    """Renders scenes with rising seeds, and keeps them in a folder."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def pictures(
        self, name: str, scene: str, overrides: Mapping[str, Any], sampler: str, spp: int, count: int, seed: int
    ) -> list[Picture]:
        """Render `count` pictures with the seeds from `seed` on, or read them."""
        path = self._folder / f"{name}_{sampler}_{spp}.npz"
        if path.exists():
            with np.load(path) as kept:
                means, variances = kept["mean"], kept["variance"]
            if len(means) >= count:
                return [Picture(*both) for both in zip(means[:count], variances[:count], strict=True)]
        loaded = rt.load(SCENES / f"{scene}.yaml", {**overrides, "render.sampler": sampler})
        images = [rt.render(loaded, spp=spp, seed=seed + number) for number in range(count)]
        path.parent.mkdir(parents=True, exist_ok=True)
        np.savez(path, mean=[image.radiance for image in images], variance=[image.variance for image in images])
        return [Picture(image.radiance, image.variance) for image in images]


def size(width: int, height: int) -> dict[str, int]:
    """Return the overrides that set a picture's size."""
    return {"film.width": width, "film.height": height}


def scaled(picture: Picture, gain: float | Array) -> Picture:
    """Multiply all light by a number, or each pixel by its own (height, width, 1)."""
    return Picture(gain * picture.mean, gain**2 * picture.variance)


def noisy_scaled(picture: Picture, change: float | Array) -> Picture:
    """Change the light of the pixels with noise by a fraction: in the others anything is seen by comparing them."""
    relative = np.sqrt(picture.variance.sum(axis=2, keepdims=True)) / picture.mean.sum(axis=2, keepdims=True)
    return scaled(picture, 1.0 + change * (relative > NOISE_FREE))


def pixels_changed(picture: Picture) -> Picture:
    """Make each pixel with noise 5 % brighter or darker, at random: always the same ones."""
    return noisy_scaled(picture, 0.05 * np.random.default_rng(0).choice((-1.0, 1.0), (*picture.mean.shape[:2], 1)))


def brighter_tile(picture: Picture) -> Picture:
    """Multiply the light in one tile of 16 x 16 pixels by 1.1."""
    gain = np.ones((*picture.mean.shape[:2], 1))
    gain[TILE] = 1.1
    return scaled(picture, gain)


def swapped(picture: Picture) -> Picture:
    """Exchange red and blue."""
    return Picture(picture.mean[..., ::-1], picture.variance[..., ::-1])


def turned() -> dict[str, Any]:
    """Turn the camera of the cover scene by a quarter of a pixel of a picture 54 pixels high."""
    look_from, look_at, up = np.array([13.0, 2.0, 3.0]), np.zeros(3), np.array([0.0, 1.0, 0.0])
    right = np.cross(look_at - look_from, up)
    pixel = 2.0 * np.tan(np.radians(10.0)) / SIZES["cover"][1]
    moved = look_at + 0.25 * pixel * np.linalg.norm(look_at - look_from) * right / np.linalg.norm(right)
    return {"camera.look_at": moved.tolist()}


# Of the finished picture, and of the scene.
CHANGES: dict[str, Callable[[Picture], Picture]] = {
    "brightness by 0.5 %": lambda picture: scaled(picture, 1.005),
    "brightness by 0.5 % of what is noisy": lambda picture: noisy_scaled(picture, 0.005),
    "brightness by 2 % of what is noisy": lambda picture: noisy_scaled(picture, 0.02),
    "a tile of 16 px by 10 %": brighter_tile,
    "channels swapped": swapped,
    "each noisy pixel by 5 %, up or down": pixels_changed,
}
OVERRIDES: dict[str, dict[str, Any]] = {
    "shift of 0.25 px": turned(),
    "defocus halved": {"camera.defocus_angle": 0.3},
    "a ball of 2.7 px missing": {SMALL: [0, -500, 0]},
}


def four_tests_pass(verdict: Verdict) -> bool:
    """Judge by the tests of single values alone, which then share the significance level."""
    return min(verdict.mean_p, verdict.tile_p, verdict.pixel_p, verdict.exceeding_p) >= ALPHA / 4.0


def judged(first: Picture, second: Picture) -> Verdict:
    """Compare two renders of as many samples of the same sampler."""
    return z_test(*first, *second, alpha=ALPHA, alike=True)


def honest(renders: Renders, pairs: int) -> None:
    """Print how many honest pairs fail."""
    print("\n| scene | " + " | ".join(f"{sampler} {spp}" for sampler in SAMPLERS for spp in LEVELS) + " |")
    print("|---" * (1 + len(SAMPLERS) * len(LEVELS)) + "|")
    failed = [0, 0]
    for scene, extent in SIZES.items():
        cells = []
        for sampler in SAMPLERS:
            for spp in LEVELS:
                pictures = renders.pictures(scene, scene, size(*extent), sampler, spp, 2 * pairs, 1000 * spp)
                verdicts = [judged(*both) for both in zip(pictures[::2], pictures[1::2], strict=True)]
                counts = sum(not four_tests_pass(v) for v in verdicts), sum(not v.passed for v in verdicts)
                failed = [total + count for total, count in zip(failed, counts, strict=True)]
                cells.append(f"{counts[1]} ({counts[0]})")
        print(f"| {scene} | {' | '.join(cells)} |", flush=True)
    total = pairs * len(SIZES) * len(SAMPLERS) * len(LEVELS)
    print(f"\nOf {total} honest pairs fail: {failed[0]} by four tests, {failed[1]} by all.")


def planted(renders: Renders, repeats: int) -> None:
    """Print how many of the planted differences are found."""
    columns = [(sampler, spp) for sampler in ("independent", "sobol") for spp in LEVELS]
    print("\n| planted | " + " | ".join(f"{sampler} {spp}" for sampler, spp in columns) + " |")
    print("|---" * (1 + len(columns)) + "|")
    for scene, what in [*(("cover", what) for what in (*CHANGES, *OVERRIDES)), *(("metals", what) for what in CHANGES)]:
        cells = []
        for sampler, spp in columns:
            kept = renders.pictures(scene, scene, size(*SIZES[scene]), sampler, spp, 2 * repeats, 1000 * spp)
            if what in CHANGES:
                other = [CHANGES[what](picture) for picture in kept[repeats:]]
            else:
                overrides = {**size(*SIZES[scene]), **OVERRIDES[what]}
                name = f"{scene}_{what.replace(' ', '_')}"
                other = renders.pictures(name, scene, overrides, sampler, spp, repeats, 7000 * spp)
            cells.append(_found([judged(a, b) for a, b in zip(other, kept[:repeats], strict=True)]))
        print(f"| {scene}: {what} | {' | '.join(cells)} |", flush=True)
    large = [
        renders.pictures(
            f"large_{angle}", "cover", {**size(*LARGE), "camera.defocus_angle": angle}, "sobol", LARGE_SPP, 2, seed
        )
        for angle, seed in ((0.6, 1), (0.3, 101))
    ]
    verdicts = [judged(a, b) for a, b in zip(*large, strict=True)]
    what = f"Defocus halved at {LARGE[0]} x {LARGE[1]}, {LARGE_SPP} spp (sobol)"
    print(f"\n{what}: {_found(verdicts)} of {len(verdicts)}; {verdicts[0].reason}")


def limits(renders: Renders) -> None:
    """Print what would have been found in the cover scene."""
    print("\n| cover | would have found |\n|---|---|")
    for sampler in SAMPLERS:
        for spp in LEVELS:
            first, second = renders.pictures("cover", "cover", size(*SIZES["cover"]), sampler, spp, 2, 1000 * spp)
            verdict = judged(first, second)
            ratio = f"noise {verdict.squares_ratio:.2f} of its variance"
            print(f"| {sampler} {spp} | {verdict.limits.sentence()}; {ratio} |")


def _found(verdicts: list[Verdict]) -> str:
    """Say how many of them fail, and in brackets how many do by four tests."""
    return f"{sum(not v.passed for v in verdicts)} ({sum(not four_tests_pass(v) for v in verdicts)})"


def main() -> None:
    """Measure, and print tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--renders", type=Path, default=Path("outputs/planted"))
    parser.add_argument(
        "--pairs", type=int, default=12, help="honest pairs of each scene, sampler and number of samples"
    )
    parser.add_argument("--repeats", type=int, default=4, help="pairs of each planted difference")
    options = parser.parse_args()
    renders = Renders(options.renders)
    planted(renders, options.repeats)
    limits(renders)
    honest(renders, options.pairs)


if __name__ == "__main__":
    main()
