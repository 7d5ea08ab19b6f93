"""Make the pages of the lecture that can be played with; the site has them beside its own (`conf.py`)."""

from pathlib import Path
from typing import Any

from PIL import Image

from raytracer.optics.sensor_formats import SENSORS
from raytracer.report.page import data_uri, page

STRIPS = Path(__file__).with_name("gallery") / "depth_of_field.webp"
"""The targets of docs/depth_of_field.yaml as rendered by make_strips.py, one strip below the other: for each aperture
of `STRIP_APERTURES`, each focus of `STRIP_FOCUSES`."""

STRIP_APERTURES = tuple(2.0**k for k in range(7))
"""Diameters of the opening (mm)."""

STRIP_FOCUSES = tuple(0.25 * k for k in range(11))
"""Inverse distances of the focus (1/m)."""


def _setting(label: str, low: float, high: float, step: float, value: float) -> dict[str, Any]:
    return {"label": label, "low": low, "high": high, "step": step, "value": value, "unit": "mm"}


SETTINGS = {
    "subject": _setting("distance of the object", 30.0, 280.0, 1.0, 180.0),
    "object_height": _setting("height of the object", 5.0, 60.0, 1.0, 40.0),
    "focal_length": _setting("focal length", 20.0, 100.0, 1.0, 60.0),
    "diameter": _setting("diameter of the lens", 1.0, 100.0, 1.0, 60.0),
    "film": _setting("distance of the film", 20.0, 220.0, 0.5, 110.0),
}
"""Lengths (mm) that the bench of the thin lens starts with, and their ranges."""


def thin_lens() -> bytes:
    """Make the page of the thin lens."""
    return page("thin_lens", "The thin lens", {"settings": SETTINGS}, parts=("bench",))


DEPTH_SETTINGS = {
    "focal_length": _setting("focal length", 12.0, 200.0, 1.0, 50.0),
    # Full stops: f/2^(k/2).
    "stop": _setting("f-number", 1.0, 10.0, 1.0, 3.0),
    "focus": _setting("focus", 0.0, 2.5, 0.05, 1.0),
    "part": _setting("allowed circle", 500.0, 6000.0, 100.0, 1500.0),
}
"""Settings of the page of depth of field; the focus is an inverse distance (1/m), the circle a part of the diagonal."""


def depth_of_field() -> bytes:
    """Make the page of depth of field, with the strips that were rendered for it."""
    with Image.open(STRIPS) as picture:
        width, height = picture.size
    count = len(STRIP_APERTURES) * len(STRIP_FOCUSES)
    strip = {
        "image": data_uri(STRIPS.read_bytes(), "image/webp"),
        "width": width,
        "height": height // count,
        "count": count,
        "aperture": STRIP_APERTURES,
        "focus": STRIP_FOCUSES,
    }
    data = {"settings": DEPTH_SETTINGS, "sensors": SENSORS, "sensor": "full_frame", "strip": strip}
    return page("depth_of_field", "Depth of field", data, parts=("bench",))


PAGES = {"thin_lens": thin_lens, "depth_of_field": depth_of_field}
