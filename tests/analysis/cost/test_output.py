"""How a study is shown: what the text, the data, the pictures and the page say, of studies that nobody measured."""

import base64
import csv
import functools
import io
import json
import math
import re
import subprocess
import sys
import xml.etree.ElementTree as ET
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from raytracer.analysis.cost import formatting, plots
from raytracer.analysis.cost.export import convergence_csv, to_csv, to_json
from raytracer.analysis.cost.page import check_report, page, write_report
from raytracer.analysis.cost.results import UNKNOWN, ConvergencePoint, PlanItem
from raytracer.analysis.cost.text import study_text
from raytracer.core.error_estimate.intervals import Interval
from raytracer.util.errors import InputError, OutputError
from tests.analysis.cost import studies

INF, NAN = math.inf, math.nan


@pytest.fixture(params=studies.ALL)
def study(request):
    return studies.ALL[request.param]()


# ---- words


def test_bias_too_small_to_matter_is_not_told_in_digits():
    variant = studies.variants()[2]
    assert formatting.format_bias(replace(variant, bias=Interval(8e-7, 5e-7, 1.2e-6))) == "< 0.001 %"
    assert (
        formatting.format_bias(replace(variant, bias=Interval(8e-6, 5e-6, 1.2e-5)))
        == "0.000800 % (0.000500 .. 0.001200)"
    )


def test_kinds_of_a_family_with_one_reason_are_told_together():
    items = [("media", "none"), ("passage", "none"), ("shape.box", "0"), ("shape.disc", "0"), ("shape.quad", "2")]
    plan = tuple(PlanItem("left out", name, why) for name, why in [*items, ("light.sun", "0")])
    assert formatting.plan_sections(studies.study(plan=plan)) == [
        (
            "Left out",
            [
                ("media", "none"),
                ("passage", "none"),
                ("shape", "box, disc: 0"),
                ("shape.quad", "2"),
                ("light.sun", "0"),
            ],
        )
    ]


def test_variants_keep_their_order_within_groups():
    found = [
        (title, [variant.name for variant in variants])
        for title, variants in formatting.group_variants(studies.variants())
    ]
    assert found == [
        ("", ["scene", "A/A"]),
        ("without", ["defocus", f"material {studies.EVIL}", "media"]),
        ("with", ["accuracy=fast", "max_depth=4", "roulette"]),
        ("with another sampler", ["sampler=independent"]),
    ]


# ---- terminal


@pytest.mark.parametrize("width", [60, 100, 160])
def test_text_is_plain_and_fits(study, width):
    said = study_text(study, width)
    assert said.isascii()
    assert said.endswith("\n")
    for line in said.splitlines():
        assert len(line) <= width
        assert line == line.rstrip()
        assert line.isprintable()


def test_text_says_what_was_found():
    said = study_text(studies.study())
    assert "error of 1 % takes         13.6 s (13.2 .. 14.0); 1,330 (1,290 .. 1,370) spp" in said
    assert "after 60 s the error is    0.470 % (0.456 .. 0.484); 5,970 spp" in said
    assert studies.EVIL in said
    lines = said.splitlines()

    def row(name):
        return next(line for line in lines if re.match(rf"\s*{re.escape(name)}\s+(\d|not )", line))

    assert re.search(r"10\.0 ms +34\.2 ns +no measurable +the same +not resolved +as the$", row("repeat of the same"))
    assert re.search(r"8\.40 ms +34\.2 ns +0\.839 +4\.21 % +15\.4 % +\[1\]$", row("defocus"))
    assert re.search(r"not measured \[2\]$", row("media"))
    assert row("sampler=independent").endswith("never")
    assert "  [1]  the bias exceeds the target, which no number of samples mends" in lines
    assert "  [2]  the variant could not be packed: nothing is left to see" in lines


@pytest.mark.parametrize(
    ("interrupted", "rounds", "said"),
    [
        (False, 9, "9 rounds, each of all variants in turn"),
        (True, 3, "interrupted after 3 rounds, of which this tells"),
        (True, 1, "interrupted after 1 round, of which this tells"),
        (True, 0, "interrupted before the first round of the variants"),
    ],
)
def test_rounds(interrupted, rounds, said):
    found = studies.study(variants=studies.variants() if rounds else (), interrupted=interrupted, rounds=rounds)
    assert said in study_text(found).splitlines()
    shown = page(replace(found, error_map=np.full((1, 1), NAN), prediction=studies.NO_PREDICTION))
    assert f"{said[1:]}." in shown.decode()


def test_colours_only_where_asked_for():
    coloured = study_text(studies.study(), colour=True)
    assert "\x1b[" in coloured
    assert re.sub(r"\x1b\[[0-9;]*m", "", coloured).split() == study_text(studies.study()).split()


