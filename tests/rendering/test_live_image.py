"""A picture in a notebook's cell while it is rendered, against a stub of IPython."""

import sys
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

import raytracer as rt
from raytracer.rendering import live_image
from raytracer.rendering.live_image import LiveImage
from raytracer.rendering.progress import Progress
from raytracer.rendering.render import prepare_scene
from raytracer.rendering.session import RenderSession
from raytracer.scene.load import build
from tests.cli.test_render import SCENE


@pytest.fixture
def shown(monkeypatch):
    """A notebook: what its cell has shown, one after the other, and whether it took the place of the last."""
    images = []

    def display(image, *, display_id):
        assert display_id
        images.append(("display", image))
        return SimpleNamespace(update=lambda image: images.append(("update", image)))

    package, displays = ModuleType("IPython"), ModuleType("IPython.display")
    package.get_ipython = lambda: SimpleNamespace(kernel=object())
    displays.display = display
    monkeypatch.setitem(sys.modules, "IPython", package)
    monkeypatch.setitem(sys.modules, "IPython.display", displays)
    return images


def session():
    return RenderSession(prepare_scene(build(SCENE, "ball.yaml")), None, None, None)


def test_one_display_is_kept_up_to_date_and_not_more_often_than_it_should(shown, monkeypatch):
    passed, running = [], session()
    live = LiveImage(passed.append)
    with live.observe(running):
        # There is nothing to be seen yet.
        live.tick(Progress(0, 100, 0.0))
        assert shown == []
        running.queue.first_pass(8)
        for _ in range(3):
            live.tick(Progress(50, 100, 0.1))
        assert [how for how, _ in shown] == ["display"]
        monkeypatch.setattr(live_image, "_INTERVAL", 0.0)
        live._next_update = 0.0
        live.tick(Progress(50, 100, 0.1))
    image = running.develop()
    live.finish(image)
    live.tick(Progress(100, 100, 0.2))
    assert [how for how, _ in shown] == ["display", "update", "update"]
    assert np.array_equal(shown[0][1].radiance, image.radiance)
    assert shown[-1][1] is image
    assert len(passed) == 6


def test_a_render_ends_with_its_picture_in_the_cell_once(shown):
    scene = build(SCENE, "ball.yaml")
    image = rt.render(scene, live=True)
    assert shown[0][0] == "display"
    assert all(how == "update" for how, _ in shown[1:])
    assert shown[-1][1] is image
    assert np.array_equal(image.radiance, rt.render(scene).radiance)


@pytest.mark.parametrize("shell", [None, SimpleNamespace()], ids=["no shell", "a terminal"])
def test_outside_of_a_notebook_nothing_is_shown(shown, shell):
    sys.modules["IPython"].get_ipython = lambda: shell
    rt.render(build(SCENE, "ball.yaml"), live=True)
    assert shown == []
