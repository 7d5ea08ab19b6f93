"""Pages of the lecture that can be played with: what they show is what Gauss says and what `rt explain` prints."""

import re
import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from raytracer.analysis.explain import explain
from raytracer.optics.thin_lens import image_distance
from raytracer.scene.load import build
from tests.repository import ROOT

MAKE = runpy.run_path(str(ROOT / "docs" / "make_pages.py"))

CAMERA = """
camera: {{type: thin_lens, look_from: [0, 0, 0], look_at: [0, 0, -1], sensor: full_frame,
         focal_length: {focal_length} mm, f_number: {f_number}, focus_distance: {focus} mm}}
film: {{width: 36, height: 24}}
environment: {{type: constant, radiance: 1}}
objects:
  - {{type: disc, name: ball, center: [0, 0, -{subject}e-3], normal: [0, 0, 1], radius: 1.0e-3}}
"""


@pytest.fixture
def bench(tmp_path: Path, open_page: Any) -> Any:
    path = tmp_path / "thin_lens.html"
    path.write_bytes(MAKE["thin_lens"]())
    return open_page(path)


def drag(page: Any, setting: str, across: float, up: float) -> None:
    """Drag a handle by millimetres."""
    place = page.locator(f"[data-setting={setting}]").bounding_box()
    scale = page.evaluate("SCALE * find('#bench').getScreenCTM().a")
    x, y = place["x"] + place["width"] / 2, place["y"] + place["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + scale * across, y - scale * up, steps=3)
    page.mouse.up()


def number(page: Any, name: str) -> float:
    return float(page.locator(f"#{name}").get_attribute("data-value"))


@pytest.mark.parametrize(
    "moves", [{"subject": (35.0, 0.0)}, {"focal_length": (-12.0, 0.0), "diameter": (0.0, -10.0)}, {"film": (40.0, 0.0)}]
)
def test_what_is_dragged_follows_gauss_and_explain(moves: dict[str, tuple[float, float]], bench: Any) -> None:
    before = bench.evaluate("({...state})")
    for setting, by in moves.items():
        drag(bench, setting, *by)
    state = bench.evaluate("({...state})")
    assert {name for name in state if state[name] != before[name]} == set(moves)
    assert number(bench, "image") == pytest.approx(image_distance(state["focal_length"], state["subject"]), rel=5e-3)
    focus = image_distance(state["focal_length"], state["film"])
    facts = {**state, "focus": focus, "f_number": state["focal_length"] / state["diameter"]}
    text = explain(build(CAMERA.format(**facts), "bench.yaml")).text()
    (circle,) = re.findall(r"^  ball +\S+ +(\S+)", text, re.MULTILINE)
    assert number(bench, "circle") == pytest.approx(float(circle), rel=1e-2)
    (film,) = re.findall(r"image distance +(\S+) mm", text)
    assert state["film"] == pytest.approx(float(film), rel=1e-3)


def test_a_button_focuses(bench: Any) -> None:
    assert number(bench, "circle") > 1.0
    bench.locator("#sharp").click()
    assert number(bench, "circle") < 0.3
    assert bench.evaluate("state.film") == pytest.approx(number(bench, "image"), abs=0.25)


# ---- Depth of field

FIELD = """
camera: {{type: thin_lens, look_from: [0, 0, 0], look_at: [0, 0, -1], sensor: {sensor}, focal_length: {focal_length} mm,
         f_number: {f_number}, focus_distance: {focus}}}
film: {{width: 36, height: 24}}
environment: {{type: constant, radiance: 1}}
objects: [{{type: disc, name: ball, center: [0, 0, -1], normal: [0, 0, 1], radius: 1.0e-3}}]
"""


@pytest.fixture
def field(tmp_path: Path, open_page: Any) -> Any:
    path = tmp_path / "depth_of_field.html"
    path.write_bytes(MAKE["depth_of_field"]())
    return open_page(path)


def metres(words: str) -> float:
    return float(words.removesuffix(" m").replace("infinity", "inf"))


@pytest.mark.parametrize(
    ("sensor", "focal_length", "stop", "focus"),
    [("full_frame", 50, 3, 1.0), ("1/2.3-inch", 12, 4, 0.5), ("full_frame", 24, 7, 0.25), ("aps_c", 85, 1, 0.0)],
)
def test_limits_are_those_that_explain_prints(
    sensor: str, focal_length: int, stop: int, focus: float, field: Any
) -> None:
    field.select_option("#sensor", sensor)
    for name, value in {"focal_length": focal_length, "stop": stop, "focus": focus}.items():
        field.locator(f"#{name}").fill(str(value))
    facts = {"sensor": sensor, "focal_length": focal_length, "f_number": 2 ** (stop / 2)}
    text = explain(build(FIELD.format(**facts, focus=1.0 / focus if focus else ".inf"), "field.yaml")).text()
    for name, label in {"near": "near limit", "far": "far limit", "hyperfocal": "hyperfocal distance"}.items():
        (printed,) = re.findall(rf"{label} +(\S+)", text)
        shown = field.locator(f"#{name}").get_attribute("data-value").replace("Infinity", "inf")
        assert float(shown) == pytest.approx(metres(printed), rel=1e-3)


@pytest.mark.parametrize(("stop", "focus"), [(1, 2.0), (1, 0.5), (10, 1.0)])
def test_the_strip_is_sharp_where_the_focus_is(stop: int, focus: float, field: Any) -> None:
    # The contrast of the targets, nearest first: the greatest at the focus if the lens is wide, alike if it is narrow.
    field.locator("#focal_length").fill("50")
    field.locator("#stop").fill(str(stop))
    field.locator("#focus").fill(str(focus))
    strip = field.evaluate("stripNumber(follow(state))")
    with Image.open(MAKE["STRIPS"]) as picture:
        height = picture.height // (len(MAKE["STRIP_APERTURES"]) * len(MAKE["STRIP_FOCUSES"]))
        shown = np.asarray(picture.convert("L"), float)[strip * height : (strip + 1) * height]
    contrast = [target.std() for target in np.split(shown, 11, axis=1)]
    if stop == 1:
        assert int(np.argmax(contrast)) == 10 - round(focus / 0.25)
        assert max(contrast) > 2.0 * min(contrast)
    else:
        assert max(contrast) < 1.3 * min(contrast)
