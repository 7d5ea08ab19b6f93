"""The explanation of a scene as a person reads it."""

import math
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np

from raytracer.explanation.keys import Key
from raytracer.scene.effects import Effect

# Moving objects without a name that the text lists; `--json` has them all.
_MOST_LISTED = 8

_COLUMNS_OF_TEXT = 100

# Smaller and larger numbers than these have an exponent.
_SMALLEST, _LARGEST = 1e-4, 1e7


class _Line(NamedTuple):
    """How a number is shown: its name in the results, and in words; and its unit.

    also : the same in another unit, shown behind it where it is known.
    """

    key: str
    words: str
    unit: str = ""
    also: "_Line | None" = None


_GROUPS = {
    "Field of view": (
        _Line("hfov_deg", "horizontal", "deg"),
        _Line("vfov_deg", "vertical", "deg"),
        _Line("dfov_deg", "diagonal", "deg"),
        _Line("fov_deg", "across the circle", "deg"),
        _Line("pixel_at_1m_mm", "a pixel at 1 m", "mm"),
        _Line("wavelength_nm", "the one wavelength seen", "nm"),
    ),
    "Sensor": (
        _Line("sensor_width_mm", "width", "mm"),
        _Line("sensor_height_mm", "height", "mm"),
        _Line("film_width_mm", "width in the picture", "mm"),
        _Line("film_height_mm", "height in the picture", "mm"),
        _Line("pixel_pitch_um", "pixel pitch", "um"),
        _Line("crop_factor", "crop factor"),
        _Line("iso", "ISO speed"),
    ),
    "Lens": (
        _Line("focal_length_mm", "focal length", "mm"),
        _Line("equivalent_focal_length_mm", "equivalent on 36 x 24 mm", "mm"),
        _Line("f_number", "f-number"),
        _Line("entrance_pupil_mm", "entrance pupil", "mm"),
        _Line("aperture_diameter_mm", "diameter of the lens", "mm"),
        _Line("airy_disc_um", "Airy disc (550 nm)", "um"),
    ),
    "Focus": (
        _Line("focus_distance_m", "focus distance", "m"),
        _Line("image_distance_mm", "image distance", "mm"),
        _Line("back_focus_mm", "film behind the last surface", "mm"),
        _Line("magnification", "magnification"),
        _Line("circle_px", "sharp up to a circle of", "px", also=_Line("circle_mm", "", "mm")),
        _Line("near_limit_m", "near limit", "m"),
        _Line("far_limit_m", "far limit", "m"),
        _Line("depth_of_field_m", "depth of field", "m"),
        _Line("hyperfocal_m", "hyperfocal distance", "m"),
        _Line("blur_at_infinity_px", "blur at infinity", "px"),
    ),
    "Equivalent thin lens": (
        _Line("thin_lens_focal_length_mm", "its focal length", "mm"),
        _Line("thin_lens_f_number", "its f-number"),
        _Line("thin_lens_vfov_deg", "its vertical field of view", "deg"),
    ),
    "Light field": (
        _Line("views", "views"),
        _Line("view_columns", "angular resolution, in a row"),
        _Line("view_rows", "and in a column"),
        _Line("view_width_px", "spatial resolution, in a row", "px"),
        _Line("view_height_px", "and in a column", "px"),
        _Line("picture_width_px", "width of all side by side", "px"),
        _Line("picture_height_px", "height of all", "px"),
        _Line("film_gigabytes", "film of all", "GB"),
        _Line("view_spacing_mm", "from view to view", "mm"),
        _Line("view_spacing_up_mm", "from row to row", "mm"),
        _Line("baseline_mm", "from the first column to the last", "mm"),
        _Line("baseline_up_mm", "from the first row to the last", "mm"),
        _Line("convergence_distance_m", "all views alike at", "m"),
        _Line("disparity_at_infinity_px", "from view to view at infinity", "px"),
        _Line("refocus_near_m", "refocusable from", "m"),
        _Line("refocus_far_m", "refocusable to", "m"),
    ),
    "Microlenses": (
        _Line("microlens_pitch_um", "pitch", "um"),
        _Line("sub_image_px", "from sub-image to sub-image", "px"),
        _Line("seen_by_microlenses", "microlenses, across, that see a place"),
        _Line("microlens_focal_length_mm", "focal length", "mm"),
        _Line("microlens_f_number", "f-number"),
        _Line("microlens_airy_disc_px", "Airy disc (550 nm)", "px"),
        _Line("sensor_behind_microlenses_mm", "sensor behind them", "mm"),
        _Line("raw_pixels", "pixels of the sensor"),
    ),
    "Exposure": (
        _Line("shutter_s", "shutter", "s"),
        _Line("readout_s", "readout", "s"),
        _Line("ev100", "EV100"),
    ),
}

