"""Reports: the page in a browser, the book of pages, pictures, and words, of which every number is the study's."""

import csv
import io
import re
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import numpy as np
import PIL.Image
import pytest

from raytracer.analysis.lens_design import paper, plots, text
from raytracer.analysis.lens_design.page import page
from raytracer.analysis.lens_design.performance.lens_study import study_lens
from raytracer.report import chart as charts
from tests.analysis.lens_design.benches import QUICK, cylinder_pair, plano_convex, shipped


@pytest.fixture(scope="module")
def gauss():
    lens = shipped("double-gauss-50mm")
    return lens, study_lens(lens, QUICK)


@pytest.fixture(scope="module")
def report(gauss, tmp_path_factory):
    path = tmp_path_factory.mktemp("lens") / "gauss.html"
    path.write_bytes(page(*gauss))
    return path


def few(found):
    """Leave out most of a study, which takes long to draw."""
    found = found._replace(fans=(), spots=found.spots[:1], spherical=(), illumination=(), mtf=(), mtf_over_field=())
    return found._replace(tolerances=())


def test_all_of_the_study_is_on_the_page(report, gauss, open_page):
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
    assert shown.locator("#drawing .wide [id*=glass]").count() == 6
    charts_of_page = shown.locator("figure > svg, .wide > svg")
    assert charts_of_page.evaluate_all("all => all.every((one) => one.getBoundingClientRect().height > 20)")
    # Each chart once, with what it shows in the data, too.
    made = [chart for group in plots.chart_groups(gauss[1]) for chart in group.charts]
    data = shown.evaluate("Object.fromEntries(Object.entries(data.charts).map(([k, c]) => [k, c.series.length]))")
    assert {chart.key: 0 if chart.bare else len(chart.series) for chart in made}.items() <= data.items()
    assert len({chart.key for chart in made}) == len(made) > 20
    for chart in made:
        assert shown.locator(f"[data-chart='{chart.key}'] > svg").get_attribute("aria-label") == chart.title
        assert len(chart.legend()) <= 8


def test_the_page_can_be_read_on_a_narrow_screen(report, open_page):
    shown = open_page(report, size=(400, 700))
    for scheme, ink in (("light", "rgb(27, 29, 33)"), ("dark", "rgb(228, 230, 234)")):
        shown.emulate_media(color_scheme=scheme)
        assert shown.locator("#mtf svg text").first.evaluate("one => getComputedStyle(one).fill") == ink
    assert shown.evaluate("document.documentElement.scrollWidth <= innerWidth")
    # All of the lens and the film are in the window, with letters that can be read.
    for part in ("[id*=glass-0-0]", "[id*=film-0]"):
        box = shown.locator(f"#drawing .narrow {part}").bounding_box()
        assert 0.0 <= box["x"] <= 400.0 - box["width"]
    heights = "all => all.map((one) => one.getBoundingClientRect().height)"
    assert min(shown.locator("#drawing .narrow text").evaluate_all(heights)) > 9.0
    # The one table that is wider is moved in its place, by keys too.
    wider = shown.locator(".scroll").evaluate_all(
        "all => all.filter((one) => one.scrollWidth > one.clientWidth).map((one) => one.getAttribute('aria-label'))"
    )
    assert wider == ["Seidel sums"]
    shown.get_by_role("region", name="Seidel sums").focus()
    shown.keyboard.press("ArrowRight")
    shown.wait_for_function("() => document.activeElement.scrollLeft > 0")


def test_charts_can_be_saved(report, open_page, gauss):
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


def test_a_lens_with_cylinders_and_a_hostile_name_has_both_planes_on_its_page(tmp_path, open_page):
    evil = '</script><img src="http://example.org/x.png"><b>'
    lens = cylinder_pair()
    whole = study_lens(lens, QUICK)
    found = few(whole)
    path = tmp_path / "cylinders.html"
    path.write_bytes(page(lens, found._replace(name=evil, source=evil)))
    shown = open_page(path)
    assert shown.locator("h1").inner_text() == evil
    assert shown.locator("img").count() == 0
    assert shown.locator("#drawing .wide svg").count() == 2
    whole, keys = ([chart.key for group in plots.chart_groups(of) for chart in group.charts] for of in (whole, found))
    assert len(set(whole)) == len(whole) > len(keys)
    assert sorted(shown.evaluate("Object.keys(data.charts)")) == sorted(keys)
    assert shown.locator("[data-chart] > svg").count() == len(keys)
    assert "First order, in the plane of x" in shown.locator("h2").all_inner_texts()
    assert shown.locator("#seidel-sums").count() == 0


