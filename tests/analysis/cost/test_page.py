"""The page of a study in a browser: what matters is seen without scrolling, and numbers are told under the pointer."""

import numpy as np
import pytest

from raytracer.analysis.cost.page import page
from tests.analysis.cost import studies

STUDY = studies.study()


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    path = tmp_path_factory.mktemp("cost") / "cost.html"
    path.write_bytes(page(STUDY))
    return path


def point_at(shown, key, x, y):
    """Move the pointer to a place of a chart, in parts of its axes from the left and from the bottom; what is said."""
    picture = shown.locator(f"figure[data-chart={key}] > svg")
    picture.scroll_into_view_if_needed()
    place = picture.evaluate(
        """(svg, [key, x, y]) => {
          const [left, right, bottom, top] = data.charts[key].box;
          const point = new DOMPoint(left + x * (right - left), bottom + y * (top - bottom));
          const { x: across, y: down } = point.matrixTransform(svg.getScreenCTM());
          return [across, down];
        }""",
        [key, x, y],
    )
    shown.mouse.move(*place)
    return shown.locator(f"figure[data-chart={key}] .pointed span").all_inner_texts()


@pytest.mark.parametrize(("size", "color_scheme"), [((1280, 800), "light"), ((400, 800), "dark")])
def test_the_ratio_of_times_is_seen_without_scrolling(report, open_page, size, color_scheme):
    shown = open_page(report, size=size, color_scheme=color_scheme)
    assert shown.evaluate("document.documentElement.scrollWidth <= innerWidth")
    box = shown.get_by_role("button", name="time against the scene").bounding_box()
    assert box["x"] + box["width"] <= size[0]
    letters = shown.locator("figure[data-chart=convergence] text")
    assert min(letters.evaluate_all("all => all.map((one) => one.getBoundingClientRect().height)")) > 7.0


def test_the_fit_tells_error_and_time(report, open_page):
    shown = open_page(report)
    (low, high), (bottom, top) = shown.evaluate("data.charts.convergence.ranges")
    point = STUDY.prediction.points[-1]
    x = np.log(point.seconds / low) / np.log(high / low)
    y = np.log(100.0 * point.error.value / bottom) / np.log(top / bottom)
    label, time, error = point_at(shown, "convergence", float(x), float(y))
    assert label in ("measured", "fit to what was measured")
    assert float(time.removeprefix("time (s): ")) == pytest.approx(point.seconds, rel=0.01)
    assert float(error.removeprefix("relative error (%): ")) == pytest.approx(100.0 * point.error.value, rel=0.01)


def test_the_map_tells_the_error_of_the_pixels_there(report, open_page):
    shown = open_page(report)
    height, width = STUDY.error_map.shape
    step = shown.evaluate("data.charts.map.grid.step")
    known = np.argwhere(np.isfinite(STUDY.error_map))
    for row, column in (known[0], known[len(known) // 2]):
        place, error = point_at(shown, "map", (column + 0.5) / width, 1.0 - (row + 0.5) / height)
        assert place == f"x {column}, y {row}"
        block = STUDY.error_map[row // step * step :, column // step * step :][:step, :step]
        expected = 100.0 * np.sqrt(np.nanmean(block**2))
        assert float(error.removeprefix("error (%): ")) == pytest.approx(expected, rel=0.01)
    blocks = np.array(shown.evaluate("data.charts.map.grid.values"), dtype=np.float64)
    row, column = np.argwhere(np.isnan(blocks))[0] * step
    said = point_at(shown, "map", (column + 0.5) / width, 1.0 - (row + 0.5) / height)
    assert said == [f"x {column}, y {row}", "error (%): not measured"]


def test_the_table_is_sorted_by_numbers_with_the_unknown_last(report, open_page):
    shown = open_page(report)
    names = shown.locator("#variants tbody td:first-child")
    assert names.first.inner_text() == "the scene"
    head = shown.get_by_role("button", name="time against the scene")
    for direction in (1, -1):
        head.click()
        keys = shown.locator("#variants tbody td:nth-child(2)").evaluate_all(
            "all => all.map((one) => one.dataset.sort)"
        )
        known = [float(key) for key in keys if key]
        assert known == sorted(known, reverse=direction < 0)
        assert keys == [key for key in keys if key] + [""] * keys.count("")
        assert "" in keys