# Without a speed, or before metering has chosen it, there is only that of the definition.
_AT_ISO_100 = {"ev100": _Line("ev100", "EV100 at ISO 100")}

_COLUMNS = (
    _Line("distance_m", "distance", "m"),
    _Line("circle_of_confusion_mm", "blur", "mm"),
    _Line("circle_of_confusion_px", "blur", "px"),
    _Line("streak_px", "streak", "px"),
    _Line("corner_streak_px", "corner's streak", "px"),
    _Line("skew_px", "skew", "px"),
    _Line("skew_deg", "skew", "deg"),
)


def rounded(value: float) -> str:
    """Four digits, without an exponent where that is not longer."""
    if math.isinf(value):
        return "infinity"
    if value != 0.0 and not _SMALLEST <= abs(value) < _LARGEST:
        return f"{value:.3e}"
    return np.format_float_positional(float(f"{value:.4g}"), trim="-")


def duration(seconds: float) -> str:
    """A time, as photographers write it if it is short."""
    if 1.0 / _LARGEST < seconds < 0.5 and math.isclose(1.0 / seconds, round(1.0 / seconds)):
        return f"1/{round(1.0 / seconds)} s"
    return f"{rounded(seconds)} s"


def _quantity(value: float, line: _Line) -> str:
    """A number with its unit."""
    if line.key.endswith("f_number"):
        return f"f/{rounded(value)}" if math.isfinite(value) else "infinity"
    if line.unit == "s":
        return duration(value)
    return f"{rounded(value)} {line.unit}".rstrip() if math.isfinite(value) else rounded(value)


def effects_text(effects: Mapping[str, Effect]) -> str:
    """What is simulated and what not, a line each; kinds that the scene has none of are a line a family."""
    active = {name: effect.why for name, effect in effects.items() if effect.active}
    absent = [name for name, effect in effects.items() if "." in name and effect.why.startswith("0 ")]
    absent = [name for name in absent if name not in active]
    missing = {name: effect.why for name, effect in effects.items() if name not in {*active, *absent}}
    for family, names in groupby(absent, lambda name: name.partition(".")[0]):
        missing[family] = f"none of {', '.join(name.partition('.')[2] for name in names)}"
    width = max(map(len, (*active, *missing)))
    return "\n".join(
        f"{heading}\n" + "".join(_reason(name, why, width) for name, why in reasons.items())
        for heading, reasons in (("Simulated", active), ("Left out", missing))
    )


def _reason(name: str, why: str, width: int) -> str:
    """The line of an effect, in more than one piece if need be."""
    first, after = f"  {name:<{width}}  ", " " * (width + 4)
    return textwrap.fill(why, _COLUMNS_OF_TEXT, initial_indent=first, subsequent_indent=after) + "\n"


def warnings_text(warnings: Sequence[str]) -> str:
    """A sentence each."""
    if not warnings:
        return ""
    return "Warnings\n" + "".join(
        textwrap.fill(sentence, _COLUMNS_OF_TEXT, initial_indent="  ", subsequent_indent="    ") + "\n"
        for sentence in warnings
    )


def keys_text(keys: Sequence[Key]) -> str:
    """Write the keys of a scene, each with its value, and below it what it means."""
    if not keys:
        return ""
    lines = ["Keys of the scene, as -D takes them"]
    for key in keys:
        value = "" if key.value is None else f" = {written(key.value)}"
        note = "" if key.is_given else "  (default)" if value else "  (not given)"
        lines.append(f"  {key.path}{value}{note}")
        if key.meaning:
            indent = " " * 6
            lines.append(textwrap.fill(key.meaning, _COLUMNS_OF_TEXT, initial_indent=indent, subsequent_indent=indent))
    return "\n".join(lines) + "\n"


def written(value: Any) -> str:
    """Write a plain value as YAML on one line."""
    if isinstance(value, Mapping):
        return f"{{{', '.join(f'{key}: {written(item)}' for key, item in value.items())}}}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(written, value))}]"
    if isinstance(value, float):
        return repr(value).removesuffix(".0")
    return "null" if value is None else str(value).lower() if isinstance(value, bool) else str(value)


