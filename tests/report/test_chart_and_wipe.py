"""Charts and the wipe between two pictures: what is seen in a browser is what the data and the pictures hold."""

import io
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import PIL.Image
import pytest

from raytracer.report import page as html
from raytracer.report.chart import DASHED, Chart, LegendEntry, Series, render
from raytracer.report.figure import IN_PAGE, Curve, new_figure, page_figure, series_id, style

SVG = "{http://www.w3.org/2000/svg}"
X = np.array([0.0, 1.0, np.nan, 3.0, 4.0])
CHART = Chart("c", "title", "x (mm)", "y (um)", (Series("a", X, 2.0 * X), Series("b", X, -X)), (0.0, 4.0), (-4.0, 8.0))

RED, BLUE = (200, 30, 10), (10, 40, 220)
WIDTH, HEIGHT = 40, 24


def curve(drawn, number):
    """The curve of a number in a chart's picture."""
    groups = ET.fromstring(str(drawn.picture)).iter(f"{SVG}g")
    return next(node for node in groups if node.get("id") == f"c-{series_id(number)}")


def test_lines_are_where_their_points_are():
    drawn = render(CHART)
    (path,) = curve(drawn, 0).iter(f"{SVG}path")
    pieces = [piece.replace("L", " ").split() for piece in path.get("d", "").split("M")[1:]]
    # A gap in the data is a gap in the line.
    assert [len(piece) // 2 for piece in pieces] == [2, 2]
    flat = np.array([float(number) for piece in pieces for number in piece]).reshape(-1, 2)
    left, right, bottom, top = drawn.data["box"]
    given = X[np.isfinite(X)]
    np.testing.assert_allclose(flat[:, 0], left + (right - left) * given / 4.0, atol=0.06)
    np.testing.assert_allclose(flat[:, 1], bottom + (top - bottom) * (2.0 * given + 4.0) / 12.0, atol=0.06)


def test_one_series_needs_no_legend_and_many_may_share_entries():
    assert CHART.legend() == (LegendEntry("a"), LegendEntry("b"))
    lines = tuple(Series(f"{n} {plane}", X, n * X, "#0072b2") for n in range(4) for plane in "TS")
    assert Chart("c", "", "", "", lines[:1]).legend() == ()
    entries = (LegendEntry("T"), LegendEntry("S", dashes=DASHED))
    assert Chart("c", "", "", "", lines, entries=entries).legend() == entries


def test_the_same_chart_is_the_same_picture():
    assert render(CHART).picture == render(CHART).picture


def show(open_page, folder, data, picture, **settings):
    file = folder / "chart.html"
    file.write_bytes(html.page("chart_test", "chart", {"charts": {"c": data}}, parts=("chart",)))
    text = file.read_text(encoding="utf-8")
    figure = f'<figure data-chart="c">{picture}<div class="tools"></div></figure><script type="application/json"'
    file.write_text(text.replace('<script type="application/json"', figure, 1), encoding="utf-8")
    return open_page(file, **settings)


def point_at(page, data, x, y):
    """Move the pointer to a place of the chart, given in parts of its axes; returns what is said."""
    left, right, bottom, top = data["box"]
    page.locator("figure > svg").scroll_into_view_if_needed()
    place = page.locator("figure > svg").evaluate(
        """(svg, at) => {
          const point = new DOMPoint(...at).matrixTransform(svg.getScreenCTM());
          return [point.x, point.y];
        }""",
        [left + x * (right - left), bottom + y * (top - bottom)],
    )
    page.mouse.move(*place)
    said = page.locator(".pointed")
    return said.locator("span").all_inner_texts() if said.is_visible() else []


@pytest.mark.parametrize("size", [(1280, 800), (400, 700)])
def test_a_line_tells_its_numbers_under_the_pointer(open_page, tmp_path, size):
    drawn = render(CHART)
    page = show(open_page, tmp_path, drawn.data, drawn.picture, size=size)
    # Between its points the line is told too: a at x = 0.5 has y = 1.
    assert point_at(page, drawn.data, 0.5 / 4.0, 5.0 / 12.0) == ["a", "x (mm): 0.5", "y (um): 1"]
    picked = page.locator(".picked").evaluate_all("all => all.map((one) => one.id)")
    assert picked == ["c-series-0"]
    faint, strong = (
        page.locator(f"#c-series-{number}").evaluate("one => getComputedStyle(one).opacity") for number in (1, 0)
    )
    assert float(faint) < 1.0
    assert strong == "1"
    assert point_at(page, drawn.data, 3.0 / 4.0, 1.0 / 12.0) == ["b", "x (mm): 3", "y (um): -3"]
    # What is said is all within the window.
    assert point_at(page, drawn.data, 0.99, 0.99 - 0.96 * 2 / 3)
    box = page.locator(".pointed").bounding_box()
    assert 0.0 <= box["x"] <= box["x"] + box["width"] <= size[0]
    # Away from all lines it is the place itself; outside nothing.
    assert point_at(page, drawn.data, 0.1, 0.95) == ["x (mm): 0.4", "y (um): 7.4"]
    assert page.locator(".picked").count() == 0
    assert point_at(page, drawn.data, -0.05, 0.5) == []


def test_logarithmic_axes_tell_their_numbers(open_page, tmp_path):
    x = np.array([1.0, 100.0])
    with style(IN_PAGE):
        axes = new_figure(4.0, 3.0, "constrained").add_subplot()
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.plot(x, 0.1 / x, gid=series_id(0))
        axes.set_xlim(0.1, 1000.0)
        axes.set_ylim(1e-4, 1.0)
        drawn = page_figure(axes, "c", "title", ("time (s)", "error (%)"), [Curve("fit", x, 10.0 / x)], (1.0, 100.0))
    page = show(open_page, tmp_path, drawn.data, drawn.picture)
    assert point_at(page, drawn.data, 0.5, 0.5) == ["fit", "time (s): 10", "error (%): 1"]


def test_a_chart_is_saved_as_it_is_seen(open_page, tmp_path):
    drawn = render(CHART)
    page = show(open_page, tmp_path, drawn.data, drawn.picture, color_scheme="dark")
    with page.expect_download() as waiting:
        page.get_by_role("button", name="Save CSV, title").click()
    rows = Path(waiting.value.path()).read_text(encoding="utf-8").splitlines()
    assert rows[:4] == ["series,x (mm),y (um)", "a,0,0", "a,1,2", "a,nan,nan"]
    with page.expect_download() as waiting:
        page.get_by_role("button", name="Save SVG, title").click()
    root = ET.fromstring(Path(waiting.value.path()).read_text(encoding="utf-8"))
    assert root.tag == f"{SVG}svg"
    # Dark lines on white, in dark mode too.
    assert root.get("color") == "#1b1d21"
    assert root[0].get("fill") == "#ffffff"


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


@pytest.mark.parametrize("settings", [{}, {"device_scale_factor": 2}], ids=str)
def test_zoomed_a_pixel_is_so_many_pixels_of_the_screen(open_page, tmp_path, settings):
    noise = np.random.default_rng(1).integers(0, 256, (HEIGHT, WIDTH, 3), dtype=np.uint8)
    page = wiping(open_page, tmp_path, html.png(noise), None, **settings)
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
    page = wiping(open_page, tmp_path, html.png(left), html.png(right), size=(400, 700))
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
