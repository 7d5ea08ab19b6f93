"""Transverse ray aberrations over the pupil, field by field.

References: Smith 2008, "Modern Optical Engineering", 4th ed., sec. 5.8 (ray intercept curves).
"""

import numpy as np

from raytracer.lens_report.analysis.beams import aimed, landed, opening
from raytracer.lens_report.analysis.bench import Bench
from raytracer.lens_report.analysis.fields import fields
from raytracer.lens_report.analysis.results import Fan


def fans(bench: Bench, meridian: str = "y") -> tuple[Fan, ...]:
    """A fan along the field and one across it, for each field of the settings and in each colour."""
    wavelengths = np.array(bench.settings.wavelengths_nm)
    pupil = np.linspace(-1.0, 1.0, bench.settings.steps)
    zones = pupil * opening(bench, meridian)
    found = []
    for point in fields(bench, meridian):
        tangential, sagittal = (np.full((len(wavelengths), len(pupil)), np.nan) for _ in range(2))
        if point.beam is not None:
            still = np.zeros(len(pupil))
            ups, acrosses = (aimed(bench, point.beam, zones, up=up) for up in (True, False))
            for row, wavelength in enumerate(wavelengths):
                along, _ = landed(bench, point.beam, ups, still, wavelength)
                across, _ = landed(bench, point.beam, still, acrosses, wavelength)
                tangential[row], sagittal[row] = 1e3 * (along[:, 0] - point.height), 1e3 * across[:, 1]
        found.append(Fan(meridian, point.field, point.field_deg, wavelengths, pupil, tangential, sagittal))
    return tuple(found)
