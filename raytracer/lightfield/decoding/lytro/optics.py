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
from dataclasses import dataclass, replace

from raytracer.film.light_field.resampling import Resampler
from raytracer.film.light_field.views import Plane, Views
from raytracer.lightfield.decoding.lytro.metadata import PhotoMetadata
from raytracer.lightfield.decoding.microlens_grid import Grid, Optics
from raytracer.lightfield.formats.geometry import regular_grid
from raytracer.schema.units import METRES_PER_MILLIMETRE

_MICROMETRES = 1e6


@dataclass(frozen=True)
class PupilOptics(Optics):
    """Optics of a camera whose exit pupil is known.

    exit_pupil : distance from the microlenses (m); None for a thin lens.
    """

    exit_pupil: float | None = None

    def views(self, grid: Grid, resampler: Resampler) -> Views:
        """Compute the geometry of the views; see `Optics.views`."""
        if self.missing or self.exit_pupil is None:
            return super().views(grid, resampler)
        assert self.pixel_pitch is not None
        assert self.focal_length is not None
        focal_length, pitch = self.focal_length * METRES_PER_MILLIMETRE, self.pixel_pitch / _MICROMETRES
        image = self._equivalent_image(focal_length, self.exit_pupil)
        if self.microlens_distance is not None:
            behind = self.microlens_distance / _MICROMETRES
            on_lens = pitch * image / behind
        else:
            assert self.f_number is not None
            on_lens = focal_length / self.f_number / grid.diameter
            behind = pitch * image / on_lens
        tangent = pitch / (1.0 + behind / self.exit_pupil) / image
        half = 0.5 * resampler.pixel
        left = (resampler.first[0] - half - 0.5 * resampler.raw_width) * tangent
        top = (0.5 * resampler.raw_height - resampler.first[1] + half) * tangent
        return Views(
            regular_grid(resampler.count, resampler.count) * on_lens,
            Plane(resampler.pixel * tangent, left, top),
            resampler.width,
            resampler.height,
            inverse_focus=0.0 if math.isinf(self.focus_distance) else 1.0 / self.focus_distance,
            cell=(on_lens, on_lens),
            aperture=grid.diameter * on_lens if self.f_number is None else focal_length / self.f_number,
            focal_length=self.focal_length,
        )

    def _equivalent_image(self, focal_length: float, exit_pupil: float) -> float:
        """Compute the image distance of the thin lens whose rays are those at the entrance pupil (m)."""
        if math.isinf(self.focus_distance):
            return focal_length
        # The distance is f^2 / d + f^2 / (z - d) for the image's d behind the focal point: a quadratic equation.
        product = focal_length * focal_length * exit_pupil / self.focus_distance
        square = exit_pupil * exit_pupil - 4.0 * product
        if not square > 0.0:
            raise ValueError(f"is too near for a lens of {focal_length:g} m with its exit pupil {exit_pupil:g} m away")
        away = 2.0 * product / (exit_pupil + math.copysign(math.sqrt(square), exit_pupil))
        return focal_length + away * focal_length / (exit_pupil - away)


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
    """Complete the optics that are known by those of the metadata; `focus_distance` of `known` is inf if not known."""

    def scaled(value: float | None, factor: float) -> float | None:
        return None if value is None else factor * value

    lens, below = metadata.lens, metadata.microlenses
    made = PupilOptics(
        pixel_pitch=known.pixel_pitch or scaled(below.pixel_pitch, _MICROMETRES),
        focal_length=known.focal_length or scaled(lens.focal_length, 1.0 / METRES_PER_MILLIMETRE),
        f_number=known.f_number or lens.f_number,
        microlens_distance=known.microlens_distance or scaled(below.distance, _MICROMETRES),
        focus_distance=known.focus_distance,
        exit_pupil=lens.exit_pupil,
    )
    if math.isinf(known.focus_distance):
        made = replace(made, focus_distance=focus_from_metadata(metadata))
    return made
