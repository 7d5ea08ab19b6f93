"""Compare our pictures with those of Mitsuba 3: do they differ by more than their noise?

    python bench/peers/compare.py --peer .venv-peers/bin/python

Each scene is rendered by both programs in batches of other seeds, with independent samples. The spread of the batches
gives the variance of each pixel, without asking either program for it. The judge is `rt compare`'s z-test.
Prints a table, writes ours | theirs | difference to outputs/peers/ (equal is grey), and exits with 1 if a
picture disagrees, with 2 if a scene could not be compared at all.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.analysis.compare import Verdict, z_test
from raytracer.film.image import Image
from raytracer.rendering.render import render
from raytracer.scene.load import load

FOLDER = Path(__file__).parent
ROOT = FOLDER.parents[1]
PEER_PROGRAM = FOLDER / "render_mitsuba.py"
NO_LLVM = 3
"""Exit status of the peer's program where its fast variant cannot run."""

DISAGREED, NOT_COMPARED = 1, 2
OUR_FIRST_SEED, THEIR_FIRST_SEED = 1, 1_000_000

Array = NDArray[np.float64]


class Case(NamedTuple):
    """A scene, and a film small enough for over a thousand samples a pixel."""

    scene: Path
    width: int
    height: int


CASES = (
    Case(ROOT / "scenes" / "cover.yaml", 200, 112),
    Case(ROOT / "scenes" / "cornell.yaml", 152, 152),
    Case(ROOT / "scenes" / "glass.yaml", 192, 108),
    Case(FOLDER / "kinds.yaml", 192, 108),
    Case(FOLDER / "surfaces.yaml", 192, 108),
    Case(FOLDER / "placements.yaml", 192, 108),
    Case(FOLDER / "fog.yaml", 192, 108),
    Case(FOLDER / "lights.yaml", 192, 108),
    Case(ROOT / "scenes" / "million.yaml", 128, 128),
)


class Estimate(NamedTuple):
    """A picture of shape (height, width, 3), and the variance of each of its values."""

    mean: Array
    variance: Array


class NotCompared(Exception):  # noqa: N818
    """A scene has no verdict; the text says why."""


