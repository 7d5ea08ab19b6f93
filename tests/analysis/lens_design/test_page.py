"""Reports as files: the page in a browser, the book of pages, and pictures."""

import csv
import io
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import PIL.Image
import pytest

from raytracer.analysis.lens_design import pdf, plots
from raytracer.analysis.lens_design.page import page
from raytracer.analysis.lens_design.performance.lens_study import LensStudy, study_lens
from raytracer.analysis.lens_design.performance.results import Settings
from raytracer.optics.lens_system.lens import Lens
from raytracer.report import chart as charts
from raytracer.report import svg
from raytracer.report.chart import Chart, Series
from raytracer.scene.assets.lenses import read_lens
from tests.analysis.lens_design.benches import SHIPPED, cylinder_pair, plano_convex

if TYPE_CHECKING:
    from playwright.sync_api import Page

Open = Callable[..., "Page"]

QUICK = Settings(steps=9, rays=16, fields=(0.0, 0.7, 1.0))
GAUSS = next(path for path in SHIPPED if path.stem == "double-gauss-50mm")


@pytest.fixture(scope="module")
def gauss() -> tuple[Lens, LensStudy]:
    lens = read_lens(GAUSS)
    return lens, study_lens(lens, QUICK)


@pytest.fixture
def report(gauss: tuple[Lens, LensStudy], tmp_path: Path) -> Path:
    path = tmp_path / "gauss.html"
    path.write_bytes(page(*gauss))
    return path


def test_all_of_the_study_is_on_the_page(report: Path, gauss: tuple[Lens, LensStudy], open_page: Open) -> None:
    shown = open_page(report)
    assert shown.locator("h1").inner_text() == "Double Gauss 50 mm f/2"
    titles = shown.locator("h2").all_inner_texts()
    assert titles[:4] == ["Cross-section", "First order", "Surfaces", "Spot diagrams"]
    assert {"Field curvature and astigmatism", "Distortion", "Relative illumination", "Seidel sums"} <= set(titles)
    # Each place of the contents is there.
    targets = shown.eval_on_selector_all("#contents a", "links => links.map((a) => a.getAttribute('href'))")
    assert all(shown.locator(target).count() == 1 for target in targets)
    # Three fields, in three colours and in all.
    assert shown.locator("#spots svg").count() == 12
    assert shown.locator("#first-order tr", has_text="back focus").inner_text().split("\t")[1] == "35.7223 mm"
    assert shown.locator("#seidel-sums tbody tr").count() == len(gauss[0].elements) + 1
    # Glass, rays of three points, and the surfaces that have none.
    assert shown.locator("#drawing path[fill-opacity]").count() == 6
    assert shown.locator("svg").evaluate_all("all => all.every((one) => one.getBoundingClientRect().height > 20)")


def test_the_page_can_be_read_on_a_narrow_screen(report: Path, open_page: Open) -> None:
    shown = open_page(report, size=(360, 700), color_scheme="dark")
    assert shown.evaluate("document.documentElement.scrollWidth <= innerWidth")
    # What is wider is moved in its place, by keys too.
    region = shown.get_by_role("region", name="Double Gauss 50 mm f/2, cross-section")
    region.focus()
    assert region.evaluate("one => one.scrollWidth > one.clientWidth")
    shown.keyboard.press("ArrowRight")
    for _ in range(100):
        if region.evaluate("one => one.scrollLeft > 0"):
            break
        shown.wait_for_timeout(20)
    else:
        pytest.fail("the cross-section does not move")


def test_charts_can_be_saved(report: Path, open_page: Open, gauss: tuple[Lens, LensStudy]) -> None:
    shown = open_page(report)
    with shown.expect_download() as waiting:
        shown.get_by_role("button", name="Save CSV, Distortion").click()
    rows = list(csv.reader(io.StringIO(Path(waiting.value.path()).read_text(encoding="utf-8"))))
    assert rows[0] == ["series", "distortion (%)", "image height (mm)"]
    found = gauss[1].distortion[0]
    np.testing.assert_allclose([float(row[1]) for row in rows[1:]], found.percent)
    np.testing.assert_allclose([float(row[2]) for row in rows[1:]], found.image_height_mm)
    with shown.expect_download() as waiting:
        shown.get_by_role("button", name="Save SVG", exact=True).click()
    text = Path(waiting.value.path()).read_text(encoding="utf-8")
    assert text.startswith('<svg xmlns="http://www.w3.org/2000/svg"')
    assert "#ffffff" in text


