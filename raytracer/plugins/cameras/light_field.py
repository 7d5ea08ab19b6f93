"""Light-field camera: an array of microlenses behind the main lens tells apart where light comes through that.

In a scene:

    camera: {type: light_field, look_from: [0, 1.6, 4], look_at: [0, 1, 0], sensor: {width: 9 mm, height: 9 mm},
             focal_length: 40 mm, f_number: 4, focus_distance: 2, microlenses: {pixels: 15}}
    camera: {type: light_field, look_from: [0, 1.6, 4], look_at: [0, 1, 0], sensor: four_thirds, focal_length: 25 mm,
             f_number: 2.8, microlenses: {pitch: 60 um, layout: hexagonal, rotation: 0.7}}
    camera: {type: light_field, look_from: [0, 1.6, 4], look_at: [0, 1, 0], sensor: full_frame, focal_length: 80 mm,
             f_number: 4, microlenses: {pixels: 30, arrangement: focused, focal_length: 0.6 mm}}
"""

import math
from collections.abc import Mapping
from typing import Any, ClassVar, Literal, NamedTuple

from pydantic import Field, PrivateAttr, ValidationError, model_validator

from raytracer.apertures.interface import unvignetted
from raytracer.cameras.glass import draw_wavelength, set_out, stop_for_key, traced_ray
from raytracer.cameras.ideal import IdealLensSpec
from raytracer.cameras.interface import (
    LENS,
    NO_ASSETS,
    Assets,
    Defocus,
    Together,
    camera_ray,
    defocus_of,
    lane_ray,
    project,
    rays_together,
    set_lane,
    trace_lanes,
)
from raytracer.cameras.microlenses import (
    Arrangement,
    Behind,
    Hexagon,
    Microlenses,
    Square,
    arranged,
    nearest,
    within_cell,
)
from raytracer.cameras.perspective import FlatPupil, Irradiance, Optics, gathered
from raytracer.cameras.placement import Frame, in_frame
from raytracer.cameras.views import described
from raytracer.glass import LINE_D
from raytracer.jit import generic, kernel
from raytracer.lanes import store
from raytracer.lenses import packets
from raytracer.lenses.diaphragm import covers
from raytracer.lenses.doubts import doubts as lens_doubts
from raytracer.lenses.first_order import exit_pupil
from raytracer.lenses.focusing import film_place
from raytracer.lenses.lens import Lens
from raytracer.lenses.pupils import pupils_of
from raytracer.lenses.setting import Setting, set_lens
from raytracer.lenses.sights import seen_at, view_of
from raytracer.lenses.surfaces import LensSurfaces
from raytracer.photography import airy_diameter_um, field_of_view
from raytracer.plenoptic.focusing import refocusable
from raytracer.plenoptic.lenslets import Lenslets
from raytracer.plenoptic.resampling import Lattice
from raytracer.plenoptic.views import Pose, Views
from raytracer.sampling import sample_2d
from raytracer.sensors import SENSORS, Size
from raytracer.spec import at
from raytracer.spectra import spectra
from raytracer.units import METRES_PER_MILLIMETRE
from raytracer.vec import add, madd, normalize, scale

_FOCUS = "marginal"
"""How a lens of glass is focused: see the key `focus` of the camera `lens`."""

_FARTHEST = 1e6
"""How many image distances from the film the exit pupil is at most: what is at infinity is as far as that."""

_SPARE_PIXELS = 8
"""By how many pixels the film for which directions are known is larger than the picture."""

_THIN = (
    "vfov",
    "hfov",
    "dfov",
    "focal_length",
    "equivalent_focal_length",
    "defocus_angle",
    "aperture",
    "vignetting",
)
"""Keys of a thin lens that a prescription has an answer of its own to."""

_ROW = math.sqrt(3.0) / 2.0
"""How far the rows of a hexagonal lattice are apart, by the distance of neighbours in a row."""


