"""A small scene in a file, and a live view of it: two discs that shine, of a type that other tests render too."""

import threading
import time

import pytest

from raytracer.live.scene_file import SceneFile
from raytracer.live.server import LiveServer
from raytracer.live.view import LiveView
from raytracer.rendering.options import RenderOptions

SCENE = """\
# A comment that stays.
camera:
  type: thin_lens
  look_from: [0, 0, 0]
  look_at: [0, 0, -1]   # straight ahead
  sensor: full_frame
  focal_length: 50 mm
  f_number: 2           # wide open
  focus_on: far

film: {width: 64, height: 40}
render: {spp: 32, max_depth: 1, sampler: sobol}
objects:
  - {type: disc, name: near, center: [-0.25, 0, -2], normal: [0, 0, 1], radius: 0.2,
     material: {type: emitter, radiance: 1}}
  - {type: disc, name: far, center: [0.5, 0, -4], normal: [0, 0, 1], radius: 0.4,
     material: {type: emitter, radiance: 0.25}}
"""


def until(happens, seconds=30.0):
    """Wait until a function returns what is true, and return that."""
    end = time.monotonic() + seconds
    while not (result := happens()):
        assert time.monotonic() < end, "it has not happened"
        time.sleep(0.01)
    return result


@pytest.fixture
def scene(tmp_path):
    """The scene's file."""
    path = tmp_path / "scene.yaml"
    path.write_text(SCENE, encoding="utf-8")
    return path


@pytest.fixture
def live(scene, tmp_path):
    """A live view of the scene, which has ended without a trace after the test."""
    before = set(threading.enumerate())
    with LiveView(SceneFile(str(scene), {}), RenderOptions(threads=2), [tmp_path / "saved.npy"]) as view:
        yield view
    until(lambda: set(threading.enumerate()) <= before)


@pytest.fixture
def server(live):
    """The server of that view."""
    with LiveServer(live) as served:
        yield served


def done(view):
    """Wait until a view has rendered all there is to render, and return its state."""

    def finished():
        state = view.state()
        return state if state["status"] == "done" and state["shown"] == state["job"] else None

    return until(finished)
