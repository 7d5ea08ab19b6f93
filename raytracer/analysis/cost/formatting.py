"""How the numbers of a study are said, the same in the terminal as on the page; in ASCII, since terminals differ."""

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from raytracer.cost.results import Arm, Prediction, Study
from raytracer.errors import one_line
from raytracer.noise.wording import (
    UNKNOWN,
    chosen_duration,
    duration,
    duration_interval,
    number,
    number_interval,
    percent,
    percent_interval,
    plain_percent,
)

SAME_TIME = "no measurable difference"
SAME_NOISE = "the same"

# Bias that is smaller than this is not told more exactly.
_SMALLEST_BIAS = 1e-5


def per_ray(nanoseconds: float) -> str:
    """The time for a ray over all threads: "34.2 ns"."""
    return UNKNOWN if math.isnan(nanoseconds) else f"{number(nanoseconds)} ns"


def samples(spp: float) -> str:
    """Samples per pixel: "4,280 spp"."""
    if math.isinf(spp):
        return "no number of samples"
    return UNKNOWN if math.isnan(spp) else f"{number(spp)} spp"


def value_of(value: Any) -> str:
    """Whatever the machine is described by, on one line."""
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {value_of(item)}" for key, item in value.items())
    if isinstance(value, (list, tuple)):
        return ", ".join(value_of(item) for item in value)
    return UNKNOWN if value is None else one_line(str(value))


def machine(study: Study) -> list[tuple[str, str]]:
    """What it was measured on, as pairs of a name and a value."""
    return [(one_line(key).replace("_", " "), value_of(value)) for key, value in study.machine.items()]


def spent(study: Study) -> str:
    """What the study itself took, by phase; compiling is in no prediction."""
    return ", ".join(f"{one_line(phase)} {duration(seconds)}" for phase, seconds in study.seconds.items())


def extent(study: Study) -> str:
    """Size, and how much of it was rendered."""
    return (
        f"{study.width} x {study.height} pixels, "
        f"{study.tiles_measured:,} of {study.tiles:,} tile{'' if study.tiles == 1 else 's'} measured"
    )


def rounds(study: Study) -> str:
    """How often the arms were measured, and whether all of what was wanted; "" if nobody wanted any."""
    if study.interrupted and not study.rounds:
        return "interrupted before the first round of the arms"
    times = "1 round" if study.rounds == 1 else f"{study.rounds} rounds"
    if study.interrupted:
        return f"interrupted after {times}, of which this tells"
    return f"{times}, each of all arms in turn" if study.rounds else ""


# ---- Plan

LEFT_OUT = "Left out"

_PLAN = {
    "simulated": "Simulated",
    "left out": LEFT_OUT,
    "setting": "Settings that trade accuracy for time",
}


def plan(study: Study) -> list[tuple[str, list[tuple[str, str]]]]:
    """Titles, and under each the names and reasons; kinds of one family with the same reason are told together."""
    groups = [*_PLAN, *dict.fromkeys(item.group for item in study.plan if item.group not in _PLAN)]
    told = []
    for group in groups:
        items = [(one_line(item.name), one_line(item.why)) for item in study.plan if item.group == group]
        if items:
            told.append((_PLAN.get(group, one_line(group)), _by_family(items)))
    return told


def left_out(study: Study) -> str:
    """The names of what is left out, those of a family together."""
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
    told = []
    for (family, why, dot), kinds in alike.items():
        if len(kinds) == 1 or not dot:
            told += [(f"{family}{dot}{kind}", why) for kind in kinds]
        else:
            told.append((family, f"{', '.join(kinds)}: {why}"))
    return told


# ---- Prediction


def _reach(spp: float, seconds: float) -> str:
    if math.isnan(spp) or math.isnan(seconds):
        return UNKNOWN
    return "never" if math.isinf(seconds) else f"{duration(seconds)}, {samples(spp)}"


def prediction(predicted: Prediction) -> list[tuple[str, str]]:
    """What is predicted, as pairs of a question and its answer."""
    target = plain_percent(predicted.target)
    spp, seconds = predicted.target_spp, predicted.target_seconds
    if math.isnan(seconds.value) or math.isinf(seconds.value):
        answer = UNKNOWN if math.isnan(seconds.value) else "never, by what was measured"
    else:
        answer = f"{duration_interval(seconds)}; {number_interval(spp)} spp"
    said = [(f"error of {target} takes", answer)]
    is_fitted = predicted.error(1.0) > 0.0
    if is_fitted:
        by_power = f"by a power law, N^-{number(predicted.exponent / 2.0)}"
        said += [
            ("by the slope -1/2 alone", _reach(predicted.plain_spp, predicted.plain_seconds)),
            (by_power, _reach(predicted.power_spp, predicted.power_seconds)),
        ]

    if predicted.budget is not None:
        if predicted.budget_spp is None or predicted.budget_error is None or predicted.budget_spp < 1.0:
            bought = "not one sample in every pixel"
        else:
            bought = f"error of {percent_interval(predicted.budget_error)}; {samples(predicted.budget_spp)}"
        said.append((f"{chosen_duration(predicted.budget)} buy", bought))

    said += [
        ("one sample in every pixel", duration_interval(predicted.per_sample)),
        ("time whatever the samples", duration_interval(predicted.fixed)),
    ]
    if is_fitted:
        said.append(("halving bias, corrected", halving(predicted)))
    return said


