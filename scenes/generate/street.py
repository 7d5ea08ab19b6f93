"""Write the scenes of ``scenes/lecture`` and ``scenes/optics`` that look down one street.

They differ in their cameras, and in whether somebody stands in the street; a second run writes the same bytes:

    python scenes/generate/street.py [FOLDER]
"""

from __future__ import annotations

import argparse
from pathlib import Path

MADE = """\
# Made by `python scenes/generate/street.py`, which reproduces this file byte for byte; to change more than its camera,
# change that script.
"""

SIZES = {"pinhole": "width: 400, height: 320", "hangar": "width: 800, height: 227"}
"""Sizes of films that are not 480 x 320."""

FILM = """\
film: {width: 480, height: 320}
render: {spp: 256, max_depth: 6}
"""

HEADS = {
    "focal_lengths": """\
# Focal lengths: one street, from one place, through lenses of 17 to 200 mm.
# Look at: the clock on the tower, 150 m away, which grows in proportion to the focal length; the street in front of it,
# which looks short through a long lens, although only less of it is seen; the corners at 17 mm, which are dark by
# cos^4.
# Change: camera.focal_length, to 17, 24, 35, 50, 100 and 200 mm.
camera:
  {type: thin_lens, look_from: [0, 1.6, 0], look_at: [0, 5, -150], sensor: full_frame, focal_length: 35 mm,
   f_number: 11, focus_distance: 30, shutter: 1/160 s, iso: 100}
""",
    "dolly_zoom": """\
# Dolly zoom, as in Hitchcock's "Vertigo": the camera moves back while it zooms in, so that a person stays the same
# size.
# Look at: the person, who stays the same size; the street behind, which seems to come closer, and the clock, which
# grows from a speck to larger than the head.  Perspective depends on where the camera stands; the focal length only
# selects a part of it.
# Change: camera.focal_length, and with it the distance, look_from[2], which is 88 times as long: 17 mm from 1.496 m, 50
# mm from 4.4 m, 200 mm from 17.6 m.
camera:
  {type: thin_lens, look_from: [0, 1.4, 4.4], look_at: [0, 1.4, 0], sensor: full_frame, focal_length: 50 mm,
   f_number: 11, focus_on: person, shutter: 1/160 s, iso: 100}
""",
    "sensor_sizes": """\
# Sensor sizes: how much of the image that a lens forms a smaller sensor records.
# Look at: with the 28 mm lens, the field of view, which becomes narrower as if the focal length were longer, by the
# crop factor; and the brightness, which stays the same, because exposure is light per area.  With the same field of
# view instead, the street in the background, which is blurred on the large sensor and sharp on the small one, whose
# lens has a pupil only a few millimetres wide.
# Change: camera.sensor, to medium_format, full_frame, aps_c, four_thirds, 1-inch or 1/2.3-inch.  For the same field of
# view, equivalent_focal_length: 75 mm instead of focal_length.
camera:
  {type: thin_lens, look_from: [0.35, 1.5, 2.6], look_at: [0.25, 1.45, 0], sensor: full_frame, focal_length: 28 mm,
   f_number: 2, focus_on: head, shutter: 1/5000 s, iso: 100}
""",
    "pinhole": """\
# Pinholes of real sizes: a box with a hole, 90 mm in front of a sheet of film of 4 x 5 inches (127 x 102 mm).
# Look at: the picture of the 6 mm hole, which spreads every point over a disc of 6 mm, near and far alike; that of the
# 1 mm hole, which is soft; and that of the 0.35 mm hole, which is sharp.  The price is light, and therefore time: 1/80
# s, 0.45 s and 3.7 s for equally bright pictures.  With an even smaller hole a real picture would be blurred by
# diffraction, which is not simulated: `rt explain` prints the size of the Airy disc, which here is 0.35 mm too.
# Change: camera.diameter, and camera.shutter with the inverse of its square.
camera:
  {type: pinhole, look_from: [0, 1.6, -6], look_at: [1.5, 3.4, -50], sensor: {width: 127 mm, height: 102 mm},
   focal_length: 90 mm, diameter: 0.35 mm, shutter: 3.7 s, iso: 100}
""",
    "hangar": """\
# The largest pinhole photograph: a hangar 16.8 m deep, with a hole of 6 mm and a canvas of 33.8 x 9.6 m.
# Look at: near and far, which are equally sharp.  The hole that is hopeless for a film of 127 mm is only 0.2 pixels
# wide here: what counts is the size of the hole compared with that of the picture.  In a box of 90 mm it draws the same
# view as blobs.  The price is time, since the hole is f/2800.
# Change: camera.focal_length=90, with camera.sensor={width: 181.07, height: 51.43} and camera.shutter=11.6 ms.
camera:
  {type: pinhole, look_from: [0, 3.2, 4], look_at: [0, 4.4, -40], sensor: {width: 33.8 m, height: 9.6 m},
   focal_length: 16.8 m, diameter: 6 mm, shutter: 405 s, iso: 100}
""",
    "pinhole_and_lens": """\
# Pinhole beside lens: a person in a street, through a lens, and through a small hole in its place.
# Look at: the street in the background.  Through the lens, which is focused on the person, it is blurred; through the
# hole it is as sharp as the person.  The lens gathers light over a diameter of 25 mm and the hole over 0.3 mm, so the
# lens needs a 7000th of the time.
# Change: camera.type to pinhole, with camera.f_number=167 and camera.shutter=1.44 s.
camera:
  {type: thin_lens, look_from: [0.6, 1.5, 2.6], look_at: [0.12, 1.56, 0], sensor: full_frame, focal_length: 50 mm,
   f_number: 2, shutter: 1/4840 s, iso: 100}
""",
    "hand_shake": """\
# Hand shake: a street through a hand-held lens of 200 mm.
# Look at: the clock, which is sharp at 1/1000 s.  At 1/200 s, one over the focal length, the tremor is a pixel long,
# and at 1/15 s nobody can read the time.  The whole frame is blurred alike, including everything at rest.
# Change: camera.shutter, to 1/1000, 1/200 and 1/15 s, and camera.iso with its inverse, to 2500, 500 and 37.5.
camera:
  {type: thin_lens, look_from: [0, 1.6, 0], look_at: [0, 6, -150], sensor: full_frame, focal_length: 200 mm,
   f_number: 22, focus_distance: 100, shutter: 1/200 s, iso: 500, shake: {amplitude: 0.2 deg, bandwidth: 8 Hz, seed: 3}}
""",
    "no_lens": """\
# No lens: a bare sensor in the street, and a pinhole camera at the same place.
# Look at: nothing.  Without a lens every pixel receives light from everything in front of the sensor, so all record the
# same grey.  An exposure of 1/80000 s is enough for that: each pixel receives light from a whole hemisphere, while a
# hole of f/11 admits a cone only 5 degrees wide.
# Change: camera.type to pinhole, with camera.focal_length=35, camera.f_number=11 and camera.shutter=1/160.
camera:
  {type: none, look_from: [0, 1.6, 0], look_at: [0, 5, -150], sensor: full_frame, shutter: 1/80000 s, iso: 100}
""",
}

