"""Light-field camera: an array of microlenses behind the main lens tells apart where light comes through that.

In a scene:

    camera: {type: light_field, look_from: [0, 1.6, 4], look_at: [0, 1, 0], sensor: {width: 9 mm, height: 9 mm},
             focal_length: 40 mm, f_number: 4, focus_distance: 2, microlenses: {pixels: 15}}
    camera: {type: light_field, look_from: [0, 1.6, 4], look_at: [0, 1, 0], sensor: four_thirds, focal_length: 25 mm,
             f_number: 2.8, microlenses: {pitch: 60 um, layout: hexagonal, rotation: 0.7}}
    camera: {type: light_field, look_from: [0, 1.6, 4], look_at: [0, 1, 0], sensor: full_frame, focal_length: 80 mm,
             f_number: 4, microlenses: {pixels: 30, arrangement: focused, focal_length: 0.6 mm}}
    camera: {type: light_field, look_from: [0, 1.6, 4], look_at: [0, 1, 0], sensor: full_frame, focal_length: 80 mm,
             f_number: 4, microlenses: {pixels: 30, layout: hexagonal, arrangement: focused,
                                        focal_length: [0.57 mm, 0.6 mm, 0.63 mm]}}
"""

import math
from typing import Any, ClassVar, Literal, Self

from pydantic import Field, PrivateAttr, ValidationError, model_validator

from raytracer.core.spectra import spectra
from raytracer.film.light_field.focusing import refocusable
from raytracer.film.light_field.lenslets import Lenslets
from raytracer.film.light_field.openings import OpeningTable
from raytracer.optics.glass import LINE_D
from raytracer.optics.lens_system.film_to_direction import build_view_table
from raytracer.optics.lens_system.first_order import exit_pupil
from raytracer.optics.lens_system.pupils.build import load_pupil_table
from raytracer.optics.lens_system.pupils.tables import QuadrantPupilTable, RadialPupilTable, pupil_extent
from raytracer.optics.lens_system.pupils.transmission import exit_pupil_plane
from raytracer.optics.lens_system.surfaces import aperture_extent
from raytracer.optics.lens_system.warnings import LENS_WARNINGS, MountedLens
from raytracer.optics.thin_lens import airy_diameter_um, field_of_view
from raytracer.plugins.cameras.base.glass import PADDING_PIXELS, PUPIL_WAVELENGTHS, GlassLensSpec
from raytracer.plugins.cameras.base.ideal import IdealLensSpec
from raytracer.plugins.cameras.base.interface import NO_ASSETS, Assets, Defocus
from raytracer.plugins.cameras.base.light_field_camera import (
    Crosstalk,
    GlassLightFieldCamera,
    HexagonCell,
    LightFieldCamera,
    MicrolensArray,
    SquareCell,
    pack_crosstalk,
    pack_lattice,
)
from raytracer.plugins.cameras.base.microlens_kinds import describe_sharpness, pack_spread
from raytracer.plugins.cameras.base.microlenses import (
    Arrangement,
    MainLens,
    Microlenses,
    describe_resolution,
    make_lenslets,
    microlens_solid_angle,
    solve_arrangement,
)
from raytracer.plugins.cameras.base.perspective import ANGLES, LENGTHS, CameraOptics
from raytracer.plugins.cameras.base.perspective_camera import FlatPupil, Irradiance
from raytracer.plugins.cameras.base.views import describe_views
from raytracer.plugins.cameras.base.warnings import MICROLENS_WARNINGS, MicrolensFit
from raytracer.plugins.cameras.base.warnings.no_views import NoViews
from raytracer.schema.rules import never, only
from raytracer.schema.spec import field_error
from raytracer.schema.units import METRES_PER_MILLIMETRE
from raytracer.schema.warning_kind import WarningRecord

_MAX_DISTANCE = 1e6
"""Largest distance of the exit pupil from the film, in image distances: one at infinity is placed there."""

_THIN_LENS_KEYS = (*ANGLES, *LENGTHS, "defocus_angle", "aperture", "vignetting")
"""Keys of a thin lens that a prescription takes the place of."""

_TRADE_OFF_FACTORS = (0.5, 2.0 / 3.0, 1.0, 1.5, 2.0, 3.0)
"""Sizes of the microlenses that the trade-off compares, over those of the camera's own."""