def test_noise_of_variants_with_different_samples_says_at_how_many():
    scene, control, *rest = studies.variants()
    said = study_text(studies.study(variants=(scene, control, replace(rest[0], spp=16))), width=200)
    assert "4.64 % (4.50 .. 4.78) at 64 spp" in said
    assert "4.21 % (4.08 .. 4.34) at 16 spp" in said


def test_what_a_terminal_would_act_upon_is_written_out():
    assert "\x1b" not in study_text(studies.study(scene="a\x1b[2Jb.yaml", warnings=("\x1b]0;x\x07",)))


# ---- data


def test_json_is_strict_and_whole(study):
    data = json.loads(json.dumps(to_json(study), allow_nan=False))
    assert data["scene"] == study.scene
    assert data["tiles_measured"] == study.tiles_measured
    assert [variant["name"] for variant in data["arms"]] == [variant.name for variant in study.variants]
    assert len(data["prediction"]["points"]) == len(study.prediction.points)
    assert {"error_map", "picture"}.isdisjoint(data)


def test_json_keeps_numbers_and_has_null_for_what_is_unknown():
    data = to_json(studies.study())
    assert data["arms"][2]["time"] == {"value": 0.839, "low": 0.821, "high": 0.857}
    assert data["arms"][2]["target_seconds"] is None
    assert data["arms"][0]["bias"] is None
    assert data["arms"][4]["per_sample"] == {"value": None, "low": None, "high": None}
    assert data["prediction"]["points"][0]["spp"] == 16
    assert data["machine"] == studies.MACHINE
    assert to_json(studies.hopeless())["prediction"]["target_seconds"]["value"] is None


def test_json_takes_values_of_numpy():
    machine = {"threads": np.int64(4), "load": np.float64(NAN), "loads": np.array([1.0, INF]), "path": Path("a")}
    data = to_json(studies.study(machine=machine))["machine"]
    assert data == {"threads": 4, "load": None, "loads": [1.0, None], "path": "a"}
    assert type(data["threads"]) is int


def test_csv_has_a_row_for_each_variant(study):
    rows = list(csv.DictReader(io.StringIO(to_csv(study))))
    assert [row["arm"] for row in rows] == [variant.name for variant in study.variants]
    for row, variant in zip(rows, study.variants, strict=True):
        assert None not in row
        assert None not in row.values()
        for column, interval in (("time_ratio", variant.time), ("bias", variant.bias or UNKNOWN)):
            found = [row[column], row[f"{column}_low"], row[f"{column}_high"]]
            np.testing.assert_array_equal([float(cell or "nan") for cell in found], interval)
        assert row["target_seconds"] == ("" if variant.target_seconds is None else repr(variant.target_seconds))


def test_csv_of_the_plot():
    table = np.genfromtxt(io.StringIO(convergence_csv(studies.study())), delimiter=",", names=True)
    np.testing.assert_array_equal(table["spp"], [16, 64, 256])
    np.testing.assert_array_equal(table["error"], [point.error.value for point in studies.predicted().points])


# ---- pictures


def _svg_of(study):
    svg = plots.convergence_svg(study)
    return None if svg is None else ET.fromstring(svg)


@pytest.mark.parametrize("name", ["nothing", "black", "one tile", "one point", "portrait"])
def test_plots_are_drawn_where_there_is_something_to_draw(name):
    study = studies.ALL[name]()
    shows_error = any(point.error.value > 0.0 for point in study.prediction.points)
    assert (_svg_of(study) is not None) == shows_error
    has_map = bool(np.nansum(study.error_map) > 0.0)
    png = plots.error_map_png(study)
    assert (png is not None) == has_map
    if png is not None:
        with Image.open(io.BytesIO(png)) as image:
            image.load()
            assert min(image.size) > 200


def test_plots_are_the_same_each_time():
    study = studies.study(width=64, height=32)
    assert plots.convergence_svg(study) == plots.convergence_svg(study)
    assert plots.error_map_png(study) == plots.error_map_png(study)


@pytest.mark.parametrize(
    ("points", "target"),
    [
        ((ConvergencePoint(16, 0.5, Interval(0.1, NAN, NAN)), ConvergencePoint(64, 1.0, UNKNOWN)), UNKNOWN),
        (
            (ConvergencePoint(16, 0.5, Interval(0.1, 0.0, INF)), ConvergencePoint(64, 1.0, Interval(0.05, 0.06, 0.07))),
            Interval(5.0, NAN, INF),
        ),
        (
            (ConvergencePoint(16, 0.5, Interval(1e-9, 1e-9, 2e-9)), ConvergencePoint(64, 1e6, Interval(1e3, 1e3, 1e3))),
            Interval(1e30, 1e29, 1e31),
        ),
    ],
    ids=["unknown", "senseless", "wide"],
)
def test_plots_take_any_intervals(points, target):
    assert _svg_of(studies.study(prediction=studies.predicted(points=points, target_seconds=target))) is not None


