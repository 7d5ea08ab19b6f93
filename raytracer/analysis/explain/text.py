"""Text of an explanation of a scene."""

import math
import textwrap
from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import Any, NamedTuple

from raytracer.analysis.explain.scene_keys import SceneKey
from raytracer.report.table import align_columns
from raytracer.report.wording import compact_number, count, exposure_time
from raytracer.scene.effects import Effect

# Moving objects without a name that the text lists; `--json` has them all.
_MOST_LISTED = 8

_COLUMNS_OF_TEXT = 100


class _Quantity(NamedTuple):
    """A quantity in the text.

    key : its name in the results.
    words : its name in the text.
    unit : of the number.
    alternative : the same in another unit, shown behind it where it is known.
    """

    key: str
    words: str
    unit: str = ""
    alternative: "_Quantity | None" = None


_GROUPS = {
    "Field of view": (
        _Quantity("hfov_deg", "horizontal", "deg"),
        _Quantity("vfov_deg", "vertical", "deg"),
        _Quantity("dfov_deg", "diagonal", "deg"),
        _Quantity("fov_deg", "across the circle", "deg"),
        _Quantity("pixel_at_1m_mm", "a pixel at 1 m", "mm"),
        _Quantity("wavelength_nm", "the one wavelength seen", "nm"),
    ),
    "Sensor": (
        _Quantity("sensor_width_mm", "width", "mm"),
        _Quantity("sensor_height_mm", "height", "mm"),
        _Quantity("film_width_mm", "width in the picture", "mm"),
        _Quantity("film_height_mm", "height in the picture", "mm"),
        _Quantity("pixel_pitch_um", "pixel pitch", "um"),
        _Quantity("crop_factor", "crop factor"),
        _Quantity("iso", "ISO speed"),
    ),
    "Lens": (
        _Quantity("focal_length_mm", "focal length", "mm"),
        _Quantity("equivalent_focal_length_mm", "equivalent on 36 x 24 mm", "mm"),
        _Quantity("f_number", "f-number"),
        _Quantity("entrance_pupil_mm", "entrance pupil", "mm"),
        _Quantity("aperture_diameter_mm", "diameter of the lens", "mm"),
        _Quantity("airy_disc_um", "Airy disc (550 nm)", "um"),
    ),
    "Focus": (
        _Quantity("focus_distance_m", "focus distance", "m"),
        _Quantity("image_distance_mm", "image distance", "mm"),
        _Quantity("back_focus_mm", "film behind the last surface", "mm"),
        _Quantity("magnification", "magnification"),
        _Quantity("circle_px", "sharp up to a circle of", "px", alternative=_Quantity("circle_mm", "", "mm")),
        _Quantity("near_limit_m", "near limit", "m"),
        _Quantity("far_limit_m", "far limit", "m"),
        _Quantity("depth_of_field_m", "depth of field", "m"),
        _Quantity("hyperfocal_m", "hyperfocal distance", "m"),
        _Quantity("blur_at_infinity_px", "blur at infinity", "px"),
    ),
    "Equivalent thin lens": (
        _Quantity("thin_lens_focal_length_mm", "its focal length", "mm"),
        _Quantity("thin_lens_f_number", "its f-number"),
        _Quantity("thin_lens_vfov_deg", "its vertical field of view", "deg"),
    ),
    "Light field": (
        _Quantity("views", "views"),
        _Quantity("view_columns", "angular resolution, in a row"),
        _Quantity("view_rows", "and in a column"),
        _Quantity("view_width_px", "spatial resolution, in a row", "px"),
        _Quantity("view_height_px", "and in a column", "px"),
        _Quantity("picture_width_px", "width of all side by side", "px"),
        _Quantity("picture_height_px", "height of all", "px"),
        _Quantity("film_gigabytes", "film of all", "GB"),
        _Quantity("view_spacing_mm", "from view to view", "mm"),
        _Quantity("view_spacing_up_mm", "from row to row", "mm"),
        _Quantity("view_angle_deg", "and as an angle about their middle", "deg"),
        _Quantity("baseline_mm", "from the first column to the last", "mm"),
        _Quantity("baseline_up_mm", "from the first row to the last", "mm"),
        _Quantity("convergence_distance_m", "all views alike at", "m"),
        _Quantity("disparity_at_infinity_px", "from view to view at infinity", "px"),
        _Quantity("refocus_near_m", "refocusable from", "m"),
        _Quantity("refocus_far_m", "refocusable to", "m"),
    ),
    "Microlenses": (
        _Quantity("microlens_pitch_um", "pitch", "um"),
        _Quantity("sub_image_px", "from sub-image to sub-image", "px"),
        _Quantity("seen_by_microlenses", "microlenses, across, that see a place"),
        _Quantity("microlens_focal_length_mm", "focal length", "mm"),
        _Quantity("microlens_f_number", "f-number"),
        _Quantity("microlens_airy_disc_px", "Airy disc (550 nm)", "px"),
        _Quantity("sensor_behind_microlenses_mm", "sensor behind them", "mm"),
        *(
            _Quantity(f"kind_{kind}_{name}", f"kind {kind}: {text}" if name.startswith("focal") else text, unit)
            for kind in (1, 2, 3)
            for name, text, unit in (
                ("focal_length_mm", "focal length", "mm"),
                ("sharp_m", "sharpest at", "m"),
                ("near_m", "sharp to a pixel from", "m"),
                ("far_m", "to", "m"),
            )
        ),
        _Quantity("sharp_near_m", "in all, sharp to a pixel from", "m"),
        _Quantity("sharp_far_m", "to", "m"),
        _Quantity("raw_pixels", "pixels of the sensor"),
    ),
    "Exposure": (
        _Quantity("shutter_s", "shutter", "s"),
        _Quantity("readout_s", "readout", "s"),
        _Quantity("ev100", "EV100"),
    ),
}

