"""Format a logged path as text: what `rt render --pixel X,Y --sample K --debug` prints."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from raytracer.rendering.path_debug import PathTrace
from raytracer.report.wording import count

_RAY = "from {origin} towards {direction}, pdf {pdf} / sr"

# Lines of each event, by the names of its values and of `_phrases`; empty ones are left out.
_TEMPLATES: Mapping[str, tuple[str, ...]] = {
    "camera": (
        "camera ray through film position {film}{at_time}{of_wavelength}",
        "from {origin} towards {direction}",
        "weights: filter {filter_weight}, shutter {shutter_weight}, camera {camera_weight}",
        "{stopped}",
    ),
    "surface": (
        "ray {ray} meets {object} ({materials}) on its {side}{through}",
        "after {distance} m at {point}",
        "{primitives} {primitive}, uv {uv}",
        _RAY,
        "normal {normal}, spawned rays start {offset} m off it",
        "{shaded}",
        "throughput {throughput}{at_wavelengths}",
    ),
    "leaves": (
        "ray {ray} leaves the scene",
        _RAY,
        "throughput {throughput}",
        "meets radiance {background}, weighted against light samples",
    ),
    "medium": ("ray {ray} in a {medium} medium {reach}", _RAY, "weight {weight}, throughput then {throughput}"),
    "emits": ("it emits {emitted}, which counts with the weight {mis_weight}",),
    "scatters": (
        "scattered towards {direction}, pdf {pdf} / sr",
        "{as_shaded}",
        "  weight {weight}, throughput then {throughput}{at_wavelengths}; {survives}",
    ),
    "absorbed": ("the path ends here: nothing is scattered",),
    "aims": (
        "aims at a light {distance} m away, towards {direction}",
        "  pdf {pdf} / sr, of a path {path_pdf} / sr",
        "  weight {mis_weight}, light over pdf {light_weight}",
        "  scattered that way {value} / sr; would bring {brings}",
    ),
    "arrives": ("nothing is in the way of the light: {brings}",),
    "blocked": ("{object} is in the way of the light, after {distance} m",),
    "blocked somewhere": ("something is in the way of the light",),
    "passes": ("{object} lets the light through, after {distance} m",),
    "again": ("once more from the camera, for the next wavelength: what it meets counts from where wavelengths part",),
    "done": ("gathered {gathered}, {times} is what the sample adds: {value}",),
    "clamped": ("gathered {gathered}, {times} is {unclamped}; after the clamp it adds {value}",),
}

_VERTICES = {"camera", "surface", "leaves", "medium", "again", "done"}


def format_path(trace: PathTrace) -> str:
    """Format a path in words and numbers, an event after the other."""
    x, y = trace.pixel
    # The last event is of the whole packet, whose other paths may be longer.
    segments = 1 + max(event["round"] for event in trace.events[:-1])
    state = "" if trace.is_finite else ", which is not finite, so it was dropped"
    lines = [f"pixel {x},{y} sample {trace.sample}: {count(segments, 'ray')} long, adds {_text(trace.value)}{state}"]
    for number, event in enumerate(trace.events):
        words = {name: _text(value) for name, value in event.items()} | _phrases(event)
        head, *rest = (template.format_map(words) for template in _TEMPLATES[_template_name(event)])
        lines += ["", head] if event["event"] in _VERTICES else [f"  {head}"]
        lines += [f"  {line}" for line in rest if line]
        if event["event"] in ("leaves", "emits", "arrives"):
            lines.append(f"  gathered so far {words['gathered']}")
        if number == trace.first_non_finite:
            lines.append(f"  ^ not finite from here on: {', '.join(event['not_finite'])}")
    return "\n".join(lines) + "\n"


def _template_name(event: Mapping[str, Any]) -> str:
    name: str = event["event"]
    if name == "scatters" and not any(event["weight"]):
        return "absorbed"
    if name == "blocked" and event["object"] is None:
        return "blocked somewhere"
    if name == "done" and not event["not_finite"] and event["value"] != event["unclamped"]:
        return "clamped"
    return name


def _text(value: Any) -> str:
    """Format a number, without a sign of zero, or numbers; names as they are."""
    if isinstance(value, Sequence) and not isinstance(value, str):
        return f"({', '.join(map(_text, value))})"
    return f"{value + 0.0:.9g}" if isinstance(value, float) else str(value)


def _phrases(event: Mapping[str, Any]) -> dict[str, str]:
    """Write the phrases of an event that it has only under some condition."""
    match event["event"]:
        case "camera":
            time, wavelength = event["time"], event["wavelength"]
            return {
                "at_time": "" if time is None else f", at {_text(time)} of the shutter's time",
                "of_wavelength": "" if wavelength is None else f", of {_text(wavelength)} nm",
                "stopped": "" if event["camera_weight"] != 0.0 else "stopped in the camera, so it sees nothing",
            }
        case "surface":
            material, shown, smooth = event["material"], event["shown"], event["smooth_normal"]
            return {
                "ray": str(event["round"] + 1),
                "materials": material if shown in (None, material) else f"{material}, {shown}",
                "through": ", which lets it straight through" if shown is None else "",
                "shaded": "" if smooth == event["normal"] else f"shaded with the normal {_text(smooth)}",
                "at_wavelengths": _wavelength_suffix(event["wavelengths"]),
            }
        case "leaves":
            return {"ray": str(event["round"] + 1)}
        case "medium":
            far = f"scatters after {_text(event['distance'])} m"
            if math.isinf(event["distance"]):
                far = f"comes through to what is met after {_text(event['surface_distance'])} m"
            return {"ray": str(event["round"] + 1), "reach": far}
        case "scatters":
            normal, survival = event["normal"], event["survival"]
            return {
                "as_shaded": f"  as shaded with the normal {_text(normal)}" if any(normal) else "",
                "at_wavelengths": _wavelength_suffix(event["wavelengths"]),
                "survives": f"survives with probability {_text(survival)}" if survival else "ends here",
            }
        case "done":
            wave = "" if event["wavelength"] is None else f"as light of {_text(event['wavelength'])} nm "
            return {"times": f"{wave}times {_text(event['factor'])}"}
    return {}


def _wavelength_suffix(waves: Sequence[float]) -> str:
    """Name the wavelengths of three numbers, where these are not red, green and blue."""
    if len(waves) > 1:
        return f" at {' '.join(map(_text, waves))} nm"
    return f", the first of them at {_text(waves[0])} nm" if waves else ""