def camera_text(kind: str, camera: Mapping[str, float]) -> str:
    """The camera's numbers in groups; those that no group knows come last, by their names."""
    if "entrance_pupil_mm" in camera:
        camera = {name: value for name, value in camera.items() if name != "aperture_diameter_mm"}
    groups = _GROUPS
    if "iso" not in camera:
        groups = {
            heading: tuple(_AT_ISO_100.get(line.key, line) for line in lines) for heading, lines in groups.items()
        }
    listed = [line for lines in groups.values() for line in lines]
    known = {line.key for line in (*listed, *(line.also for line in listed if line.also is not None))}
    rest = tuple(_Line(name, name) for name in camera if name not in known)
    shown_lines = {
        heading: [line for line in lines if line.key in camera]
        for heading, lines in {**groups, "Further numbers": rest}.items()
    }
    width = max((len(line.words) for lines in shown_lines.values() for line in lines), default=0)
    shown_groups = [
        "".join([f"  {heading}\n", *(f"    {line.words:<{width}}  {_quantities(camera, line)}\n" for line in lines)])
        for heading, lines in shown_lines.items()
        if lines
    ]
    return f"Camera: {kind}\n" + "".join(shown_groups)


_TRADE_OFF = (
    _Line("microlens_pitch_um", "pitch", "um"),
    _Line("sub_image_px", "pixels each"),
    _Line("view_columns", "views"),
    _Line("view_width_px", "view", "px"),
    _Line("refocus_near_m", "refocusable from", "m"),
    _Line("refocus_far_m", "to", "m"),
)


def trade_off_text(rows: Sequence[Mapping[str, float]], own: Mapping[str, float]) -> str:
    """A table of what other microlenses would give, a row each; nothing for cameras without any."""
    if not rows:
        return ""
    cells = [[f"{line.words} ({line.unit})" if line.unit else line.words for line in _TRADE_OFF]]
    for row in rows:
        cells.append([rounded(row[line.key]) for line in _TRADE_OFF])
        cells[-1][2] += f" x {rounded(row['view_rows'])}"
        cells[-1][3] += f" x {rounded(row['view_height_px'])}"
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    marks = ["", *("  these" if row["microlens_pitch_um"] == own["microlens_pitch_um"] else "" for row in rows)]
    lines = [
        "  " + "  ".join(f"{cell:>{width}}" for cell, width in zip(row, widths, strict=True)) + mark
        for row, mark in zip(cells, marks, strict=True)
    ]
    return "Microlenses of other sizes before the same sensor\n" + "\n".join(lines) + "\n"


def thin_lens_text(keys: Mapping[str, Any] | None) -> str:
    """The thin lens in place of a lens of glass, to be copied into a scene; nothing without one."""
    if keys is None:
        return ""
    import yaml

    text = yaml.safe_dump(dict(keys), default_flow_style=None, sort_keys=False, width=_COLUMNS_OF_TEXT)
    return "Thin lens in its place\n" + textwrap.indent(f"camera:\n{textwrap.indent(text, '  ')}", "  ")


def _quantities(camera: Mapping[str, float], line: _Line) -> str:
    """A line's number, and the same in its other unit."""
    lines = [line, line.also] if line.also is not None and line.also.key in camera else [line]
    return ", ".join(_quantity(camera[each.key], each) for each in lines)


def objects_text(objects: Mapping[str, Mapping[str, float]]) -> str:
    """A table, a row an object, of the columns that any object has."""
    if not objects:
        return ""
    rows, left_out = _chosen(objects)
    columns = [column for column in _COLUMNS if any(column.key in numbers for numbers in rows.values())]
    cells = [["object", *(f"{column.words} ({column.unit})" for column in columns)]]
    cells += [[name, *(_cell(numbers, column) for column in columns)] for name, numbers in rows.items()]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    lines = ["  " + "  ".join(_justified(row, widths)).rstrip() for row in cells]
    if left_out:
        lines.append(f"  and {left_out} more that move, which --json lists")
    blurred = any(column.key == "circle_of_confusion_px" for column in columns)
    meaning = "; their blur is the circle of confusion" if blurred else ""
    return f"Objects in the middle of the exposure{meaning}\n" + "\n".join(lines) + "\n"


def _chosen(objects: Mapping[str, Mapping[str, float]]) -> tuple[dict[str, Mapping[str, float]], int]:
    """The objects with names, and those without that go farthest; and how many are left out."""
    unnamed = [name for name in objects if name.startswith("objects[")]
    farthest = sorted(unnamed, key=lambda name: -objects[name].get("streak_px", 0.0))[_MOST_LISTED:]
    return {name: numbers for name, numbers in objects.items() if name not in set(farthest)}, len(farthest)


def _cell(numbers: Mapping[str, float], column: _Line) -> str:
    return rounded(numbers[column.key]) if column.key in numbers else "-"


def _justified(row: Sequence[str], widths: Iterable[int]) -> list[str]:
    """Names to the left, numbers to the right."""
    name, *numbers = row
    first, *others = widths
    return [f"{name:<{first}}", *(f"{number:>{width}}" for number, width in zip(numbers, others, strict=True))]
