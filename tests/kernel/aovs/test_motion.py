"""Motion vectors: what the film position of the seen point changes by while the shutter is open."""

import math

import numpy as np
import pytest

from raytracer.plugins.cameras.base.interface import project
from raytracer.rendering.render import render
from tests.kernel.aovs.test_aovs import PIXEL, SIZE, VFOV, centres
from tests.small_scenes import scene
from tests.vectorised import rows, vectorised

WALL = "{type: quad, corner: [-9, -9, 0], edges: [[18, 0, 0], [0, 18, 0]]"

# What the scenes here have in common, so that those of a camera that stands compile one kernel, and those of one that
# moves another: behind the camera, where it sees nothing of it.
REST = """
  - {type: quad, corner: [0, 0, 99], edges: [[1.0e-3, 0, 0], [0, 1.0e-3, 0]]}
  - {type: quad, corner: [0, 0, 98], edges: [[1.0e-3, 0, 0], [0, 1.0e-3, 0]], motion: {velocity: [1, 0, 0]}}
  - {type: sphere, center: [0, 0, 97], radius: 1.0e-3, motion: {velocity: [1, 0, 0]}}
  - {type: disc, center: [0, 0, 96], normal: [0, 0, 1], radius: 1.0e-3, motion: {spin: {axis: [0, 0, 1], rate: 20}}}
"""


def scene_of(objects, camera=""):
    look = f"type: pinhole, vfov: {VFOV}, look_from: [0, 0, 4], look_at: [0, 0, 0], shutter: 1{camera}"
    text = f"camera: {{{look}}}\nobjects:\n  - {objects}{REST}"
    return scene(text, width=SIZE, height=SIZE, sampler="sobol", max_depth=1, filled=False)


def layers(objects, camera="", spp=64):
    return render(scene_of(objects, camera), spp=spp, aovs=("motion", "position", "depth")).image.layers


@pytest.mark.parametrize(
    ("camera", "wall", "expected"),
    [("", "M", [0.3, 0.2]), ("M", "", [-0.3, -0.2]), ("M", "M", [0.0, 0.0])],
    ids=["wall", "camera", "both"],
)
def test_a_wall_that_slides_moves_all_of_the_picture_alike(camera, wall, expected):
    # 4 m away, a pixel is 4 PIXEL wide; rows count downwards.  A camera's motion is the opposite of the wall's.
    moves = {"M": ", motion: {velocity: [0.3, -0.2, 0]}", "": ""}
    motion = layers(f"{WALL}{moves[wall]}}}", moves[camera])["motion"]
    np.testing.assert_allclose(motion, np.broadcast_to(expected, motion.shape) / (4.0 * PIXEL), rtol=0.0, atol=1e-9)


def test_motion_is_the_difference_of_what_project_says():
    # A ball that comes nearer and goes aside: each pixel's mean, from the mean position seen, to the second order in
    # what a pixel and the shutter spread.  With velocities this small that is less than a thousandth.
    velocity = np.array([0.02, 0.01, 0.03])
    ball = f"{{type: sphere, center: [0, 0, 0], radius: 1, motion: {{velocity: {velocity.tolist()}}}}}"
    aovs = layers(ball, spp=256)
    seen = np.hypot(*centres()) < 1.0 / math.sqrt(15.0) - 2.0 * PIXEL
    middle = aovs["position"][seen]
    camera = scene_of(ball).camera.pack(SIZE, SIZE)
    # Seen half-way through, on average.
    before, after = (
        vectorised(project)(camera, rows(middle + fraction * velocity), None)[:, :2] for fraction in (-0.5, 0.5)
    )
    expected = after - before
    assert np.abs(expected).max() > 0.1
    np.testing.assert_allclose(aovs["motion"][seen], expected, rtol=0.0, atol=2e-3 * np.abs(expected).max())


def test_a_turning_disc_moves_by_its_angle_times_the_radius():
    # A turn by w about the axis: a point seen at time t at p was at R(-w t) p and goes to R(w (1 - t)) p.  The mean of
    # the difference over t is the integral of R(w s) - R(-w s) over s = 0..1: 2 (1 - cos w) / w, across p.
    w = math.radians(20.0)
    spin = "motion: {spin: {axis: [0, 0, 1], rate: 20, center: [0, 0, 0]}}"
    motion = layers(f"{{type: disc, center: [0, 0, 0], normal: [0, 0, 1], radius: 9, {spin}}}", spp=256)["motion"]
    right, up = centres()
    size = 2.0 * (1.0 - math.cos(w)) / w / PIXEL
    np.testing.assert_allclose(motion[..., 0], -size * up, rtol=0.0, atol=0.02)
    np.testing.assert_allclose(motion[..., 1], -size * right, rtol=0.0, atol=0.02)


def test_what_passes_behind_the_camera_is_left_out():
    # At the opening 1 m away and at the closing 1 m behind: no film position there, so no motion, but a depth.
    aovs = layers(WALL.replace("-9, 0]", "-9, 3]") + ", motion: {velocity: [0, 0, 2]}}")
    np.testing.assert_array_equal(aovs["motion"], 0.0)
    assert (aovs["depth"] < 1.0).all()