OPTICS = {
    "fisheye": """\
# Fisheye: a lens that sees a whole hemisphere, and therefore cannot keep straight lines straight.
# Look at: the street, which is straight, as is every house in it.  Lines through the middle of the picture stay
# straight; all others are bent, more so towards the edge.  The corners are black: the image of the lens is a circle of
# 25 mm.
# Change: camera.lens to ../lenses/wide-22mm.yaml, which keeps lines straight, and therefore stretches the corners.
camera:
  {type: lens, lens: ../lenses/fisheye-10mm.yaml, look_from: [0, 1.6, 0], look_at: [0, 3, -20],
   sensor: {width: 25 mm, height: 16.667 mm}, f_number: 8, focus_distance: 10, shutter: 1/250 s, iso: 100}
""",
}

INHABITED = ("dolly_zoom", "sensor_sizes", "pinhole_and_lens")

ENVIRONMENT = """\
environment: {type: sky, sun_elevation: 38, sun_azimuth: 145, turbidity: 3, ground_albedo: 0.2, sun: true}
textures:
  paving: {type: checker, scale: 1, even: [0.2, 0.19, 0.18], odd: [0.3, 0.29, 0.27]}
  bands: {type: checker, scale: 2, even: [0.55, 0.2, 0.14], odd: [0.7, 0.66, 0.58]}
materials:
  street: {type: lambertian, albedo: paving}
  lawn: {type: lambertian, albedo: [0.09, 0.17, 0.05]}
  cream: {type: lambertian, albedo: [0.62, 0.54, 0.4]}
  brick: {type: lambertian, albedo: [0.42, 0.17, 0.11]}
  blue: {type: lambertian, albedo: [0.25, 0.36, 0.45]}
  roof: {type: lambertian, albedo: [0.2, 0.11, 0.09]}
  glass: {type: lambertian, albedo: [0.05, 0.06, 0.08]}
  white: {type: lambertian, albedo: 0.75}
  bark: {type: lambertian, albedo: [0.13, 0.09, 0.06]}
  leaves: {type: lambertian, albedo: [0.1, 0.22, 0.05]}
  tower: {type: lambertian, albedo: bands}
"""

