"""The page of a sweep in a browser: what is chosen is what is seen, and the numbers are those of the sweep."""

import dataclasses
import json

import numpy as np
import PIL.Image
import pytest

from raytracer.analysis.sweep.manifest import write_manifest
from raytracer.analysis.sweep.page import page as page_of
from raytracer.analysis.sweep.page import point_numbers as numbers_of
from raytracer.analysis.sweep.results import PointResult
from raytracer.analysis.sweep.run import sweep as rendered
from tests.analysis.sweep.made_up import ALBEDO, F_NUMBER, FOCUS, HEIGHT, WIDTH, images, made_up

AT = "#camera.f_number={}&camera.focus_distance={}"


def write_page(made):
    (made.folder / "index.html").write_bytes(page_of(made, images))


@pytest.fixture(scope="module")
def sweep(tmp_path_factory):
    made = made_up(tmp_path_factory.mktemp("sweep"), failed=((2, 1),), missing=((3, 2),))
    write_page(made)
    return made


@pytest.fixture
def opened(sweep, open_page):
    """The page, at a #fragment or not, once its first picture is there."""

    def opened(fragment="", **settings):
        page = open_page(sweep.folder / "index.html", fragment, **settings)
        page.locator("body[data-shown]").wait_for()
        return page

    return opened


def at(sweep, *index):
    return next(taken for taken in sweep.results if taken.point.index == index)


def seen(page, side="left"):
    """The picture that lies to one side of the divider, uint8 (height, width, 3)."""
    width, height, values = page.evaluate(
        """(side) => {
          const canvas = document.querySelector(`.wipe-${side}`);
          const { width, height } = canvas;
          return [width, height, [...canvas.getContext("2d").getImageData(0, 0, width, height).data]];
        }""",
        side,
    )
    return np.reshape(np.array(values, dtype=np.uint8), (height, width, 4))[..., :3]


def in_file(sweep, *index):
    with PIL.Image.open(sweep.folder / at(sweep, *index).files[0]) as file:
        return np.asarray(file)


def wait(page, *points):
    names = " | ".join(taken.point.name for taken in points)
    page.locator(f'body[data-shown="{names}"]').wait_for()


def numbers(page, side="a"):
    """Read the table beside the picture, in full, by the numbers' keys."""
    return page.evaluate(
        """(side) => Object.fromEntries([...document.querySelectorAll("#differing tr[data-key], #same tr[data-key]")]
          .map((row) => [row.dataset.key, (row.querySelector(`td.${side}`) ?? row.cells[1]).title]))""",
        side,
    )


def test_a_failed_point_says_why(opened, sweep):
    page = opened(AT.format("2.8", "5"))
    assert page.locator("#trouble").inner_text() == f"failed: {at(sweep, 2, 1).reason}"
    assert "1 of 12 points failed." in page.locator("#notes").inner_text()
    assert set(numbers(page).values()) <= {"", "20", "64", "0.008", "100"}
    page.goto(page.url.split("#")[0] + AT.format("4", "10"))
    page.get_by_text("not rendered: the sweep was ended before it").wait_for()
    # All others are as they should be.
    page.keyboard.press("ArrowUp")
    wait(page, at(sweep, 2, 2))
    assert not page.locator("#trouble").is_visible()
    np.testing.assert_array_equal(seen(page), in_file(sweep, 2, 2))


def test_a_picture_of_the_overview_is_chosen_by_a_click(opened, sweep):
    page = opened()
    cells = page.locator("#overview .cell")
    assert cells.count() == 12
    assert page.locator("#overview th").all_inner_texts() == ["2", "5", "10", "1.4", "2", "2.8", "4"]
    cells.nth(4).click()
    wait(page, at(sweep, 1, 1))
    assert cells.nth(4).get_attribute("data-at") == "a"
    cells.nth(6).click(modifiers=["Shift"])
    wait(page, at(sweep, 1, 1), at(sweep, 2, 0))
    assert cells.nth(6).get_attribute("data-at") == "b"
    assert cells.nth(7).inner_text() == "failed"