_FACTORS = (0.5, 2.0 / 3.0, 1.0, 1.5, 2.0, 3.0)
"""Sizes of other microlenses that the trade-off is told of, in units of the camera's own."""

_MISMATCH = 0.05
"""By what part of their width sub-images may miss each other unremarked: engraved f-numbers are rounded by as much."""

_SEEN_BY = 2.0
"""Microlenses across that should see each place: Georgiev, Lumsdaine 2010, "Reducing Plenoptic Camera Artifacts"."""


class MainLens(NamedTuple):
    """The main lens, of glass the thin one in its place; lengths on the side of the film are mm.

    film : the part of the sensor that the picture shows.
    image : distance of the image of the plane of focus behind it.
    pupil : of that image from the exit pupil.
    diameter : of the entrance pupil.
    focal_length : that by which the distances of focus and of its image go together.
    """

    film: Size
    image: float
    pupil: float
    diameter: float
    focal_length: float


class LightField(IdealLensSpec):
    """A main lens, an array of microlenses near its image, and a sensor behind that.

    The main lens is a thin one, with all keys of `thin_lens`, or one of glass, `lens: FILE`, with the aberrations and
    the vignetting of the camera `lens`.

    The picture is that of the sensor, upright, so turned by 180 degrees: a mosaic of sub-images, one behind each
    microlens, in which every pixel sees one part of the main lens.  Each pixel sees through the microlens whose
    sub-image it is part of, and no other: where sub-images would overlap, as behind a main lens that is wider than the
    microlenses are made for, there is no crosstalk.

    Plain pixels are the mean radiance of what comes through the part of the main lens that a pixel sees, where the lens
    is not there 0: the mean over a sub-image, over what of it is lit, is the pixel of an ordinary photograph on sensors
    of the microlenses' size.  Exposed by `iso` it is the irradiance on the sensor, on which the light of a microlens is
    spread over all of its sub-image.

    References: Ng, Levoy, Bredif, Duval, Horowitz, Hanrahan 2005, "Light Field Photography with a Hand-Held Plenoptic
    Camera", Stanford CTSR 2005-02; Lumsdaine, Georgiev 2009, "The Focused Plenoptic Camera", ICCP.
    """

    loads: ClassVar[Mapping[str, str]] = {"lens": "lens"}
    binds: ClassVar[tuple[str, ...]] = ("lens",)

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
        "focal_length, distance, arrangement, rotation, offset",
    )
    _bound: Lens | None = PrivateAttr(default=None)

    @model_validator(mode="after")
    def _has_what_it_takes(self) -> Any:
        if self.lens is not None:
            given = [key for key in _THIN if getattr(self, key) is not None]
            if given:
                at(given[0], f"lens and {given[0]} both say what the main lens is: give one of them")
            return self
        if self.dispersion is not None:
            at("dispersion", "a thin lens has no glass that could disperse: give lens")
        if not self._has_scale():
            at("focal_length", "microlenses need the size of the optics: give focal_length, sensor, or both")
        if not self._lets_light_in():
            at("f_number", f"microlenses tell apart the parts of an opening, and there is none: {self._openings()}")
        return self

    def _has_scale(self) -> bool:
        return self.lens is not None or super()._has_scale()

    def _lets_light_in(self) -> bool:
        return self.lens is not None or super()._lets_light_in()

    # ---- The main lens

    def bound(self, assets: Assets) -> "LightField":
        if self.lens is None:
            return self
        bound = self.model_copy()
        bound._bound = assets["lens"]
        try:
            film_place(bound.glass(), _FOCUS, stop_radius=stop_for_key(bound.glass(), self.f_number))
        except ValueError as error:
            at("lens", str(error))
        if not self.focuses_on_something():
            bound._check_focus()
        return bound

    def glass(self) -> Lens:
        """The lens that its file holds; the camera must be `bound`."""
        if self._bound is None:
            raise TypeError("the camera has not been bound to the lens that its file holds")
        return self._bound

    def setting(self) -> Setting:
        """The lens of glass as it is set.

        Raises
        ------
        ValueError : it cannot be focused so.
        """
        lens = self.glass()
        return set_lens(lens, stop_for_key(lens, self.f_number), 1e3 * self.focal_distance(), _FOCUS)

    def _check_focus(self) -> None:
        if self.lens is None:
            super()._check_focus()
        elif self._bound is not None:
            try:
                self.setting()
            except ValueError as error:
                at("lens" if self.focus_distance is None else "focus_distance", str(error))

    def optics(self, width: int, height: int) -> Optics:
        if self.lens is None:
            return super().optics(width, height)
        sensor = self._sensor() or Size(*SENSORS["full_frame"])
        film, thin = self._fitted(sensor, width, height), self.setting().thin
        return Optics(0.5 * film.height / thin.image_distance, sensor, film, thin.focal_length, thin.image_distance)

    def _pupil(self, optics: Optics) -> float:
        if self.lens is None:
            return super()._pupil(optics)
        return METRES_PER_MILLIMETRE * self.setting().thin.aperture

    def relative_aperture(self, width: int, height: int) -> float | None:
        return super().relative_aperture(width, height) if self.lens is None else self.setting().f_number

    def main(self, width: int, height: int) -> MainLens:
        """The main lens, for a film of width x height pixels."""
        optics = self.optics(width, height)
        assert optics.film is not None
        assert optics.image_distance is not None
        assert optics.focal_length is not None
        image, pupil = optics.image_distance, optics.image_distance
        if self.lens is not None:
            setting = self.setting()
            exit_place = exit_pupil(setting.surfaces).z
            pupil = setting.film - exit_place if math.isfinite(exit_place) else _FARTHEST * image
            if pupil <= 0.0:
                at("lens", "the exit pupil lies behind the film: microlenses cannot be turned towards it")
        diameter = self._pupil(optics) / METRES_PER_MILLIMETRE
        return MainLens(optics.film, image, pupil, diameter, optics.focal_length)

    # ---- What is behind it

    def arrangement(self, width: int, height: int) -> Arrangement:
        """The microlenses behind the lens, for a film of width x height pixels.

        Raises
        ------
        ValidationError : there is no such arrangement.
        """
        main = self.main(width, height)
        behind = Behind(main.image, main.pupil, main.diameter, main.film.height / height, width, height)
        try:
            return arranged(self.microlenses, behind)
        except ValidationError as error:
            (found,) = error.errors(include_url=False)
            at(("microlenses", *found["loc"]), str(found["msg"]))

    def describe(self, width: int, height: int) -> dict[str, float]:
        """Derived numbers: angles and pixels of a view, and how far it can be refocused."""
        layout, array, main = self.lenslets(width, height), self.arrangement(width, height), self.main(width, height)
        numbers = super().describe(width, height)
        if self.lens is not None:
            setting = self.setting()
            numbers |= {"focal_length_mm": setting.focal_length, "f_number": setting.f_number}
        numbers |= {
            "microlens_pitch_um": 1e3 * array.pitch,
            "sub_image_px": array.spacing,
            "microlens_focal_length_mm": array.focal_length,
            "microlens_f_number": array.focal_length / array.pitch,
            "microlens_airy_disc_px": airy_diameter_um(array.distance / array.pitch)
            / (1e3 * main.film.height / height),
            "sensor_behind_microlenses_mm": array.distance,
            "raw_pixels": float(width * height),
        }
        if not layout.holds_views:
            return numbers
        views = layout.views
        right, up = (0.5 * size * views.plane.pixel for size in (views.width, views.height))
        for name, half in (("v", up), ("h", right), ("d", math.hypot(right, up))):
            numbers[f"{name}fov_deg"] = field_of_view(2.0 * half, 1.0)
        return {
            **numbers,
            "pixel_at_1m_mm": views.plane.pixel / METRES_PER_MILLIMETRE,
            **described(views),
            **_sizes(array, layout, views),
        }

    def trade_off(self, width: int, height: int) -> list[dict[str, float]]:
        found = []
        for factor in _FACTORS:
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
            sizes = _sizes(other.arrangement(width, height), layout, views)
            found.append({**sizes, "refocus_near_m": near, "refocus_far_m": far})
        return found

    def doubts(self, width: int, height: int) -> list[tuple[str, str]]:
        found = [("microlenses", message) for message in self._mismatches(width, height)]
        if self.lens is None:
            return found
        return found + [("lens", message) for message in lens_doubts(self.glass(), self.setting().shift)]

    def _mismatches(self, width: int, height: int) -> list[str]:
        """In what the microlenses do not suit the main lens."""
        array, lenslets, found = self.arrangement(width, height), self.lenslets(width, height), []
        if not lenslets.holds_views:
            found.append(
                f"the picture of {width} x {height} pixels has no room for sub-images of {array.spacing:.3g} pixels "
                "side by side, and so holds no views: give a film with more pixels, or smaller microlenses"
            )
        part, f_number = array.distance / array.matched, self.relative_aperture(width, height)
        meant = "" if f_number is None else f": f/{part * f_number:.3g} in place of f/{f_number:.3g} would fill them"
        if part > 1.0 + _MISMATCH:
            found.append(
                f"the main lens is {part:.3g} times as wide as they have room for, so that sub-images would overlap; "
                f"what is beyond their own pixels is cut off here{meant}"
            )
        elif part < 1.0 - _MISMATCH:
            found.append(
                f"sub-images are {part:.3g} times as wide as there is room for, and the pixels between them stay dark"
                f"{meant}"
            )
        if self.microlenses.arrangement == "focused" and lenslets.overlap < _SEEN_BY:
            found.append(
                f"each place is seen by {lenslets.overlap:.3g} of them across, and it takes {_SEEN_BY:g} to leave none "
                "out and to tell its depth: give a focal_length that is nearer to what shows the main lens"
            )
        return found

    def layout(self, width: int, height: int) -> Lenslets | None:
        found = self.lenslets(width, height)
        return found if found.holds_views else None

    def lenslets(self, width: int, height: int) -> Lenslets:
        """Where the sub-images are, and what their pixels see."""
        main, array = self.main(width, height), self.arrangement(width, height)
        pixel, frame, sharp = (
            METRES_PER_MILLIMETRE * main.film.height / height,
            self.frame(),
            1.0 / self.focal_distance(),
        )
        # The plane that the microlenses see: by 1/F = 1/f - 1/z, turned to the side of the scene by the pupils' sizes.
        moved = (1.0 / main.image - 1.0 / array.image) / METRES_PER_MILLIMETRE
        return Lenslets(
            lattice=self._lattice(array, main.film, width, height),
            width=width,
            height=height,
            middle=(0.5 * width, 0.5 * height),
            slope=pixel / (METRES_PER_MILLIMETRE * array.image * array.magnification),
            stride=pixel * array.image / array.distance,
            inverse_distance=sharp + moved * main.pupil / main.image,
            inverse_focus=sharp,
            aperture=METRES_PER_MILLIMETRE * main.diameter,
            focal_length=main.focal_length,
            pose=Pose(frame.origin, frame.right, frame.up, frame.forward),
            blur=self._blur(array),
        )

    def _blur(self, array: Arrangement) -> float:
        """How far the place on the main lens moves that a pixel sees, by the place on the microlens (m/pixel)."""
        lenses = self.microlenses
        # What microlenses that are sharp on the main lens blur there would be rounding.
        is_sharp = lenses.arrangement == "plenoptic" and None in (lenses.focal_length, lenses.distance)
        if is_sharp or lenses.model == "pinhole":
            return 0.0
        return METRES_PER_MILLIMETRE * array.pitch / array.spacing * array.blur

    def _lattice(self, array: Arrangement, film: Size, width: int, height: int) -> Lattice:
        """The middles of the sub-images: of whole pixels a whole number of them has its place between the edges."""
        lenses, spacing = self.microlenses, array.spacing
        turn = math.radians(lenses.rotation)
        cosine, sine = spacing * math.cos(turn), spacing * math.sin(turn)
        along, down = (cosine, -sine), (sine, cosine)
        x, y = 0.5 * width, 0.5 * height
        if lenses.pitch is None and lenses.layout == "square":
            # Sub-images from edge to edge of pixels, those that are left over on both sides.
            x, y = (_first_middle(size, spacing) for size in (width, height))
        shift = array.magnification * height / film.height
        origin = (x + shift * lenses.offset[0], y - shift * lenses.offset[1])
        if lenses.layout == "square":
            return Lattice(origin, along, down)
        return Lattice(origin, along, (0.5 * along[0] + _ROW * down[0], 0.5 * along[1] + _ROW * down[1]))

    def pack(self, width: int, height: int, assets: Assets = NO_ASSETS) -> "LightFieldCamera | GlassLightFieldCamera":
        """The camera for a film of width x height pixels."""
        array, lenslets = self.arrangement(width, height), self.lenslets(width, height)
        cell = Hexagon() if self.microlenses.layout == "hexagonal" else Square()
        spread = None if self.microlenses.model == "pinhole" else Spread(lenslets.blur)
        grid = Array(packed_lattice(lenslets.lattice), cell, spread, *lenslets.middle, lenslets.slope, lenslets.stride)
        if self.lens is not None:
            return self._pack_glass(array, grid, lenslets, width, height, assets)
        lens = self.packed_lens(width, height, assets)
        assert lens is not None
        lens = lens._replace(inverse_focus=lenslets.inverse_distance)
        thin = _thin(self.main(width, height), height, lenslets)
        return LightFieldCamera(self.frame(), lens, grid, self._gathering(array), thin)

    def _gathering(self, array: Arrangement) -> Any:
        """How a pixel gathers irradiance, None for radiance: a microlens's area over the square of its distance."""
        if not self.is_radiometric():
            return None
        if self.pupil == "flat":
            image = METRES_PER_MILLIMETRE * array.image
            return FlatPupil(image, self._extent(array) * image * image)
        return Irradiance(self._extent(array))

    def _extent(self, array: Arrangement) -> float:
        """The solid angle in which a pixel sees its microlens: its area over the square of its distance."""
        area = array.pitch * array.pitch * (_ROW if self.microlenses.layout == "hexagonal" else 1.0)
        return area / (array.distance * array.distance)

    def _pack_glass(
        self, array: Arrangement, grid: "Array", lenslets: Lenslets, width: int, height: int, assets: Assets
    ) -> "GlassLightFieldCamera":
        """The camera behind a lens of glass."""
        setting = self.setting()
        surfaces = self.glass().packed(
            stop_radius=setting.stop_radius,
            shift=setting.shift,
            diaphragm=self._shape(assets),
            dispersion=self.dispersion is not False,
            coatings=False,
        )
        main = self.main(width, height)
        pixel = main.film.height / height
        half = (0.5 * main.film.width + _SPARE_PIXELS * pixel, 0.5 * main.film.height + _SPARE_PIXELS * pixel)
        try:
            pupils = pupils_of(setting.surfaces, setting.film, half, (LINE_D,), is_round=self.glass().is_round())
        except ValueError as error:
            at("lens", str(error))
        return GlassLightFieldCamera(
            frame=self.frame(),
            surfaces=surfaces,
            grid=grid,
            edge=array.pitch / array.spacing,
            widening=array.pupil / array.image / METRES_PER_MILLIMETRE,
            behind=array.pupil,
            z=setting.film + array.pupil - main.pupil,
            pupil=setting.thin.pupil,
            gain=self._extent(array) if self.is_radiometric() else 1.0,
            wavelengths=None if surfaces.indices is None else spectra(),
            seen=view_of(setting, pupils),
            beyond=array.pupil / main.pupil,
            thin=_thin(main, height, lenslets),
        )


