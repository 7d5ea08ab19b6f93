"""Warnings for photographers: where the picture differs from that of a real camera, or from what may be meant.

References: Born, Wolf 1999, "Principles of Optics", 7th ed.; ISO 12232:2019 (the speed of a sensor).
"""

import math
from collections.abc import Iterator, Mapping

from raytracer.analysis.explain.camera_numbers import CameraView
from raytracer.core.shutter.table import TICK
from raytracer.core.shutter.timing import Timing
from raytracer.report.wording import compact_number, exposure_time
from raytracer.scene.pack.lights import lights_of
from raytracer.scene.spec import SceneSpec

_FASTEST_F_NUMBER = 0.5
"""Least f-number of a lens in air that is free of coma: 1 / (2 sin 90 deg), Born & Wolf 1999, sec. 4.8.2."""

_LONGEST_SHUTTER = 30.0
"""Longest exposure time (s) on the dials of cameras; longer ones are held open by hand."""

_SHORTEST_FOCAL_LENGTH = 1.0
"""Least focal length (mm) of any camera's lens; those of telephones have a few millimetres."""

# Edge at which the readout begins, and the side along which it goes.
_EDGES = {"down": "top", "up": "bottom", "right": "left", "left": "right"}
_SIDES = {"down": "height", "up": "height", "right": "width", "left": "width"}


def photographic_warnings(view: CameraView, numbers: Mapping[str, float]) -> list[str]:
    """List one sentence for each warning; `numbers` are those of the camera."""
    spec = view.spec
    return [*_optics(view, numbers), *_units(spec), *_highlights(spec), *_flashes(spec)]


def _optics(view: CameraView, numbers: Mapping[str, float]) -> Iterator[str]:
    """Warn where an ideal lens differs from a real one."""
    airy, pitch, f_number = (numbers.get(name, math.nan) for name in ("airy_disc_um", "pixel_pitch_um", "f_number"))
    if airy > pitch:
        working = numbers["image_distance_mm"] / numbers["entrance_pupil_mm"]
        yield (
            f"diffraction is left out: at the working f-number f/{compact_number(working)} the Airy disc of green "
            f"light (550 nm) is {compact_number(airy)} um wide, and a pixel {compact_number(pitch)} um, so a real "
            "picture would be softer"
        )
    if f_number < _FASTEST_F_NUMBER:
        yield (
            f"f/{compact_number(f_number)} is faster than f/{_FASTEST_F_NUMBER:g}, which no lens in air can be: the "
            "ideal lens has no such limit"
        )
    if view.pupil() == 0.0 and math.isfinite(f_number):
        yield (
            f"the aperture of f/{compact_number(f_number)} sets the exposure but blurs nothing, since a "
            f"{view.spec.camera.type} camera sees through a point"
        )


def _units(spec: SceneSpec) -> Iterator[str]:
    """Warn of numbers that look as if they were written in another unit."""
    camera = spec.camera
    seconds, is_photograph = camera.timing().seconds(), camera.iso_speed() is not None or camera.exposure is not None
    if is_photograph and seconds > _LONGEST_SHUTTER:
        long = compact_number(seconds)
        yield f"the shutter is open for {long} s, longer than cameras offer: was 1/{long} s meant?"
    for key in ("focal_length", "equivalent_focal_length"):
        length = getattr(camera, key, None)
        if length is not None and length < _SHORTEST_FOCAL_LENGTH:
            given = compact_number(length)
            yield f"{key} is {given} mm, shorter than any camera's, and a plain number is mm: was {given} m meant?"


def _highlights(spec: SceneSpec) -> Iterator[str]:
    """Warn of a sensor that is full before it has given its largest number."""
    sensor, speed, push = spec.camera.simulated_sensor(), spec.camera.iso_speed(), spec.camera.exposure_compensation
    if sensor is None or speed is None or not push:
        return
    pulled = speed * math.exp2(push)
    if pulled < sensor.base_iso:
        yield (
            f"exposure_compensation takes the speed to ISO {compact_number(pulled)}, below the sensor's base_iso of "
            f"{compact_number(sensor.base_iso)}: its wells are full at {compact_number(pulled / sensor.base_iso)} of "
            "white, where highlights end"
        )


# ---- Flashes


def _flashes(spec: SceneSpec) -> Iterator[str]:
    """Warn of flashes of which the shutter keeps light from the film, or from a part of it."""
    timing = spec.camera.timing()
    pulses = {f"lights[{number}]": light.pulse(timing) for number, light in enumerate(lights_of(spec))}
    shining = {name: pulse for name, pulse in pulses.items() if pulse is not None}
    for name, (begin, end) in shining.items():
        flash = "the flash" if len(shining) == 1 else f"the flash {name}"
        yield from (
            f"{flash} shines for {exposure_time(end - begin)}, {what}" for what in _shutter_clipping(timing, begin, end)
        )


def _shutter_clipping(timing: Timing, begin: float, end: float) -> Iterator[str]:
    """Say how the shutter clips a flash that shines between two times of the scene (s), if it does."""
    span, (opened, closing) = timing.span(), timing.full()
    tick = TICK * (span.close - span.open)
    if end <= span.open or begin >= span.close:
        yield "but while the shutter is closed: none of its light is in the picture"
        return

    # Lines begin to open from 0 to `readout` after the first, and are lit in full or in part if they do between these.
    full = max(0.0, end - closing), min(timing.readout, begin - opened)
    part = max(0.0, begin - timing.closes), min(timing.readout, end - timing.opens)
    if full[0] <= tick and full[1] >= timing.readout - tick:
        return
    if timing.readout == 0.0:
        open_for = max(0.0, min(end, closing) - max(begin, opened))
        most = 1.0 if timing.profile is None else max(transmission for _, transmission in timing.profile)
        lost = 1.0 - timing.transmitted(begin, end) / (most * (end - begin))
        yield (
            f"of which the shutter is fully open for {exposure_time(open_for)}: "
            f"{compact_number(round(100.0 * lost, 1))} % of its light is lost"
        )
        return
    lit = _lit_band(timing, part, full, tick)
    yield f"while the shutter is not open everywhere: it lights {lit}{_sync_hint(timing, begin, end)}"


def _lit_band(timing: Timing, part: tuple[float, float], full: tuple[float, float], tick: float) -> str:
    """Say which lines are lit, and which in full."""
    lit, whole = (f"{_percent(first, timing)} to {_percent(last, timing)} %" for first, last in (part, full))
    side, edge = _SIDES[timing.direction], _EDGES[timing.direction]
    where = f"{lit} of the {side} from the {edge}"
    if full[1] - full[0] <= tick:
        return f"{where}, none of it in full"
    return where if lit == whole else f"{where}, and {whole} in full"


def _percent(delay: float, timing: Timing) -> str:
    return f"{100.0 * delay / timing.readout:.0f}"


def _sync_hint(timing: Timing, begin: float, end: float) -> str:
    """Say for how long the shutter must be open to light all of the picture; "" if it is long enough."""
    opened, closing = timing.full()
    needed = timing.readout + (end - begin)
    if closing - opened >= needed:
        return ""
    return f"; all of it can be lit by a shutter that is fully open for {exposure_time(needed)} or longer"