def headline(study: Study) -> str:
    """The answers to what was asked, as sentences."""
    predicted = study.prediction
    target, seconds = plain_percent(predicted.target), predicted.target_seconds
    if math.isnan(seconds.value):
        said = f"How long a relative error of {target} takes could not be told."
    elif math.isinf(seconds.value):
        said = f"A relative error of {target} cannot be reached, by what was measured."
    else:
        said = (
            f"A relative error of {target} takes {duration_interval(seconds)}, "
            f"with {samples(predicted.target_spp.value)}."
        )
    if predicted.budget is not None and predicted.budget_error is not None and (predicted.budget_spp or 0.0) >= 1.0:
        said += f" {chosen_duration(predicted.budget)} buy an error of {percent_interval(predicted.budget_error)}."
    return said


def halving(predicted: Prediction) -> str:
    """What separate sequences lose against an unbroken one."""
    if predicted.halving == 1.0:
        return "none: the mean of separate runs is as good as one unbroken run"
    return (
        f"the mean of the replicates has {number(predicted.halving)} times the squared error of one unbroken run of "
        "as many samples"
    )


# ---- Arms

_GROUPS = {
    "scene": "",
    "control": "",
    "effect": "without",
    "setting": "with",
    "sampler": "with another sampler",
}


class Section(NamedTuple):
    """Arms of one group, in the order in which they were measured."""

    title: str
    arms: tuple[Arm, ...]


def sections(arms: Sequence[Arm]) -> list[Section]:
    """Arms by group; the scene and its control come first, under no title."""
    titles: dict[str, list[Arm]] = {"": []}
    for arm in arms:
        titles.setdefault(_GROUPS.get(arm.group, one_line(arm.group)), []).append(arm)
    return [Section(title, tuple(found)) for title, found in titles.items() if found]


def name(arm: Arm) -> str:
    """The arm's name on one line."""
    return "the scene" if arm.group == "scene" else one_line(arm.name)


def common_spp(arms: Sequence[Arm]) -> int | None:
    """Samples per pixel at which noise is stated, if they are the same for all arms that have any."""
    counts = {arm.spp for arm in arms if arm.spp > 0 and not arm.failed}
    return counts.pop() if len(counts) == 1 else None


def time_of(arm: Arm) -> str:
    """Time per sample against the scene, in words or numbers."""
    if arm.group == "scene":
        return ""
    if math.isnan(arm.time.value):
        return UNKNOWN
    return number_interval(arm.time) if arm.time_differs else SAME_TIME


def noise_of(arm: Arm) -> str:
    """Noise, or that it is the scene's."""
    if math.isnan(arm.noise.value):
        return UNKNOWN
    if arm.group == "scene" or arm.noise_differs:
        return percent_interval(arm.noise)
    return SAME_NOISE


def bias_of(arm: Arm) -> str:
    """Bias against the scene with its interval, or how much of it would have been seen."""
    if arm.bias is None:
        return "" if arm.group == "scene" else "none" if arm.unbiased else UNKNOWN
    if arm.bias_resolved:
        if arm.bias.high < _SMALLEST_BIAS:
            return f"< {plain_percent(_SMALLEST_BIAS)}"
        return percent_interval(arm.bias)
    if arm.bias.high == 0.0:
        return "none"
    if math.isfinite(arm.bias.high):
        return f"not resolved (< {100.0 * arm.bias.high:.2g} %)"
    return "not resolved"


class Notes:
    """Sentences under a table, each said once, and the numbers by which cells refer to them."""

    def __init__(self) -> None:
        self.sentences: list[str] = []

    def mark(self, sentence: str) -> str:
        """The number of a sentence in brackets."""
        said = one_line(sentence)
        if said not in self.sentences:
            self.sentences.append(said)
        return f"[{self.sentences.index(said) + 1}]"


def target_of(arm: Arm, notes: Notes) -> str:
    """Time to the target; a reference to a note where there is none, or a doubt."""
    said = [reached(arm)] if arm.target_seconds is not None else []
    return " ".join([*said, *([notes.mark(arm.why_blank)] if arm.why_blank else [])])


def reached(arm: Arm) -> str:
    """The time to the target that an arm has, in words if it is the scene's."""
    differs = arm.group == "scene" or arm.time_differs or arm.noise_differs or arm.bias_resolved
    if arm.target_seconds is None:
        return ""
    return duration(arm.target_seconds) if differs else "as the scene"


def concentration(study: Study) -> str:
    """How much of the error sits in a few pixels."""
    return f"the worst 0.1 % of the measured pixels carry {percent(study.top_share)} of the squared error"