def test_a_hostile_name_is_text(gauss: tuple[Lens, LensStudy], tmp_path: Path, open_page: Open) -> None:
    evil = '</script><img src="http://example.org/x.png"><b>'
    path = tmp_path / "evil.html"
    path.write_bytes(page(gauss[0], gauss[1]._replace(name=evil, source=evil)))
    shown = open_page(path)
    assert shown.locator("h1").inner_text() == evil
    assert shown.locator("img").count() == 0


def test_a_lens_with_cylinders_has_both_planes_on_its_page(tmp_path: Path, open_page: Open) -> None:
    lens = cylinder_pair()
    path = tmp_path / "cylinders.html"
    path.write_bytes(page(lens, study_lens(lens, QUICK)))
    shown = open_page(path)
    assert shown.locator("#drawing svg").count() == 2
    assert "First order, in the plane of x" in shown.locator("h2").all_inner_texts()
    assert shown.locator("#seidel-sums").count() == 0


def test_the_book_is_the_same_each_time(gauss: tuple[Lens, LensStudy]) -> None:
    lens, found = gauss
    few = found._replace(fans=(), spots=found.spots[:1], spherical=(), illumination=(), mtf=(), mtf_over_field=())
    few = few._replace(tolerances=())
    first = pdf.pdf(lens, few)
    assert first.startswith(b"%PDF-")
    # First order, spots, charts, and tables.
    assert first.count(b"/Type /Page ") >= 4
    assert pdf.pdf(lens, few) == first


def test_a_drawing_in_pixels(gauss: tuple[Lens, LensStudy]) -> None:
    with PIL.Image.open(io.BytesIO(pdf.png(*gauss))) as picture:
        assert picture.width > 1200
        values = np.asarray(picture.convert("RGB"), np.float64)
    assert 0.7 < (values.min(axis=2) > 250).mean() < 0.98
    # Blue glass and brown.
    assert (np.abs(values - (178, 213, 236)).max(axis=2) < 25).mean() > 0.005
    assert (np.abs(values - (226, 202, 168)).max(axis=2) < 25).mean() > 0.02


def test_a_name_is_no_formula(gauss: tuple[Lens, LensStudy]) -> None:
    # Matplotlib would read what is between two dollars as TeX, and raise.
    lens, found = gauss
    assert pdf.png(lens, found._replace(name=r"$\frac{$")).startswith(b"\x89PNG")


def test_lines_are_where_their_points_are() -> None:
    x = np.array([0.0, 1.0, np.nan, 3.0, 4.0])
    chart = Chart("c", "title", "x", "y", (Series("a", x, 2.0 * x), Series("b", x, -x)), (0.0, 4.0), (-4.0, 8.0))
    drawn = [node for node in svg_paths(charts.render_svg(chart)) if "a" in node[2:][0][2:]]
    (line,) = drawn
    pieces = line[1]["d"].split("M")[1:]
    # A gap in the data is a gap in the line.
    points = [[tuple(map(float, point.split())) for point in piece.split("L")] for piece in pieces]
    assert [len(piece) for piece in points] == [2, 2]
    flat = np.array([point for piece in points for point in piece])
    given = x[np.isfinite(x)]
    slope, start = np.polyfit(given, flat[:, 0], 1)
    np.testing.assert_allclose(flat[:, 0], start + slope * given, atol=0.06)
    assert slope > 0.0
    assert (np.diff(flat[:, 1]) < 0.0).all()


def svg_paths(node: svg.Node) -> list[svg.Node]:
    """The paths in a picture that have a title."""
    found = [node] if node[0] == "path" and len(node) > 2 else []
    for child in node[2:]:
        if isinstance(child, list):
            found += svg_paths(child)
    return found


def test_every_chart_of_every_shipped_kind_can_be_drawn() -> None:
    for lens in (plano_convex(), cylinder_pair()):
        for group in plots.chart_groups(study_lens(lens, QUICK)):
            keys = [chart.key for chart in group.charts]
            assert len(set(keys)) == len(keys)
            for chart in group.charts:
                json.dumps(charts.render_svg(chart), allow_nan=False)


def test_texts_name_lines_as_they_are_drawn() -> None:
    named = 0
    for group in plots.chart_groups(study_lens(plano_convex(), QUICK)):
        for look in re.findall(r"the (dotted|dashed|solid|grey|black) line", group.text):
            named += 1
            wanted = {"dotted": charts.DOTTED, "dashed": charts.DASHED}[look]
            assert any(series.dashes == wanted for chart in group.charts for series in chart.series)
    assert named


def test_what_comes_from_outside_is_escaped_in_files() -> None:
    evil = '<script>"&'
    node: Any = svg.render_svg(10.0, 10.0, evil, svg.element("text", {"x": 1.0}, evil))
    written = svg.document(node).decode()
    assert "<script>" not in written
    assert written.count("&lt;script&gt;") == 3