def test_the_address_says_what_is_seen(opened, sweep):
    page = opened(AT.format("2", "5") + "&vs.camera.f_number=1.4&vs.camera.focus_distance=10")
    wait(page, at(sweep, 1, 1), at(sweep, 0, 2))
    page.get_by_role("slider", name="f_number, point A").fill("0")
    page.wait_for_url(
        "**#camera.f_number=1.4&camera.focus_distance=5&vs.camera.f_number=1.4&vs.camera.focus_distance=10"
    )
    # What it does not know, it leaves.
    page.goto(page.url.split("#")[0] + "#camera.f_number=2&camera.zoom=3&camera.focus_distance=7")
    wait(page, at(sweep, 1, 1), at(sweep, 0, 2))


@pytest.mark.parametrize("size", [(360, 640), (1600, 900)])
def test_nothing_is_wider_than_the_window(opened, size):
    page = opened(AT.format("1.4", "5") + "&vs.camera.f_number=2", size=size, color_scheme="dark")
    assert page.evaluate("document.documentElement.scrollWidth") <= size[0]
    dark = page.evaluate("getComputedStyle(document.body).backgroundColor")
    assert dark == "rgb(21, 23, 27)"
    picture, sliders = page.locator(".wipe-view").bounding_box(), page.locator("#sliders").bounding_box()
    assert (sliders["y"] > picture["y"] + picture["height"]) == (size[0] < 800)


def test_names_are_text(open_page, tmp_path):
    made = made_up(tmp_path, (ALBEDO, F_NUMBER, FOCUS), failed=((0, 0, 0),))
    made = dataclasses.replace(made, scene="/home/me/<b>&amp;.yaml")
    write_page(made)
    page = open_page(tmp_path / "index.html")
    assert page.locator("h1").inner_text() == "<b>&amp;.yaml"
    assert page.title() == "<b>&amp;.yaml: albedo, f_number, focus_distance"
    assert page.locator("#trouble").inner_text() == "failed: camera: <i>no</i> & never"
    assert page.locator("b").count() == page.locator("i").count() == 0

    # Of three axes, two are the overview's, and they can be chosen.
    assert page.locator("#overview .cell").count() == 8
    page.get_by_label("rows").select_option(label="focus_distance")
    assert page.locator("#overview .cell").count() == 12
    page.locator("#overview .cell").nth(2).click()
    wait(page, at(made, 0, 2, 0))


def test_sliders_and_keys_choose_the_picture(opened, sweep):
    page = opened()
    aperture, focus = (page.get_by_role("slider", name=f"{name}, point A") for name in ("f_number", "focus_distance"))
    np.testing.assert_array_equal(seen(page), in_file(sweep, 0, 0))
    aperture.fill("3")
    wait(page, at(sweep, 3, 0))
    np.testing.assert_array_equal(seen(page), in_file(sweep, 3, 0))
    focus.press("ArrowRight")
    wait(page, at(sweep, 3, 1))
    assert [aperture.get_attribute("aria-valuetext"), focus.get_attribute("aria-valuetext")] == ["4", "5"]
    assert page.locator("#sliders output.a").all_inner_texts() == ["4", "5"]
    # Outside of sliders, arrows go along rows and columns.
    focus.evaluate("one => one.blur()")
    for key, *index in (("Left", 3, 0), ("Up", 2, 0), ("Down", 3, 0), ("Up", 2, 0), ("Up", 1, 0), ("Left", 1, 0)):
        page.keyboard.press(f"Arrow{key}")
        wait(page, at(sweep, *index))
    # It runs through the values by itself.
    play = page.get_by_role("button", name="run through focus_distance")
    play.click()
    for index in ((1, 1), (1, 2), (1, 1)):
        wait(page, at(sweep, *index))
    play.click()
    assert play.get_attribute("aria-pressed") == "false"