CLOTHES = """\
  red: {type: lambertian, albedo: [0.6, 0.06, 0.05]}
  dark: {type: lambertian, albedo: [0.05, 0.06, 0.1]}
  skin: {type: lambertian, albedo: [0.55, 0.36, 0.26]}
"""

STREET = """\
groups:
  # What a house has besides its walls: it is 8 m wide, 9 m long and 7 m high, its front at x = 0.
  front:
    - {type: box, min: [-0.7071, -0.7071, -4.8], max: [0.7071, 0.7071, 4.8], material: roof,
       transform: [{rotate: {axis: [0, 0, 1], angle: 45}}, {scale: [4.4, 2.6, 1]}, {translate: [-4, 6.7, 0]}]}
    - {type: box, min: [-0.1, 0, -0.6], max: [0.06, 2.2, 0.6], material: roof}
    - {type: instance, of: window, placements: [[{translate: [0, 1.2, -2.9]}], [{translate: [0, 1.2, 2.9]}],
         [{translate: [0, 4.2, -2.9]}], [{translate: [0, 4.2, 0]}], [{translate: [0, 4.2, 2.9]}]]}
    - {type: instance, of: window, transform: [{rotate: {axis: [0, 1, 0], angle: -90}}, {translate: [-4, 0, 4.5]}],
       placements: &gable
         [[{translate: [0, 1.2, -2]}], [{translate: [0, 1.2, 2]}],
          [{translate: [0, 4.2, -2]}], [{translate: [0, 4.2, 2]}]]}
    - {type: instance, of: window, transform: [{rotate: {axis: [0, 1, 0], angle: 90}}, {translate: [-4, 0, -4.5]}],
       placements: *gable}
  window:
    - {type: box, min: [-0.1, 0, -0.6], max: [0.04, 1.5, 0.6], material: white}
    - {type: box, min: [-0.1, 0.08, -0.52], max: [0.06, 1.42, -0.04], material: glass}
    - {type: box, min: [-0.1, 0.08, 0.04], max: [0.06, 1.42, 0.52], material: glass}
  cream house:
    - {type: box, min: [-8, 0, -4.5], max: [0, 7, 4.5], material: cream}
    - {type: instance, of: front}
  brick house:
    - {type: box, min: [-8, 0, -4.5], max: [0, 7, 4.5], material: brick}
    - {type: instance, of: front}
  blue house:
    - {type: box, min: [-8, 0, -4.5], max: [0, 7, 4.5], material: blue}
    - {type: instance, of: front}
  tree:
    - {type: box, min: [-0.12, 0, -0.12], max: [0.12, 2.4, 0.12], material: bark}
    - {type: sphere, center: [0, 3.3, 0], radius: 1.25, material: leaves}
    - {type: sphere, center: [0.5, 2.8, 0.5], radius: 0.8, material: leaves}
    - {type: sphere, center: [-0.5, 4.1, -0.2], radius: 0.9, material: leaves}
objects:
  - {type: quad, name: street, corner: [-6, 0, 60], edges: [[12, 0, 0], [0, 0, -260]], material: street}
  - {type: quad, name: lawn, corner: [-500, -0.05, 100], edges: [[1000, 0, 0], [0, 0, -1100]], material: lawn}
"""

