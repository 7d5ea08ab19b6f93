"""Camera with a lens of glass: rays go through all of its surfaces, so it has the errors of a real one.

In a scene:

    camera: {type: lens, lens: lenses/double-gauss-50mm.yaml, look_from: [0, 1, 4], look_at: [0, 1, 0],
             sensor: full_frame, f_number: 2, focus_distance: 2}
    camera: {type: lens, lens: lenses/cooke-triplet-50mm.yaml, look_from: [0, 1.6, 4], look_at: [0, 1, 0],
             f_number: 5.6, focus_distance: 3, shutter: 1/125 s, iso: 400}
"""

import math
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from raytracer.core.spectra import spectra
from raytracer.optics.glass import LINE_D
from raytracer.optics.lens_system.film_to_direction import build_view_table, fields_of_view, trace_film_rays
from raytracer.optics.lens_system.ghosts import build_ghost_paths
from raytracer.optics.lens_system.pupils.build import load_pupil_table
from raytracer.optics.lens_system.pupils.search import on_axis_solid_angle, pupil_center
from raytracer.optics.lens_system.pupils.transmission import exit_pupil_plane, rear_plane_radius
from raytracer.optics.lens_system.warnings import LENS_WARNINGS, MountedLens
from raytracer.optics.thin_lens import airy_diameter_um, crop_factor, exposure_value
from raytracer.plugins.cameras.base.exposed import ExposedSpec
from raytracer.plugins.cameras.base.glass import PADDING_PIXELS, PUPIL_WAVELENGTHS, FocusCriterion, GlassLensSpec
from raytracer.plugins.cameras.base.interface import NO_ASSETS, Assets, Defocus
from raytracer.plugins.cameras.base.lens_camera import LensCamera, LensFilm, LensFlare
from raytracer.schema.fields import FNumber
from raytracer.schema.spec import field_error
from raytracer.schema.units import METRES_PER_MILLIMETRE
from raytracer.schema.warning_kind import WarningRecord


