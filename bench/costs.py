"""Measure what each effect costs on the cover scene, in time and in noise.

    python bench/costs.py

Each effect is added to the cover by overriding keys of its scene file, so that the picture stays as comparable as the
effect lets it. The renderers are warm and take turns (warm.py); what is printed is the median of the ratios to the
plain cover within a round, with a bootstrap interval. A second plain cover, "the same again", shows what the machine's
noise alone makes of two equal renders.
Prints Markdown, and writes every figure to outputs/costs.json.
"""

from __future__ import annotations

import statistics
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from warm import (
    QUICK_ROUNDS,
    ROUNDS,
    SCENES,
    Renderers,
    arguments_for,
    figures,
    measured,
    our_command,
    publish,
    table,
    with_interval,
)

from raytracer.core.error_estimate.intervals import ratio_interval

WIDTH, HEIGHT, SPP = 400, 225, 64
PLAIN, AGAIN = "the cover", "the same again"
HALF_SKY = 64
MAP_EDGE = 256


def write_sky(path: Path) -> None:
    """Write the cover's gradient as an equirectangular image, top row up."""
    height = np.cos(np.pi * (np.arange(HALF_SKY) + 0.5) / HALF_SKY)
    blend = (0.5 * (height + 1.0))[:, None, None]
    rows = (1.0 - blend) * np.array([1.0, 1.0, 1.0]) + blend * np.array([0.5, 0.7, 1.0])
    np.save(path, np.repeat(rows, 2 * HALF_SKY, axis=1).astype(np.float32))


def write_image(path: Path) -> None:
    """Write smooth stripes around the cover's ground colour, in linear light."""
    wave = 0.5 + 0.1 * np.sin(2.0 * np.pi * np.arange(MAP_EDGE) / MAP_EDGE)
    np.save(path, np.broadcast_to(wave[:, None, None], (MAP_EDGE, MAP_EDGE, 3)).astype(np.float32))


def write_normals(path: Path) -> None:
    """Write gentle waves as a normal map of the OpenGL kind."""
    slope = 0.2 * np.sin(2.0 * np.pi * np.arange(MAP_EDGE) / MAP_EDGE)
    normals = np.stack(np.broadcast_arrays(slope[:, None], slope[None, :], 1.0), axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    np.save(path, (0.5 * normals + 0.5).astype(np.float32))


def variants(folder: Path) -> dict[str, tuple[Path, list[str]]]:
    """List the scene file and overrides of every variant, by its name."""
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


def measure(rounds: int, threads: int) -> dict[str, Any]:
    """Warm renders of all variants in turn, and their ratios to the plain cover."""
    with tempfile.TemporaryDirectory() as folder, Renderers() as renderers:
        for name, (path, defines) in variants(Path(folder)).items():
            options = [word for define in defines for word in ("--define", define)]
            renderers.start(name, [*our_command(path, WIDTH, HEIGHT, SPP, threads), *options])
        answers = renderers.take_turns(rounds, 1, dict.fromkeys(renderers, SPP))
    return {
        "failed": renderers.failed,
        "arms": {
            name: {
                "seconds": figures(answers[name]).tolist(),
                "time_ratio": ratio_interval(figures(answers[name]), figures(answers[PLAIN])),
                "rays_ratio": ratio_interval(figures(answers[name], "rays"), figures(answers[PLAIN], "rays")).value,
                "noise_ratio": ratio_interval(figures(answers[name], "noise"), figures(answers[PLAIN], "noise")).value,
            }
            for name in renderers
        },
    }


def report(result: dict[str, Any]) -> str:
    """Write the figures as Markdown."""
    rows = [
        [
            name,
            f"{statistics.median(variant['seconds']):.3f}",
            with_interval(variant["time_ratio"]),
            f"{variant['rays_ratio']:.2f}",
            f"{variant['time_ratio'][0] / variant['rays_ratio']:.2f}",
            f"{variant['noise_ratio']:.2f}",
        ]
        for name, variant in result["arms"].items()
    ]
    rows += [[name, f"not measured: {reason}", "", "", "", ""] for name, reason in result["failed"].items()]
    return table(("scene", "seconds", "time", "rays", "time per ray", "relMSE"), rows)


def main() -> None:
    """Measure, write, print."""
    arguments = arguments_for(__doc__, "costs").parse_args()
    rounds = arguments.rounds or (QUICK_ROUNDS if arguments.quick else ROUNDS)
    result = measured(lambda: measure(rounds, arguments.threads))
    publish(result, report(result), arguments.out)


if __name__ == "__main__":
    main()