def test_the_numbers_are_those_of_the_manifest(opened, sweep, tmp_path):
    write_manifest(sweep, tmp_path)
    points = json.loads((tmp_path / "manifest.json").read_bytes())["points"]
    page = opened(AT.format("1.4", "5"))
    (point,) = (point for point in points if point["index"] == [0, 1])
    told = numbers(page)
    del told["files"]
    assert {key: float(value) for key, value in told.items()} == {
        "samples": point["samples"],
        "error": pytest.approx(100.0 * point["error"]["relative"]),
        "render_seconds": point["seconds"]["render"],
        "seconds": point["seconds"]["total"],
        "rays": point["rays"],
        **point["exposure"],
        **{key: float(value) for key, value in point["camera"].items()},
    }
    # They are short and say their units.
    rows = {row.get_attribute("data-key"): row.inner_text().split("\t") for row in page.locator("#differing tr").all()}
    assert rows["error"][0] == "relative error"
    assert [rows["error"][1], rows["error"][-1]] == ["1.33", "%"]
    assert [rows["far_limit_m"][1], rows["far_limit_m"][-1]] == ["13.35", "m"]
    assert rows["rays"][1] == "123,456,790"
    # What no point changes is told apart.
    assert "vfov_deg" not in rows
    assert "horizontal" not in page.locator("#same").inner_text()
    page.locator("#same summary").click()
    assert page.locator("#same tr[data-key=vfov_deg]").inner_text().split("\t") == ["vertical field of view", "20", "°"]


def test_two_points_are_wiped(opened, sweep):
    page = opened(AT.format("1.4", "10"))
    assert not page.locator(".wipe-divider").is_visible()
    page.get_by_role("button", name="Compare").click()
    wait(page, at(sweep, 0, 2), at(sweep, 3, 2))
    page.get_by_role("slider", name="f_number, point B").fill("1")
    wait(page, at(sweep, 0, 2), at(sweep, 1, 2))
    np.testing.assert_array_equal(seen(page, "left"), in_file(sweep, 0, 2))
    np.testing.assert_array_equal(seen(page, "right"), in_file(sweep, 1, 2))
    assert float(numbers(page, "b")["seconds"]) == at(sweep, 1, 2).seconds["total"]
    words = ["A: f_number 1.4, focus_distance 10", "B: f_number 2, focus_distance 10"]
    assert page.locator(".wipe-label").all_inner_texts() == words
    page.keyboard.press("x")
    wait(page, at(sweep, 1, 2), at(sweep, 0, 2))
    page.keyboard.press("c")
    wait(page, at(sweep, 1, 2))


def test_numbers_are_those_that_were_metered_and_a_page_needs_no_picture():
    # f/2 and 1/125 s at ISO 1600, which the metering chose: log2(4 * 125 * 100 / 1600), where at ISO 100 it were 8.97.
    made = made_up(None, (F_NUMBER,), failed=((0,), (1,), (2,), (3,)))
    camera, exposure = {"ev100": 8.966, "vfov_deg": 20.0}, {"iso": 1600.0, "ev100": 4.966}
    taken = PointResult(made.results[0].point, "done", camera=camera, exposure=exposure)
    assert {"ev100": 4.966, "vfov_deg": 20.0}.items() <= numbers_of(taken).items()
    assert b"4 of 4 points failed." in page_of(made, images)


def test_all_pictures_are_at_hand_before_they_are_asked_for(opened, sweep):
    """Once all is decoded, what a slider chooses is drawn before its event is over."""
    page = opened()
    page.evaluate("Promise.all(points.map((point) => gallery.decode(point)))")
    shown = page.evaluate(
        """() => {
          const slider = document.querySelector("input.a");
          slider.value = 1;
          slider.dispatchEvent(new Event("input"));
          return document.body.dataset.shown;
        }"""
    )
    assert shown == at(sweep, 1, 0).point.name