class RealLens(GlassLensSpec):
    """A lens of glass, as its prescription has it, through which every ray goes, surface by surface.

    So the picture has the lens's own aberrations, distortion and vignetting, and its blur the shape of what of the
    pupil is seen from each place.  `look_from` is the middle of the entrance pupil near the axis, from where distances
    are measured; the lens with its front before that, and the film behind it, stand in the scene but are not seen.

    Without `iso`, a picture of an even scene has its radiance in the middle, and is darker to its corners by the
    lens's vignetting and the fourth power of the cosine.  With it, the film gathers what arrives through the exit
    pupil, E = integral of L cos^4 / Z^2 dA.

    References: Kolb, Mitchell, Hanrahan 1995, "A Realistic Camera Model for Computer Graphics", SIGGRAPH; Steinert,
    Dammertz, Hanika, Lensch 2011, "General Spectral Camera Lens Simulation", CGF 30(6).
    """

    type: Literal["lens"] = "lens"
    lens: str = Field(description="prescription of the lens (.yaml .dat .zmx), relative to the scene", min_length=1)
    f_number: FNumber | None = Field(
        default=None, description="f-number to which the stop closes; by default it is as wide open as it goes"
    )
    focus: FocusCriterion = Field(
        default="marginal",
        description="what is sharp: where light through the zone of the pupil that halves its area meets on the axis, "
        "or where the spot of a point of the axis has the least root mean square radius (`rms`)",
    )
    dispersion: bool = Field(
        default=True,
        description="whether the lens's glasses have an index by wavelength, where its prescription says so; else each "
        "has that of the d line for all colours",
    )
    flare: bool = Field(
        default=False,
        description="whether the lens's surfaces reflect light too: what is lost, ghosts of two reflections, and flare",
    )

    def stop_f_number(self) -> float | None:
        return self.f_number

    def focus_criterion(self) -> FocusCriterion:
        return self.focus

    def film_to_ray(
        self, x: float, y: float, width: int, height: int
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the ray through the middle of the pupil: see `PerspectiveSpec.film_to_ray`."""
        setting, film = self.lens_setup(), self.film_size(width, height)
        place = ((0.5 - x) * film.width, (y - 0.5) * film.height)
        target = pupil_center(setting.surfaces, setting.film, *place, LINE_D)
        if target is None:
            raise ValueError("no light arrives there: the lens's image circle does not reach so far")
        points, ways = trace_film_rays(setting, np.array([place]), target[None])
        return METRES_PER_MILLIMETRE * points[0], ways[0]

    def relative_aperture(self, width: int, height: int) -> float | None:
        return self.lens_setup().f_number

    def is_radiometric(self) -> bool:
        return self.iso is not None or self.exposure is not None

    def thin_lens_equivalent(self, width: int, height: int) -> dict[str, Any]:
        """Return the thin-lens camera in place of this one: keys of a scene file, of plain values."""
        setting = self.lens_setup()
        thin, film = setting.thin, self.film_size(width, height)
        common = [key for key in ExposedSpec.model_fields if key in self.model_fields_set - {"type", "sensor"}]
        keys = {"type": "thin_lens"} | {key: getattr(self, key) for key in common}
        focus = {key: getattr(self, key) for key in ("focus_on", "focus_at") if getattr(self, key) is not None}
        return {
            **keys,
            "sensor": self.sensor if self.sensor is not None else "full_frame",
            "vfov": thin.vfov(film.height),
            **(focus or {"focus_distance": self.plane_of_focus()}),
            "aperture": thin.aperture,
            **({} if self.aperture_shape is None else {"aperture_shape": self.aperture_shape}),
        }

    def describe(self, width: int, height: int) -> dict[str, float]:
        """Return derived numbers, by name with unit; those of the thin lens in place of it begin with `thin_lens`."""
        setting, film = self.lens_setup(), self.film_size(width, height)
        sensor = self.sensor_size()
        thin, crop, pitch = setting.thin, crop_factor(*sensor), film.height / height
        pupil, seconds = thin.aperture, self.exposure_seconds()
        numbers = {
            "pixel_at_1m_mm": 1e3 * pitch / thin.image_distance,
            "sensor_width_mm": sensor.width,
            "sensor_height_mm": sensor.height,
            "film_width_mm": film.width,
            "film_height_mm": film.height,
            "pixel_pitch_um": 1e3 * pitch,
            "crop_factor": crop,
            "focal_length_mm": setting.focal_length,
            "equivalent_focal_length_mm": crop * setting.focal_length,
            "image_distance_mm": thin.image_distance,
            "back_focus_mm": setting.film - float(setting.surfaces.vertex[-1]),
            "f_number": setting.f_number,
            "entrance_pupil_mm": pupil,
            "airy_disc_um": airy_diameter_um(thin.image_distance / pupil),
        }
        if seconds > 0.0:
            numbers["ev100"] = exposure_value(setting.f_number, seconds, self.iso or 100.0)
        focus = self.plane_of_focus()
        return {
            **fields_of_view(setting, film),
            **numbers,
            "magnification": thin.image_distance / (1e3 * focus),
            "focus_distance_m": focus,
            "aperture_diameter_mm": pupil,
            "blur_at_infinity_px": pupil * thin.image_distance / (1e3 * focus) / pitch,
            "thin_lens_focal_length_mm": thin.focal_length,
            "thin_lens_f_number": thin.f_number,
            "thin_lens_vfov_deg": thin.vfov(film.height),
        }

    def warnings(self, width: int, height: int) -> list[WarningRecord]:
        diagonal, film_key = math.hypot(*self.film_size(width, height)), "lens" if self.sensor is None else "sensor"
        return LENS_WARNINGS.find(MountedLens(self.glass(), self.lens_setup().shift, diagonal, film_key))

    def pack(self, width: int, height: int, assets: Assets = NO_ASSETS) -> "LensCamera":
        """Pack the camera for a film of width x height pixels, with its pupil as each place of the film sees it."""
        lens, setting = self.glass(), self.lens_setup()
        surfaces = lens.packed(
            stop_radius=setting.stop_radius,
            shift=setting.shift,
            diaphragm=self.pack_shape(assets),
            dispersion=self.dispersion,
            coatings=self.flare,
        )
        film = self.film_size(width, height)
        pixel = film.height / height
        half = (0.5 * film.width + PADDING_PIXELS * pixel, 0.5 * film.height + PADDING_PIXELS * pixel)
        # For colours of coatings light has a wavelength too.
        is_spectral = surfaces.indices is not None or surfaces.coatings is not None
        wavelengths = PUPIL_WAVELENGTHS if surfaces.indices is not None else (LINE_D,)
        bare = surfaces._replace(coatings=None)
        try:
            # First the test that finds quickly that no light comes through.
            light = on_axis_solid_angle(bare, setting.film, LINE_D, is_round=lens.is_round())
            pupils = load_pupil_table(bare, setting.film, half, wavelengths, is_round=lens.is_round())
        except ValueError as error:
            field_error("lens", str(error))
        plane, rear = exit_pupil_plane(bare, setting.film), float(surfaces.vertex[-1])
        flare = None
        if self.flare:
            behind, corner = setting.film - rear, math.hypot(*half)
            reach = rear_plane_radius(bare, setting.film, corner)
            flare = LensFlare(
                build_ghost_paths(surfaces, corner, behind, reach=reach, is_round=lens.is_round()), behind
            )
        return LensCamera(
            frame=self.frame(),
            film=LensFilm(pixel, -0.5 * film.width, 0.5 * film.height, setting.film),
            surfaces=surfaces,
            pupils=pupils,
            plane=plane,
            pupil=setting.thin.pupil,
            gain=(1.0 if self.is_radiometric() else 1.0 / light) / (setting.film - plane) ** 2,
            wavelengths=spectra() if is_spectral else None,
            flare=flare,
            view_table=build_view_table(setting, pupils),
            thin=Defocus(
                METRES_PER_MILLIMETRE * setting.thin.aperture,
                pixel / setting.thin.image_distance,
                1.0 / self.plane_of_focus(),
            ),
        )
