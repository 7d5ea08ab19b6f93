"""Charts: lines are where their points are, and a page tells the number under the pointer."""

import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from raytracer.report import page as html
from raytracer.report.chart import DASHED, Chart, LegendEntry, Series, render
from raytracer.report.figure import IN_PAGE, Curve, new_figure, page_figure, series_id, style

Open = Callable[..., Any]

SVG = "{http://www.w3.org/2000/svg}"
X = np.array([0.0, 1.0, np.nan, 3.0, 4.0])
CHART = Chart("c", "title", "x (mm)", "y (um)", (Series("a", X, 2.0 * X), Series("b", X, -X)), (0.0, 4.0), (-4.0, 8.0))


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
