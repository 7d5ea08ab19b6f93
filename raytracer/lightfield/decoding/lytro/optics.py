"""Optics of a Lytro camera, by its metadata: from pixels to places on the lens, and slopes.

With the focal length f, the image at the distance v behind the rear principal plane, and the exit pupil at z before the
microlenses, the pupils' magnification is P = (z - (v - f)) / f.  The distances are measured from the entrance pupil:
what the microlenses are focused on is at f^2 / (v - f) + f / P, and where pixels see through the entrance pupil, and in
which direction, is as behind a thin lens with its image at f + (v - f) / P.  P = 1 is a thin lens; P is large behind
a nearly telecentric one, as the F01's.

v - f = L N p, with the lens's `infinityLambda` L, f-number N and the pitch p of the microlenses: light from infinity is
spread over L microlenses.

References: Born, Wolf, "Principles of Optics", sec. 4.3-4.4 (Newton's form of the lens equation; pupils); for
`infinityLambda`, the converters of photographs' depth maps that use it so.
"""

import math
from dataclasses import dataclass

from raytracer.lightfield.decoding.lytro.metadata import PhotoMetadata
from raytracer.lightfield.decoding.microlens_grid import Optics
from raytracer.schema.units import METRES_PER_MILLIMETRE

_MICROMETRES = 1e6


@dataclass(frozen=True)
class PupilOptics(Optics):
    """Optics of a camera whose exit pupil is known.

    exit_pupil : distance from the microlenses (m); None for a thin lens.
    """

    exit_pupil: float | None = None

    def _image_and_pupil(self, focal_length: float, inverse_focus: float) -> tuple[float, float]:
        """Compute the image distance of the thin lens whose rays are those at the entrance pupil, and `exit_pupil`.

        Raises ValueError: the lens makes no image of what is so near.
        """
        if self.exit_pupil is None:
            return super()._image_and_pupil(focal_length, inverse_focus)
        if inverse_focus == 0.0:
            return focal_length, self.exit_pupil
        # The distance is f^2 / d + f^2 / (z - d) for the image's d behind the focal point: a quadratic equation.
        exit_pupil = self.exit_pupil
        product = focal_length * focal_length * exit_pupil * inverse_focus
        square = exit_pupil * exit_pupil - 4.0 * product
        if not square > 0.0:
            raise ValueError(
                f"the focus distance, {1.0 / inverse_focus:g} m, is too near for a lens of {focal_length:g} m with its "
                f"exit pupil {exit_pupil:g} m away"
            )
        away = 2.0 * product / (exit_pupil + math.copysign(math.sqrt(square), exit_pupil))
        return focal_length + away * focal_length / (exit_pupil - away), exit_pupil


def focus_from_metadata(metadata: PhotoMetadata) -> float:
    """Compute the distance from the entrance pupil of what is sharp on the microlenses (m); inf if not known."""
    lens, pitch = metadata.lens, metadata.microlenses.pitch
    if None in (lens.focal_length, lens.f_number, lens.infinity_lambda, pitch):
        return math.inf
    assert lens.focal_length is not None
    assert lens.f_number is not None
    assert lens.infinity_lambda is not None
    assert pitch is not None
    focal_length, away = lens.focal_length, lens.infinity_lambda * lens.f_number * pitch
    if not away > 0.0:
        return math.inf
    square = focal_length * focal_length
    pupil = focal_length + away if lens.exit_pupil is None else lens.exit_pupil
    distance = square / away + (square / (pupil - away) if pupil != away else math.inf)
    return distance if distance > 0.0 else math.inf


def optics_from_metadata(metadata: PhotoMetadata, known: Optics) -> PupilOptics:
    """Complete the optics that are known by those of the metadata."""

    def scaled(value: float | None, factor: float) -> float | None:
        return None if value is None else factor * value

    lens, below = metadata.lens, metadata.microlenses
    focus = known.focus_distance
    return PupilOptics(
        pixel_pitch=known.pixel_pitch or scaled(below.pixel_pitch, _MICROMETRES),
        focal_length=known.focal_length or scaled(lens.focal_length, 1.0 / METRES_PER_MILLIMETRE),
        f_number=known.f_number or lens.f_number,
        microlens_distance=known.microlens_distance or scaled(below.distance, _MICROMETRES),
        focus_distance=focus_from_metadata(metadata) if focus is None else focus,
        exit_pupil=lens.exit_pupil,
    )
