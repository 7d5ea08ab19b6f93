"""What is seen at a place in the picture: the object under it, and its distance along the axis."""

import math

import pytest

from raytracer.scene.pack.scene import pack
from raytracer.scene.picking import pick
from tests.small_scenes import scene

LENS = "{type: thin_lens, look_from: [0, 0, 0], look_at: [0, 0, -1], vfov: 90, aperture: 20 mm}"
WALL = "{type: quad, corner: [-90, -90, -8], edges: [[180, 0, 0], [0, 180, 0]]}"
BALL = "{type: sphere, name: ball, center: [0, 0, -5], radius: 1}"
PAIR = """groups:
  pair:
    - {type: sphere, center: [-3, 0, -6], radius: 1}
    - {type: box, min: [2, -1, -7], max: [4, 1, -6]}
"""


def picked(x, y, *objects, camera=LENS, before=""):
    items = "".join(f"  - {item}\n" for item in objects)
    packed = pack(scene(f"camera: {camera}\n{before}objects:\n{items}", filled=False, width=40, height=40))
    return pick(packed, packed.build(), x, y)


def test_the_object_and_its_distance_are_those_under_the_place():
    assert picked(0.5, 0.5, WALL, BALL) == ("ball", "ball", pytest.approx(4.0))
    # Along the axis, and not along the ray.
    assert picked(0.1, 0.2, WALL, BALL) == ("objects[0]", None, pytest.approx(8.0))
    assert picked(0.1, 0.2, BALL) is None


def test_an_instance_is_picked_as_a_whole_and_a_shape_of_many_primitives_too():
    both = "{type: instance, of: pair, name: both, transform: [{translate: [0, 0, 1]}]}"
    # The near side of a ball 5 m down the axis and 3 m beside it, and the front of the box.
    for x, distance in ((0.2, 5.0 - 5.0 / math.hypot(3.0, 5.0)), (0.8, 5.0)):
        found = picked(x, 0.5, WALL, BALL, both, before=PAIR)
        assert found[:2] == ("both", "both")
        assert found.distance == pytest.approx(distance)
    cubes = "{type: box, name: cube, min: [-1, -1, -4], max: [1, 1, -3]}"
    assert picked(0.5, 0.5, BALL, cubes, WALL) == ("cube", "cube", pytest.approx(3.0))


def test_what_moves_is_picked_in_the_middle_of_the_exposure():
    moving = BALL.replace("}", ", motion: {velocity: [0, 0, -8]}}")
    camera = LENS.replace("}", ", shutter: 1/4 s}")
    assert picked(0.5, 0.5, moving, WALL, camera=camera).distance == pytest.approx(5.0)


def test_invisible_surfaces_are_looked_through():
    fog = "{type: sphere, center: [0, 0, -3], radius: 0.5, medium: fog}"
    assert picked(0.5, 0.5, fog, BALL, before="media: {fog: {type: homogeneous, scattering: 0.1}}\n").object == "ball"


def test_cameras_without_an_axis_and_pictures_of_many_views_have_no_such_place():
    with pytest.raises(ValueError, match="the camera orthographic has no axis"):
        picked(0.5, 0.5, BALL, camera="{type: orthographic, look_from: [0, 0, 0], look_at: [0, 0, -1], height: 2}")
