"""The camera's values that can be changed while it is looked through, and what is sharp in it."""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from raytracer.analysis.explain.camera_numbers import CameraView, depth_of_field
from raytracer.scene.pack.scene import PackedScene
from raytracer.scene.spec import SceneSpec

FOCUS = ("focus_distance", "focus_on", "focus_at")
"""Keys of which one says where the plane of focus is."""


class Range(NamedTuple):
    """The values that a slider offers; of most, as in photography, equal steps are equal ratios."""

    label: str
    unit: str
    low: float
    high: float
    is_logarithmic: bool = True


RANGES: Mapping[str, Range] = {
    "focus_distance": Range("focus distance", "m", 0.01, 1000.0),
    "f_number": Range("f-number", "", 0.7, 45.0),
    "aperture": Range("aperture", "mm", 0.1, 200.0),
    "defocus_angle": Range("defocus angle", "deg", 0.01, 30.0),
    "focal_length": Range("focal length", "mm", 4.0, 800.0),
    "vfov": Range("field of view", "deg", 2.0, 140.0),
    "shutter": Range("shutter", "s", 1.0 / 8000.0, 30.0),
    "iso": Range("ISO", "", 25.0, 102400.0),
    "exposure_compensation": Range("compensation", "EV", -5.0, 5.0, is_logarithmic=False),
}
"""Sliders by key of the camera, in their order."""


def controls(packed: PackedScene) -> list[dict[str, Any]]:
    """List the sliders of a scene's camera: those keys that it has as numbers, and its focus."""
    camera: Any = packed.spec.camera
    result = []
    for key, wanted in RANGES.items():
        value = getattr(camera, key, None)
        if key == "focus_distance" and hasattr(camera, "focus_at"):
            value = camera.plane_of_focus()
        elif key not in camera.model_fields_set:
            continue
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            continue
        if wanted.is_logarithmic and value <= 0.0:
            continue
        low, high = min(wanted.low, value), max(wanted.high, value)
        if key == "focus_distance":
            # Scenes are of all sizes: a decade below that of the value, its own, and one above.
            decade = math.floor(math.log10(value))
            low, high = 10.0 ** (decade - 1), 10.0 ** (decade + 2)
        result.append({"key": key, "value": value, **wanted._asdict(), "low": low, "high": high})
    return result


def camera_overrides(spec: SceneSpec, values: Mapping[str, Any]) -> dict[str, Any]:
    """Make overrides of values of the camera; what says its focus otherwise is taken out."""
    camera: Any = spec.camera
    overrides = {f"camera.{key}": value for key, value in values.items()}
    if any(key in FOCUS for key in values):
        for key in FOCUS:
            if key not in values and getattr(camera, key, None) is not None:
                overrides[f"camera.{key}"] = None
    return overrides


def sharpness(packed: PackedScene) -> dict[str, float]:
    """Compute the distances (m) of the plane of focus and of the limits of what is sharp, as `rt explain` gives them.

    It is empty for a camera that blurs nothing.
    """
    if not hasattr(packed.spec.camera, "describe"):
        return {}
    view = CameraView(packed.spec, packed.scene.camera, packed.shift)
    numbers = depth_of_field(view, None)
    names = {"near_limit_m": "near", "far_limit_m": "far", "circle_mm": "circle_mm", "circle_px": "circle_px"}
    found = {short: numbers[name] for name, short in names.items() if name in numbers}
    return {"focus": view.focus(), "pupil_mm": 1e3 * view.pupil(), **found} if found else {}
