"""A light field in the live view: a click focuses it afterwards, and nothing is rendered anew."""

import re

import numpy as np
import pytest
from playwright.sync_api import expect

from raytracer.film.light_field.layout import extract_light_field
from raytracer.lightfield.refocusing.refocus import refocus
from raytracer.live.picture import RADIANCE, REFOCUSED
from raytracer.rendering.render import render
from raytracer.scene.load import load
from tests.live.conftest import SCENE, done
from tests.live.test_page import click

LENS = "  type: thin_lens\n", "  f_number: 2           # wide open\n  focus_on: far\n"
ARRAY = "  type: camera_array\n", "  rows: 3\n  columns: 5\n  spacing: 20 mm\n"


@pytest.fixture
def scene(tmp_path):
    """The discs, seen by an array of cameras."""
    text = SCENE
    for old, new in zip(LENS, ARRAY, strict=True):
        assert old in text
        text = text.replace(old, new)
    path = tmp_path / "scene.yaml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize(("x", "name", "distance"), [(0.35, "near", 2.0), (0.68, "far", 4.0)])
@pytest.mark.parametrize("layer", [RADIANCE, REFOCUSED])
def test_a_click_refocuses_on_the_object_under_it(live, scene, layer, x, name, distance):
    job = done(live)["job"]
    # Of the whole picture the place is in the view in the middle.
    place = {"x": x, "y": 0.5} if layer == REFOCUSED else {"x": (2 + x) / 5, "y": 0.5}
    reply = live.handle({"do": "focus", "layer": layer, **place})
    assert reply["layer"] == REFOCUSED
    assert reply["text"].startswith(f"refocused on {name}, ")
    assert reply["distance"] == pytest.approx(distance, rel=0.01)
    assert live.state()["job"] == job

    field = extract_light_field(render(load(scene)).image)
    expected = refocus(field, reply["distance"]).radiance
    np.testing.assert_array_equal(live.frame(REFOCUSED).pixels, expected.astype(np.float32))
    assert REFOCUSED in live.state()["layers"]


def test_the_page_shows_what_is_refocused(server, open_page):
    page = open_page(server.address)
    page.locator("body[data-done=true]").wait_for()
    assert page.evaluate("[canvas.width, canvas.height]") == [5 * 64, 3 * 40]
    page.get_by_text("focuses here").click()
    click(page, (2 + 0.35) / 5, 0.5)
    page.locator(f"body[data-layer={REFOCUSED}]").wait_for()
    expect(page.locator("#notice")).to_have_text(re.compile("refocused on near, "))
    assert page.evaluate("[canvas.width, canvas.height]") == [64, 40]
    assert page.locator("#layer").input_value() == REFOCUSED
    box = page.locator(".wipe-stage").bounding_box()
    page.mouse.move(box["x"] + 0.35 * box["width"], box["y"] + 0.5 * box["height"])
    expect(page.locator("#readout")).to_have_text("x 22, y 20: 1  1  1")