def _thin(main: MainLens, height: int, lenslets: Lenslets) -> Defocus:
    """What would blur a photograph by the main lens on the same sensor, without microlenses."""
    pixel = main.film.height / height / main.image
    return Defocus(METRES_PER_MILLIMETRE * main.diameter, pixel, lenslets.inverse_focus)


def _sizes(array: Arrangement, layout: Lenslets, views: Views) -> dict[str, float]:
    """What microlenses make of a sensor: places and directions."""
    numbers = {
        "microlens_pitch_um": 1e3 * array.pitch,
        "sub_image_px": array.spacing,
        "view_columns": float(views.columns),
        "view_rows": float(views.rows),
        "view_width_px": float(views.width),
        "view_height_px": float(views.height),
    }
    return numbers | ({"seen_by_microlenses": layout.overlap} if layout.is_focused else {})


def _first_middle(size: int, spacing: float) -> float:
    """The middle of the first sub-image between two edges, with as many whole pixels left over on both sides."""
    return math.floor(0.5 * (size - math.floor(size / spacing) * spacing)) + 0.5 * spacing


# ---- In kernels


class PackedLattice(NamedTuple):
    """Steps of a lattice along x and y, in pixels, from `x` and `y` on; and back, from pixels to steps."""

    x: float
    y: float
    along_x: float
    along_y: float
    across_x: float
    across_y: float
    i_x: float
    i_y: float
    j_x: float
    j_y: float


