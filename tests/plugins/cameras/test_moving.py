"""Cameras that move, against the resting camera in the place where they are at the time."""

from pathlib import Path

import numpy as np
import pytest
from pydantic import TypeAdapter, ValidationError

from raytracer.core.motion.resolve import matrix_at
from raytracer.core.shutter.table import Shutter
from raytracer.plugins.cameras.base.moving import MovingCamera, pack_camera
from raytracer.scene.assets import LOADERS
from raytracer.schema.registry import CAMERAS
from tests.core.motion.kernels import camera_rays
from tests.plugins.cameras.kernels import camera_rays as resting_rays
from tests.repository import SCENES

CAMERA = TypeAdapter(CAMERAS.union())
VIEW = {"look_from": [1, 2, 5], "look_at": [0, 0.5, 0], "up": [0.1, 1, 0]}
TURN = {"spin": {"axis": [0, 1, 0.2], "rate": 30, "center": [0, 0.5, 1]}, "velocity": [0.5, 0, -1]}
SIZES = {
    # Of one view, which is then the middle, as which points are seen.
    "camera_array": {"rows": 1, "columns": 1, "spacing": 0.1},
    "light_slab": {"rows": 1, "columns": 1, "uv": 0.1, "st": [4, 3]},
    "camera_box": {"rows": 1, "columns": 1, "size": 4, "faces": ["front"]},
    "camera_sphere": {"rows": 1, "columns": 1},
    "light_field": {"focal_length": 50, "f_number": 4},
    "orthographic": {"height": 4},
    "lens": {"lens": str(SCENES / "lenses" / "double-gauss-50mm.yaml"), "f_number": 8, "dispersion": False},
}
X, Y = np.meshgrid(np.linspace(4.5, 12, 5), np.linspace(3, 8, 4))


def camera(kind="pinhole", **keys):
    spec = CAMERA.validate_python({"type": kind, **VIEW, **SIZES.get(kind, {}), **keys})
    return spec.bind_assets({str(place[0]): LOADERS[held](Path(name)) for place, (name, held) in spec.files().items()})


@pytest.mark.parametrize("kind", list(CAMERAS.specs()))
def test_rays_of_a_moving_camera_are_those_of_the_resting_one_moved(kind):
    """Rays, and where their points are seen: `project` leads back to where on the film they began."""
    spec = camera(kind, shutter={"open": 0.5, "close": 2.5}, motion=TURN)
    packed = pack_camera(spec, 16, 12)
    assert isinstance(packed, MovingCamera)
    for fraction in (0.0, 0.3, 1.0):
        origins, directions, seen = camera_rays(packed, X.ravel(), Y.ravel(), fraction)
        rest_origins, rest_directions = resting_rays(packed.camera, X.ravel(), Y.ravel())
        matrix = matrix_at(spec.motion, 0.5 + 2.0 * fraction)
        np.testing.assert_allclose(origins, rest_origins @ matrix[:3, :3].T + matrix[:3, 3], atol=1e-12)
        np.testing.assert_allclose(directions, rest_directions @ matrix[:3, :3].T, atol=1e-12)
        # A bare sensor sees each point everywhere, a ray none; a lens of glass has errors, and microlenses many images.
        if kind not in ("none", "lens", "light_field", "ray"):
            np.testing.assert_allclose(seen[:, :2], np.column_stack([X.ravel(), Y.ravel()]), atol=1e-9)


@pytest.mark.parametrize("kind", list(CAMERAS.specs()))
@pytest.mark.parametrize(
    "keys",
    [
        {"motion": TURN},
        {"shutter": 0, "motion": TURN},
        {"shutter": 2, "motion": {"velocity": [0, 0, 0]}},
        {"shutter": {"close": 1}, "motion": {"keyframes": [{"time": t, "transform": []} for t in (0, 1)]}},
        {"shutter": "1/60 s", "time": 3},
        {"shake": {"amplitude": 1}, "time": 2, "shutter": 0},
        {"shake": {"amplitude": 0, "bandwidth": 3, "seed": 4}, "shutter": 1},
    ],
)
def test_a_camera_that_does_not_move_is_packed_as_without_the_keys(kind, keys):
    still = pack_camera(camera(kind), 16, 12)
    packed = pack_camera(camera(kind, **keys), 16, 12)
    assert type(packed) is type(still)
    assert repr(packed) == repr(still)


def test_a_camera_is_posed_where_it_is_at_the_moment():
    motion = {"velocity": [1, 2, 3]}
    posed = pack_camera(camera(motion=motion, time=2), 16, 12)
    there = pack_camera(camera(look_from=[3, 6, 11], look_at=[2, 4.5, 6]), 16, 12)
    for field, expected in zip(posed.frame, there.frame, strict=True):
        np.testing.assert_allclose(field, expected, atol=1e-14)


@pytest.mark.parametrize(
    ("keys", "expected"),
    [
        ({}, Shutter(0.0, 0.0)),
        ({"time": 3}, Shutter(3.0, 3.0)),
        ({"shutter": "1/125 s"}, Shutter(0.0, 0.008)),
        ({"shutter": "1/125 s", "time": 2}, Shutter(2.0, 2.008)),
        ({"shutter": {"open": -1, "close": "500 ms"}}, Shutter(-1.0, 0.5)),
        ({"shutter": {"close": 2}}, Shutter(0.0, 2.0)),
    ],
)
def test_a_shutter_is_an_interval_or_a_duration(keys, expected):
    assert camera(**keys).shutter_interval() == expected


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"shutter": {"open": 2, "close": 1}}, "must not be before the shutter opens, 2 s, got 1 s"),
        ({"shutter": -1}, "must be at least 0"),
        ({"shutter": "8 mm"}, "'mm' is a unit of length"),
        ({"shutter": {"open": 0, "close": 1}, "time": 1}, "give one"),
        ({"shutter": {"open": 0, "clos": 1}}, "unknown key 'clos' of shutter; did you mean 'close'?"),
        ({"shutter": [0, 1]}, "must be a time in seconds"),
        ({"shutter": {"open": 1e9, "duration": 1e-9}}, "too short to be told"),
        ({"motion": {"keyframes": [{"time": t, "transform": [{"scale": 1 + t}]} for t in (0, 1)]}}, "but not scaled"),
    ],
)
def test_what_is_no_shutter_is_named(keys, words):
    with pytest.raises(ValidationError) as caught:
        camera(**keys)
    assert words in str(caught.value)


def test_a_camera_that_turns_too_often_is_refused():
    spinning = {"spin": {"axis": [0, 1, 0], "rate": "100 turn/s"}}
    with pytest.raises(ValueError, match=r"turns 100 times while the shutter is open"):
        pack_camera(camera(motion=spinning, shutter=1), 16, 12)
