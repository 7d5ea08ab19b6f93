"""A study as one page of HTML that holds all it shows, and as a folder with the page, its pictures and its data.

The page asks nothing of the network, works from the file system, and in the dark.  Whatever comes from a scene (its
name, those of materials) is escaped.
"""

import base64
import io
import json
import math
from importlib.resources import files
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from raytracer.cost import export, figures, phrases
from raytracer.cost.results import Arm, Study
from raytracer.errors import InputError, one_line
from raytracer.film.output import check_file, write_bytes
from raytracer.noise import wording
from raytracer.noise.intervals import Interval

PAGE = "cost.html"
_NAMES = (PAGE, "cost.csv", "cost.json", "convergence.csv", "convergence.svg", "error_map.png", "error_map.npy")


class Cell(NamedTuple):
    """What a cell says, its interval, and the number that it is sorted by: none sorts last."""

    main: str
    ends: str
    sort: str
    number: bool


class Column(NamedTuple):
    """A column's title, whether its cells are numbers, and what it says and does not say."""

    title: str
    number: bool
    meaning: str


def _columns(study: Study) -> list[Column]:
    spp = phrases.common_spp(study.arms)
    target = wording.plain_percent(study.prediction.target)
    return [
        Column(
            "arm",
            False,
            "What was changed. A/A is the scene once more, measured like any other arm: it shows which differences are "
            "nothing but the machine's unrest and the dice.",
        ),
        Column(
            "time per spp",
            True,
            "Seconds for one sample in every pixel of the whole picture, over all threads. It does not say how good "
            "the sample is: dearer samples may be the better ones.",
        ),
        Column(
            "time per ray",
            True,
            "The same for one ray, be it from the camera, a bounce, or towards a light. An effect may make rays dearer "
            "(more to compute at each hit) or take more of them; this tells which.",
        ),
        Column(
            "rays per sample",
            True,
            "How many rays a sample takes on average. It counts rays and not their length or what they meet.",
        ),
        Column(
            "time against the scene",
            False,
            "Time per sample over that of the scene in the same round: 0.84 is 16 % faster without it. "
            f'"{phrases.SAME_TIME.capitalize()}" means that two runs of the very same scene differ as much; it does '
            "not mean that the difference is 0.",
        ),
        Column(
            f"noise at {spp:,} spp" if spp else "noise",
            False,
            "Relative error by chance alone, at equal samples, not equal time. "
            f'"{phrases.SAME_NOISE.capitalize()}" means as noisy as the scene, as far as could be told. A quiet '
            "picture of something else is no better picture: see the bias.",
        ),
        Column(
            "squared noise against the scene",
            False,
            "How many times the samples it takes to be as free of noise as the scene, roughly. Times the ratio of "
            "times, it is the ratio of the work.",
        ),
        Column(
            "bias against the scene",
            False,
            "How far the picture is from that of the scene when all noise is gone (RMS, relative), where its square "
            "exceeds three standard deviations of what is measured of arms without any. It stays "
            'however many samples are taken. "Not resolved" means that it is smaller than what these rounds could see, '
            "given in brackets; not that there is none. It is against the scene as it is, which may itself be an "
            "approximation.",
        ),
        Column(
            "brightness",
            False,
            "How much brighter the picture as a whole is than that of the scene. A bias may leave it as it is: light "
            "that is lost here may turn up there.",
        ),
        Column(
            f"time to {target}",
            True,
            f"Predicted time until noise and bias together are {target}, compiling apart; as the scene's where neither "
            "time nor noise nor bias differs. It is blank where the bias exceeds the target, since no number of "
            "samples mends a bias.",
        ),
    ]


def _key(value: float | None) -> str:
    """A number to sort by; infinity is after all others, what is unknown has none."""
    if value is None or math.isnan(value):
        return ""
    return repr(float(value)) if math.isfinite(value) else "1e308"


def _cell(words: str, value: float | None, number: bool = False) -> Cell:
    main, bracket, ends = words.partition(" (")
    return Cell(main, bracket.strip() + ends, _key(value), number)


def _cells(arm: Arm, study: Study) -> list[Cell]:
    if arm.failed:
        return [
            Cell("not measured", "", "", True),
            *(Cell("", "", "", True) for _ in range(2)),
            Cell(one_line(arm.failed), "", "", False),
            *(Cell("", "", "", False) for _ in range(5)),
        ]
    of_scene = arm.group == "scene"
    noise = phrases.noise_of(arm)
    if phrases.common_spp(study.arms) is None and arm.spp:
        noise = f"{noise} at {arm.spp:,} spp"
    ratio = phrases.SAME_NOISE if not arm.noise_differs else wording.number_interval(arm.noise_ratio)
    if math.isnan(arm.noise_ratio.value):
        ratio = wording.UNKNOWN
    if arm.target_seconds is None:
        target = Cell("", one_line(arm.why_blank), "", False)
    else:
        target = Cell(phrases.reached(arm), one_line(arm.why_blank), _key(arm.target_seconds), True)
    return [
        _cell(wording.duration_interval(arm.per_sample), arm.per_sample.value, number=True),
        _cell(_nanoseconds(arm.per_ray), arm.per_ray.value, number=True),
        _cell(wording.number(arm.rays_per_sample), arm.rays_per_sample, number=True),
        _cell(phrases.time_of(arm), arm.time.value),
        _cell(noise, arm.noise.value),
        _cell("" if of_scene else ratio, arm.noise_ratio.value),
        _cell(phrases.bias_of(arm), None if arm.bias is None else arm.bias.value),
        _cell(_brightness(arm), None if arm.brightness is None else arm.brightness.value),
        target,
    ]