TOWER = """\
  - {type: box, name: tower, min: [-2.5, 0, -155], max: [2.5, 14, -150], material: tower}
  - {type: disc, center: [0, 8, -149.95], normal: [0, 0, 1], radius: 1.7, material: white}
  - {type: box, min: [-0.1, 7.9, -149.95], max: [0.1, 9.4, -149.9], material: glass}
  - {type: box, min: [-0.1, 7.9, -149.95], max: [1.1, 8.1, -149.9], material: glass}
"""

PERSON = """\
  # Somebody 1.75 m tall, who stands at the origin.
  - &limb {type: sphere, center: [0, 0, 0], radius: 1, material: dark,
     transform: [{scale: [0.1, 0.45, 0.1]}, {translate: [-0.12, 0.42, 0]}]}
  - {<<: *limb, transform: [{scale: [0.1, 0.45, 0.1]}, {translate: [0.12, 0.42, 0]}]}
  - {<<: *limb, material: red, transform:
     [{scale: [0.075, 0.34, 0.075]}, {rotate: {axis: [0, 0, 1], angle: -9}}, {translate: [-0.27, 1.05, 0]}]}
  - {<<: *limb, material: red, transform:
     [{scale: [0.075, 0.34, 0.075]}, {rotate: {axis: [0, 0, 1], angle: 9}}, {translate: [0.27, 1.05, 0]}]}
  - {<<: *limb, name: person, material: red, transform: [{scale: [0.25, 0.4, 0.17]}, {translate: [0, 1.1, 0]}]}
  - {type: sphere, name: head, center: [0, 1.6, 0], radius: 0.14, material: skin}
  - {type: sphere, center: [-0.05, 1.63, 0.12], radius: 0.025, material: dark}
  - {type: sphere, center: [0.05, 1.63, 0.12], radius: 0.025, material: dark}
"""


STEP = 16
NEAREST, FARTHEST = -14, -150
COLOURS = ("cream", "brick", "blue")


def placements(kind: str, turns: list[str], places: list[tuple[int, int]]) -> str:
    """Return an object placed at these x and z (m), each turned as the texts say."""
    lines = [f"      - [{turn}{{translate: [{x}, 0, {z}]}}]\n" for turn, (x, z) in zip(turns, places, strict=True)]
    return f"  - type: instance\n    of: {kind}\n    placements:\n{''.join(lines)}"


def turn(angle: int) -> str:
    """Return a step that turns by this angle (deg) about the vertical."""
    return f"{{rotate: {{axis: [0, 1, 0], angle: {angle % 360}}}}}, "


def houses_and_trees() -> str:
    """Return both sides of the street: houses in three colours by turns, and a tree between any two."""
    text = ""
    rows = range(NEAREST, FARTHEST + STEP, -STEP)
    for number, colour in enumerate(COLOURS):
        left = [(-9, z) for z in rows[number::3]]
        right = [(9, z) for z in rows[(number + 2) % 3 :: 3]]
        turns = [""] * len(left) + [turn(180)] * len(right)
        text += placements(f"{colour} house", turns, left + right)
    trees = [(x, z - STEP // 2) for z in rows for x in (-7, 7)]
    return text + placements("tree", [turn(-5 * z + 60 * x) for x, z in trees], trees)


def street(name: str) -> str:
    """Return the text of a whole scene file."""
    film = FILM.replace("width: 480, height: 320", SIZES.get(name, "width: 480, height: 320"))
    head, somebody = (HEADS | OPTICS)[name].partition("camera:"), name in INHABITED
    text = f"{head[0]}{MADE}{head[1]}{head[2]}{film}{ENVIRONMENT}{CLOTHES if somebody else ''}"
    return f"{text}{STREET}{houses_and_trees()}{TOWER}{PERSON if somebody else ''}"


def main() -> None:
    """Write the scenes to the folders lecture and optics of the one given, or beside the other scenes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    default = Path(__file__).resolve().parent.parent
    parser.add_argument("folder", nargs="?", type=Path, default=default, help="default: scenes")
    arguments = parser.parse_args()
    for folder, heads in (("lecture", HEADS), ("optics", OPTICS)):
        for name in heads:
            target = arguments.folder / folder / f"{name}.yaml"
            target.write_text(street(name), encoding="utf-8", newline="\n")


if __name__ == "__main__":
    main()
