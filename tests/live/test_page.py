"""The live view's page in a browser."""

import re

import pytest
from axe_playwright_python import sync_playwright as axe
from playwright.sync_api import expect

from tests.live.conftest import SCENE, until

BAD = SCENE.replace("f_number: 2 ", "f_number: wide ")


@pytest.fixture
def page(server, open_page):
    """The page of the live view, once all is rendered."""
    page = open_page(server.address)
    page.locator("body[data-done=true]").wait_for()
    return page


def finished(page, job):
    page.locator(f"body[data-done=true][data-job='{job}']").wait_for()


def brightest(page):
    """The brightest red on the canvas, 0 to 255."""
    return max(pixels(page, "canvas")[::4])


def pixels(page, canvas):
    """The pixels of a canvas, from one that is made to be read."""
    return page.evaluate(
        """(drawn) => {
            const copy = make("canvas", { width: drawn.width, height: drawn.height });
            const context = copy.getContext("2d", { willReadFrequently: true });
            context.drawImage(drawn, 0, 0);
            return [...context.getImageData(0, 0, drawn.width, drawn.height).data];
        }""",
        page.evaluate_handle(canvas),
    )


def click(page, x, y):
    box = page.locator(".wipe-stage").bounding_box()
    page.mouse.click(box["x"] + x * box["width"], box["y"] + y * box["height"])


def test_the_picture_is_shown_as_bright_as_the_exposure_says(page):
    assert page.evaluate("[canvas.width, canvas.height]") == [64, 40]
    assert brightest(page) == 255
    page.locator("#exposure").fill("-2")
    # A quarter of the light, in sRGB.
    assert brightest(page) == pytest.approx(137, abs=1)
    assert page.locator("#exposure-words").inner_text() == "-2 EV"
    expect(page.locator("#status")).to_contain_text("done: 32 of 32 spp")
    page.locator("#exposure").fill("0")
    page.locator("#colours").select_option("false")
    assert brightest(page) != 255


def test_layers_are_switched_and_values_are_told_under_the_pointer(page):
    page.locator("#layer").select_option("samples")
    page.locator("body[data-layer=samples]").wait_for()
    assert page.evaluate("frame.pixels.every((value) => value === 32)")
    box = page.locator(".wipe-stage").bounding_box()
    page.mouse.move(box["x"] + 0.35 * box["width"], box["y"] + 0.5 * box["height"])
    expect(page.locator("#readout")).to_have_text(re.compile(r"x 22, y 20: .* ± .*, 32 samples"))


def test_an_edit_shows_beside_the_picture_before_it_and_an_error_until_it_is_mended(page, scene):
    scene.write_text(SCENE.replace("radiance: 1}", "radiance: 0.1}"), encoding="utf-8")
    finished(page, 2)
    assert brightest(page) == pytest.approx(137, abs=1)
    page.locator("#compare").click()
    expect(page.locator(".wipe-label")).to_have_text(["before", "now"])
    assert max(pixels(page, "before")[::4]) == 255

    scene.write_text(BAD, encoding="utf-8")
    expect(page.locator("#errors p")).to_have_text(re.compile(r"scene\.yaml:8: camera\.f_number: must be a number"))
    assert brightest(page) == pytest.approx(137, abs=1)
    scene.write_text(SCENE, encoding="utf-8")
    finished(page, 3)
    expect(page.locator("#errors")).to_be_hidden()
    assert brightest(page) == 255


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_page_is_for_everybody_and_for_small_windows(server, scene, open_page, scheme):
    page = open_page(server.address, size=(390, 800), color_scheme=scheme)
    page.locator("body[data-done=true]").wait_for()
    scene.write_text(BAD, encoding="utf-8")
    expect(page.locator("#errors")).to_be_visible()
    assert axe.Axe().run(page).response["violations"] == []
    assert page.evaluate("document.documentElement.scrollWidth") == 390


def test_a_slider_shows_another_picture_and_is_written_on_request_alone(page, scene):
    assert page.locator("#controls label").count() == 3
    page.locator("#camera-f_number").evaluate("(it) => { it.value = 1; it.dispatchEvent(new Event('input')); }")
    finished(page, 2)
    assert scene.read_text(encoding="utf-8") == SCENE
    page.locator("#write").click()
    expect(page.locator("#notice")).to_contain_text("wrote")
    assert scene.read_text(encoding="utf-8") == SCENE.replace("f_number: 2 ", "f_number: 45 ")
    expect(page.locator("#write")).to_be_disabled()


def test_a_click_focuses_here_where_that_is_chosen(page, live):
    click(page, 0.35, 0.5)
    page.locator("[data-mode=focus]").click()
    click(page, 0.35, 0.5)
    finished(page, 2)
    expect(page.locator("#notice")).to_have_text("focused on near, 2 m away")
    assert live.state()["sharpness"]["focus"] == pytest.approx(2.0, rel=0.01)
    expect(page.locator("#sharpness text")).to_have_text("2 m")
    expect(page.locator("#sharpness-words")).to_contain_text("sharp from 1.9")


def test_pause_and_save_are_pressed(page, live, tmp_path):
    page.locator("#save").click()
    expect(page.locator("#notice")).to_contain_text("saved.npy")
    assert (tmp_path / "saved.npy").exists()
    page.locator("#pause").click()
    until(lambda: live.state()["paused"])
    expect(page.locator("#pause")).to_have_attribute("aria-pressed", "true")
