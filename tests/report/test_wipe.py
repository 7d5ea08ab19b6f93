"""The wipe between two pictures, in a browser: what is seen on the screen is what the pictures hold."""

import io
from collections.abc import Callable
from typing import Any

import numpy as np
import PIL.Image
import pytest

from raytracer.report import page as html

Open = Callable[..., Any]

RED, BLUE = (200, 30, 10), (10, 40, 220)
WIDTH, HEIGHT = 40, 24


def plain(color, width=WIDTH, height=HEIGHT):
    return np.full((height, width, 3), color, dtype=np.uint8)


def wiping(open_page, folder, left, right, **settings):
    file = folder / "wipe.html"
    file.write_bytes(html.page("wipe", "wipe", {"left": left, "right": right}))
    page = open_page(file, **settings)
    page.evaluate(
        """() => {
          const element = make("div");
          document.body.append(element);
          window.wipe = new Wipe(element, data.left, data.right, { leftLabel: "before", rightLabel: "after" });
          return wipe.shown;
        }"""
    )
    return page


def screen(page):
    """Capture the visible part of the pictures."""
    return np.asarray(PIL.Image.open(io.BytesIO(page.locator(".wipe-view").screenshot())).convert("RGB"))


def where_red(page):
    """Measure the part of the view's last rows, where nothing else is drawn, that is the left picture."""
    row = screen(page)[-3]
    return float(np.mean(np.all(row == RED, axis=-1)))


@pytest.fixture
def page(open_page, tmp_path):
    return wiping(open_page, tmp_path, html.png(plain(RED)), html.png(plain(BLUE)))


def test_the_divider_is_dragged(page):
    assert where_red(page) == pytest.approx(0.5, abs=0.01)
    box, grip = page.locator(".wipe-view").bounding_box(), page.locator(".wipe-divider").bounding_box()
    x, y = grip["x"] + grip["width"] / 2, grip["y"] + grip["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(box["x"] + 0.25 * box["width"], y + 30, steps=4)
    page.mouse.up()
    assert where_red(page) == pytest.approx(0.25, abs=0.01)

    # Let go of, it stays.
    page.mouse.move(box["x"] + 0.9 * box["width"], y)
    assert where_red(page) == pytest.approx(0.25, abs=0.01)

    # A press on the picture brings it there, too; beyond the picture it goes to its edge.
    page.mouse.click(box["x"] + 0.75 * box["width"], box["y"] + box["height"] - 20)
    assert where_red(page) == pytest.approx(0.75, abs=0.01)
    page.mouse.down()
    page.mouse.move(box["x"] + 2 * box["width"], y)
    page.mouse.up()
    assert page.evaluate("wipe.position") == 1.0


def test_keys_move_the_divider_and_the_pixel_under_the_pointer_is_told(page):
    divider = page.get_by_role("slider", name="divider")
    divider.focus()
    page.keyboard.press("ArrowLeft")
    assert page.evaluate("wipe.position") == pytest.approx(0.48)
    page.keyboard.press("Shift+ArrowRight")
    assert divider.get_attribute("aria-valuenow") == "58"
    page.keyboard.press("Home")
    assert where_red(page) < 0.01
    page.keyboard.press("End")
    assert where_red(page) > 0.98
    box = page.locator(".wipe-view").bounding_box()
    page.mouse.move(box["x"] + (3 + 0.5) / WIDTH * box["width"], box["y"] + (20 + 0.5) / HEIGHT * box["height"])
    said = page.locator(".wipe-bar output").inner_text()
    assert said == "x 3, y 20 · before 200 30 10 · after 10 40 220"


def test_a_finger_moves_the_divider(open_page, tmp_path):
    page = wiping(open_page, tmp_path, html.png(plain(RED)), html.png(plain(BLUE)), has_touch=True, size=(400, 700))
    box = page.locator(".wipe-view").bounding_box()
    page.touchscreen.tap(box["x"] + 0.3 * box["width"], box["y"] + box["height"] - 30)
    assert page.evaluate("wipe.position") == pytest.approx(0.3, abs=0.01)


@pytest.mark.parametrize("device_scale_factor", [1, 2])
def test_zoomed_a_pixel_is_so_many_pixels_of_the_screen(open_page, tmp_path, device_scale_factor):
    noise = np.random.default_rng(1).integers(0, 256, (HEIGHT, WIDTH, 3), dtype=np.uint8)
    page = wiping(open_page, tmp_path, html.png(noise), None, device_scale_factor=device_scale_factor)
    page.evaluate("wipe.show(data.left)")
    page.evaluate("wipe.shown")
    for zoom in (2, 4):
        page.get_by_role("button", name=f"{zoom}:1").click()
        page.mouse.move(1, 1)
        np.testing.assert_array_equal(screen(page), noise.repeat(zoom, axis=0).repeat(zoom, axis=1))
    page.get_by_role("button", name="Fit").click()
    assert screen(page).shape[0] > 8 * HEIGHT


def test_what_is_larger_than_the_page_is_pulled(open_page, tmp_path):
    left, right = plain(RED, 800, 600), plain(BLUE, 800, 600)
    left[300, 400] = right[300, 400] = 255
    page = wiping(open_page, tmp_path, html.png(left), html.png(right), size=(600, 500))
    page.get_by_role("button", name="4:1").click()
    place = "[...document.querySelectorAll('.wipe-view')].map(view => [view.scrollLeft, view.scrollTop])[0]"
    before = page.evaluate(place)
    assert min(before) > 0  # the middle stayed in the middle

    box = page.locator(".wipe-view").bounding_box()
    x, y = box["x"] + 60, box["y"] + 60
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 40, y + 30, steps=3)
    page.mouse.up()
    after = page.evaluate(place)
    np.testing.assert_allclose(np.subtract(before, after), (40, 30), atol=1)

    # The divider is where it was on the screen, and cuts where it is.
    assert page.evaluate("wipe.position") == 0.5
    row = screen(page)[100]
    assert np.mean(np.all(row == RED, axis=-1)) == pytest.approx(0.5, abs=0.03)


def test_the_picture_asked_for_last_is_shown(page):
    """A large picture takes longer to decode than a small one that is asked for after it."""
    large = html.png(np.random.default_rng(1).integers(0, 256, (600, 800, 3), dtype=np.uint8))
    page.evaluate(
        """async (large) => {
          wipe.show(large, null, "large");
          const first = wipe.shown;
          wipe.show(data.right, null, "small");
          await Promise.all([first, wipe.shown]);
        }""",
        large,
    )
    assert page.locator(".wipe-label.left").inner_text() == "small"
    assert page.evaluate("[...document.querySelectorAll('canvas')].map(canvas => canvas.width)") == [0, WIDTH]
    assert not page.locator(".wipe-divider").is_visible()
    assert set(map(tuple, screen(page)[-3])) == {BLUE}