def test_the_book_is_the_same_each_time():
    lens = plano_convex()
    found = few(study_lens(lens, QUICK))
    first = paper.pdf(lens, found)
    assert first.startswith(b"%PDF-")
    # First order, spots, charts, and tables.
    assert first.count(b"/Type /Page ") >= 4
    assert paper.pdf(lens, found) == first


def test_a_drawing_in_pixels_whatever_its_name(gauss):
    # Matplotlib would read what is between two dollars as TeX, and raise.
    data = paper.png(gauss[0], gauss[1]._replace(name=r"$\frac{$"))
    with PIL.Image.open(io.BytesIO(data)) as picture:
        assert picture.width > 1200
        values = np.asarray(picture.convert("RGB"))[::2, ::2].astype(np.int16)
    assert 0.7 < (values.min(axis=2) > 250).mean() < 0.98
    # Blue glass and brown.
    assert (np.abs(values - (178, 213, 236)).max(axis=2) < 25).mean() > 0.005
    assert (np.abs(values - (226, 202, 168)).max(axis=2) < 25).mean() > 0.02


def number(line):
    return float(re.search(r"[−-]?\d+\.?\d*", line)[0].replace("−", "-"))


def test_the_summary_is_the_study(gauss):
    _, found = gauss
    rows = (re.split(r"  +", line.strip(), maxsplit=1) for line in text.summary(found).splitlines())
    said = {row[0]: number(row[1]) for row in rows if len(row) > 1 and re.search(r"\d", row[1])}
    said |= {row[0]: number(row[1]) for row in text.aberrations(found)}
    first = found.first_order[0]
    for name, value, error in (
        ("focal length", first.focal_length_mm, 1e-5),
        ("back focus", first.back_focus_mm, 1e-5),
        ("front focal point F", first.front_focus_z_mm, 1e-5),
        ("entrance pupil's diameter", first.entrance_pupil_diameter_mm, 1e-5),
        ("working f-number", first.working_f_number, 1e-3),
        ("field of view, diagonal", first.field_of_view_diagonal_deg, 1e-4),
        ("longitudinal colour", found.colour[0].axial_between_ends_mm, 0.01),
        ("distortion", found.distortion[0].percent[-1], 0.01),
        ("focus, sagittal", found.field_curvature[0].sagittal_mm[0, -1], 0.01),
        ("relative illumination", 100.0 * found.illumination[0].relative[-1], 0.01),
    ):
        assert said[name] == pytest.approx(value, rel=error), name
    head, *spots = text.spots(found)
    assert len(spots) == 3
    assert number(spots[1][head.index("RMS")]) == pytest.approx(found.spots[1].rms_um, rel=0.01)


def test_the_sums_are_under_their_surfaces(gauss):
    _, found = gauss
    table = text.seidel(found)
    columns = [[number(row.cells[column]) for row in table.rows] for column in range(7)]
    for column in columns:
        assert sum(column[:-1]) == pytest.approx(column[-1], abs=0.01 * len(column))
    assert columns[0][-1] == pytest.approx(1000.0 * found.seidel.total_spherical, abs=0.006)


def test_a_lens_with_cylinders_has_two_of_each_but_no_sums():
    found = study_lens(cylinder_pair(), QUICK)
    assert text.seidel(found) is None
    said = text.summary(found)
    assert "\nSeidel sums: not defined" in said
    for meridian, distortion in zip("yx", found.distortion, strict=True):
        for title in ("First order", "Aberrations", "Spots, of all wavelengths together"):
            assert f"\n{title}, in the plane of {meridian}\n" in said
        rows = {row[0]: row[1] for row in text.aberrations(found, meridian)}
        assert number(rows["distortion"]) == pytest.approx(distortion.percent[-1], rel=0.01)


def test_texts_name_lines_as_they_are_drawn():
    named = 0
    for group in plots.chart_groups(study_lens(plano_convex(), QUICK)):
        for look in re.findall(r"the (dotted|dashed|solid|grey|black) line", group.text):
            named += 1
            wanted = {"dotted": charts.DOTTED, "dashed": charts.DASHED}[look]
            assert any(series.dashes == wanted for chart in group.charts for series in chart.series)
    assert named


def test_what_comes_from_outside_is_escaped_in_files(gauss):
    lens, found = gauss
    evil = '<script>"&'
    written = paper.svg(replace(lens, name=evil), found).decode()
    assert "<script>" not in written
    assert "&lt;script&gt;" in written
    (title, *_) = ET.fromstring(written).iter("{http://www.w3.org/2000/svg}title")
    assert title.text.startswith(evil)
