"""The page of a study in a browser: what matters is seen without scrolling, and numbers are told under the pointer."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import pytest

from raytracer.analysis.cost.page import page
from tests.analysis.cost import studies

if TYPE_CHECKING:
    from playwright.sync_api import Page

Open = Callable[..., "Page"]

STUDY = studies.study()


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    path = tmp_path_factory.mktemp("cost") / "cost.html"
    path.write_bytes(page(STUDY))
    return path


@pytest.mark.parametrize(("size", "color_scheme"), [((1280, 800), "light"), ((400, 800), "dark")])
def test_the_ratio_of_times_is_seen_without_scrolling(report, open_page, size, color_scheme):
    shown = open_page(report, size=size, color_scheme=color_scheme)
    assert shown.evaluate("document.documentElement.scrollWidth <= innerWidth")
    box = shown.get_by_role("button", name="time against the scene").bounding_box()
    assert box["x"] + box["width"] <= size[0]
    letters = shown.locator("figure[data-chart=convergence] text")
    assert min(letters.evaluate_all("all => all.map((one) => one.getBoundingClientRect().height)")) > 7.0


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


def test_the_map_tells_the_error_of_the_pixels_there(report, open_page):
    shown = open_page(report)
    height, width = STUDY.error_map.shape
    step = shown.evaluate("data.charts.map.grid.step")
    blocks = np.array(shown.evaluate("data.charts.map.grid.values"), dtype=np.float64)
    known, unknown = np.argwhere(np.isfinite(STUDY.error_map)), np.argwhere(np.isnan(blocks)) * step
    figure = shown.locator("figure[data-chart=map]")
    for row, column in (known[0], known[len(known) // 2], unknown[0]):
        figure.scroll_into_view_if_needed()
        place = figure.locator("> svg").evaluate(
            """(svg, [x, y]) => {
              const [left, right, bottom, top] = data.charts.map.box;
              const point = new DOMPoint(left + x * (right - left), bottom + y * (top - bottom));
              const { x: across, y: down } = point.matrixTransform(svg.getScreenCTM());
              return [across, down];
            }""",
            [(column + 0.5) / width, 1.0 - (row + 0.5) / height],
        )
        shown.mouse.move(*place)
        place, error = figure.locator(".pointed span").all_inner_texts()
        assert place == f"x {column}, y {row}"
        block = STUDY.error_map[row // step * step :, column // step * step :][:step, :step]
        if np.isnan(block).all():
            assert error == "error (%): not measured"
        else:
            expected = 100.0 * np.sqrt(np.nanmean(block**2))
            assert float(error.removeprefix("error (%): ")) == pytest.approx(expected, rel=0.01)
