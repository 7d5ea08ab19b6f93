"""How a study is shown: what the text, the data, the pictures and the page say, of studies that nobody measured."""

import base64
import csv
import functools
import html
import io
import json
import math
import re
import subprocess
import sys
import xml.etree.ElementTree as ET
from collections import Counter
from dataclasses import replace
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

every_study = pytest.mark.parametrize("name", studies.ALL)


def test_bias_in_words():
    control, defocus = studies.variants()[1:3]
    sampler = replace(control, bias=None, unbiased=True)
    for variant, bias, words in (
        (defocus, Interval(8e-7, 5e-7, 1.2e-6), "< 0.001 %"),
        (defocus, Interval(8e-6, 5e-6, 1.2e-5), "0.000800 % (0.000500 .. 0.001200)"),
        (control, Interval(0.0, 0.0, 0.0), "none"),
        (sampler, None, "none"),
    ):
        assert formatting.format_bias(replace(variant, bias=bias)) == words
    control = replace(control, bias=Interval(0.0, 0.0, 0.0))
    rows = csv.DictReader(io.StringIO(to_csv(studies.study(variants=(control, sampler)))))
    assert [(row["bias"], row["unbiased"]) for row in rows] == [("0.0", "False"), ("", "True")]


def test_kinds_of_a_family_with_one_reason_are_told_together():
    items = [("media", "none"), ("shape.box", "0"), ("shape.disc", "0"), ("shape.quad", "2"), ("light.sun", "0")]
    found = studies.study(plan=tuple(PlanItem("left out", name, why) for name, why in items))
    rows = [("media", "none"), ("shape", "box, disc: 0"), ("shape.quad", "2"), ("light.sun", "0")]
    assert formatting.plan_sections(found) == [("Left out", rows)]
    assert "media; shape box, disc" in " ".join(study_text(found).split())


@every_study
def test_text_is_plain_and_fits(name):
    for width in (60, 100, 160):
        said = study_text(studies.ALL[name](), width)
        assert said.isascii()
        for line in said.splitlines():
            assert len(line) <= width
            assert line == line.rstrip()
            assert line.isprintable()


def test_text_says_what_was_found():
    said = study_text(studies.study())
    lines = said.splitlines()
    assert lines[0].startswith("scenes/")
    assert lines[1].startswith("A relative error of 1 % takes 13.6 s (13.2 .. 14.0), with 1,330 spp. After 60 s the")
    assert "error of 1 % takes         13.6 s (13.2 .. 14.0); 1,330 (1,290 .. 1,370) spp" in said
    assert "after 60 s the error is    0.470 % (0.456 .. 0.484); 5,970 spp" in said
    assert studies.EVIL in said
    for row in (
        r"repeat of the same .* 10\.0 ms +34\.2 ns +no measurable +the same +not resolved +as the$",
        r"defocus +8\.40 ms +34\.2 ns +0\.839 +4\.21 % +15\.4 % +\[1\]$",
        r"media +not measured \[2\]$",
        r"sampler=independent .* never$",
        r"  \[1\]  the bias exceeds the target, which no number of samples mends$",
        r"  \[2\]  the variant could not be packed: nothing is left to see$",
    ):
        assert any(re.search(row.replace(" .* ", " +(?:.* )?"), line) for line in lines), row
    assert "How long a relative error of 1 % takes could not be told." in " ".join(study_text(studies.black()).split())
    # Rays have a column where there is room.
    assert "rays per" not in said
    assert re.search(r"^the scene +10\.0 ms +34\.2 ns +2\.70 ", study_text(studies.study(), 120), re.MULTILINE)
    coloured = study_text(studies.study(), colour=True)
    assert re.sub(r"\x1b\[[0-9;]*m", "", coloured).split() == said.split() != coloured.split()
    # What a terminal would act upon is written out.
    assert "\x1b" not in study_text(studies.study(scene="a\x1b[2Jb.yaml", warnings=("\x1b]0;x\x07",)))


def test_doubts_and_other_samples_stand_beside_what_they_are_about():
    scene, control, defocus, *_ = studies.variants()
    doubt = "its bias may exceed the target"
    study = studies.nothing()
    study = replace(study, variants=(scene, control, replace(defocus, spp=16, target_seconds=20.0, why_blank=doubt)))
    study = replace(study, plan=(PlanItem("left out", "shape.box", "used by nothing"),))
    said = study_text(study, width=200)
    assert "4.64 % (4.50 .. 4.78) at 64 spp" in said
    assert "4.21 % (4.08 .. 4.34) at 16 spp" in said
    assert re.search(r"20\.0 s \[1\]$", said, re.MULTILINE)
    assert f"  [1]  {doubt}\n" in said
    assert "used by nothing" not in said
    shown = page(study).decode()
    for words in (doubt, "used by nothing"):
        assert words in shown


