"""Write ``scenes/showcase/night_street.yaml``: a wet street at night with all of its lamps and windows.

Of the windows four in ten are lit, by chance; a second run writes the same bytes:

    python scenes/generate/night_street.py [OUT.yaml]
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

DEFAULT = Path(__file__).parents[1] / "showcase" / "night_street.yaml"

HEAD = """\
# A wet street at night, through a Petzval lens of 100 mm, nearly wide open: somebody has left an umbrella.
# Look at: lamps out of focus, which draw the six blades of the stop in the middle of the picture, and towards its
# corners the cat's eyes that the rims of the lens leave of them; how long their reflections are, since the road is
# rough and seen from low down.
# Change: camera.f_number to 8, and camera.shutter to 1/6 s with it; camera.focus_on to last car, with
# camera.focus_distance null; camera.lens to ../lenses/double-gauss-50mm.yaml; materials.asphalt.roughness to 0.6, for a
# dry road.
# Made by `python scenes/generate/night_street.py`, which reproduces this file byte for byte; change that script
# instead.  The umbrella is a mesh that `make scenes` makes.
camera:
  {type: lens, lens: ../lenses/petzval-100mm.yaml, look_from: [0.33, 0.46, 5.1], look_at: [0.17, 0.57, 0],
   sensor: full_frame, f_number: 2.5, aperture_shape: {type: polygon, blades: 6, rotation: 10}, focus_distance: 4.9,
   dispersion: false, shutter: 1/60 s, iso: 800}
film: {width: 720, height: 480, tone_curve: {type: filmic, white: 5}}
render: {spp: 1024, max_depth: 3}
environment: {type: gradient, horizon: [0.006, 0.006, 0.011], zenith: [0.0006, 0.0014, 0.005]}
textures:
  puddles: {type: noise, scale: 1.3, octaves: 4, seed: 3, low: 0.12, high: 0.42}
  grain: {type: noise, scale: 60, octaves: 2, seed: 5}
materials:
  asphalt: {type: principled, base_color: [0.022, 0.022, 0.024], roughness: puddles, ior: 1.4, bump: grain,
    bump_height: 0.0003}
  pavement: {type: principled, base_color: [0.06, 0.057, 0.053], roughness: 0.35}
  wall: {type: lambertian, albedo: [0.075, 0.07, 0.07]}
  cloth: {type: principled, base_color: [0.6, 0.012, 0.015], roughness: 0.38}
  steel: {type: principled, base_color: [0.6, 0.6, 0.62], metallic: 1, roughness: 0.25}
  iron: {type: lambertian, albedo: 0.02}
  street lamp: {type: emitter, radiance: [60, 35, 14.5]}
  bulb: {type: emitter, radiance: [20, 10.4, 3.6]}
  headlamp: {type: emitter, radiance: [45, 43, 38]}
  rear lamp: {type: emitter, radiance: [10, 0.28, 0.16]}
  go: {type: emitter, radiance: [0.4, 9, 4]}
  stop: {type: emitter, radiance: [11, 0.5, 0.26]}
  warm window: {type: emitter, radiance: [0.3, 0.16, 0.06]}
  pale window: {type: emitter, radiance: [0.2, 0.155, 0.1]}
  blue window: {type: emitter, radiance: [0.05, 0.09, 0.17]}
  pink sign: {type: emitter, radiance: [2.2, 0.12, 0.7]}
  cyan sign: {type: emitter, radiance: [0.06, 0.9, 1.1]}
  shop: {type: emitter, radiance: [1.7, 1.35, 0.95]}
objects:
  - {type: quad, name: street, corner: [-30, 0, 20], edges: [[60, 0, 0], [0, 0, -220]], material: asphalt}
  - {type: box, name: left pavement, min: [-6.5, -0.1, -119], max: [-4, 0.14, -4], material: pavement}
  - {type: box, name: right pavement, min: [4, -0.1, -119], max: [6.5, 0.14, -4], material: pavement}
  - {type: box, name: left houses, min: [-20, -1, -118], max: [-6.5, 13, -14], material: wall}
  - {type: box, name: right houses, min: [6.5, -1, -117], max: [20, 11, -10], material: wall}
  - {type: box, name: last house, min: [-22, -1, -130], max: [22, 17, -120], material: wall}
  - &umbrella
    {type: mesh, name: umbrella, file: ../generated/umbrella_cloth.ply, smooth: true, material: cloth,
     transform: [{rotate: {axis: [0, 1, 0], angle: 22.5}}, {rotate: {axis: [0, 0, 1], angle: 51}},
       {translate: [0, 0.375, 0]}, {rotate: {axis: [0, 1, 0], angle: 48}}]}
  - {<<: *umbrella, name: its frame, file: ../generated/umbrella_frame.ply, smooth: false, material: steel}
  # Beside the camera, and not in the picture.
  - {type: quad, name: shop, corner: [-5, 0.5, 3.5], edges: [[0, 2.2, 0], [0, 0, 4]], material: shop}
