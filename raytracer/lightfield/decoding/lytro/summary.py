"""Summary of a photograph's metadata, as `rt lightfield info` prints it."""

import math
from collections.abc import Iterable

from raytracer.lightfield.decoding.lytro.metadata import FILTERS
from raytracer.lightfield.decoding.lytro.optics import focus_from_metadata
from raytracer.lightfield.decoding.lytro.photo import PhotoFile


def summarize(photo: PhotoFile) -> dict[str, str]:
    """Say what is known of a photograph: texts by what they are about."""
    told = photo.metadata
    lens, below = told.lens, told.microlenses
    focus = focus_from_metadata(told)

    def levels(numbers: tuple[float, ...]) -> str:
        if len(set(numbers)) == 1:
            return f"{numbers[0]:g}"
        return _join(f"{number:g} of {name}" for number, name in zip(numbers, FILTERS, strict=True))

    lines = {
        "camera": _join((told.camera, told.serial), " "),
        "taken": told.time,
        "raw picture": f"{told.width} x {told.height} pixels of {told.bits} bits, {told.endianness}-endian",
        "colour filters": told.bayer or "none",
        "levels": f"{levels(told.black)} is black, {levels(told.white)} white",
        "white picture": "in the file" if photo.has_white else "not in the file",
    }
    if told.gains is not None:
        lines["white balance"] = "{:.4g} red, {:.4g} green, {:.4g} blue".format(*told.gains)
    lines["lens"] = _join(
        (
            _told(lens.focal_length, "{:.4g} mm", 1e3),
            _told(lens.f_number, "f/{:.3g}"),
            _told(lens.zoom_step, "zoom step {:g}"),
            _told(lens.focus_step, "focus step {:g}"),
            _told(lens.exit_pupil, "exit pupil {:.4g} mm away", 1e3),
        )
    )
    lines["focused at"] = "infinity" if math.isinf(focus) else f"{focus:.4g} m"
    lines["microlenses"] = _join(
        (
            _told(below.pitch, "{:.4g} um apart", 1e6),
            _told(below.distance, "{:.4g} um before the sensor", 1e6),
            _told(below.pixel_pitch, "pixels of {:.4g} um", 1e6),
        )
    )
    if told.exposure is not None:
        lines["exposure"] = f"{1e3 * told.exposure:.4g} ms"
    return {name: text for name, text in lines.items() if text}


def _told(value: float | None, text: str, factor: float = 1.0) -> str:
    return "" if value is None else text.format(factor * value)


def _join(parts: Iterable[str], between: str = ", ") -> str:
    return between.join(part for part in parts if part)
