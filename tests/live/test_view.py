"""The live render: its pictures are those of `rt render`, and changes of values cost a preview."""

import os
import threading

import numpy as np
import pytest

from raytracer.live.picture import enlarge
from raytracer.live.scene_file import SceneFile
from raytracer.live.view import LiveView
from raytracer.rendering.render import render
from raytracer.scene.load import load
from raytracer.util.errors import InputError
from tests.live.conftest import SCENE, done, until
from tests.repository import ROOT

# Enough samples that a render is under way whatever is done meanwhile.
LONG = ("spp: 32", "spp: 100000000")


def steps_of(view, monkeypatch):
    """The steps of the pictures that a view's engine publishes from now on."""
    steps = []
    publish = view._engine._publish
    monkeypatch.setattr(view._engine, "_publish", lambda source: (steps.append(source.step), publish(source)))
    return steps


def is_under_way(view):
    """Tell if the full picture of the latest edit has its first samples, and gets more."""
    state = view.state()
    return state["shown"] == state["job"] and state["step"] == 1 and state["status"] == "rendering" and state["samples"]


def edit(path, before, after):
    text = path.read_text(encoding="utf-8")
    assert before in text
    path.write_text(text.replace(before, after), encoding="utf-8")


def test_the_picture_at_the_end_is_that_of_a_render(live, scene, tmp_path):
    done(live)
    assert live.handle({"do": "save"})["text"] == f"wrote {tmp_path / 'saved.npy'}"
    expected = render(load(scene), threads=1).image.radiance
    np.testing.assert_array_equal(np.load(tmp_path / "saved.npy"), expected.astype(np.float32))
    frame = live.frame()
    assert (frame.step, frame.is_done, frame.samples) == (1, True, 32)
    np.testing.assert_array_equal(frame.pixels, expected.astype(np.float32))


def test_values_of_the_camera_show_an_eighth_of_the_size_first_and_make_nothing_anew(live, monkeypatch):
    done(live)
    live.handle({"do": "set", "values": {"f_number": 4.0}})
    done(live)
    made, steps = live._engine.cache.counts, steps_of(live, monkeypatch)
    live.handle({"do": "set", "values": {"f_number": 8.0, "focus_distance": 2.0}})
    state = done(live)
    assert steps == [8, 4, 1, 1]
    assert live._engine.cache.counts == made
    assert state["tried"] == {"f_number": 8.0, "focus_distance": 2.0, "focus_on": None}
    values = {control["key"]: control["value"] for control in state["controls"]}
    assert values == {"f_number": 8.0, "focus_distance": 2.0, "focal_length": 50.0}
    # The limits are those of thin lenses: H = f^2 / (N c) + f, s (H - f) / (H + s - 2 f) and s (H - f) / (H - s).
    circle, focal = np.hypot(36.0, 24.0) / 1500.0, 50.0
    hyperfocal = focal**2 / (8.0 * circle) + focal
    assert state["sharpness"]["near"] == pytest.approx(2.0 * (hyperfocal - focal) / (hyperfocal + 1900.0), rel=1e-3)
    assert state["sharpness"]["far"] == pytest.approx(2.0 * (hyperfocal - focal) / (hyperfocal - 2000.0), rel=1e-3)


def test_an_edit_is_rendered_and_an_error_keeps_the_picture_until_it_is_mended(live, scene):
    done(live)
    edit(scene, "radiance: 1}", "radiance: 3}")
    until(lambda: live.state()["job"] == 2)
    done(live)
    assert live.frame().pixels.max() == 3.0
    edit(scene, "f_number: 2 ", "f_numbr: 2 ")
    (error,) = until(lambda: [error for error in live.state()["errors"] if ":8: camera.f_numbr: " in error])
    assert error.startswith(f"{scene}:8: ")
    assert error.replace(str(scene), scene.name) in (ROOT / "docs" / "live.md").read_text(encoding="utf-8")
    assert live.frame().pixels.max() == 3.0
    edit(scene, "f_numbr: 2 ", "f_number: 2 ")
    until(lambda: not live.state()["errors"])
    assert done(live)["job"] == 2


def test_a_file_is_read_once_it_stands_still(scene):
    file = SceneFile(str(scene), {})
    file.load()
    assert not file.has_changed()
    text = scene.read_text(encoding="utf-8")
    # As editors write: what is there goes, then the new text comes in parts.
    for written in ("", text[:40], text + "# more"):
        scene.write_text(written, encoding="utf-8")
        assert not file.has_changed()
    assert file.has_changed()
    file.load()
    assert not file.has_changed()
    scene.unlink()
    assert not file.has_changed()
    assert not file.has_changed()