def test_the_plot_holds_the_measurements_the_target_and_both_slopes():
    """Read off the drawing itself, between its axes' limits."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    study = studies.study()
    figure = Figure()
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    axes.set_xscale("log")
    axes.set_yscale("log")
    plots._draw_convergence(axes, study, list(study.prediction.points))
    lines = {str(line.get_label()): line.get_xydata() for line in axes.get_lines()}
    for label, slope in (("slope -1/2: independent samples", -0.5), ("slope -3/4", -0.75)):
        (x0, y0), (x1, y1) = np.asarray(lines[label])
        assert math.log(y1 / y0) / math.log(x1 / x0) == pytest.approx(slope)
        last = study.prediction.points[-1]
        assert y0 * (last.seconds / x0) ** slope == pytest.approx(last.error.value)
    np.testing.assert_array_equal(np.asarray(lines["target 1 %"])[:, 1], 0.01)
    np.testing.assert_array_equal(np.asarray(lines["budget 60 s"])[:, 0], 60.0)
    fit = np.asarray(lines["fit to what was measured"])
    for point in study.prediction.points:
        assert np.interp(math.log(point.seconds), *np.log(fit).T) == pytest.approx(
            math.log(point.error.value), abs=1e-3
        )


def test_the_map_of_a_large_picture_is_reduced_by_mean_squares():
    error = np.full((3, 2 * plots._LARGEST_EDGE), NAN)
    error[0, :4] = [3.0, 4.0, 1.0, NAN]
    error[1, :2] = [0.0, 5.0]
    reduced = plots._downsample(error)
    assert reduced.shape == (2, plots._LARGEST_EDGE)
    assert reduced[0, 0] == pytest.approx(math.sqrt((9.0 + 16.0 + 25.0) / 4.0))
    assert reduced[0, 1] == 1.0
    assert np.isnan(reduced[1]).all()
    small = np.array([[NAN, 1.0]])
    assert plots._downsample(small) is small


def test_the_picture_is_transparent_where_nothing_was_rendered():
    study = studies.study()
    png = plots.picture_png(study)
    assert png is not None
    with Image.open(io.BytesIO(png)) as image:
        pixels = np.asarray(image)
    np.testing.assert_array_equal(pixels[..., 3] == 255, np.isfinite(study.picture[..., 0]))
    assert pixels[pixels[..., 3] == 255][:, :3].max() == 255
    assert plots.picture_png(studies.nothing()) is None


# ---- page


class _Page(HTMLParser):
    """Collects what a page would load, its text, and whether its tags close."""

    VOID = frozenset({"meta", "br", "img", "link", "input", "hr"})

    def __init__(self, html):
        super().__init__()
        self.open: list[str] = []
        self.tags: list[str] = []
        self.references: list[str] = []
        self.ids: list[str] = []
        self.text: list[str] = []
        self.rows: list[int] = []
        self.feed(html)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        if tag not in self.VOID:
            self.open.append(tag)
        for name, value in attrs:
            assert not name.startswith("on")
            if name in {"src", "href", "xlink:href", "srcset", "action", "data", "poster"}:
                self.references.append(value or "")
            if name == "id":
                self.ids.append(value or "")
        if tag == "tr":
            self.rows.append(0)
        if tag in {"td", "th"}:
            self.rows[-1] += 1

    def handle_startendtag(self, tag, attrs):
        self.handle_starttag(tag, attrs)
        if tag not in self.VOID:
            self.open.pop()

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] not in {"style", "script"}:
            self.text.append(data)


@functools.cache
def _page_of(name):
    return page(studies.ALL[name]()).decode()


@pytest.mark.parametrize("name", studies.ALL)
def test_the_page_is_whole_and_asks_nothing_of_the_network(name):
    study, html = studies.ALL[name](), _page_of(name)
    found = _Page(html)
    assert found.open == []
    assert len(found.ids) == len(set(found.ids))
    assert {"iframe", "object", "base"}.isdisjoint(found.tags)
    assert found.tags.count("script") == html.count("<script>") + 1
    for reference in found.references:
        assert reference.startswith(("data:", "#"))
        if reference.startswith("#"):
            assert reference[1:] in found.ids
    for reference in re.findall(r"url\(([^)]*)\)", html):
        assert reference.startswith("#")
        assert reference[1:] in found.ids
    assert "@import" not in html

    # Names of XML vocabularies are all that looks like an address.
    addresses = set(re.findall(r"https?://[^\s\"'<]*", html))
    assert addresses <= {"http://www.w3.org/2000/svg", "http://www.w3.org/1999/xlink"}
    if study.variants:
        assert found.rows[-len(study.variants) :] == [10] * len(study.variants)


def test_names_of_the_scene_are_text():
    html = _page_of("usual")
    found = _Page(html)
    assert studies.EVIL not in html
    assert " ".join(found.text).count(studies.EVIL) == 7
    assert found.tags.count("b") == html.count("<b>")
    assert "&lt;b&gt;" in html


def test_the_page_carries_its_data():
    study = studies.study()
    found = _Page(_page_of("usual"))
    data = [reference for reference in found.references if re.match("data:(text|application)/", reference)]
    assert len(data) == 3
    as_csv, _, as_json = (base64.b64decode(reference.partition(",")[2]).decode() for reference in data)
    assert as_csv == to_csv(study)
    assert json.loads(as_json) == json.loads(json.dumps(to_json(study)))


def test_ink_of_the_page_is_its_own():
    html = _page_of("usual")
    assert "#010203" not in html
    assert html.count("currentColor") > 50
    assert "prefers-color-scheme: dark" in html


# ---- folder


@pytest.mark.parametrize("name", ["usual", "nothing"])
def test_a_report_is_written_whole(name, tmp_path):
    study = studies.ALL[name]()
    folder = tmp_path / "new" / "report"
    check_report(folder)
    assert not folder.exists()
    written = write_report(study, folder)
    assert written[0] == folder / "cost.html"
    assert sorted(folder.iterdir()) == sorted(written)
    assert json.loads((folder / "cost.json").read_text())["scene"] == study.scene
    if folder / "error_map.npy" in written:
        np.testing.assert_array_equal(np.load(folder / "error_map.npy"), study.error_map.astype(np.float32))


def test_a_folder_that_cannot_be_written_is_found_before_the_work(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="is a file, and not a folder"):
        check_report(tmp_path / "file")
    with pytest.raises(InputError, match="not a folder"):
        check_report(tmp_path / "file" / "deeper")
    (tmp_path / "report" / "cost.csv").mkdir(parents=True)
    with pytest.raises(InputError, match=r"cost\.csv: is a folder"):
        check_report(tmp_path / "report")
    with pytest.raises(OutputError):
        write_report(studies.nothing(), tmp_path / "file" / "deeper")


def test_text_and_data_import_nothing_of_pages():
    code = (
        "import sys, raytracer.analysis.cost.text, raytracer.analysis.cost.export; "
        "print({'matplotlib', 'jinja2'} & set(sys.modules))"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "set()"


def test_answers_come_first():
    first, second = study_text(studies.study()).splitlines()[:2]
    assert first.startswith("scenes/")
    assert second.startswith("A relative error of 1 % takes 13.6 s (13.2 .. 14.0), with 1,330 spp. After 60 s the")
    said = " ".join(study_text(studies.black()).split())
    assert "How long a relative error of 1 % takes could not be told." in said


def test_what_is_left_out_is_named_and_the_page_has_the_reasons():
    items = [("media", "no medium anywhere"), ("shape.box", "used by nothing"), ("shape.disc", "used by nothing")]
    found = studies.study(plan=tuple(PlanItem("left out", name, why) for name, why in items))
    assert "media; shape box, disc" in " ".join(study_text(found).split())
    assert "used by nothing" not in study_text(found)
    assert "used by nothing" in page(found).decode()


def test_rays_have_a_column_where_there_is_room():
    narrow, roomy = (study_text(studies.study(), width=width) for width in (100, 120))
    assert "rays per" not in narrow
    assert re.search(r"^the scene +10\.0 ms +34\.2 ns +2\.70 ", roomy, re.MULTILINE)


def test_a_variant_without_bias_by_construction_has_none_in_the_data():
    control = studies.variants()[1]
    sampler = replace(control, name="sampler=independent", group="sampler", bias=None, unbiased=True)
    assert formatting.format_bias(sampler) == "none"
    assert formatting.format_bias(replace(control, bias=Interval(0.0, 0.0, 0.0))) == "none"
    rows = list(csv.DictReader(io.StringIO(to_csv(studies.study(variants=(control, sampler))))))
    assert [(row["bias"], row["unbiased"]) for row in rows] == [("0.0", "False"), ("", "True")]


def test_a_doubt_stands_beside_the_time_that_it_is_about():
    doubtful = replace(studies.variants()[2], target_seconds=20.0, why_blank="its bias may exceed the target")
    study = studies.study(variants=(*studies.variants()[:2], doubtful))
    said = study_text(study, width=160)
    assert re.search(r"20\.0 s \[1\]$", said, re.MULTILINE)
    assert "  [1]  its bias may exceed the target\n" in said
    assert "its bias may exceed the target" in page(study).decode()