def _nanoseconds(interval: Interval) -> str:
    return phrases.per_ray(interval.value)


def _brightness(arm: Arm) -> str:
    if arm.brightness is None:
        return "" if arm.group == "scene" else wording.UNKNOWN
    return wording.percent_interval(arm.brightness)


class _File(NamedTuple):
    name: str
    type: str
    what: str
    content: bytes

    @property
    def data(self) -> str:
        return base64.b64encode(self.content).decode()


def _data(study: Study) -> list[_File]:
    as_json = json.dumps(export.to_json(study), indent=2, allow_nan=False) + "\n"
    return [
        _File("cost.csv", "text/csv", "the table of costs, with all intervals", export.to_csv(study).encode()),
        _File(
            "convergence.csv",
            "text/csv",
            "samples, seconds and errors of the plot",
            export.convergence_csv(study).encode(),
        ),
        _File("cost.json", "application/json", "all that is on this page but its pictures", as_json.encode()),
    ]


def page(study: Study) -> str:
    """The page as HTML.

    Raises
    ------
    InputError : the extra `report` is not installed.
    """
    figures.require_report()
    from jinja2 import Environment, StrictUndefined
    from markupsafe import Markup

    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    template = environment.from_string(files("raytracer.cost").joinpath("page.html").read_text(encoding="utf-8"))
    convergence, error_map, picture = (
        figures.convergence_inline(study),
        figures.error_map_inline(study),
        figures.picture_png(study),
    )
    machine = phrases.machine(study)
    if study.seconds:
        machine.append(("time spent", phrases.spent(study)))
    said = phrases.rounds(study)
    concentration = phrases.concentration(study) if math.isfinite(study.top_share) else ""
    values: dict[str, Any] = {
        "scene": one_line(study.scene),
        "extent": phrases.extent(study),
        "headline": phrases.headline(study),
        "warnings": [one_line(warning) for warning in study.warnings],
        # Matplotlib's own, in which there is no text of a scene.
        "convergence": convergence and Markup(convergence),
        "map": error_map and Markup(error_map),
        "picture": picture and base64.b64encode(picture).decode(),
        "sampled": study.tiles_measured < study.tiles,
        "points": [
            {
                "spp": f"{point.spp:,}",
                "time": wording.duration(point.seconds),
                "error": wording.percent_interval(point.error),
            }
            for point in study.prediction.points
        ],
        "prediction": phrases.prediction(study.prediction),
        "concentration": f"{concentration[:1].upper()}{concentration[1:]}." if concentration else "",
        "rounds": said and f"{said[:1].upper()}{said[1:]}.",
        "columns": _columns(study),
        "arms": [
            {
                "name": phrases.name(arm),
                "what": "" if arm.group == "scene" else one_line(arm.what),
                "cells": _cells(arm, study),
            }
            for section in phrases.sections(study.arms)
            for arm in section.arms
        ],
        "plan": phrases.plan(study),
        "machine": machine,
        "files": _data(study),
    }
    return template.render(values)


def check_report(folder: str | Path) -> None:
    """Make sure, before anything is measured, that a report can be written into `folder`.

    Raises
    ------
    InputError : the extra `report` is not installed, or a file of the report could not be written there.
    """
    figures.require_report()
    folder = Path(folder)
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: is a file, and not a folder for a report")
    for name in _NAMES:
        check_file(folder / name)


def write_report(study: Study, folder: str | Path) -> tuple[Path, ...]:
    """Write the page, its pictures and its data into `folder`, which is made if need be.

    `error_map.npy` holds the map's numbers, float32 (height, width), nan where not measured.  A picture that would show
    nothing is left out.

    Returns
    -------
    The files, the page first.

    Raises
    ------
    InputError : the extra `report` is not installed.
    OutputError : a file cannot be written.
    """
    contents: dict[str, bytes | None] = {PAGE: page(study).encode()}
    contents |= {file.name: file.content for file in _data(study)}
    contents["convergence.svg"] = figures.convergence_svg(study)
    contents["error_map.png"] = figures.error_map_png(study)
    if figures.has_map(study):
        numbers = io.BytesIO()
        np.save(numbers, study.error_map.astype(np.float32), allow_pickle=False)
        contents["error_map.npy"] = numbers.getvalue()

    written = []
    for name, data in contents.items():
        if data is not None:
            path = Path(folder) / name
            write_bytes(path, data)
            written.append(path)
    return tuple(written)