def packed_lattice(lattice: Lattice) -> PackedLattice:
    """A lattice for kernels."""
    (ax, ay), (bx, by) = lattice.along, lattice.across
    area = ax * by - ay * bx
    return PackedLattice(*lattice.origin, ax, ay, bx, by, by / area, -bx / area, -ay / area, ax / area)


class Spread(NamedTuple):
    """Light goes through all of a microlens: by how much it moves on the main lens for that (m per pixel)."""

    blur: float


class Array(NamedTuple):
    """Packed: microlenses before a sensor; lengths on it are pixels of sub-images.

    lattice, of the sub-images; cell and spread, of a microlens, spread None for a pinhole; x, y, where the axis is;
    slope, stride, as in `plenoptic.Lenslets`.
    """

    lattice: PackedLattice
    cell: Any
    spread: Any
    x: float
    y: float
    slope: float
    stride: float


class LightFieldCamera(NamedTuple):
    """Packed, with a thin lens.

    lens, whose plane of focus is that which the microlenses lie in the image of; irradiance, None where the sensor
    gathers radiance; thin, what would blur a photograph without microlenses.
    """

    frame: Frame
    lens: Any
    grid: Array
    irradiance: Any
    thin: Defocus


class GlassLightFieldCamera(NamedTuple):
    """Packed, with a lens of glass (mm, in the lens's frame).

    edge, of a pixel of sub-images on the array; widening, of places on the thin lens in place of it (m) to those in its
    exit pupil; behind, how far the array is behind that; z, the array's place on the axis; pupil, that of the entrance
    pupil; gain, of cos^4; wavelengths, tables of spectra where the glass disperses, else None; seen, where on the film
    a direction is seen, and beyond, by how much that is larger on the array; thin, in place of the lens.
    """

    frame: Frame
    surfaces: LensSurfaces
    grid: Array
    edge: float
    widening: float
    behind: float
    z: float
    pupil: float
    gain: float
    wavelengths: Any
    seen: Any
    beyond: float
    thin: Defocus