@every_study
def test_data_are_strict_and_whole(name):
    study = studies.ALL[name]()
    data = json.loads(json.dumps(to_json(study), allow_nan=False))
    assert (data["scene"], data["tiles_measured"]) == (study.scene, study.tiles_measured)
    assert len(data["prediction"]["points"]) == len(study.prediction.points)
    assert {"error_map", "picture"}.isdisjoint(data)
    rows = list(csv.DictReader(io.StringIO(to_csv(study))))
    names = [variant.name for variant in study.variants]
    assert [row["arm"] for row in rows] == [variant["name"] for variant in data["arms"]] == names
    for row, variant in zip(rows, study.variants, strict=True):
        assert not {None} & {*row, *row.values()}
        for column, interval in (("time_ratio", variant.time), ("bias", variant.bias or UNKNOWN)):
            cells = [row[column], row[f"{column}_low"], row[f"{column}_high"]]
            np.testing.assert_array_equal([float(cell or "nan") for cell in cells], interval)
        assert row["target_seconds"] == ("" if variant.target_seconds is None else repr(variant.target_seconds))


def test_json_keeps_numbers_and_has_null_for_what_is_unknown():
    machine = {"threads": np.int64(4), "load": np.float64(NAN), "loads": np.array([1.0, INF]), "path": Path("a")}
    data = to_json(studies.study(machine=machine))
    assert data["arms"][2]["time"] == {"value": 0.839, "low": 0.821, "high": 0.857}
    assert data["arms"][2]["target_seconds"] is None
    assert data["arms"][4]["per_sample"] == {"value": None, "low": None, "high": None}
    assert data["machine"] == {"threads": 4, "load": None, "loads": [1.0, None], "path": "a"}
    assert type(data["machine"]["threads"]) is int
    assert to_json(studies.hopeless())["prediction"]["target_seconds"]["value"] is None


# ---- pictures


@pytest.mark.parametrize("name", ["nothing", "black", "one point", "portrait"])
def test_plots_are_drawn_where_there_is_something_to_draw(name):
    study = studies.ALL[name]()
    svg, png = plots.convergence_svg(study), plots.error_map_png(study)
    assert (svg is not None) == any(point.error.value > 0.0 for point in study.prediction.points)
    assert (png is not None) == bool(np.nansum(study.error_map) > 0.0)
    if png is not None:
        with Image.open(io.BytesIO(png)) as image:
            image.load()
            assert min(image.size) > 200


def test_the_plot_holds_the_measurements_the_target_and_both_slopes():
    from matplotlib.figure import Figure

    study = studies.study()
    axes = Figure().add_subplot()
    axes.set_xscale("log")
    axes.set_yscale("log")
    plots._draw_convergence(axes, study, list(study.prediction.points))
    lines = {str(line.get_label()): np.asarray(line.get_xydata()) for line in axes.get_lines()}
    last = study.prediction.points[-1]
    for label, slope in (("slope -1/2: independent samples", -0.5), ("slope -3/4", -0.75)):
        (x0, y0), (x1, y1) = lines[label]
        assert math.log(y1 / y0) / math.log(x1 / x0) == pytest.approx(slope)
        assert y0 * (last.seconds / x0) ** slope == pytest.approx(last.error.value)
    np.testing.assert_array_equal(lines["target 1 %"][:, 1], 0.01)
    np.testing.assert_array_equal(lines["budget 60 s"][:, 0], 60.0)
    seconds, errors = np.log(lines["fit to what was measured"]).T
    for point in study.prediction.points:
        fit = np.interp(math.log(point.seconds), seconds, errors)
        assert fit == pytest.approx(math.log(point.error.value), abs=1e-3)


def test_the_map_of_a_large_picture_is_reduced_by_mean_squares():
    error = np.full((3, 2 * plots._LARGEST_EDGE), NAN)
    error[0, :4] = [3.0, 4.0, 1.0, NAN]
    error[1, :2] = [0.0, 5.0]
    reduced = plots._downsample(error)
    assert reduced.shape == (2, plots._LARGEST_EDGE)
    assert reduced[0, 0] == pytest.approx(math.sqrt((9.0 + 16.0 + 25.0) / 4.0))
    assert reduced[0, 1] == 1.0
    assert np.isnan(reduced[1]).all()


# ---- page and folder


@functools.cache
def page_of(name):
    return page(studies.ALL[name]()).decode()


