"""Format a logged path as text: what `rt render --pixel X,Y --sample K --debug` prints."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from raytracer.rendering.path_debug import PathTrace
from raytracer.report.wording import count


def format_path(trace: PathTrace) -> str:
    """Format a path in words and numbers, an event after the other."""
    x, y = trace.pixel
    # The last event is of the whole packet, whose other paths may be longer.
    segments = 1 + max(event["round"] for event in trace.events[:-1])
    state = "" if trace.is_finite else ", which is not finite, so it was dropped"
    lines = [f"pixel {x},{y} sample {trace.sample}: {count(segments, 'ray')} long, adds {_numbers(trace.value)}{state}"]
    for number, event in enumerate(trace.events):
        head, *rest = _FORMATTERS[event["event"]](event)
        lines += ["", head] if event["event"] in _VERTICES else [f"  {head}"]
        lines += [f"  {line}" for line in rest]
        if event["event"] in ("leaves", "emits", "arrives"):
            lines.append(f"  gathered so far {_numbers(event['gathered'])}")
        if number == trace.first_non_finite:
            lines.append(f"  ^ not finite from here on: {', '.join(event['not_finite'])}")
    return "\n".join(lines) + "\n"


_VERTICES = {"camera", "surface", "leaves", "medium", "again", "done"}


def _number(value: float) -> str:
    # No sign of zero.
    return f"{value + 0.0:.9g}"


def _numbers(values: Sequence[float]) -> str:
    return f"({', '.join(map(_number, values))})"


def _lines_of_camera(event: Mapping[str, Any]) -> list[str]:
    time = "" if event["time"] is None else f", at {_number(event['time'])} of the shutter's time"
    weights = [f"{name} {_number(event[f'{name}_weight'])}" for name in ("filter", "shutter", "camera")]
    stopped = ["stopped in the camera, so it sees nothing"] if event["camera_weight"] == 0.0 else []
    wavelength = "" if event["wavelength"] is None else f", of {_number(event['wavelength'])} nm"
    return [
        f"camera ray through film position {_numbers(event['film'])}{time}{wavelength}",
        f"from {_numbers(event['origin'])} towards {_numbers(event['direction'])}",
        f"weights: {', '.join(weights)}",
        *stopped,
    ]


def _lines_of_surface(event: Mapping[str, Any]) -> list[str]:
    material = event["material"] if event["shown"] in (None, event["material"]) else None
    shown = material or f"{event['material']}, {event['shown']}"
    through = ", which lets it straight through" if event["shown"] is None else ""
    return [
        f"ray {event['round'] + 1} meets {event['object']} ({shown}) on its {event['side']}{through}",
        f"after {_number(event['distance'])} m at {_numbers(event['point'])}",
        f"{event['primitives']} {event['primitive']}, uv {_numbers(event['uv'])}",
        f"from {_numbers(event['origin'])} towards {_numbers(event['direction'])}, pdf {_number(event['pdf'])} / sr",
        f"normal {_numbers(event['normal'])}, spawned rays start {_number(event['offset'])} m off it",
        *_shading_normal_lines(event),
        f"throughput {_numbers(event['throughput'])}{_wavelength_suffix(event)}",
    ]


def _wavelength_suffix(event: Mapping[str, Any]) -> str:
    """Name the wavelengths of three numbers, where these are not red, green and blue."""
    waves = event["wavelengths"]
    if not waves:
        return ""
    return (
        f" at {' '.join(map(_number, waves))} nm"
        if len(waves) > 1
        else f", the first of them at {_number(waves[0])} nm"
    )


def _shading_normal_lines(event: Mapping[str, Any]) -> list[str]:
    if event["smooth_normal"] == event["normal"]:
        return []
    return [f"shaded with the normal {_numbers(event['smooth_normal'])}"]


def _lines_of_leaving(event: Mapping[str, Any]) -> list[str]:
    return [
        f"ray {event['round'] + 1} leaves the scene",
        f"from {_numbers(event['origin'])} towards {_numbers(event['direction'])}, pdf {_number(event['pdf'])} / sr",
        f"throughput {_numbers(event['throughput'])}",
        f"meets radiance {_numbers(event['background'])}, weighted against light samples",
    ]


def _lines_of_medium(event: Mapping[str, Any]) -> list[str]:
    far = f"scatters after {_number(event['distance'])} m"
    if math.isinf(event["distance"]):
        far = f"comes through to what is met after {_number(event['surface_distance'])} m"
    return [
        f"ray {event['round'] + 1} in a {event['medium']} medium {far}",
        f"from {_numbers(event['origin'])} towards {_numbers(event['direction'])}, pdf {_number(event['pdf'])} / sr",
        f"weight {_numbers(event['weight'])}, throughput then {_numbers(event['throughput'])}",
    ]


def _lines_of_emission(event: Mapping[str, Any]) -> list[str]:
    return [f"it emits {_numbers(event['emitted'])}, which counts with the weight {_number(event['mis_weight'])}"]


def _lines_of_scattering(event: Mapping[str, Any]) -> list[str]:
    if not any(event["weight"]):
        return ["the path ends here: nothing is scattered"]
    head = f"scattered towards {_numbers(event['direction'])}, pdf {_number(event['pdf'])} / sr"
    survival = f"survives with probability {_number(event['survival'])}" if event["survival"] else "ends here"
    then = f"{_numbers(event['throughput'])}{_wavelength_suffix(event)}"
    weights = f"weight {_numbers(event['weight'])}, throughput then {then}; {survival}"
    normal = [f"  as shaded with the normal {_numbers(event['normal'])}"] if any(event["normal"]) else []
    return [head, *normal, f"  {weights}"]


def _lines_of_aiming(event: Mapping[str, Any]) -> list[str]:
    return [
        f"aims at a light {_number(event['distance'])} m away, towards {_numbers(event['direction'])}",
        f"  pdf {_number(event['pdf'])} / sr, of a path {_number(event['path_pdf'])} / sr",
        f"  weight {_number(event['mis_weight'])}, light over pdf {_numbers(event['light_weight'])}",
        f"  scattered that way {_numbers(event['value'])} / sr; would bring {_numbers(event['brings'])}",
    ]


def _lines_of_arrival(event: Mapping[str, Any]) -> list[str]:
    return [f"nothing is in the way of the light: {_numbers(event['brings'])}"]


def _lines_of_block(event: Mapping[str, Any]) -> list[str]:
    if event["object"] is None:
        return ["something is in the way of the light"]
    return [f"{event['object']} is in the way of the light, after {_number(event['distance'])} m"]


def _lines_of_passing(event: Mapping[str, Any]) -> list[str]:
    return [f"{event['object']} lets the light through, after {_number(event['distance'])} m"]


def _lines_of_return(event: Mapping[str, Any]) -> list[str]:
    return ["once more from the camera, for the next wavelength: what it meets counts from where wavelengths part"]


def _lines_of_end(event: Mapping[str, Any]) -> list[str]:
    gathered, value = _numbers(event["gathered"]), _numbers(event["value"])
    times = f"times {_number(event['factor'])}"
    if event["wavelength"] is not None:
        times = f"as light of {_number(event['wavelength'])} nm {times}"
    if event["not_finite"] or event["value"] == event["unclamped"]:
        return [f"gathered {gathered}, {times} is what the sample adds: {value}"]
    return [f"gathered {gathered}, {times} is {_numbers(event['unclamped'])}; after the clamp it adds {value}"]


_FORMATTERS = {
    "camera": _lines_of_camera,
    "surface": _lines_of_surface,
    "leaves": _lines_of_leaving,
    "medium": _lines_of_medium,
    "emits": _lines_of_emission,
    "scatters": _lines_of_scattering,
    "aims": _lines_of_aiming,
    "arrives": _lines_of_arrival,
    "blocked": _lines_of_block,
    "passes": _lines_of_passing,
    "again": _lines_of_return,
    "done": _lines_of_end,
}
