"""Formatting of a study's numbers, alike for the terminal and the page; in ASCII, since terminals differ."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from raytracer.analysis.cost.results import Prediction, Study, VariantResult
from raytracer.report.wording import (
    UNKNOWN,
    count,
    format_duration,
    format_duration_interval,
    format_given_duration,
    format_given_percent,
    format_interval,
    format_number,
    format_percent,
    format_percent_interval,
    plural,
)
from raytracer.util.errors import one_line

SAME_TIME = "no measurable difference"
SAME_NOISE = "the same"

# Bias below which only that is shown.
_SMALLEST_BIAS = 1e-5

# Phases of a study whose names are not what users read.
_PHASES = {"compile arms": "compile variants"}


def _format_per_ray(nanoseconds: float) -> str:
    """Format the time for a ray over all threads: "34.2 ns"."""
    return UNKNOWN if math.isnan(nanoseconds) else f"{format_number(nanoseconds)} ns"


def _format_samples(spp: float) -> str:
    """Format samples per pixel: "4,280 spp"."""
    if math.isinf(spp):
        return "no number of samples"
    return UNKNOWN if math.isnan(spp) else f"{format_number(spp)} spp"


def _format_value(value: Any) -> str:
    """Format any value that describes the machine, on one line."""
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {_format_value(item)}" for key, item in value.items())
    if isinstance(value, (list, tuple)):
        return ", ".join(_format_value(item) for item in value)
    return UNKNOWN if value is None else one_line(str(value))


def machine_rows(study: Study) -> list[tuple[str, str]]:
    """List names and values of what describes the machine, and the time that the study took by phase.

    Compiling is in no prediction.
    """
    rows = [(one_line(key).replace("_", " "), _format_value(value)) for key, value in study.machine.items()]
    phases = ((_PHASES.get(phase, phase), seconds) for phase, seconds in study.seconds.items())
    spent = ", ".join(f"{one_line(phase)} {format_duration(seconds)}" for phase, seconds in phases)
    return [*rows, ("time spent", spent)] if spent else rows


def format_extent(study: Study) -> str:
    """Format the size of the picture, and how much of it was rendered."""
    return (
        f"{study.width} x {study.height} pixels, "
        f"{study.tiles_measured:,} of {study.tiles:,} {plural(study.tiles, 'tile')} measured"
    )


def format_rounds(study: Study) -> str:
    """Format how many rounds were measured, and if all of those that were asked for; "" if none were."""
    if study.interrupted and not study.rounds:
        return "interrupted before the first round of the variants"
    times = count(study.rounds, "round")
    if study.interrupted:
        return f"interrupted after {times}, of which this tells"
    return f"{times}, each of all variants in turn" if study.rounds else ""


# ---- Plan

LEFT_OUT = "Left out"

_PLAN = {
    "simulated": "Simulated",
    "left out": LEFT_OUT,
    "setting": "Settings that trade accuracy for time",
}


def plan_sections(study: Study) -> list[tuple[str, list[tuple[str, str]]]]:
    """List titles, and under each the names and reasons; kinds of one family with the same reason are joined."""
    groups = [*_PLAN, *dict.fromkeys(item.group for item in study.plan if item.group not in _PLAN)]
    sections = []
    for group in groups:
        items = [(one_line(item.name), one_line(item.why)) for item in study.plan if item.group == group]
        if items:
            sections.append((_PLAN.get(group, one_line(group)), _by_family(items)))
    return sections


def format_left_out(study: Study) -> str:
    """List the names of effects that are left out, those of a family together."""
    families: dict[str, list[str]] = {}
    for name in (one_line(item.name) for item in study.plan if item.group == "left out"):
        family, _, kind = name.partition(".")
        families.setdefault(family, []).extend([kind] if kind else [])
    return "; ".join(f"{family} {', '.join(kinds)}" if kinds else family for family, kinds in families.items())


def _by_family(items: Sequence[tuple[str, str]]) -> list[tuple[str, str]]:
    alike: dict[tuple[str, str, str], list[str]] = {}
    for name, why in items:
        family, dot, kind = name.partition(".")
        # What belongs to no family stays by itself.
        alike.setdefault((family, why, dot), []).append(kind)
    rows = []
    for (family, why, dot), kinds in alike.items():
        if len(kinds) == 1 or not dot:
            rows += [(f"{family}{dot}{kind}", why) for kind in kinds]
        else:
            rows.append((family, f"{', '.join(kinds)}: {why}"))
    return rows


# ---- Prediction


def point_rows(predicted: Prediction) -> list[tuple[str, str, str]]:
    """List samples per pixel, time and error of each measured point."""
    return [
        (f"{point.spp:,}", format_duration(point.seconds), format_percent_interval(point.error))
        for point in predicted.points
    ]


def _format_reach(spp: float, seconds: float) -> str:
    if math.isnan(spp) or math.isnan(seconds):
        return UNKNOWN
    return "never" if math.isinf(seconds) else f"{format_duration(seconds)}, {_format_samples(spp)}"


def prediction_rows(predicted: Prediction) -> list[tuple[str, str]]:
    """List the predictions, as pairs of a question and its answer."""
    target = format_given_percent(predicted.target)
    spp, seconds = predicted.target_spp, predicted.target_seconds
    if math.isnan(seconds.value) or math.isinf(seconds.value):
        answer = UNKNOWN if math.isnan(seconds.value) else "never, by what was measured"
    else:
        answer = f"{format_duration_interval(seconds)}; {format_interval(spp)} spp"
    rows = [(f"error of {target} takes", answer)]
    is_fitted = predicted.error(1.0) > 0.0
    if is_fitted:
        by_power = f"by a power law, N^-{format_number(predicted.exponent / 2.0)}"
        rows += [
            ("by the slope -1/2 alone", _format_reach(predicted.plain_spp, predicted.plain_seconds)),
            (by_power, _format_reach(predicted.power_spp, predicted.power_seconds)),
        ]

    if predicted.budget is not None:
        if predicted.budget_spp is None or predicted.budget_error is None or predicted.budget_spp < 1.0:
            reached = "unknown: less than one sample per pixel"
        else:
            reached = f"{format_percent_interval(predicted.budget_error)}; {_format_samples(predicted.budget_spp)}"
        rows.append((f"after {format_given_duration(predicted.budget)} the error is", reached))

    rows += [
        ("time per spp", format_duration_interval(predicted.per_sample)),
        ("time whatever the samples", format_duration_interval(predicted.fixed)),
    ]
    if is_fitted:
        halving = "none: the mean of separate runs is as good as one unbroken run"
        if predicted.halving != 1.0:
            halving = (
                f"the mean of the replicates has {format_number(predicted.halving)} times the squared error of one "
                "unbroken run of as many samples"
            )
        rows.append(("halving bias, corrected", halving))
    return rows


def headline(study: Study) -> str:
    """Write the answers to target and budget as sentences."""
    predicted = study.prediction
    target, seconds = format_given_percent(predicted.target), predicted.target_seconds
    if math.isnan(seconds.value):
        sentences = f"How long a relative error of {target} takes could not be told."
    elif math.isinf(seconds.value):
        sentences = f"A relative error of {target} cannot be reached, by what was measured."
    else:
        sentences = (
            f"A relative error of {target} takes {format_duration_interval(seconds)}, "
            f"with {_format_samples(predicted.target_spp.value)}."
        )
    if predicted.budget is not None and predicted.budget_error is not None and (predicted.budget_spp or 0.0) >= 1.0:
        error = format_percent_interval(predicted.budget_error)
        sentences += f" After {format_given_duration(predicted.budget)} the error is {error}."
    return sentences


# ---- Variants

_NAMES = {"scene": "the scene", "control": "repeat of the same"}

_GROUPS = {
    "scene": "",
    "control": "",
    "effect": "without",
    "setting": "with",
    "sampler": "with another sampler",
}


def group_variants(variants: Sequence[VariantResult]) -> list[tuple[str, list[VariantResult]]]:
    """Group variants under titles; the scene and its control come first, under no title."""
    titles: dict[str, list[VariantResult]] = {"": []}
    for variant in variants:
        titles.setdefault(_GROUPS.get(variant.group, one_line(variant.group)), []).append(variant)
    return [(title, members) for title, members in titles.items() if members]


def display_name(variant: VariantResult) -> str:
    """Return the variant's name on one line."""
    return _NAMES.get(variant.group) or one_line(variant.name)