# Without a speed, or before metering has chosen one, EV100 is at ISO 100.
_AT_ISO_100 = {"ev100": _Quantity("ev100", "EV100 at ISO 100")}

_COLUMNS = (
    _Quantity("distance_m", "distance", "m"),
    _Quantity("circle_of_confusion_mm", "blur", "mm"),
    _Quantity("circle_of_confusion_px", "blur", "px"),
    _Quantity("streak_px", "streak", "px"),
    _Quantity("corner_streak_px", "corner's streak", "px"),
    _Quantity("skew_px", "skew", "px"),
    _Quantity("skew_deg", "skew", "deg"),
)


def _format_quantity(value: float, line: _Quantity) -> str:
    """Format a number with its unit."""
    if line.key.endswith("f_number"):
        return f"f/{compact_number(value)}" if math.isfinite(value) else "infinity"
    if line.unit == "s":
        return exposure_time(value)
    return f"{compact_number(value)} {line.unit}".rstrip() if math.isfinite(value) else compact_number(value)


def effects_text(effects: Mapping[str, Effect], *, with_left_out: bool) -> str:
    """Write the effects simulated, a line each, and those left out, or how many these are.

    Kinds that the scene has none of are one line a family.
    """
    active = {name: effect.why for name, effect in effects.items() if effect.active}
    absent = [name for name, effect in effects.items() if "." in name and effect.why.startswith("0 ")]
    absent = [name for name in absent if name not in active]
    missing = {name: effect.why for name, effect in effects.items() if name not in {*active, *absent}}
    for family, names in groupby(absent, lambda name: name.partition(".")[0]):
        missing[family] = f"none of {', '.join(name.partition('.')[2] for name in names)}"
    width = max(map(len, (*active, *missing) if with_left_out else (*active, "")))

    def listed(heading: str, reasons: Mapping[str, str]) -> str:
        lines = (_wrap(why, f"  {name:<{width}}  ", width + 4) for name, why in reasons.items())
        return f"{heading}\n{''.join(lines)}"

    if with_left_out:
        return f"{listed('Simulated', active)}\n{listed('Left out', missing)}"
    more = count(len(effects) - len(active), "effect")
    return f"{listed('Simulated', active)}  and {more} left out: --all lists them, each with a reason\n"


def _wrap(sentence: str, first: str, indent: int) -> str:
    """Write a sentence as lines, of which the first begins with `first`."""
    return textwrap.fill(sentence, _COLUMNS_OF_TEXT, initial_indent=first, subsequent_indent=" " * indent) + "\n"


def warnings_text(warnings: Sequence[str]) -> str:
    """Write the warnings, a sentence each."""
    return "Warnings\n" + "".join(_wrap(sentence, "  ", 4) for sentence in warnings) if warnings else ""


def keys_text(keys: Sequence[SceneKey]) -> str:
    """Write the keys of a scene, each with its value, and below it what it means."""
    if not keys:
        return ""
    text = "Keys of the scene, as -D takes them\n"
    for key in keys:
        value = "" if key.value is None else f" = {to_flow_yaml(key.value)}"
        note = "" if key.is_given else "  (default)" if value else "  (not given)"
        text += f"  {key.path}{value}{note}\n" + (_wrap(key.meaning, " " * 6, 6) if key.meaning else "")
    return text