@every_study
def test_the_page_is_whole_and_asks_nothing_of_the_network(name):
    whole = page_of(name)
    ids = re.findall(r'\sid="([^"]*)"', whole)
    assert len(ids) == len(set(ids))
    for reference in re.findall(r'\s(?:xlink:href|href|src)="([^"]*)"', whole) + re.findall(r"url\(([^)]*)\)", whole):
        assert reference.startswith("data:") or reference[1:] in ids
    assert "@import" not in whole
    # Names of XML vocabularies are all that looks like an address.
    addresses = set(re.findall(r"https?://[^\s\"'<]*", whole))
    assert addresses <= {"http://www.w3.org/2000/svg", "http://www.w3.org/1999/xlink"}
    assert not re.search(r"<(iframe|object|base|form)\b|<[^>]*\s(on\w+|srcset|action|poster|data)=", whole)
    body = re.sub(r"<(svg|script|style)\b.*?</\1>", "", whole, flags=re.DOTALL)
    tags = Counter(re.findall(r"<(/?[a-z]\w*)", body))
    for tag in {tag for tag in tags if tag[0] != "/"} - {"meta", "br", "img", "link", "input", "hr", "html", "body"}:
        assert tags[tag] == tags[f"/{tag}"], tag
    variants = studies.ALL[name]().variants
    cells = [len(re.findall(r"<t[dh]\b", row)) for row in re.findall(r"<tr\b.*?</tr>", body, re.DOTALL)]
    assert cells[len(cells) - len(variants) :] == [10] * len(variants)
    # Names of the scene are text.
    assert studies.EVIL not in whole
    if name == "usual":
        assert html.unescape(re.sub(r"<[^>]*>", "", body)).count(studies.EVIL) == 7
        assert whole.count("currentColor") > 50
        assert "#010203" not in whole
        assert "prefers-color-scheme: dark" in whole


def test_the_page_carries_its_data():
    study = studies.study()
    data = re.findall(r'"data:(?:text|application)/[^,"]*,([^"]*)"', page_of("usual"))
    as_csv, _, as_json = (base64.b64decode(html.unescape(part)).decode() for part in data)
    assert as_csv == to_csv(study)
    assert json.loads(as_json) == json.loads(json.dumps(to_json(study)))


@pytest.mark.parametrize("name", ["one tile", "nothing"])
def test_a_report_is_written_whole(name, tmp_path):
    study = studies.ALL[name]()
    folder = tmp_path / "new" / "report"
    check_report(folder)
    assert not folder.exists()
    written = write_report(study, folder)
    assert written[0] == folder / "cost.html"
    assert sorted(folder.iterdir()) == sorted(written)
    assert json.loads((folder / "cost.json").read_text())["scene"] == study.scene
    assert (folder / "error_map.npy" in written) == (name == "one tile")
    if name == "one tile":
        np.testing.assert_array_equal(np.load(folder / "error_map.npy"), study.error_map.astype(np.float32))
        # Drawn again, plots are the same.
        assert (folder / "convergence.svg").read_bytes() == plots.convergence_svg(study)
        assert (folder / "error_map.png").read_bytes() == plots.error_map_png(study)
        with Image.open(folder / "error_map.png") as image:
            assert min(image.size) > 200


def test_a_folder_that_cannot_be_written_is_found_before_the_work(tmp_path):
    (tmp_path / "file").write_text("")
    (tmp_path / "report" / "cost.csv").mkdir(parents=True)
    for name, words in (
        ("file", "is a file, and not a folder"),
        ("file/deeper", "not a folder"),
        ("report", r"cost\.csv: is a folder"),
    ):
        with pytest.raises(InputError, match=words):
            check_report(tmp_path / name)
    with pytest.raises(OutputError):
        write_report(studies.nothing(), tmp_path / "file" / "deeper")


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


def test_csv_of_the_plot():
    table = np.genfromtxt(io.StringIO(convergence_csv(studies.study())), delimiter=",", names=True)
    np.testing.assert_array_equal(table["spp"], [16, 64, 256])
    np.testing.assert_array_equal(table["error"], [point.error.value for point in studies.predicted().points])


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
    study = studies.study(prediction=studies.predicted(points=points, target_seconds=target))
    assert ET.fromstring(plots.convergence_svg(study)).tag.endswith("svg")


def test_the_picture_is_transparent_where_nothing_was_rendered():
    study = studies.study()
    png = plots.picture_png(study)
    with Image.open(io.BytesIO(png)) as image:
        pixels = np.asarray(image)
    np.testing.assert_array_equal(pixels[..., 3] == 255, np.isfinite(study.picture[..., 0]))
    assert pixels[pixels[..., 3] == 255][:, :3].max() == 255
    assert plots.picture_png(studies.nothing()) is None


def test_text_and_data_import_nothing_of_pages():
    code = (
        "import sys, raytracer.analysis.cost.text, raytracer.analysis.cost.export; "
        "print({'matplotlib', 'jinja2'} & set(sys.modules))"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "set()"
