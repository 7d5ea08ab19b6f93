"""Write ``scenes/next_week.yaml``, the final scene of *Ray Tracing: The Next Week*.

The random numbers come from one seeded generator, so a second run writes the same bytes:

    python scenes/generate/next_week.py [OUT.yaml]
"""

from __future__ import annotations

import argparse
import random
from pathlib import Path

from cover import number, numbers

SEED = 10

HEADER = """\
# The final scene of "Ray Tracing: The Next Week" (Shirley, Black, Hollasch), sec. 10: all that the book has in it.
# Made by `python scenes/generate/next_week.py`, which reproduces this file byte for byte; change that script instead.
# The book's picture of the earth is left out: the globe has land and sea of noise.
# Look at: the ball to the left blurred along its way; the blue one, glass with a dense blue medium under its skin, that
# shines where light grazes it; a thin haze over all, brighter round the lamp, that ends 5 km away; the caustic under
# the glass ball; marble; a cube of a thousand white balls.
camera:
  type: pinhole
  look_from: [478, 278, -600]
  look_at: [278, 278, 0]
  up: [0, 1, 0]
  vfov: 40
  shutter: {open: 0, close: 1}
film: {width: 800, height: 800, filter: box}
render: {spp: 1000, max_depth: 40}
textures:
  globe: {type: noise, pattern: perlin, scale: 0.02, octaves: 7, low: [0.02, 0.06, 0.35], high: [0.35, 0.5, 0.08]}
  marble: {type: noise, pattern: marble, scale: 0.2}
materials:
  ground: {type: lambertian, albedo: [0.48, 0.83, 0.53]}
  white: {type: lambertian, albedo: [0.73, 0.73, 0.73]}
  orange: {type: lambertian, albedo: [0.7, 0.3, 0.1]}
  glass: {type: dielectric, ior: 1.5}
  brushed: {type: metal, albedo: [0.8, 0.8, 0.9], fuzz: 1}
  earth: {type: lambertian, albedo: globe}
  stone: {type: lambertian, albedo: marble}
  light: {type: emitter, radiance: [7, 7, 7]}
media:
  haze: {type: homogeneous, extinction: 0.0001, albedo: 1}
  blue: {type: homogeneous, extinction: 0.2, albedo: [0.2, 0.4, 0.9]}
  space: {type: homogeneous, absorption: 0}
medium: haze
objects:
  - {type: sphere, name: edge of the haze, center: [0, 0, 0], radius: 5000, medium: haze, outside_medium: space}
  - {type: quad, name: lamp, corner: [123, 554, 147], edges: [[300, 0, 0], [0, 0, 265]], material: light}
  - type: sphere
    name: moving ball
    center: [400, 400, 200]
    radius: 50
    material: orange
    motion: {velocity: [30, 0, 0]}
  - {type: sphere, name: glass ball, center: [260, 150, 45], radius: 50, material: glass}
  - {type: sphere, name: metal ball, center: [0, 150, 145], radius: 50, material: brushed}
  - {type: sphere, name: blue ball, center: [360, 150, 145], radius: 70, material: glass, medium: blue}
  - {type: sphere, name: globe, center: [400, 200, 400], radius: 100, material: earth}
  - {type: sphere, name: marble ball, center: [220, 280, 300], radius: 80, material: stone}
"""

TURN = "[{rotate: {axis: [0, 1, 0], angle: 15}}, {translate: [-100, 270, 395]}]"
"""Where the cube of balls is; written once, and meant again by its anchor."""


def floor(rng: random.Random) -> list[str]:
    """20 x 20 boxes of 100 m, of heights from 1 to 101 m."""
    lines = []
    for i in range(20):
        for j in range(20):
            x, z = -1000 + 100 * i, -1000 + 100 * j
            height = number(rng.uniform(1, 101))
            lines.append(
                f"  - {{type: box, min: [{x}, 0, {z}], max: [{x + 100}, {height}, {z + 100}], material: ground}}\n"
            )
    return lines


def cube(rng: random.Random) -> list[str]:
    """A thousand white balls in a cube of 165 m."""
    lines = []
    for count in range(1000):
        center = numbers((rng.uniform(0, 165), rng.uniform(0, 165), rng.uniform(0, 165)))
        turn = "*turn" if count else f"&turn {TURN}"
        lines.append(f"  - {{type: sphere, center: {center}, radius: 10, material: white, transform: {turn}}}\n")
    return lines


def next_week() -> str:
    """Return the text of the whole scene file."""
    rng = random.Random(SEED)
    return "".join([HEADER, *floor(rng), *cube(rng)])


def main() -> None:
    """Write the scene to the path given, or beside the other scenes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    default = Path(__file__).resolve().parent.parent / "next_week.yaml"
    parser.add_argument("out", nargs="?", type=Path, default=default, help="default: scenes/next_week.yaml")
    arguments = parser.parse_args()
    arguments.out.write_text(next_week(), encoding="utf-8", newline="\n")


if __name__ == "__main__":
    main()
