"""Results as notebooks show them."""

import base64
import io
import re
from dataclasses import fields, replace
from html.parser import HTMLParser

import numpy as np
import PIL.Image
import pytest

import raytracer as rt
from raytracer.analysis.cost.notebook import CostStudy
from raytracer.analysis.cost.results import Study
from raytracer.analysis.sweep.results import Axis, PointResult, Sweep, SweepPoint
from raytracer.film.image import Image
from raytracer.report.fragment import THUMBNAIL
from tests.analysis.cost.studies import study

VOID = {"img"}


class Fragment(HTMLParser):
    """The cells, texts and pictures of a fragment, whose elements have to be closed in order."""

    def __init__(self, text):
        super().__init__()
        self.rows, self.texts, self.labels, self.pictures, self._open = [], [], [], [], []
        self.feed(text)
        assert self._open == []

    def handle_starttag(self, tag, attributes):
        assert tag not in ("script", "b2")
        if tag in VOID:
            keys = dict(attributes)
            self.labels.append(keys["alt"])
            kind, data = re.fullmatch(r"data:image/([\w+]+);base64,(.*)", keys["src"]).groups()
            content = base64.b64decode(data)
            self.pictures.append(content if kind == "svg+xml" else PIL.Image.open(io.BytesIO(content)))
            return
        self._open.append(tag)
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self.rows[-1].append("")

    def handle_endtag(self, tag):
        assert self._open.pop() == tag

    def handle_data(self, data):
        self.texts.append(data)
        if self._open and self._open[-1] in ("td", "th"):
            self.rows[-1][-1] += data

    @property
    def text(self):
        return " ".join(self.texts)


def grey(value, width=480, height=300):
    return Image(np.full((height, width, 3), float(value)), np.full((height, width, 3), 1e-6), 4)


def swept(rows=2, pictures=None, **changes):
    axes = (Axis("camera.f_number", (1, 2), ("1", "2")), Axis("focus<b2>", (3, 4, 5), ("3", "4", "5")))[2 - rows :]
    shape = tuple(len(axis.values) for axis in axes)
    points = [SweepPoint(tuple(map(int, index)), {}, f"point {index}") for index in np.ndindex(shape)]
    results = tuple(PointResult(point, "done") for point in points)
    shown = tuple(grey(0.1 * number) for number in range(len(points))) if pictures is None else pictures
    return replace(Sweep("a<b2>.yaml", axes, False, results, pictures=shown), **changes)


def test_a_sweep_is_a_table_of_its_pictures():
    shown = Fragment(swept()._repr_html_())
    assert [len(row) for row in shown.rows] == [4, 4, 4]
    assert shown.rows[0] == ["f_number", *(f"focus<b2> {label}" for label in "345")]
    assert [row[0] for row in shown.rows[1:]] == ["1", "2"]
    assert [max(picture.size) for picture in shown.pictures] == [THUMBNAIL] * 6
    means = [np.asarray(picture).mean() for picture in shown.pictures]
    assert means == sorted(means)
    assert means[5] > means[0]
    assert "a<b2>.yaml" in shown.text


def test_a_sweep_along_one_axis_is_a_row_and_what_failed_says_why():
    sweep = swept(1)
    results = (replace(sweep.results[0], status="failed", reason="no <b2> there"), *sweep.results[1:])
    shown = Fragment(replace(sweep, results=results, pictures=(None, *sweep.pictures[1:]))._repr_html_())
    assert shown.rows[1] == ["no <b2> there", "", ""]
    assert len(shown.pictures) == 2


def test_a_sweep_in_a_folder_shows_its_files_or_their_names(tmp_path):
    grey(0.5).save(tmp_path / "a.png")
    sweep = swept(1, ())
    results = tuple(
        replace(result, files=(name,)) for result, name in zip(sweep.results, ("a.png", "b.exr", "c.png"), strict=True)
    )
    shown = Fragment(replace(sweep, results=results, folder=tmp_path)._repr_html_())
    assert shown.rows[1] == ["", "b.exr", "c.png"]
    assert shown.pictures[0].size == (240, 150)


def test_a_comparison_shows_both_images_the_metrics_and_the_verdict():
    compared = rt.compare(grey(0.5), grey(0.4), metrics=["rmse", "psnr"])
    shown = Fragment(compared._repr_html_())
    assert shown.labels == ["A", "B"]
    assert ["RMSE", "0.1", "of linear light"] in shown.rows
    assert compared.verdict.reason in shown.text
    # Also where the pixels were released.
    assert Fragment(compared.without_pixels()._repr_html_()).labels == []


def test_an_explanation_has_the_effects_as_tables_and_all_else_as_its_text():
    camera = rt.camera.thin_lens(look_from=(0, 0, 4), vfov=40, aperture="10 mm", focus_distance=4)
    ball = rt.object.sphere(name="<b2>", center=[0, 0, 0], radius=1)
    explained = rt.explain(rt.Scene(camera=camera, film=rt.Film(width=8, height=6), objects=[ball]))
    shown = Fragment(explained._repr_html_())
    effects = {row[0]: row[1] for row in shown.rows if row != ["effect", "why"]}
    assert effects == {name: effect.why for name, effect in explained.effects.items()}
    assert "Field of view" in shown.text
    assert "<b2>" in shown.text
    text = str(explained)
    assert all(line in text for line in shown.texts[-1].splitlines())


def test_a_study_of_cost_shows_the_table_of_variants_and_the_plot():
    made = study(scene="<b2>.yaml")
    shown = Fragment(CostStudy(**{each.name: getattr(made, each.name) for each in fields(Study)})._repr_html_())
    assert shown.labels == ["relative error against time"]
    assert shown.pictures[0].startswith(b"<?xml")
    names = [variant.name for variant in made.variants if not variant.failed]
    assert len(names) > 2
    assert len(shown.rows[-len(names)]) == len(shown.rows[-1]) > 5
    assert "<b2>.yaml" in shown.text


@pytest.mark.parametrize("key", ["variants", "warnings"])
def test_a_study_without_variants_or_warnings_is_shown_too(key):
    made = study(**{key: ()})
    assert Fragment(CostStudy(**{each.name: getattr(made, each.name) for each in fields(Study)})._repr_html_()).rows