@generic
def through(spread, grid, draws):
    """Where light goes through a microlens, from its middle (pixels), and how far that moves it on the main lens (m).

    All right and down.
    """
    raise NotImplementedError


@through.register(type(None))
def _(spread, grid, draws):
    return 0.0, 0.0, 0.0, 0.0


@through.register(Spread)
def _(spread, grid, draws):
    u1, u2 = sample_2d(draws.sampler, draws.key, draws.index, draws.dimension + LENS)
    i, j = within_cell(grid.cell, u1, u2)
    x = i * grid.lattice.along_x + j * grid.lattice.across_x
    y = i * grid.lattice.along_y + j * grid.lattice.across_y
    return x, y, -spread.blur * x, -spread.blur * y


@kernel
def way_of(grid, x, y, draws):
    """The way that light takes to a place of the sensor.

    Returns
    -------
    Where it goes through the array, right and up from the axis (pixels), and through the main lens, right and up (m).
    """
    lattice = grid.lattice
    from_x, from_y = x - lattice.x, y - lattice.y
    i, j = nearest(grid.cell, lattice.i_x * from_x + lattice.i_y * from_y, lattice.j_x * from_x + lattice.j_y * from_y)
    middle_x = lattice.x + i * lattice.along_x + j * lattice.across_x
    middle_y = lattice.y + i * lattice.along_y + j * lattice.across_y
    off_x, off_y, moved_x, moved_y = through(grid.spread, grid, draws)
    right = grid.stride * (x - middle_x) + moved_x
    down = grid.stride * (y - middle_y) + moved_y
    return middle_x + off_x - grid.x, grid.y - middle_y - off_y, right, -down


