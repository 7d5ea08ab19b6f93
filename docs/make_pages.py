"""Make the pages of the lecture that can be played with; the site has them beside its own (`conf.py`)."""

from typing import Any

from raytracer.report.page import page


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
    return page("thin_lens", "The thin lens", {"settings": SETTINGS})


PAGES = {"thin_lens": thin_lens}
