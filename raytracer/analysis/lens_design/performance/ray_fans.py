"""Transverse ray aberrations over the pupil, field by field.

References: Smith 2008, "Modern Optical Engineering", 4th ed., sec. 5.8 (ray intercept curves).
"""

import numpy as np

from raytracer.analysis.lens_design.performance.beams import aim_fan, film_points, open_stop_fraction
from raytracer.analysis.lens_design.performance.field_points import settings_field_points
from raytracer.analysis.lens_design.performance.optical_bench import OpticalBench
from raytracer.analysis.lens_design.performance.results import Fan


def fans(bench: OpticalBench, meridian: str = "y") -> tuple[Fan, ...]:
    """Trace a fan along the field and one across it, for each field of the settings and in each colour."""
    wavelengths = np.array(bench.settings.wavelengths_nm)
    pupil = np.linspace(-1.0, 1.0, bench.settings.steps)
    zones = pupil * open_stop_fraction(bench, meridian)
    traced = []
    for point in settings_field_points(bench, meridian):
        tangential, sagittal = (np.full((len(wavelengths), len(pupil)), np.nan) for _ in range(2))
        if point.beam is not None:
            still = np.zeros(len(pupil))
            ups, acrosses = (aim_fan(bench, point.beam, zones, up=up) for up in (True, False))
            for row, wavelength in enumerate(wavelengths):
                along, _ = film_points(bench, point.beam, ups, still, wavelength)
                across, _ = film_points(bench, point.beam, still, acrosses, wavelength)
                tangential[row], sagittal[row] = 1e3 * (along[:, 0] - point.height), 1e3 * across[:, 1]
        traced.append(Fan(meridian, point.field, point.field_deg, wavelengths, pupil, tangential, sagittal))
    return tuple(traced)