@camera_ray.register(LightFieldCamera)
def _(camera, x, y, time, draws):
    frame, lens = camera.frame, camera.lens
    array_x, array_y, right, up = way_of(camera.grid, x, y, draws)
    slope_x, slope_y = camera.grid.slope * array_x, camera.grid.slope * array_y
    shift = add(scale(right, frame.right), scale(up, frame.up))
    direction = add(add(scale(slope_x, frame.right), scale(slope_y, frame.up)), frame.forward)
    towards = madd(direction, -lens.inverse_focus, shift)
    passes = covers(lens.shape, right / lens.radius, up / lens.radius)
    passes *= unvignetted(lens.rim, right, up, slope_x - lens.inverse_focus * right, slope_y - lens.inverse_focus * up)
    weight = passes * gathered(camera.irradiance, direction, shift, towards)
    return add(frame.origin, shift), normalize(towards), weight


@rays_together.register(GlassLightFieldCamera)
def _(camera):
    return Together()


@set_lane.register(GlassLightFieldCamera)
def _(camera, rows, lane, x, y, draws):
    array_x, array_y, right, up = way_of(camera.grid, x, y, draws)
    # The picture lies upside down behind the lens.
    place_x, place_y = -camera.edge * array_x, -camera.edge * array_y
    rows[packets.ORIGIN, lane], rows[packets.ORIGIN + 1, lane] = place_x, place_y
    rows[packets.DIRECTION, lane] = camera.widening * right - place_x
    rows[packets.DIRECTION + 1, lane] = camera.widening * up - place_y
    draw_wavelength(camera.wavelengths, rows, lane, draws)


