"""The two curtains of a focal-plane shutter, on their way over the film."""

from docs.diagrams.base import BLUE, INK, SENSOR, Sheet
from raytracer.core.shutter.table import Shutter
from raytracer.core.shutter.timing import Timing, pack_shutter

TRAVEL = 1 / 250
"""Time (s) that a curtain takes from one edge of the film to the other."""

TIMES = {"1/60 s": 1 / 60, "1/250 s": 1 / 250, "1/2000 s": 1 / 2000}
"""Exposure times (s)."""

_WIDTH, _HEIGHT, _STEP, _ROW = 3.0, 2.0, 3.5, 3.3
_MOMENTS = 5
LIGHT = "#f6d488"
_LINES = 1000


def focal_plane(seconds: float) -> Shutter:
    """Pack a focal-plane shutter that exposes each place for so long (s)."""
    timing = Timing(0.0, seconds, readout=TRAVEL, curtain="focal_plane")
    return pack_shutter(timing, _LINES, _LINES)


def uncovered(seconds: float, time: float) -> tuple[float, float]:
    """Find which part of the film, from 0 at the edge that is first to 1, two curtains leave open at a time (s)."""
    shutter = focal_plane(seconds)
    part = time / (shutter.close - shutter.open)
    # The first curtain is where places begin to be exposed, the second one where they end.
    first, second = part / shutter.scan.delay, (part - shutter.scan.width) / shutter.scan.delay
    return min(1.0, max(0.0, second)), min(1.0, max(0.0, first))


def slit() -> Sheet:
    """Draw the film behind two curtains at five moments of three exposures."""
    height = _ROW * len(TIMES)
    sheet = Sheet((-2.6, _STEP * _MOMENTS), (-1.3, height - 0.9))
    for row, (words, seconds) in enumerate(TIMES.items()):
        bottom = (len(TIMES) - 1 - row) * _ROW
        sheet.text((-1.4, bottom + 0.5 * _HEIGHT), words, INK, 12)
        for moment in range(_MOMENTS):
            time = (moment + 0.5) / _MOMENTS * (seconds + TRAVEL)
            _film(sheet, (_STEP * moment, bottom), *uncovered(seconds, time))
            sheet.text((_STEP * moment + 0.5 * _WIDTH, bottom - 0.35), f"{1e3 * time:.2f} ms", size=9.0)
    left = -0.1
    for x, color, text in (
        (left, SENSOR, "first curtain"),
        (left + 4.3, LIGHT, "open to the light"),
        (left + 9.2, BLUE, "second curtain"),
    ):
        sheet.box((x, -1.2), (0.5, 0.3), color)
        sheet.text((x + 0.7, -1.05), text, ha="left")
    return sheet


def _film(sheet: Sheet, corner: tuple[float, float], second: float, first: float) -> None:
    """Draw a film: the first curtain is below what is open, and the second one above."""
    x, y = corner
    top = y + _HEIGHT
    sheet.box((x, y), (_WIDTH, _HEIGHT), LIGHT)
    sheet.box((x, y), (_WIDTH, (1.0 - first) * _HEIGHT), SENSOR)
    sheet.box((x, top - second * _HEIGHT), (_WIDTH, second * _HEIGHT), BLUE)
    sheet.box((x, y), (_WIDTH, _HEIGHT), "none", INK, linewidth=1.2)


DIAGRAMS = {"slit": slit}
