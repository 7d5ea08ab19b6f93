"""Optics of the camera of a raw picture, without which views have no metres."""

import math
from dataclasses import dataclass

from raytracer.film.light_field.resampling import Resampler
from raytracer.film.light_field.views import Plane, Views
from raytracer.lightfield.decoding.microlens_grid import Grid
from raytracer.lightfield.formats.geometry import regular_grid
from raytracer.schema.units import METRES_PER_MILLIMETRE

_METRES_PER_MICROMETRE = 1e-6


@dataclass(frozen=True)
class Optics:
    """Optics of a camera with microlenses at the distance of the image, as far as they are known.

    Attributes
    ----------
    pixel_pitch : distance of the sensor's pixels (um).
    focal_length : of the main lens (mm).
    f_number : of the main lens.
    microlens_distance : from the microlenses to the sensor (um), which is their focal length; by default what makes
        the aperture of the f-number as large as sub-images are.
    focus_distance : of the plane that is sharp on the microlenses, from the lens (m).
    """

    pixel_pitch: float | None = None
    focal_length: float | None = None
    f_number: float | None = None
    microlens_distance: float | None = None
    focus_distance: float = math.inf

    @property
    def missing(self) -> str:
        """Lengths that are missing for metres, as a phrase; empty if none is."""
        needed = {"the pitch of the sensor's pixels": self.pixel_pitch, "the lens's focal length": self.focal_length}
        names = [name for name, value in needed.items() if value is None]
        if self.f_number is None and self.microlens_distance is None:
            names.append("its f-number or the distance of the microlenses to the sensor")
        return ", ".join(names[:-1]) + (" and " if names[1:] else "") + "".join(names[-1:])

    def views(self, grid: Grid, resampler: Resampler) -> Views:
        """Compute the geometry of the views that `resampler` makes: in metres, or else in steps of one view.

        Raises
        ------
        ValueError : the plane that is sharp is within the focal length.
        """
        steps = regular_grid(resampler.count, resampler.count)
        if self.missing:
            plane = Plane(1.0, -0.5 * resampler.width, 0.5 * resampler.height)
            aperture = grid.diameter / resampler.step
            return Views(steps, plane, resampler.width, resampler.height, cell=(1.0, 1.0), aperture=aperture)

        assert self.pixel_pitch is not None
        assert self.focal_length is not None
        focal_length, pitch = self.focal_length * METRES_PER_MILLIMETRE, self.pixel_pitch * _METRES_PER_MICROMETRE
        inverse_focus = 0.0 if math.isinf(self.focus_distance) else 1.0 / self.focus_distance
        inverse_image = 1.0 / focal_length - inverse_focus
        if not inverse_image > 0.0:
            raise ValueError(f"must be more than the focal length, {focal_length:g} m")
        image = 1.0 / inverse_image

        # A pixel sees through its microlens's middle: similar triangles give its place on the main lens.
        if self.microlens_distance is not None:
            behind = self.microlens_distance * _METRES_PER_MICROMETRE
            on_lens = pitch * image / behind
        else:
            assert self.f_number is not None
            on_lens = focal_length / self.f_number / grid.diameter
            behind = pitch * image / on_lens
        aperture = grid.diameter * on_lens if self.f_number is None else focal_length / self.f_number

        # Sub-images are spread by 1 + behind / image, as they are seen from the main lens (Ng 2006, sec. 3.3).
        tangent = pitch / (1.0 + behind / image) / image
        half = 0.5 * resampler.pixel
        left = (resampler.first[0] - half - 0.5 * resampler.raw_width) * tangent
        top = (0.5 * resampler.raw_height - resampler.first[1] + half) * tangent
        step = resampler.step * on_lens
        return Views(
            steps * step,
            Plane(resampler.pixel * tangent, left, top),
            resampler.width,
            resampler.height,
            inverse_focus=inverse_focus,
            cell=(step, step),
            aperture=aperture,
            focal_length=self.focal_length,
        )