def _common_spp(variants: Sequence[VariantResult]) -> int | None:
    """Samples per pixel at which noise is stated, if they are the same for all variants that have any."""
    counts = {variant.spp for variant in variants if variant.spp > 0 and not variant.failed}
    return counts.pop() if len(counts) == 1 else None


def _format_time_ratio(variant: VariantResult) -> str:
    """Format the time per sample against the scene."""
    if variant.group == "scene":
        return ""
    if math.isnan(variant.time.value):
        return UNKNOWN
    return format_interval(variant.time) if variant.time_differs else SAME_TIME


def _format_noise(variant: VariantResult) -> str:
    """Format the noise, or say that it is the scene's."""
    if math.isnan(variant.noise.value):
        return UNKNOWN
    if variant.group != "scene" and not variant.noise_differs:
        return SAME_NOISE
    return format_percent_interval(variant.noise)


def _format_noise_at(variant: VariantResult) -> str:
    """Format the noise with its samples per pixel."""
    noise = _format_noise(variant)
    return noise if noise in {UNKNOWN, SAME_NOISE} else f"{noise} at {variant.spp:,} spp"


def _format_noise_ratio(variant: VariantResult) -> str:
    if variant.group == "scene":
        return ""
    is_same = not variant.noise_differs and not math.isnan(variant.noise_ratio.value)
    return SAME_NOISE if is_same else format_interval(variant.noise_ratio)


