"""Export of a study as JSON and CSV, in seconds and fractions, with every interval."""

import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from raytracer.analysis.cost.results import Study
from raytracer.core.error_estimate.intervals import UNKNOWN
from raytracer.report.table import csv_text

# Keys of JSON that are not the names of fields.
_JSON_KEYS = {"variants": "arms"}


def _plain(value: Any) -> Any:
    """Convert a value to numbers, strings, lists and dicts; what is not finite becomes None, since JSON lacks it."""
    if is_dataclass(value) and not isinstance(value, type):
        return {f.name: _plain(getattr(value, f.name)) for f in fields(value) if f.repr}
    if isinstance(value, tuple) and hasattr(value, "_asdict"):
        return {name: _plain(item) for name, item in value._asdict().items()}
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, (bool, int, str)):
        return value
    return [_plain(item) for item in value] if isinstance(value, Iterable) else str(value)


def to_json(study: Study) -> dict[str, Any]:
    """Convert all of a study but its pictures to what `json.dumps` takes with `allow_nan=False`.

    Names are those of `raytracer.analysis.cost.results`, but for `arms`, which are the variants; intervals are
    {"value", "low", "high"}; times are in seconds (per ray: in nanoseconds), errors, bias and brightness fractions.
    What is unknown or infinite is null.
    """
    return {_JSON_KEYS.get(name, name): value for name, value in _plain(study).items()}


def json_text(study: Study) -> str:
    """Write `to_json` as text."""
    return json.dumps(to_json(study), indent=2, allow_nan=False) + "\n"


# Columns of the table of variants, with their units, and the field of a variant that each holds.
_COLUMNS = {
    "arm": "name",
    "group": "group",
    "what": "what",
    "seconds_per_sample": "per_sample",
    "nanoseconds_per_ray": "per_ray",
    "rays_per_sample": "rays_per_sample",
    "time_ratio": "time",
    "time_differs": "time_differs",
    "spp": "spp",
    "noise": "noise",
    "squared_noise_ratio": "noise_ratio",
    "noise_differs": "noise_differs",
    "bias": "bias",
    "bias_resolved": "bias_resolved",
    "unbiased": "unbiased",
    "brightness": "brightness",
    "target_spp": "target_spp",
    "target_seconds": "target_seconds",
    "why_blank": "why_blank",
    "failed": "failed",
}
_INTERVALS = ("per_sample", "per_ray", "time", "noise", "noise_ratio", "bias", "brightness")


def to_csv(study: Study) -> str:
    """Write the variants, one a row, each interval in three columns; empty where unknown, "inf" where out of reach."""
    header: list[str] = []
    rows: list[list[Any]] = [[] for _ in study.variants]
    for column, name in _COLUMNS.items():
        header += [column, f"{column}_low", f"{column}_high"] if name in _INTERVALS else [column]
        for row, variant in zip(rows, study.variants, strict=True):
            value = getattr(variant, name)
            row.extend((value or UNKNOWN) if name in _INTERVALS else [value])
    return csv_text(header, rows)


def convergence_csv(study: Study) -> str:
    """Write the convergence of the whole picture: samples per pixel, seconds, relative error with its interval."""
    rows = ([point.spp, point.seconds, *point.error] for point in study.prediction.points)
    return csv_text(("spp", "seconds", "error", "error_low", "error_high"), rows)