def test_the_table_of_all_points_is_sorted(opened, sweep):
    page = opened()
    page.get_by_text("Numbers of all points").click()
    head = page.locator("#all th[title=far_limit_m] button")
    head.click()
    column = [row.split("\t") for row in page.locator("#all tbody tr").all_inner_texts()]
    limits = [float(row[8]) for row in column if row[2] == ""]
    known = sorted(taken.camera["far_limit_m"] for taken in sweep.results if taken.status == "done")
    np.testing.assert_allclose(limits, known, rtol=1e-3)
    head.click()
    assert page.locator("#all tbody tr").nth(0).inner_text().split("\t")[8] == "inf"
    page.locator("#all tbody tr").nth(0).click()
    assert page.locator("#all tbody tr[data-at=a]").count() == 1


def test_zipped_axes_have_one_slider(open_page, tmp_path):
    focus = FOCUS._replace(values=(2.0, 5.0, 10.0, 20.0), labels=("2", "5", "10", "20"))
    made = made_up(tmp_path, (F_NUMBER, focus), zipped=True)
    write_page(made)
    page = open_page(tmp_path / "index.html")
    slider = page.get_by_role("slider", name="point A")
    assert slider.count() == 1
    slider.fill("2")
    wait(page, at(made, 2, 2))
    assert page.locator("#sliders output.a").inner_text() == "2.8, 10"
    np.testing.assert_array_equal(seen(page), in_file(made, 2, 2))


def test_many_pixels_are_held_smaller(monkeypatch):
    """What a browser could not hold becomes as many pixels as it can, and the page says so."""
    made = made_up(None)
    exact = page_of(made, images)
    monkeypatch.setattr("raytracer.analysis.sweep.page._EXACT_PIXELS", 1.0)
    monkeypatch.setattr("raytracer.analysis.sweep.page._MOST_PIXELS", 12 * WIDTH * HEIGHT / 4)
    smaller = page_of(made, images)
    assert len(smaller) < len(exact)
    assert b"scaled to 50 % and compressed" in smaller
    assert b"compressed" not in exact
    assert f'"size":[{WIDTH // 2},{HEIGHT // 2}]'.encode() in smaller


SCENE = """
camera: {type: thin_lens, look_from: [0, 0, 5], look_at: [0, 0, 0], sensor: full_frame, f_number: 2, focal_length: 50}
film: {width: 32, height: 20}
render: {spp: 4, seed: 1}
environment: {type: constant, radiance: 1}
materials: {grey: {type: lambertian, albedo: 0.5}}
objects: [{type: sphere, center: [0, 0, 0], radius: 1, material: grey}]
"""


@pytest.mark.slow
def test_a_sweep_that_was_rendered(open_page, tmp_path):
    """From the command line's function to the screen: pictures are the files', numbers the manifest's."""
    (tmp_path / "ball.yaml").write_text(SCENE)
    values = {"camera.f_number": "1.4,8", "camera.focus_distance": "2:5:2"}
    made = rendered(tmp_path / "ball.yaml", values, folder=tmp_path / "out", threads=2)
    page = open_page(tmp_path / "out" / "index.html")
    points = json.loads((tmp_path / "out" / "manifest.json").read_bytes())["points"]
    assert [point["status"] for point in points] == ["done"] * 4
    for taken, point in zip(made.results, points, strict=True):
        page.get_by_role("slider", name="f_number, point A").fill(str(point["index"][0]))
        page.get_by_role("slider", name="focus_distance, point A").fill(str(point["index"][1]))
        wait(page, taken)
        np.testing.assert_array_equal(seen(page), in_file(made, *point["index"]))
        told = numbers(page)
        assert {key: float(told[key]) for key in point["camera"]} == {
            key: float(value) for key, value in point["camera"].items()
        }
        assert float(told["seconds"]) == point["seconds"]["total"]