def ours(case: Case, spp: int, batches: int, depth: int | None) -> Estimate:
    """Render our picture, with independent samples."""
    overrides = {"film.width": case.width, "film.height": case.height, "render.sampler": "independent"}
    spec = load(case.scene, overrides if depth is None else {**overrides, "render.max_depth": depth})
    images = [render(spec, spp=spp // batches, seed=OUR_FIRST_SEED + batch).image.radiance for batch in range(batches)]
    return Estimate(np.mean(images, axis=0), np.var(images, axis=0, ddof=1) / batches)


def theirs(
    peer: str, case: Case, spp: int, batches: int, depth: int | None, folder: Path, variant: str = "llvm_ad_rgb"
) -> Estimate:
    """Render Mitsuba's picture, by its compiled variant, or by the plain one where that cannot run.

    Raises
    ------
    NotCompared : the peer failed; with its own words.
    """
    mean, variance = (folder / f"{case.scene.stem}-mitsuba{kind}.npy" for kind in ("", "-variance"))
    options = {
        "variant": variant,
        "width": case.width,
        "height": case.height,
        "spp": spp,
        "batches": batches,
        "seed": THEIR_FIRST_SEED,
        "out": mean,
        "variance": variance,
        **({} if depth is None else {"depth": depth}),
    }
    command = [peer, str(PEER_PROGRAM), str(case.scene), *(f"--{name}={value}" for name, value in options.items())]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    except OSError as error:
        raise NotCompared(f"{peer}: {error.strerror}") from None
    if done.returncode == NO_LLVM:
        print(f"{case.scene.name}: {done.stderr.strip()}; trying scalar_rgb", file=sys.stderr)
        return theirs(peer, case, spp, batches, depth, folder, "scalar_rgb")
    if done.returncode:
        raise NotCompared((done.stderr.strip().splitlines() or [f"exit status {done.returncode}"])[-1])
    return Estimate(np.load(mean).astype(np.float64), np.load(variance).astype(np.float64))


def save_picture(path: Path, a: Estimate, b: Estimate) -> None:
    """Write a | b | difference side by side; a difference of 10 % of the picture's mean is black or white."""
    middle, full = 0.5, 0.1
    difference = middle + middle * (a.mean - b.mean) / (full * b.mean.mean())
    Image(np.concatenate([a.mean, b.mean, difference.clip(0.0, 1.0)], axis=1)).save(path)


def summary(case: Case, a: Estimate, b: Estimate, verdict: Verdict) -> dict[str, object]:
    """Summarize a scene for the table and the JSON file."""
    sizes = a.mean.mean(axis=(0, 1)), b.mean.mean(axis=(0, 1))
    return {
        "scene": case.scene.stem,
        "width": case.width,
        "height": case.height,
        "agrees": verdict.passed,
        "reason": verdict.reason,
        "mean": sizes[0].tolist(),
        "peer_mean": sizes[1].tolist(),
        "relative_difference": (sizes[0] / sizes[1] - 1.0).tolist(),
        "mean_z": verdict.mean_z.tolist(),
        "p": {name: getattr(verdict, f"{name}_p") for name in ("mean", "tile", "pixel", "exceeding")},
        "largest_tile_z": float(np.abs(verdict.tile_z).max()),
        "variance_over_peer": float(a.variance.sum() / b.variance.sum()),
    }


def print_table(rows: list[dict[str, object]]) -> None:
    """Write the verdicts as a Markdown table."""
    print(
        "| scene | film | verdict | difference of means (r, g, b) | z of means | largest z of a tile | variance ratio |"
    )
    print("|---|---|---|---|---|---|---|")
    for row in rows:
        if "agrees" not in row:
            print(f"| {row['scene']} | | not compared: {row['reason']} | | | | |")
            continue
        differences = ", ".join(f"{value:+.3%}" for value in row["relative_difference"])  # type: ignore[attr-defined]
        z = ", ".join(f"{value:+.1f}" for value in row["mean_z"])  # type: ignore[attr-defined]
        verdict = "agrees" if row["agrees"] else f"DIFFERS: {row['reason']}"
        print(
            f"| {row['scene']} | {row['width']} x {row['height']} | {verdict} | {differences} | {z} "
            f"| {row['largest_tile_z']:.1f} | {row['variance_over_peer']:.2f} |"
        )


def parse_arguments() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", help="names of scenes (default: all that are compared)")
    parser.add_argument("--peer", required=True, help="Python of the environment that has mitsuba")
    parser.add_argument("--spp", type=int, default=1024)
    parser.add_argument("--batches", type=int, default=16, help="renders that each spp is split over")
    parser.add_argument("--depth", type=int, help="max_depth, to narrow a difference down; default: the scene's")
    parser.add_argument("--out", type=Path, default=ROOT / "outputs" / "peers")
    arguments = parser.parse_args()
    known = {case.scene.stem for case in CASES}
    if unknown := set(arguments.scenes) - known:
        parser.error(f"unknown scene {', '.join(sorted(unknown))}; there are {', '.join(sorted(known))}")
    if arguments.batches < 2 or arguments.spp % arguments.batches:
        parser.error("--spp must be a multiple of --batches, and --batches at least 2")
    return arguments


def main() -> int:
    """Compare, print, and tell whether all agree."""
    arguments = parse_arguments()
    arguments.out.mkdir(parents=True, exist_ok=True)
    rows: list[dict[str, object]] = []
    for case in CASES:
        if arguments.scenes and case.scene.stem not in arguments.scenes:
            continue
        print(f"{case.scene.stem}: {case.width} x {case.height}, {arguments.spp} spp", file=sys.stderr)
        try:
            b = theirs(arguments.peer, case, arguments.spp, arguments.batches, arguments.depth, arguments.out)
        except NotCompared as error:
            rows.append({"scene": case.scene.stem, "reason": str(error)})
            continue
        a = ours(case, arguments.spp, arguments.batches, arguments.depth)
        save_picture(arguments.out / f"{case.scene.stem}.png", a, b)
        rows.append(summary(case, a, b, z_test(a.mean, a.variance, b.mean, b.variance)))
    (arguments.out / "verdicts.json").write_text(json.dumps(rows, indent=2) + "\n", encoding="utf-8")
    print_table(rows)
    if any(row.get("agrees") is False for row in rows):
        return DISAGREED
    return NOT_COMPARED if any("agrees" not in row for row in rows) else 0


if __name__ == "__main__":
    sys.exit(main())