class LightField(GlassLensSpec, IdealLensSpec):
    """A main lens, an array of microlenses near its image, and a sensor behind that.

    The main lens is a thin one, with all keys of `thin_lens`, or one of glass, `lens: FILE`, with the aberrations and
    the vignetting of the camera `lens`.

    The picture is that of the sensor, upright, so turned by 180 degrees: a mosaic of sub-images, one behind each
    microlens, in which every pixel sees one part of the main lens.  Each pixel sees through the microlens whose
    sub-image it is part of, and no other, also where sub-images would overlap, as behind a main lens that is wider than
    the microlenses are made for; with `crosstalk: true` it sees through all whose sub-images cover it.

    Plain pixels are the mean radiance of what comes through the part of the main lens that a pixel sees, where the lens
    is not there 0: the mean over a sub-image, over what of it is lit, is the pixel of an ordinary photograph on sensors
    of the microlenses' size.  Exposed by `iso` it is the irradiance on the sensor, on which the light of a microlens is
    spread over all of its sub-image.

    References: Ng, Levoy, Bredif, Duval, Horowitz, Hanrahan 2005, "Light Field Photography with a Hand-Held Plenoptic
    Camera", Stanford CTSR 2005-02; Lumsdaine, Georgiev 2009, "The Focused Plenoptic Camera", ICCP.
    """

    # Which views are lit, and by how much, is a matter of the opening's shape.
    bound_fields: ClassVar[tuple[str, ...]] = ("lens", "aperture_shape")

    _opening_assets: Assets = PrivateAttr(default_factory=dict)
    _opening_table: OpeningTable | None = PrivateAttr(default=None)

    type: Literal["light_field"] = "light_field"
    lens: str | None = Field(
        default=None,
        description="prescription of a main lens of glass (.yaml .dat .zmx), relative to the scene, in place of a thin "
        "one",
        min_length=1,
    )
    dispersion: bool | None = Field(
        default=None,
        description="whether glasses of `lens` have an index by wavelength, where its prescription says so; true by "
        "default",
    )
    microlenses: Microlenses = Field(
        default_factory=Microlenses,
        description="the array before the sensor: {pixels: 15} or {pitch: 125 um} or {count: 100}, layout, model, "
        "focal_length, distance, arrangement, crosstalk, rotation, offset",
    )

    _one_main_lens = never(
        *_THIN_LENS_KEYS, where="lens", message="lens and {key} both say what the main lens is: give one of them"
    )
    _has_glass = only("dispersion", where="lens", message="a thin lens has no glass that could disperse: give lens")

    @model_validator(mode="after")
    def _has_a_main_lens(self) -> Any:
        if self.lens is not None:
            return self
        if not self.has_scale():
            field_error("focal_length", "microlenses need the size of the optics: give focal_length, sensor, or both")
        if not self.has_aperture():
            field_error(
                "f_number", f"microlenses tell apart the parts of an opening, and there is none: {self.aperture_hint}"
            )
        return self

    def bind_assets(self, assets: Assets) -> Self:
        bound = super().bind_assets(assets).model_copy()
        bound._opening_assets = assets
        return bound

    def _opening(self) -> OpeningTable | None:
        """Return the table of the main lens's opening; None for a round one."""
        if self._opening_table is None and self.aperture_shape is not None:
            shape = self.pack_shape(self._opening_assets)
            self._opening_table = None if shape is None else OpeningTable(shape)
        return self._opening_table

    def has_scale(self) -> bool:
        return self.lens is not None or super().has_scale()

    def has_aperture(self) -> bool:
        return self.lens is not None or super().has_aperture()

    def stop_f_number(self) -> float | None:
        return self.f_number

    def check_focus(self) -> None:
        if self.lens is None:
            IdealLensSpec.check_focus(self)
        elif self._bound is not None:
            super().check_focus()

    def optics(self, width: int, height: int) -> CameraOptics:
        if self.lens is None:
            return super().optics(width, height)
        sensor, film, thin = self.sensor_size(), self.film_size(width, height), self.lens_setup().thin
        return CameraOptics(
            0.5 * film.height / thin.image_distance, sensor, film, thin.focal_length, thin.image_distance
        )

    def pupil_diameter(self, width: int, height: int) -> float:
        if self.lens is None:
            return super().pupil_diameter(width, height)
        return METRES_PER_MILLIMETRE * self.lens_setup().thin.aperture

    def relative_aperture(self, width: int, height: int) -> float | None:
        return super().relative_aperture(width, height) if self.lens is None else self.lens_setup().f_number

    def main_lens(self, width: int, height: int) -> MainLens:
        """Return the main lens for a film of width x height pixels."""
        optics = self.optics(width, height)
        assert optics.film is not None
        assert optics.image_distance is not None
        assert optics.focal_length is not None
        image, pupil = optics.image_distance, optics.image_distance
        if self.lens is not None:
            setting = self.lens_setup()
            exit_place = exit_pupil(setting.surfaces).z
            pupil = setting.film - exit_place if math.isfinite(exit_place) else _MAX_DISTANCE * image
            if pupil <= 0.0:
                field_error("lens", "the exit pupil lies behind the film: microlenses cannot be turned towards it")
        diameter = self.pupil_diameter(width, height) / METRES_PER_MILLIMETRE
        return MainLens(optics.film, image, pupil, diameter, optics.focal_length, width, height)

    def arrangement(self, width: int, height: int) -> Arrangement:
        """Work out the microlenses behind the lens, for a film of width x height pixels.

        Raises
        ------
        ValidationError : there is no such arrangement.
        """
        try:
            return solve_arrangement(self.microlenses, self.main_lens(width, height))
        except ValidationError as error:
            (detail,) = error.errors(include_url=False)
            field_error(("microlenses", *detail["loc"]), str(detail["msg"]))

    def lenslets(self, width: int, height: int) -> Lenslets:
        """Lay out the sub-images of a film of width x height pixels."""
        array, main = self.arrangement(width, height), self.main_lens(width, height)
        return make_lenslets(self.microlenses, array, main, self.frame(), self.plane_of_focus(), self._opening())

    def layout(self, width: int, height: int) -> Lenslets | None:
        lenslets = self.lenslets(width, height)
        return lenslets if lenslets.holds_views else None

    def why_no_views(self, width: int, height: int) -> str | None:
        return next((record.text for record in NoViews().find(self._fit(width, height))), None)

    def _fit(self, width: int, height: int) -> MicrolensFit:
        array, layout = self.arrangement(width, height), self.lenslets(width, height)
        return MicrolensFit(self.microlenses, array, layout, self.relative_aperture(width, height))

    def describe(self, width: int, height: int) -> dict[str, float]:
        """Return derived numbers: angles and pixels of a view, and the range in which it can be refocused."""
        array, main = self.arrangement(width, height), self.main_lens(width, height)
        layout = self.lenslets(width, height)
        numbers, pixel = super().describe(width, height), 1e3 * main.film.height / height
        if self.lens is not None:
            setting = self.lens_setup()
            numbers |= {"focal_length_mm": setting.focal_length, "f_number": setting.f_number}
        numbers |= {
            "microlens_pitch_um": 1e3 * array.pitch,
            "sub_image_px": array.spacing,
            "microlens_focal_length_mm": array.focal_length,
            "microlens_f_number": array.focal_length / array.pitch,
            "microlens_airy_disc_px": airy_diameter_um(array.distance / array.pitch) / pixel,
            "sensor_behind_microlenses_mm": array.distance,
            "raw_pixels": float(width * height),
        }
        if layout.is_focused:
            numbers |= describe_sharpness(layout, self.microlenses.focal_lengths)
        if not layout.holds_views:
            return numbers
        views = layout.views
        right, up = (0.5 * size * views.plane.pixel for size in (views.width, views.height))
        for name, half in (("v", up), ("h", right), ("d", math.hypot(right, up))):
            numbers[f"{name}fov_deg"] = field_of_view(2.0 * half, 1.0)
        return {
            **numbers,
            "pixel_at_1m_mm": views.plane.pixel / METRES_PER_MILLIMETRE,
            **describe_views(views),
            **describe_resolution(array, layout, views),
        }

    def trade_off(self, width: int, height: int) -> list[dict[str, float]]:
        rows = []
        for factor in _TRADE_OFF_FACTORS:
            other = self.model_copy(update={"microlenses": self.microlenses.scaled(factor)}) if factor != 1.0 else self
            try:
                layout = other.lenslets(width, height)
            except ValidationError:
                # They leave too few pixels to tell directions apart.
                continue
            if not layout.holds_views:
                continue
            views = layout.views
            near, far = refocusable(views)
            sizes = describe_resolution(other.arrangement(width, height), layout, views)
            rows.append({**sizes, "refocus_near_m": near, "refocus_far_m": far})
        return rows

    def warnings(self, width: int, height: int) -> list[WarningRecord]:
        warnings = MICROLENS_WARNINGS.find(self._fit(width, height))
        if self.lens is None:
            return warnings
        return warnings + LENS_WARNINGS.find(MountedLens(self.glass(), self.lens_setup().shift))

    def pack(self, width: int, height: int, assets: Assets = NO_ASSETS) -> LightFieldCamera | GlassLightFieldCamera:
        array, lenslets = self.arrangement(width, height), self.lenslets(width, height)
        cell = HexagonCell() if self.microlenses.layout == "hexagonal" else SquareCell()
        spread = None if self.microlenses.model == "pinhole" else pack_spread(lenslets)
        crosstalk = self._pack_crosstalk(lenslets, width, height, assets) if self.microlenses.crosstalk else None
        grid = MicrolensArray(
            pack_lattice(lenslets.lattice), cell, spread, crosstalk, *lenslets.middle, lenslets.slope, lenslets.stride
        )
        if self.lens is not None:
            return self._pack_glass(array, grid, lenslets, width, height, assets)
        lens = self.pack_lens(width, height, assets)
        assert lens is not None
        lens = lens._replace(inverse_focus=lenslets.inverse_distance)
        thin = _thin_defocus(self.main_lens(width, height), height, lenslets)
        return LightFieldCamera(self.frame(), lens, grid, self._pack_irradiance(array), thin)

    def _pack_crosstalk(self, lenslets: Lenslets, width: int, height: int, assets: Assets) -> Crosstalk:
        """Pack the crosstalk: how far from the middle of a sub-image light of its microlens falls."""
        main = self.main_lens(width, height)
        reach = 0.5e-3 * main.diameter * aperture_extent(self.pack_shape(assets))
        if self.lens is not None:
            # Light comes through a part of the exit pupil's plane, which is its image near the axis alone.
            setting, half = self.lens_setup(), self._padded_half(main)
            pupils = self._load_pupils(half, spectral=self.dispersion is not False)
            plane = exit_pupil_plane(setting.surfaces, setting.film)
            extent = pupil_extent(pupils, main.pupil / (setting.film - plane))
            reach = extent * METRES_PER_MILLIMETRE * main.image / main.pupil
        lattice = lenslets.lattice
        # No place of a cell is farther from its middle than a step.
        step = max(math.hypot(*lattice.along), math.hypot(*lattice.across))
        blur = max(map(abs, (lenslets.blur, *lenslets.kinds)))
        return pack_crosstalk(lattice, (reach + blur * step) / lenslets.stride)

    def _padded_half(self, main: MainLens) -> tuple[float, float]:
        """Return half of the film's size, with room for filters (mm)."""
        padding = PADDING_PIXELS * main.pixel
        return 0.5 * main.film.width + padding, 0.5 * main.film.height + padding

    def _load_pupils(
        self, half: tuple[float, float], *, spectral: bool = False
    ) -> RadialPupilTable | QuadrantPupilTable:
        """Load the table of the exit pupils of a lens of glass, for light of the d line or of all wavelengths."""
        setting, lens = self.lens_setup(), self.glass()
        surfaces, wavelengths = setting.surfaces, [LINE_D]
        if spectral:
            surfaces = lens.packed(stop_radius=setting.stop_radius, shift=setting.shift, coatings=False)
            wavelengths = list(PUPIL_WAVELENGTHS) if surfaces.indices is not None else wavelengths
        try:
            return load_pupil_table(surfaces, setting.film, half, wavelengths, is_round=lens.is_round())
        except ValueError as error:
            field_error("lens", str(error))

    def _pack_irradiance(self, array: Arrangement) -> Irradiance | FlatPupil | None:
        """Pack the weight of rays through a microlens; None where the sensor gathers radiance."""
        if not self.is_radiometric():
            return None
        solid_angle = microlens_solid_angle(self.microlenses, array)
        if self.pupil == "flat":
            image = METRES_PER_MILLIMETRE * array.image
            return FlatPupil(image, solid_angle * image * image)
        return Irradiance(solid_angle)

    def _pack_glass(
        self, array: Arrangement, grid: MicrolensArray, lenslets: Lenslets, width: int, height: int, assets: Assets
    ) -> GlassLightFieldCamera:
        """Pack the camera behind a lens of glass."""
        setting = self.lens_setup()
        surfaces = self.glass().packed(
            stop_radius=setting.stop_radius,
            shift=setting.shift,
            diaphragm=self.pack_shape(assets),
            dispersion=self.dispersion is not False,
            coatings=False,
        )
        main = self.main_lens(width, height)
        pupils = self._load_pupils(self._padded_half(main))
        return GlassLightFieldCamera(
            frame=self.frame(),
            surfaces=surfaces,
            grid=grid,
            edge=array.pitch / array.spacing,
            edge_growth=array.pupil / array.image / METRES_PER_MILLIMETRE,
            behind=array.pupil,
            z=setting.film + array.pupil - main.pupil,
            pupil=setting.thin.pupil,
            gain=microlens_solid_angle(self.microlenses, array) if self.is_radiometric() else 1.0,
            wavelengths=None if surfaces.indices is None else spectra(),
            view_table=build_view_table(setting, pupils),
            beyond=array.pupil / main.pupil,
            thin=_thin_defocus(main, height, lenslets),
        )


def _thin_defocus(main: MainLens, height: int, lenslets: Lenslets) -> Defocus:
    """Return the thin lens of a photograph by the main lens on the same sensor, without microlenses."""
    pixel = main.film.height / height / main.image
    return Defocus(METRES_PER_MILLIMETRE * main.diameter, pixel, lenslets.inverse_focus)