def test_what_is_tried_stays_through_edits_of_the_rest_of_the_file(live, scene):
    done(live)
    live.handle({"do": "set", "values": {"f_number": 5.6}})
    edit(scene, "radiance: 1}", "radiance: 3}")
    until(lambda: live.state()["job"] == 3)
    assert done(live)["tried"] == {"f_number": 5.6}
    edit(scene, "f_number: 2 ", "f_number: 4 ")
    until(lambda: live.state()["job"] == 4)
    assert done(live)["tried"] == {}


def test_what_is_tried_is_written_where_it_stands_and_every_other_byte_stays(live, scene):
    done(live)
    live.handle({"do": "set", "values": {"f_number": 5.6, "focus_distance": 3.25}})
    job = done(live)["job"]
    live.handle({"do": "write"})
    written = SCENE.replace("f_number: 2 ", "f_number: 5.6 ").replace("focus_on: far", "focus_distance: 3.25")
    assert scene.read_bytes() == written.encode()
    # It is what is shown already.
    until(lambda: live.state()["tried"] == {})
    assert live.state()["job"] == job


@pytest.mark.parametrize(("x", "name", "distance"), [(0.35, "near", 2.0), (0.68, "far", 4.0)])
def test_a_click_focuses_on_the_object_under_it(live, x, name, distance):
    done(live)
    reply = live.handle({"do": "focus", "x": x, "y": 0.5})
    assert reply["text"] == f"focused on {name}, {distance:g} m away"
    assert done(live)["sharpness"]["focus"] == pytest.approx(distance, rel=1e-6)
    live.handle({"do": "focus", "x": x, "y": 0.5, "on": True})
    assert done(live)["tried"]["focus_on"] == name
    with pytest.raises(InputError, match="nothing but the background"):
        live.handle({"do": "focus", "x": 0.5, "y": 0.01})


def test_a_paused_render_waits_can_be_saved_and_goes_on(live, scene, tmp_path):
    edit(scene, *LONG)
    until(lambda: live.state()["job"] == 2 and is_under_way(live))
    live.handle({"do": "pause", "on": True})
    until(lambda: live.state()["status"] == "paused")
    mark = live.mark()
    live.handle({"do": "save"})
    assert np.load(tmp_path / "saved.npy").shape == (40, 64, 3)
    assert live.mark() == mark
    live.handle({"do": "pause", "on": False})
    until(lambda: live.mark() != mark)


def test_a_hundred_quick_edits_leave_nothing_behind(live, scene):
    done(live)
    threads, files = threading.active_count(), len(os.listdir("/proc/self/fd"))
    edit(scene, *LONG)
    until(lambda: live.state()["job"] == 2 and is_under_way(live))
    for number in range(100):
        live.handle({"do": "set", "values": {"f_number": 2.0 + 0.01 * number}})
    until(lambda: is_under_way(live))
    assert live.state()["tried"] == {"f_number": 2.99}
    # Those of the last render, and no others.
    until(lambda: threading.active_count() <= threads + 2)
    assert len(os.listdir("/proc/self/fd")) <= files
    assert os.listdir(scene.parent) == [scene.name]


def test_all_layers_are_told_at_a_pixel(live):
    done(live)
    values = live.handle({"do": "values", "x": 0.35, "y": 0.5})["values"]
    assert values["samples"] == [32]
    assert values["radiance"] == live.frame().pixels[20, 22].astype(float).tolist()
    assert len(values["standard error"]) == 3


@pytest.mark.parametrize(
    ("message", "sentence"),
    [
        ({"do": "fly"}, "there is no action"),
        ({"do": "set", "values": {"look_from": [1, 2, 3]}}, "look_from is no value that a slider sets"),
        ({"do": "set", "values": {"f_number": -1}}, "camera.f_number"),
        ({"do": "values", "x": 1.5, "y": 0.0}, "outside of the picture"),
    ],
)
def test_what_cannot_be_done_is_refused_in_a_sentence(live, message, sentence):
    done(live)
    with pytest.raises(InputError, match=sentence):
        live.handle(message)
    assert live.state()["tried"] == {}


def test_pictures_are_enlarged_to_any_size():
    assert (
        enlarge(np.arange(6).reshape(2, 3), 7, 4).tolist() == [[0, 0, 0, 1, 1, 2, 2]] * 2 + [[3, 3, 3, 4, 4, 5, 5]] * 2
    )


def test_a_view_can_be_ended_at_once(scene, tmp_path):
    from raytracer.live.scene_file import SceneFile
    from raytracer.rendering.options import RenderOptions

    edit(scene, *LONG)
    with LiveView(SceneFile(str(scene), {}), RenderOptions(threads=2), []):
        pass
