"""Reports as files: the page in a browser, the book of pages, and pictures."""

import csv
import io
import re
import xml.etree.ElementTree as ET
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import PIL.Image
import pytest

from raytracer.analysis.lens_design import paper, plots
from raytracer.analysis.lens_design.page import page
from raytracer.analysis.lens_design.performance.lens_study import LensStudy, study_lens
from raytracer.analysis.lens_design.performance.results import Settings
from raytracer.optics.lens_system.lens import Lens
from raytracer.report import chart as charts
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
    assert shown.locator("#drawing .wide [id*=glass]").count() == 6
    charts_of_page = shown.locator("figure > svg, .wide > svg")
    assert charts_of_page.count() > 20
    assert charts_of_page.evaluate_all("all => all.every((one) => one.getBoundingClientRect().height > 20)")


@pytest.mark.parametrize("color_scheme", ["light", "dark"])
def test_the_page_can_be_read_on_a_narrow_screen(report: Path, open_page: Open, color_scheme: str) -> None:
    shown = open_page(report, size=(400, 700), color_scheme=color_scheme)
    assert shown.evaluate("document.documentElement.scrollWidth <= innerWidth")
    # All of the lens and the film are in the window, with letters that can be read.
    for part in ("[id*=glass-0-0]", "[id*=film-0]"):
        box = shown.locator(f"#drawing .narrow {part}").bounding_box()
        assert box is not None
        assert box["x"] >= 0.0
        assert box["x"] + box["width"] <= 400.0
    heights = shown.locator("#drawing .narrow text").evaluate_all(
        "all => all.map((one) => one.getBoundingClientRect().height)"
    )
    assert min(heights) > 9.0
    # The one table that is wider is moved in its place, by keys too.
    wider = shown.locator(".scroll").evaluate_all(
        "all => all.filter((one) => one.scrollWidth > one.clientWidth).map((one) => one.getAttribute('aria-label'))"
    )
    assert wider == ["Seidel sums"]
    region = shown.get_by_role("region", name="Seidel sums")
    region.focus()
    assert region.evaluate("one => one.scrollWidth > one.clientWidth")
    shown.keyboard.press("ArrowRight")
    for _ in range(100):
        if region.evaluate("one => one.scrollLeft > 0"):
            break
        shown.wait_for_timeout(20)
    else:
        pytest.fail("the table does not move")


def test_lines_and_letters_have_the_ink_of_the_page(report: Path, open_page: Open) -> None:
    inks = []
    for color_scheme in ("light", "dark"):
        shown = open_page(report, color_scheme=color_scheme)
        inks.append(shown.locator("#mtf svg text").first.evaluate("one => getComputedStyle(one).fill"))
    assert inks == ["rgb(27, 29, 33)", "rgb(228, 230, 234)"]


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
    assert shown.locator("#drawing .wide svg").count() == 2
    assert "First order, in the plane of x" in shown.locator("h2").all_inner_texts()
    assert shown.locator("#seidel-sums").count() == 0


def test_the_book_is_the_same_each_time(gauss: tuple[Lens, LensStudy]) -> None:
    lens, found = gauss
    few = found._replace(fans=(), spots=found.spots[:1], spherical=(), illumination=(), mtf=(), mtf_over_field=())
    few = few._replace(tolerances=())
    first = paper.pdf(lens, few)
    assert first.startswith(b"%PDF-")
    # First order, spots, charts, and tables.
    assert first.count(b"/Type /Page ") >= 4
    assert paper.pdf(lens, few) == first


def test_a_drawing_in_pixels(gauss: tuple[Lens, LensStudy]) -> None:
    with PIL.Image.open(io.BytesIO(paper.png(*gauss))) as picture:
        assert picture.width > 1200
        values = np.asarray(picture.convert("RGB"), np.float64)
    assert 0.7 < (values.min(axis=2) > 250).mean() < 0.98
    # Blue glass and brown.
    assert (np.abs(values - (178, 213, 236)).max(axis=2) < 25).mean() > 0.005
    assert (np.abs(values - (226, 202, 168)).max(axis=2) < 25).mean() > 0.02


def test_a_name_is_no_formula(gauss: tuple[Lens, LensStudy]) -> None:
    # Matplotlib would read what is between two dollars as TeX, and raise.
    lens, found = gauss
    assert paper.png(lens, found._replace(name=r"$\frac{$")).startswith(b"\x89PNG")


def test_every_chart_of_every_shipped_kind_can_be_drawn() -> None:
    for lens in (plano_convex(), cylinder_pair()):
        for group in plots.chart_groups(study_lens(lens, QUICK)):
            keys = [chart.key for chart in group.charts]
            assert len(set(keys)) == len(keys)
            for chart in group.charts:
                drawn = charts.render(chart)
                assert ET.fromstring(str(drawn.picture)).get("aria-label") == chart.title
                assert len(drawn.data["series"]) == (0 if chart.bare else len(chart.series))
                assert len(chart.legend()) <= 8


def test_texts_name_lines_as_they_are_drawn() -> None:
    named = 0
    for group in plots.chart_groups(study_lens(plano_convex(), QUICK)):
        for look in re.findall(r"the (dotted|dashed|solid|grey|black) line", group.text):
            named += 1
            wanted = {"dotted": charts.DOTTED, "dashed": charts.DASHED}[look]
            assert any(series.dashes == wanted for chart in group.charts for series in chart.series)
    assert named


def test_what_comes_from_outside_is_escaped_in_files(gauss: tuple[Lens, LensStudy]) -> None:
    lens, found = gauss
    evil = '<script>"&'
    written = paper.svg(replace(lens, name=evil), found).decode()
    assert "<script>" not in written
    assert "&lt;script&gt;" in written
    (title, *_) = ET.fromstring(written).iter("{http://www.w3.org/2000/svg}title")
    assert title.text is not None
    assert title.text.startswith(evil)


def test_a_curve_is_told_under_the_pointer(report: Path, gauss: tuple[Lens, LensStudy], open_page: Open) -> None:
    shown = open_page(report)
    found = gauss[1].distortion[0]
    picture = shown.locator("figure[data-chart=distortion-y] > svg")
    picture.scroll_into_view_if_needed()
    place = picture.evaluate(
        """(svg, at) => {
          const axes = [0, 1].map((which) => axisOf(data.charts["distortion-y"], which));
          const point = new DOMPoint(...at.map((value, which) => axes[which].place(value)));
          const { x, y } = point.matrixTransform(svg.getScreenCTM());
          return [x, y];
        }""",
        [float(found.percent[-2]), float(found.image_height_mm[-2])],
    )
    shown.mouse.move(*place)
    *_, distortion, height = shown.locator("figure[data-chart=distortion-y] .pointed span").all_inner_texts()
    assert float(distortion.removeprefix("distortion (%): ")) == pytest.approx(found.percent[-2], rel=0.02)
    assert float(height.removeprefix("image height (mm): ")) == pytest.approx(found.image_height_mm[-2], rel=0.02)