"""

ROWS = (3.4, 6.4, 9.4)
"""Heights of the sills (m)."""

LIT = 0.4
GLASS = ("warm window", "warm window", "pale window", "blue window")


def ball(place: tuple[float, float, float], radius: float, material: str, name: str = "") -> str:
    """Return a sphere."""
    center = ", ".join(f"{value:g}" for value in np.round(place, 2))
    named = f"name: {name}, " if name else ""
    return f"  - {{type: sphere, {named}center: [{center}], radius: {radius:g}, material: {material}}}\n"


def box(low: tuple[float, float, float], high: tuple[float, float, float], material: str, name: str = "") -> str:
    """Return a box."""
    ends = [", ".join(f"{value:g}" for value in np.round(end, 2)) for end in (low, high)]
    named = f"name: {name}, " if name else ""
    return f"  - {{type: box, {named}min: [{ends[0]}], max: [{ends[1]}], material: {material}}}\n"


def windows(chance: np.random.Generator) -> str:
    """Return lit windows on both sides and at the end of the street, and shops below some of them."""
    text = ""
    for side in (-1, 1):
        for z in range(-112, -16, 4):
            for sill in ROWS[: 3 if side < 0 else 2]:
                if chance.random() < LIT:
                    x = sorted((side * 6.45, side * 6.6))
                    text += box((x[0], sill, z), (x[1], sill + 1.5, z + 1.1), str(chance.choice(GLASS)))
            if chance.random() < LIT:
                x = sorted((side * 6.45, side * 6.6))
                text += box((x[0], 0.5, z), (x[1], 2.6, z + 2.8), "pale window")
    for x in range(-18, 18, 3):
        for sill in (*ROWS, 12.4):
            if chance.random() < LIT:
                text += box((x, sill, -120.1), (x + 1.3, sill + 1.6, -119.95), str(chance.choice(GLASS)))
    return text


def festoon(z: float, sag: float, count: int) -> str:
    """Return bulbs on a line across the street."""
    places = np.linspace(-1.0, 1.0, count)
    return "".join(ball((6.0 * x, 6.2 - sag * (1.0 - x * x), z - 1.5 * x), 0.045, "bulb") for x in places)


def car(x: float, z: float, comes: bool, name: str = "") -> str:
    """Return a car as a dark box with two lamps, at its end that faces the camera."""
    low, high = (0.66, "headlamp") if comes else (0.82, "rear lamp")
    lamps = "".join(ball((x + side, low, z), 0.1, high) for side in (-0.66, 0.66))
    return lamps + box((x - 0.85, 0.3, z - 4.2), (x + 0.85, 1.42, z - 0.1), "iron", name)


def scene() -> str:
    """Return the text of the scene file."""
    text = HEAD
    for side, first in ((-1, -12), (1, -19)):
        for z in range(first, -118, -16):
            text += ball((side * 4.4, 5.0, z), 0.14, "street lamp")
            text += box((side * 4.55 - 0.05, 0, z - 0.05), (side * 4.55 + 0.05, 5.0, z + 0.05), "iron")
    for z, sag, count in ((-24, 1.2, 15), (-40, 1.0, 17), (-60, 1.3, 19), (-84, 1.1, 21)):
        text += festoon(z, sag, count)
    for x, z in ((-1.9, -31), (-2.1, -55), (-1.8, -80)):
        text += car(x, z, comes=True)
    for x, z, name in ((1.7, -21, ""), (2.1, -38, ""), (1.8, -66, "last car")):
        text += car(x, z, comes=False, name=name)
    for x, z, material in ((3.7, -47, "go"), (-3.7, -52, "stop"), (3.7, -92, "go")):
        text += ball((x, 3.2, z), 0.16, material)
    text += box((5.7, 2.7, -30), (6.3, 3.5, -29.8), "pink sign")
    text += box((-6.3, 2.9, -38), (-5.4, 3.5, -37.8), "cyan sign")
    return text + windows(np.random.default_rng(7))


def main() -> None:
    """Write the scene to the path given, or to where the other showcases are."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", nargs="?", type=Path, default=DEFAULT, help="default: scenes/showcase/night_street.yaml")
    parser.parse_args().out.write_text(scene(), encoding="utf-8", newline="\n")


if __name__ == "__main__":
    main()
