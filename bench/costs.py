"""Measure what each effect costs on the cover scene, in time and in noise.

    python bench/costs.py

Each effect is added to the cover by overriding keys of its scene file, so that the picture stays as comparable as the
effect lets it. The renderers stay warm in processes of their own and take turns, as in bench.py; what is printed is the
median of the ratios to the plain cover within a round, with a bootstrap interval. A second plain cover, "the same
again", shows what the machine's noise alone makes of two equal renders.
Prints Markdown, and writes every figure to outputs/costs.json.
"""

from __future__ import annotations

import argparse
import json
import statistics
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

import bench
from bench import ROOT, SCENES, Failed, Task, Worker, load_average, processor, ratio_interval, revision, say, table

COVER = Task("cover", 400, 225, 64)
PLAIN, AGAIN = "the cover", "the same again"
HALF_SKY = 64
MAP_EDGE = 256


def write_sky(path: Path) -> None:
    """The cover's gradient as an equirectangular image, top row up."""
    height = np.cos(np.pi * (np.arange(HALF_SKY) + 0.5) / HALF_SKY)
    blend = (0.5 * (height + 1.0))[:, None, None]
    rows = (1.0 - blend) * np.array([1.0, 1.0, 1.0]) + blend * np.array([0.5, 0.7, 1.0])
    np.save(path, np.repeat(rows, 2 * HALF_SKY, axis=1).astype(np.float32))


def write_image(path: Path) -> None:
    """Smooth stripes around the cover's ground colour, in linear light."""
    wave = 0.5 + 0.1 * np.sin(2.0 * np.pi * np.arange(MAP_EDGE) / MAP_EDGE)
    np.save(path, np.broadcast_to(wave[:, None, None], (MAP_EDGE, MAP_EDGE, 3)).astype(np.float32))


def write_normals(path: Path) -> None:
    """Gentle waves, as a normal map of the OpenGL kind."""
    slope = 0.2 * np.sin(2.0 * np.pi * np.arange(MAP_EDGE) / MAP_EDGE)
    normals = np.stack(np.broadcast_arrays(slope[:, None], slope[None, :], 1.0), axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    np.save(path, (0.5 * normals + 0.5).astype(np.float32))


def arms(folder: Path) -> dict[str, tuple[Path, list[str]]]:
    """Scene file and overrides of every arm, by its name."""
    cover = SCENES / "cover.yaml"
    sky, image, normals = (folder / f"{name}.npy" for name in ("sky", "image", "normals"))
    write_sky(sky)
    write_image(image)
    write_normals(normals)
    ground = "objects.0.material="
    return {
        PLAIN: (cover, []),
        AGAIN: (cover, []),
        "motion: one small sphere": (cover, ["objects.1.motion={velocity: [0, 0.5, 0]}", "camera.shutter=1"]),
        "motion: scenes/bouncing.yaml": (SCENES / "bouncing.yaml", []),
        "texture: checker on the ground": (
            cover,
            [ground + "{type: lambertian, albedo: {type: checker, scale: 0.32, even: 0.3, odd: 0.7}}"],
        ),
        "texture: image on the ground": (
            cover,
            [ground + f"{{type: lambertian, albedo: {{type: image, file: '{image}', scale: 4000}}}}"],
        ),
        "texture: marble on the ground": (
            cover,
            [ground + "{type: lambertian, albedo: {type: noise, pattern: marble, scale: 4}}"],
        ),
        "normal map on the ground": (
            cover,
            [ground + f"{{type: lambertian, normal_map: {{type: image, file: '{normals}', scale: 4000}}}}"],
        ),
        "image environment": (cover, [f"environment={{type: image, file: '{sky}'}}"]),
        "medium: thin fog everywhere": (
            cover,
            ["media={fog: {type: homogeneous, scattering: 0.001}}", "medium=fog"],
        ),
    }


def command(path: Path, defines: list[str], threads: int) -> list[str]:
    """How an arm's renderer is started."""
    size = ["--width", str(COVER.width), "--height", str(COVER.height), "--spp", str(COVER.spp)]
    options = [option for define in defines for option in ("--define", define)]
    worker = str(ROOT / "bench" / "worker.py")
    return [sys.executable, worker, str(path), *size, "--threads", str(threads), *options]


def measure(rounds: int, threads: int) -> dict[str, Any]:
    """Warm renders of all arms in turn, and their ratios to the plain cover."""
    with tempfile.TemporaryDirectory() as folder:
        workers: dict[str, Worker] = {}
        failed: dict[str, str] = {}
        try:
            for name, (path, defines) in arms(Path(folder)).items():
                say(f"{name} starts")
                try:
                    workers[name] = Worker(command(path, defines, threads))
                except Failed as error:
                    failed[name] = str(error)
                    say(f"{name}: {error}")
            runs: dict[str, list[dict[str, Any]]] = {name: [] for name in workers}
            for turn in range(rounds):
                for name in list(workers) if turn % 2 == 0 else list(workers)[::-1]:
                    runs[name].append(workers[name].render(seed=1 + turn))
        finally:
            for worker in workers.values():
                worker.close()
    result: dict[str, Any] = {"failed": failed, "arms": {}}
    for name, answers in runs.items():
        pairs = list(zip(answers, runs[PLAIN], strict=True))
        result["arms"][name] = {
            "seconds": [answer["render"] for answer in answers],
            "time_ratio": ratio_interval([one["render"] / plain["render"] for one, plain in pairs]),
            "rays_ratio": statistics.median(one["rays"] / plain["rays"] for one, plain in pairs),
            "noise_ratio": statistics.median(one["noise"] / plain["noise"] for one, plain in pairs),
        }
    return result


def report(result: dict[str, Any]) -> str:
    """The figures as Markdown."""
    rows = [
        [
            name,
            f"{statistics.median(arm['seconds']):.3f}",
            "{:.2f} ({:.2f} .. {:.2f})".format(*arm["time_ratio"]),
            f"{arm['rays_ratio']:.2f}",
            f"{arm['time_ratio'][0] / arm['rays_ratio']:.2f}",
            f"{arm['noise_ratio']:.2f}",
        ]
        for name, arm in result["arms"].items()
    ]
    rows += [[name, f"not measured: {reason}", "", "", "", ""] for name, reason in result["failed"].items()]
    return table(("scene", "seconds", "time", "rays", "time per ray", "relMSE"), rows)


def main() -> None:
    """Measure, write, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=bench.ROUNDS)
    parser.add_argument("--threads", type=int, default=bench.cores())
    parser.add_argument("--out", type=Path, default=ROOT / "outputs" / "costs.json")
    arguments = parser.parse_args()
    before = load_average()
    result = measure(arguments.rounds, arguments.threads)
    about = {"processor": processor(), "threads": arguments.threads, "revision": revision(), "rounds": arguments.rounds}
    result |= about | {"load_before": before, "load_after": load_average()}
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    arguments.out.write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")
    print(f"{about['processor']}, {about['threads']} threads, rt at {about['revision']}, {about['rounds']} rounds;")
    print(f"load average {before} before, {result['load_after']} after.\n")
    print(report(result))


if __name__ == "__main__":
    main()