@trace_lanes.register(GlassLightFieldCamera)
def _(camera, rows):
    square = set_out(rows, camera.z, camera.behind)
    store(rows, packets.WEIGHT, camera.gain * (square * square))
    packets.trace_packet(camera.surfaces, rows)


@lane_ray.register(GlassLightFieldCamera)
def _(camera, rows, lane, x, y, time, draws):
    return traced_ray(camera, rows, lane)


@defocus_of.register(LightFieldCamera)
def _(camera: LightFieldCamera) -> Defocus:
    return camera.thin


@defocus_of.register(GlassLightFieldCamera)
def _(camera: GlassLightFieldCamera) -> Defocus:
    return camera.thin


@project.register(LightFieldCamera)
def _(camera, point, time):
    right, up, depth = in_frame(camera.frame, point)
    if depth <= 0.0:
        return math.nan, math.nan, depth
    grid = camera.grid
    return grid.x + right / depth / grid.slope, grid.y - up / depth / grid.slope, depth


@project.register(GlassLightFieldCamera)
def _(camera, point, time):
    right, up, depth = in_frame(camera.frame, point)
    x, y = seen_at(camera.seen, right, up, depth)
    scaled = camera.beyond / camera.edge
    return camera.grid.x + scaled * x, camera.grid.y - scaled * y, depth