def _format_brightness(variant: VariantResult) -> str:
    if variant.brightness is None:
        return "" if variant.group == "scene" else UNKNOWN
    return format_percent_interval(variant.brightness)


def format_bias(variant: VariantResult) -> str:
    """Format the bias against the scene with its interval, or how much of it would have been seen."""
    if variant.bias is None:
        return "" if variant.group == "scene" else "none" if variant.unbiased else UNKNOWN
    if variant.bias_resolved:
        if variant.bias.high < _SMALLEST_BIAS:
            return f"< {format_given_percent(_SMALLEST_BIAS)}"
        return format_percent_interval(variant.bias)
    if variant.bias.high == 0.0:
        return "none"
    if math.isfinite(variant.bias.high):
        return f"not resolved (< {100.0 * variant.bias.high:.2g} %)"
    return "not resolved"


def format_target_time(variant: VariantResult) -> str:
    """Format the time to the target of a variant, in words if it is the scene's."""
    differs = variant.group == "scene" or variant.time_differs or variant.noise_differs or variant.bias_resolved
    if variant.target_seconds is None:
        return ""
    return format_duration(variant.target_seconds) if differs else "as the scene"


class Column(NamedTuple):
    """A column of the table of variants.

    title : with a break where it may be broken.
    is_number : True if its cells are numbers, False for words.
    meaning : what it says and does not say.
    words : writes the cell of a variant that was measured, an interval in brackets.
    """

    title: str
    is_number: bool
    meaning: str
    words: Callable[[VariantResult], str]


_COLUMNS = {
    "time": Column(
        "time against\nthe scene",
        False,
        "Time per sample over that of the scene in the same round: 0.84 is 16 % faster without it. "
        f'"{SAME_TIME.capitalize()}" means that two runs of the very same scene differ as much; it does not mean '
        "that the difference is 0.",
        _format_time_ratio,
    ),
    "noise": Column(
        "noise{at}",
        False,
        f'Relative error by chance alone, at equal samples, not equal time. "{SAME_NOISE.capitalize()}" means as '
        "noisy as the scene, as far as could be told. A quiet picture of something else is no better picture: see "
        "the bias.",
        _format_noise,
    ),
    "bias": Column(
        "bias against\nthe scene",
        False,
        "How far the picture is from that of the scene when all noise is gone (RMS, relative), where its square "
        "exceeds three standard deviations of what is measured of variants without any. It stays however many "
        'samples are taken. "Not resolved" means that it is smaller than what these rounds could see, given in '
        "brackets; not that there is none. It is against the scene as it is, which may itself be an "
        "approximation.",
        format_bias,
    ),
    "target_seconds": Column(
        "time to\n{target}",
        True,
        "Predicted time until noise and bias together are {target}, compiling apart; as the scene's where neither "
        "time nor noise nor bias differs. It is blank where the bias exceeds the target, since no number of "
        "samples mends a bias.",
        format_target_time,
    ),
    "per_sample": Column(
        "time\nper spp",
        True,
        "Seconds for one sample in every pixel of the whole picture, over all threads. It does not say how good "
        "the sample is: dearer samples may be the better ones.",
        lambda variant: format_duration_interval(variant.per_sample),
    ),
    "per_ray": Column(
        "time\nper ray",
        True,
        "The same for one ray, be it from the camera, a bounce, or towards a light. An effect may make rays "
        "dearer (more to compute at each hit) or take more of them; this tells which.",
        lambda variant: _format_per_ray(variant.per_ray.value),
    ),
    "rays_per_sample": Column(
        "rays per\nsample",
        True,
        "How many rays a sample takes on average. It counts rays and not their length or what they meet.",
        lambda variant: format_number(variant.rays_per_sample),
    ),
    "noise_ratio": Column(
        "squared noise against\nthe scene",
        False,
        "How many times the samples it takes to be as free of noise as the scene, roughly. Times the ratio of "
        "times, it is the ratio of the work.",
        _format_noise_ratio,
    ),
    "brightness": Column(
        "brightness",
        False,
        "How much brighter the picture as a whole is than that of the scene. A bias may leave it as it is: light "
        "that is lost here may turn up there.",
        _format_brightness,
    ),
}


def columns(study: Study) -> dict[str, Column]:
    """Return the columns of the table of variants, without that of their names, by the fields that they are of."""
    spp, target = _common_spp(study.variants), format_given_percent(study.prediction.target)
    values = {"at": f" at\n{spp:,} spp" if spp else "", "target": target}
    columns = {
        key: column._replace(title=column.title.format(**values), meaning=column.meaning.format(**values))
        for key, column in _COLUMNS.items()
    }
    return columns if spp else columns | {"noise": columns["noise"]._replace(words=_format_noise_at)}


def format_concentration(study: Study) -> str:
    """Describe the part of the error that sits in a few pixels."""
    return f"the worst 0.1 % of the measured pixels carry {format_percent(study.top_share)} of the squared error"
