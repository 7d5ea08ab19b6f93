"""Write ``scenes/cover.yaml``, the final scene of *Ray Tracing in One Weekend*.

The random numbers come from one seeded generator, so a second run writes the same bytes:

    python scenes/generate/cover.py [OUT.yaml]
"""

from __future__ import annotations

import argparse
import math
import random
from pathlib import Path

SEED = 20

HEADER = """\
# The final scene of "Ray Tracing in One Weekend" (Shirley, Black, Hollasch): its cover picture.
# Made by `python scenes/generate/cover.py`, which reproduces this file byte for byte; change that script instead.
# Look at: the three large spheres, from the far left to the near right lambertian, glass and metal; the inverted world
# in the glass one; the clean mirror beside small metals of all degrees of fuzz; focus lost before and behind 10 m.
camera:
  type: thin_lens
  look_from: [13, 2, 3]
  look_at: [0, 0, 0]
  up: [0, 1, 0]
  vfov: 20
  focus_distance: 10
  defocus_angle: 0.6
film: {width: 1200, height: 675, filter: box}
render: {spp: 500, max_depth: 50}
environment: {type: gradient, horizon: [1, 1, 1], zenith: [0.5, 0.7, 1.0]}
objects:
"""


def number(value: float) -> str:
    """Write a number with at most four decimals and no trailing zeros."""
    return f"{value:.4f}".rstrip("0").rstrip(".")


def numbers(values: tuple[float, ...]) -> str:
    """Write a YAML flow sequence of numbers."""
    return "[" + ", ".join(number(v) for v in values) + "]"


def sphere(center: tuple[float, float, float], radius: float, material: str) -> str:
    """Write one sphere as one line of the object list."""
    return f"  - {{type: sphere, center: {numbers(center)}, radius: {number(radius)}, material: {material}}}\n"


def lambertian(albedo: tuple[float, ...]) -> str:
    """Write an inline diffuse material."""
    return f"{{type: lambertian, albedo: {numbers(albedo)}}}"


def metal(albedo: tuple[float, ...], fuzz: float) -> str:
    """Write an inline metal."""
    return f"{{type: metal, albedo: {numbers(albedo)}, fuzz: {number(fuzz)}}}"


GLASS = "{type: dielectric, ior: 1.5}"


def small_spheres(rng: random.Random) -> list[str]:
    """Scatter the 22 x 22 grid of small spheres, drawing in the book's order."""
    lines = []
    for a in range(-11, 11):
        for b in range(-11, 11):
            choice = rng.random()
            center = (a + 0.9 * rng.random(), 0.2, b + 0.9 * rng.random())

            # Leave the large metal sphere room.
            if math.dist(center, (4, 0.2, 0)) <= 0.9:
                continue

            if choice < 0.8:
                material = lambertian(tuple(rng.random() * rng.random() for _ in range(3)))
            elif choice < 0.95:
                material = metal(tuple(rng.uniform(0.5, 1) for _ in range(3)), rng.uniform(0, 0.5))
            else:
                material = GLASS
            lines.append(sphere(center, 0.2, material))
    return lines


def cover() -> str:
    """Return the text of the whole scene file."""
    return "".join(
        [
            HEADER,
            sphere((0, -1000, 0), 1000, lambertian((0.5, 0.5, 0.5))),
            *small_spheres(random.Random(SEED)),
            sphere((0, 1, 0), 1, GLASS),
            sphere((-4, 1, 0), 1, lambertian((0.4, 0.2, 0.1))),
            sphere((4, 1, 0), 1, metal((0.7, 0.6, 0.5), 0)),
        ]
    )


def main() -> None:
    """Write the scene to the path given, or beside the other scenes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    default = Path(__file__).resolve().parent.parent / "cover.yaml"
    parser.add_argument("out", nargs="?", type=Path, default=default, help="default: scenes/cover.yaml")
    arguments = parser.parse_args()
    arguments.out.write_text(cover(), encoding="utf-8", newline="\n")


if __name__ == "__main__":
    main()