def to_flow_yaml(value: Any) -> str:
    """Write a plain value as YAML on one line."""
    if isinstance(value, Mapping):
        return f"{{{', '.join(f'{key}: {to_flow_yaml(item)}' for key, item in value.items())}}}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(to_flow_yaml, value))}]"
    if isinstance(value, float):
        return repr(value).removesuffix(".0")
    return "null" if value is None else str(value).lower() if isinstance(value, bool) else str(value)


def camera_text(kind: str, camera: Mapping[str, float]) -> str:
    """Write the camera's numbers in groups; those in no group come last, by their names."""
    if "entrance_pupil_mm" in camera:
        camera = {name: value for name, value in camera.items() if name != "aperture_diameter_mm"}
    groups = _GROUPS
    if "iso" not in camera:
        groups = {
            heading: tuple(_AT_ISO_100.get(line.key, line) for line in lines) for heading, lines in groups.items()
        }
    listed = [line for lines in groups.values() for line in lines]
    known = {line.key for line in (*listed, *(line.alternative for line in listed if line.alternative is not None))}
    rest = tuple(_Quantity(name, name) for name in camera if name not in known)
    shown_lines = {
        heading: [line for line in lines if line.key in camera]
        for heading, lines in {**groups, "Further numbers": rest}.items()
    }
    width = max((len(line.words) for lines in shown_lines.values() for line in lines), default=0)
    text = f"Camera: {kind}\n"
    for heading, lines in shown_lines.items():
        text += f"  {heading}\n" if lines else ""
        for line in lines:
            both = [line, line.alternative] if line.alternative and line.alternative.key in camera else [line]
            numbers = ", ".join(_format_quantity(camera[each.key], each) for each in both)
            text += f"    {line.words:<{width}}  {numbers}\n"
    return text


_TRADE_OFF = (
    _Quantity("microlens_pitch_um", "pitch", "um"),
    _Quantity("sub_image_px", "pixels each"),
    _Quantity("view_columns", "views"),
    _Quantity("view_width_px", "view", "px"),
    _Quantity("refocus_near_m", "refocusable from", "m"),
    _Quantity("refocus_far_m", "to", "m"),
)


def trade_off_text(rows: Sequence[Mapping[str, float]], own: Mapping[str, float]) -> str:
    """Write a table of other microlenses, one a row; "" for cameras without any."""
    if not rows:
        return ""
    cells = [[f"{line.words} ({line.unit})" if line.unit else line.words for line in _TRADE_OFF]]
    for row in rows:
        cells.append([compact_number(row[line.key]) for line in _TRADE_OFF])
        cells[-1][2] += f" x {compact_number(row['view_rows'])}"
        cells[-1][3] += f" x {compact_number(row['view_height_px'])}"
    marks = ["", *("  these" if row["microlens_pitch_um"] == own["microlens_pitch_um"] else "" for row in rows)]
    lines = [f"  {row}{mark}" for row, mark in zip(align_columns(cells, left=0), marks, strict=True)]
    return "Microlenses of other sizes before the same sensor\n" + "\n".join(lines) + "\n"


def thin_lens_text(keys: Mapping[str, Any] | None) -> str:
    """Write the thin lens in place of a lens of glass, to be copied into a scene; "" without one."""
    if keys is None:
        return ""
    import yaml

    text = yaml.safe_dump(dict(keys), default_flow_style=None, sort_keys=False, width=_COLUMNS_OF_TEXT)
    return "Thin lens in its place\n" + textwrap.indent(f"camera:\n{textwrap.indent(text, '  ')}", "  ")


def objects_text(objects: Mapping[str, Mapping[str, float]]) -> str:
    """Write a table of objects, one a row, with the columns that any object has."""
    if not objects:
        return ""
    # Those with names, and those without that go farthest.
    unnamed = [name for name in objects if name.startswith("objects[")]
    left_out = sorted(unnamed, key=lambda name: -objects[name].get("streak_px", 0.0))[_MOST_LISTED:]
    rows = {name: numbers for name, numbers in objects.items() if name not in set(left_out)}
    columns = [column for column in _COLUMNS if any(column.key in numbers for numbers in rows.values())]
    cells = [["object", *(f"{column.words} ({column.unit})" for column in columns)]]
    for name, numbers in rows.items():
        cells.append([name, *(compact_number(numbers[c.key]) if c.key in numbers else "-" for c in columns)])
    lines = [f"  {row}".rstrip() for row in align_columns(cells)]
    if left_out:
        lines.append(f"  and {len(left_out)} more that move, which --json lists")
    blurred = any(column.key == "circle_of_confusion_px" for column in columns)
    meaning = "; their blur is the circle of confusion" if blurred else ""
    return f"Objects in the middle of the exposure{meaning}\n" + "\n".join(lines) + "\n"
