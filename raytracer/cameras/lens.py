"""Camera with a lens of glass: rays go through all of its surfaces, so it has the errors of a real one.

In a scene:

    camera: {type: lens, lens: lenses/double-gauss-50mm.yaml, look_from: [0, 1, 4], look_at: [0, 1, 0],
             sensor: full_frame, f_number: 2, focus_distance: 2}
    camera: {type: lens, lens: lenses/cooke-triplet-50mm.yaml, look_from: [0, 1.6, 4], look_at: [0, 1, 0],
             f_number: 5.6, focus_distance: 3, shutter: 1/125 s, iso: 400}
"""

import functools
import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PrivateAttr, model_validator

from raytracer.apertures.interface import ApertureSpec
from raytracer.cameras.exposed import ExposedSpec
from raytracer.cameras.interface import (
    GHOST,
    LENS,
    NO_ASSETS,
    WAVELENGTH,
    Assets,
    Defocus,
    Together,
    defocus_of,
    lane_ray,
    project,
    rays_together,
    set_lane,
    share_lanes,
    trace_lanes,
)
from raytracer.cameras.placement import Frame, in_frame
from raytracer.glass import LINE_D
from raytracer.jit import generic, kernel
from raytracer.kinds import APERTURES
from raytracer.lanes import WIDTH, load, root, select, store
from raytracer.lenses import packets
from raytracer.lenses.equivalent import ThinEquivalent, thin_equivalent
from raytracer.lenses.first_order import cardinal_points
from raytracer.lenses.focusing import film_place, focus_shift
from raytracer.lenses.ghosts import Flare, aim_ghost, choose, flare_of, trace_way
from raytracer.lenses.lens import Lens
from raytracer.lenses.pupils import SquarePupils, aim, aiming_plane, light_on_axis, middle, pupils_of, rear_reach
from raytracer.lenses.stops import f_number_of, stop_radius_for
from raytracer.lenses.surfaces import LensSurfaces, trace_rays
from raytracer.photography import airy_diameter_um, crop_factor, exposure_value
from raytracer.sampling import sample_1d, sample_2d
from raytracer.sampling.warp import sample_disc
from raytracer.sensors import SENSORS, Size
from raytracer.spec import Fraction, Name, PositiveLengthOrInf, Quantity, at
from raytracer.spectra import FIRST, LAST, Spectra, hero, spectra
from raytracer.units import METRES_PER_MILLIMETRE
from raytracer.vec import add, madd, scale

if TYPE_CHECKING:
    Aperture: TypeAlias = ApertureSpec
else:
    Aperture = APERTURES.union_or_name()

_FOCUSES = ("focus_distance", "focus_on", "focus_at")

# Wavelengths (nm) for which the pupil is looked for: what glass does is monotonous between them.
_SEEN = (FIRST, 500.0, LAST)

# Steps by which a place of the film is found that sees a direction.
_ROUNDS = 16

# Rows of a packet in which the way through the lens is: the surfaces that reflect.
_WAY = packets.FREE

_SPARE_PIXELS = 8
"""By how many pixels the film for which the pupil is known is larger than the picture: filters reach out of it."""


class _Setting(NamedTuple):
    """A lens as a camera has set it (mm): wide open or stopped down, and focused.

    stop_radius, None for wide open; shift, of the group that focuses; surfaces, packed for the d line; film, where it
    is on the axis; thin, the thin lens in place of it; focal_length, f_number, of the lens as it is set.
    """

    stop_radius: float | None
    shift: float
    surfaces: LensSurfaces
    film: float
    thin: ThinEquivalent
    focal_length: float
    f_number: float


@functools.lru_cache(maxsize=64)
def _stop(lens: Lens, f_number: float) -> float | None:
    """Radius of the stop for an f-number; None for wide open."""
    try:
        return stop_radius_for(lens, f_number)
    except ValueError:
        # What is engraved on a lens is rounded.
        if lens.f_number is not None and f_number >= lens.f_number:
            return None
        raise


@functools.lru_cache(maxsize=64)
def _set(lens: Lens, stop_radius: float | None, distance: float, how: str) -> _Setting:
    """A lens focused at a distance (mm) from its entrance pupil."""
    shift, film = focus_shift(lens, distance, how, stop_radius=stop_radius)
    surfaces = lens.packed(stop_radius=stop_radius, shift=shift)
    thin = thin_equivalent(surfaces, film, distance)
    return _Setting(
        stop_radius, shift, surfaces, film, thin, abs(cardinal_points(surfaces).focal_length), f_number_of(surfaces)
    )


class RealLens(ExposedSpec):
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

    loads: ClassVar[Mapping[str, str]] = {"lens": "lens"}
    binds: ClassVar[tuple[str, ...]] = ("lens",)

    type: Literal["lens"] = "lens"
    lens: str = Field(description="prescription of the lens (.yaml .dat .zmx), relative to the scene", min_length=1)
    f_number: Annotated[float, Quantity(low=0.0, low_open=True)] | None = Field(
        default=None, description="f-number to which the stop closes; by default it is as wide open as it goes"
    )
    focus_distance: PositiveLengthOrInf | None = Field(
        default=None,
        description="distance of the plane of focus along the axis, from the entrance pupil (m), inf allowed; default: "
        "|look_at - look_from|",
    )
    focus_on: Name | None = Field(
        default=None,
        description="name of the object whose middle is in focus, in place of `focus_distance`; for the surface that "
        "is seen of it, see `focus_at`",
    )
    focus_at: tuple[Fraction, Fraction] | None = Field(
        default=None,
        description="place in the frame at which what is seen is in focus: fractions of its width and height, from the "
        "top left, in place of `focus_distance`; infinity where nothing is seen; cutouts count as solid",
    )
    focus: Literal["marginal", "rms"] = Field(
        default="marginal",
        description="what is sharp: where light through the zone of the pupil that halves its area meets on the axis, "
        "or where the spot of a point of the axis has the least root mean square radius (`rms`)",
    )
    aperture_shape: Aperture | None = Field(
        default=None,
        description="shape of the stop, of the same area as the round one: a type, or a mapping; round by default",
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
    _bound: Lens | None = PrivateAttr(default=None)

    @model_validator(mode="after")
    def _one_focus(self) -> "RealLens":
        focuses = [key for key in _FOCUSES if getattr(self, key) is not None]
        if len(focuses) > 1:
            at(focuses[1], f"{focuses[0]} and {focuses[1]} both set the plane of focus: give one of them")
        return self

    # ---- What it is with its lens

    def bound(self, assets: Assets) -> "RealLens":
        bound = self.model_copy()
        bound._bound = assets["lens"]
        radius = bound._stop_radius()
        try:
            film_place(bound.glass(), self.focus, stop_radius=radius)
        except ValueError as error:
            at("lens", str(error))
        if self.focus_on is None and self.focus_at is None:
            bound._check_focus()
        return bound

    def glass(self) -> Lens:
        """The lens that its file holds; the camera must be `bound`."""
        if self._bound is None:
            raise TypeError("the camera has not been bound to the lens that its file holds")
        return self._bound

    def _stop_radius(self) -> float | None:
        if self.f_number is None:
            return None
        try:
            return _stop(self.glass(), self.f_number)
        except ValueError as error:
            at("f_number", str(error))

    def _check_focus(self) -> None:
        """Refuse a plane of focus that the lens cannot have."""
        try:
            self.setting()
        except ValueError as error:
            at("lens" if self.focus_distance is None else "focus_distance", str(error))

    def setting(self) -> _Setting:
        """The lens as it is set.

        Raises
        ------
        ValueError : it cannot be focused so.
        """
        return _set(self.glass(), self._stop_radius(), 1e3 * self.focal_distance(), self.focus)

    def focal_distance(self) -> float:
        """Distance of the plane of focus (m)."""
        return self.distance() if self.focus_distance is None else self.focus_distance

    def focused(self, distance: float) -> "RealLens":
        """The camera focused at a distance along its axis (m) in place of on an object, or at a place in the frame.

        Raises
        ------
        ValueError : the lens cannot be focused there.
        """
        focused = self.model_copy(update={"focus_distance": distance, "focus_on": None, "focus_at": None})
        focused._check_focus()
        return focused

    def sight(self, x: float, y: float, width: int, height: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The ray through the middle of the pupil: see `PerspectiveSpec.sight`."""
        setting, film = self.setting(), self._film(width, height)
        place = ((0.5 - x) * film.width, (y - 0.5) * film.height)
        target = middle(setting.surfaces, setting.film, *place, LINE_D)
        if target is None:
            raise ValueError("no light arrives there: the lens's image circle does not reach so far")
        points, ways = _traced(setting, np.array([place]), target[None])
        return METRES_PER_MILLIMETRE * points[0], ways[0]

    def _film(self, width: int, height: int) -> Size:
        """The part of the sensor that the picture shows (mm)."""
        return self._fitted(self._sensor() or Size(*SENSORS["full_frame"]), width, height)

    def relative_aperture(self, width: int, height: int) -> float | None:
        return self.setting().f_number

    def is_radiometric(self) -> bool:
        return self.iso is not None or self.exposure is not None

    def equivalent(self, width: int, height: int) -> dict[str, Any]:
        """The thin-lens camera in place of this one: keys of a scene file, of plain values."""
        setting = self.setting()
        thin, film = setting.thin, self._film(width, height)
        kept = [key for key in ExposedSpec.model_fields if key in self.model_fields_set - {"type", "sensor"}]
        keys = {"type": "thin_lens"} | {key: getattr(self, key) for key in kept}
        focus = {key: getattr(self, key) for key in ("focus_on", "focus_at") if getattr(self, key) is not None}
        return {
            **keys,
            "sensor": self.sensor if self.sensor is not None else "full_frame",
            "vfov": thin.vfov(film.height),
            **(focus or {"focus_distance": self.focal_distance()}),
            "aperture": thin.aperture,
            **({} if self.aperture_shape is None else {"aperture_shape": self.aperture_shape}),
        }

    def describe(self, width: int, height: int) -> dict[str, float]:
        """Derived numbers for `rt explain`, by name with unit; those of the thin lens in place of it begin so."""
        setting, film = self.setting(), self._film(width, height)
        sensor = self._sensor() or Size(*SENSORS["full_frame"])
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
        focus = self.focal_distance()
        return {
            **_angles(setting, film),
            **numbers,
            "magnification": thin.image_distance / (1e3 * focus),
            "focus_distance_m": focus,
            "aperture_diameter_mm": pupil,
            "blur_at_infinity_px": pupil * thin.image_distance / (1e3 * focus) / pitch,
            "thin_lens_focal_length_mm": thin.focal_length,
            "thin_lens_f_number": thin.f_number,
            "thin_lens_vfov_deg": thin.vfov(film.height),
        }

    def doubts(self, width: int, height: int) -> list[tuple[str, str]]:
        found = [
            ("lens", f"surfaces {first} and {second} of the lens go through each other within their apertures")
            for first, second in self.glass().crossings()
        ]
        circle, film = self.glass().image_circle, self._film(width, height)
        corner = math.hypot(*film)
        # Sizes of sensors are rounded to a tenth of a millimetre, and so are image circles.
        if circle is None or corner <= circle + 0.2:
            return found
        message = (
            f"the picture is {corner:.3g} mm across its corners, and the image circle of the lens {circle:.3g} mm: "
            "beyond it the picture is dark, or worse than the lens was made for"
        )
        return [*found, ("lens" if self.sensor is None else "sensor", message)]

    # ---- Packed

    def files(self) -> dict[tuple[str | int, ...], tuple[str, str]]:
        shape = {} if self.aperture_shape is None else self.aperture_shape.files()
        return super().files() | {("aperture_shape", *keys): file for keys, file in shape.items()}

    def pack(self, width: int, height: int, assets: Assets = NO_ASSETS) -> "LensCamera":
        """The camera for a film of width x height pixels, with its pupil as each place of the film sees it."""
        lens, setting = self.glass(), self.setting()
        surfaces = lens.packed(
            stop_radius=setting.stop_radius,
            shift=setting.shift,
            diaphragm=self._shape(assets),
            dispersion=self.dispersion,
            coatings=self.flare,
        )
        film = self._film(width, height)
        pixel = film.height / height
        half = (0.5 * film.width + _SPARE_PIXELS * pixel, 0.5 * film.height + _SPARE_PIXELS * pixel)
        # For colours of coatings light has a wavelength too.
        is_spectral = surfaces.indices is not None or surfaces.coatings is not None
        seen = _SEEN if surfaces.indices is not None else (LINE_D,)
        bare = surfaces._replace(coatings=None)
        try:
            pupils = pupils_of(bare, setting.film, half, seen, is_round=lens.is_round())
            light = light_on_axis(bare, setting.film, LINE_D, is_round=lens.is_round())
        except ValueError as error:
            at("lens", str(error))
        plane, rear = aiming_plane(bare, setting.film), float(surfaces.vertex[-1])
        flare = None
        if self.flare:
            behind, corner = setting.film - rear, math.hypot(*half)
            reach = rear_reach(bare, setting.film, corner)
            flare = Reflections(flare_of(surfaces, corner, behind, reach=reach, is_round=lens.is_round()), behind)
        return LensCamera(
            frame=self.frame(),
            film=Film(pixel, -0.5 * film.width, 0.5 * film.height, setting.film),
            surfaces=surfaces,
            pupils=pupils,
            plane=plane,
            pupil=setting.thin.pupil,
            gain=(1.0 if self.is_radiometric() else 1.0 / light) / (setting.film - plane) ** 2,
            wavelengths=spectra() if is_spectral else None,
            flare=flare,
            seen=_view(setting, pupils),
            thin=Defocus(
                METRES_PER_MILLIMETRE * setting.thin.aperture,
                pixel / setting.thin.image_distance,
                1.0 / self.focal_distance(),
            ),
        )

    def _shape(self, assets: Assets) -> Any:
        """The packed shape of the stop; None if it is round."""
        shape = self.aperture_shape
        if shape is None:
            return None
        try:
            return shape.pack({key: assets[f"aperture_shape.{key}"] for key in shape.loads})
        except ValueError as error:
            at(("aperture_shape", *shape.loads), str(error))


# ---- What is seen where


def _traced(
    setting: _Setting, places: NDArray[np.float64], targets: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Rays from places of the film (n, 2) through points of the plane that is aimed at (n, 2), at the d line.

    Returns
    -------
    Points (mm) from the middle of the entrance pupil, and directions, as right, up, forward: (n, 3); NaN where lost.
    """
    plane = aiming_plane(setting.surfaces, setting.film)
    starts = np.column_stack([places, np.full(len(places), setting.film)])
    ways = np.column_stack([targets, np.full(len(places), plane)]) - starts
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    weights, points, onward = trace_rays(setting.surfaces, starts, ways, False)
    points[:, 2] -= setting.thin.pupil
    for rows in (points, onward):
        rows[:, 2] *= -1.0
        rows[weights == 0.0] = np.nan
    return points, onward


def _sights(setting: _Setting, places: NDArray[np.float64], targets: NDArray[np.float64]) -> NDArray[np.float64]:
    """Directions (n, 3) from the middle of the entrance pupil in which such rays are at the distance of focus."""
    points, ways = _traced(setting, places, targets)
    distance = setting.thin.focus_distance
    if math.isinf(distance):
        return ways
    along = (points * ways).sum(axis=1)
    way = -along + np.sqrt(along**2 - (points**2).sum(axis=1) + distance**2)
    return np.asarray(points + way[:, None] * ways)


def _angles(setting: _Setting, film: Size) -> dict[str, float]:
    """Fields of view (deg) between opposite edges and corners, by rays, as far as the lens reaches these."""
    found = {}
    for name, x, y in (("v", 0.0, 0.5), ("h", 0.5, 0.0), ("d", 0.5, 0.5)):
        place = (x * film.width, y * film.height)
        target = middle(setting.surfaces, setting.film, *place, LINE_D)
        if target is not None:
            ((right, up, forward),) = _sights(setting, np.array([place]), target[None])
            found[f"{name}fov_deg"] = 2.0 * math.degrees(math.atan2(math.hypot(right, up), forward))
    return found


class RoundView(NamedTuple):
    """Packed, of a lens that is alike all around its axis: how far from the axis an angle is seen.

    radius (n,) float64, on the film (mm), of evenly spaced angles from 0 on; per_radian, how many a radian has.
    """

    radius: NDArray[np.float64]
    per_radian: float


class SquareView(NamedTuple):
    """Packed, of any other: in which direction each place of a quadrant of the film sees.

    slopes (n, m, 2) float64, by |y| and |x| on the film: how far to the side and up a metre ahead; step_x and step_y,
    of the table (mm); image_x and image_y, how large a slope is on the film, near the axis (mm).
    """

    slopes: NDArray[np.float64]
    step_x: float
    step_y: float
    image_x: float
    image_y: float


_ANGLES = 1025


def _view(setting: _Setting, pupils: Any) -> RoundView | SquareView:
    """What `project` needs, from where the pupil is."""
    ellipses = pupils.ellipses
    if isinstance(pupils, SquarePupils):
        rows, columns = ellipses.shape[:2]
        places = np.stack(np.meshgrid(np.arange(columns) / pupils.per_mm_x, np.arange(rows) / pupils.per_mm_y), axis=-1)
        sights = _sights(setting, places.reshape(-1, 2), ellipses[..., :2].reshape(-1, 2)).reshape(rows, columns, 3)
        slopes = -sights[..., :2] / sights[..., 2:]
        step_x, step_y = 1.0 / pupils.per_mm_x, 1.0 / pupils.per_mm_y
        image_x, image_y = step_x / float(slopes[0, 1, 0]), step_y / float(slopes[1, 0, 1])
        return SquareView(np.ascontiguousarray(slopes), step_x, step_y, image_x, image_y)
    from scipy.interpolate import PchipInterpolator

    radii = np.arange(len(ellipses)) / pupils.per_mm
    targets = np.column_stack([ellipses[:, 0], np.zeros(len(ellipses))])
    sights = _sights(setting, np.column_stack([radii, np.zeros(len(radii))]), targets)
    angles = np.arctan2(-sights[:, 0], sights[:, 2])
    angles[0] = 0.0
    # Up to where the lens shows nothing, or the same again.
    odd = np.flatnonzero(~(np.diff(angles) > 0.0))
    count = int(odd[0]) + 1 if len(odd) else len(angles)
    if count < 2:
        return RoundView(np.zeros(2), 1.0)
    even = np.linspace(0.0, angles[count - 1], _ANGLES)
    return RoundView(
        np.ascontiguousarray(PchipInterpolator(angles[:count], radii[:count])(even)), (_ANGLES - 1) / float(even[-1])
    )


@generic
def seen_at(view, right, up, forward):
    """Where on the film (mm, upright) a direction is seen; NaN if nowhere."""
    raise NotImplementedError


@seen_at.register(RoundView)
def _(view, right, up, forward):
    across = math.hypot(right, up)
    place = math.atan2(across, forward) * view.per_radian
    if not place <= len(view.radius) - 1.0:
        return math.nan, math.nan
    if across == 0.0:
        return 0.0, 0.0
    row = min(int(place), len(view.radius) - 2)
    part = place - row
    radius = view.radius[row] + part * (view.radius[row + 1] - view.radius[row])
    return radius * right / across, radius * up / across


@seen_at.register(SquareView)
def _(view, right, up, forward):
    if forward <= 0.0:
        return math.nan, math.nan
    rows, columns = view.slopes.shape[0], view.slopes.shape[1]
    wanted_x, wanted_y = abs(right / forward), abs(up / forward)
    x, y = wanted_x * view.image_x, wanted_y * view.image_y
    # Go by what the middle of the film would need, again and again: distortion is little beside that.
    for _round in range(_ROUNDS):
        across, above = x / view.step_x, y / view.step_y
        column, row = max(0, min(int(across), columns - 2)), max(0, min(int(above), rows - 2))
        u, v = across - column, above - row
        a, b = view.slopes[row, column], view.slopes[row, column + 1]
        c, d = view.slopes[row + 1, column], view.slopes[row + 1, column + 1]
        slope_x = (1.0 - v) * ((1.0 - u) * a[0] + u * b[0]) + v * ((1.0 - u) * c[0] + u * d[0])
        slope_y = (1.0 - v) * ((1.0 - u) * a[1] + u * b[1]) + v * ((1.0 - u) * c[1] + u * d[1])
        x += view.image_x * (wanted_x - slope_x)
        y += view.image_y * (wanted_y - slope_y)
    if not (0.0 <= x <= (columns - 1) * view.step_x and 0.0 <= y <= (rows - 1) * view.step_y):
        return math.nan, math.nan
    return math.copysign(x, right), math.copysign(y, up)


# ---- In kernels


class Film(NamedTuple):
    """The film (mm): edge of a pixel, left and top edge of the upright picture, and its place on the lens's axis."""

    pixel: float
    left: float
    top: float
    z: float


class Reflections(NamedTuple):
    """Light that is reflected in the lens.

    ways, that it takes; behind, how far behind the last vertex the film is (mm).
    """

    ways: Flare
    behind: float


class LensCamera(NamedTuple):
    """Packed.

    film, surfaces, pupils, in the lens's frame; plane, on which the pupils are, and pupil, the place of the entrance
    pupil, on its axis (mm); gain, of cos^4 times an area (1/mm2); wavelengths, tables of spectra where light has a
    wavelength in the lens, else None; flare, Reflections or None; seen, where what is; thin, in place of it.
    """

    frame: Frame
    film: Film
    surfaces: LensSurfaces
    pupils: Any
    plane: float
    pupil: float
    gain: float
    wavelengths: Any
    flare: Any
    seen: Any
    thin: Defocus


@generic
def draw_wavelength(wavelengths, rows, lane, draws):
    """Give a sample its wavelength (nm)."""
    raise NotImplementedError


@draw_wavelength.register(type(None))
def _(wavelengths, rows, lane, draws):
    return


@draw_wavelength.register(Spectra)
def _(wavelengths, rows, lane, draws):
    drawn = sample_1d(draws.sampler, draws.key, draws.index, draws.dimension + WAVELENGTH)
    rows[packets.DRAWN, lane] = drawn
    rows[packets.WAVELENGTH, lane], _ = hero(wavelengths, drawn)


@generic
def aim_way(flare, camera, rows, lane, x, y, u, v, draws):
    """As `pupils.aim`, of the way that a sample takes through the lens, which is noted down."""
    raise NotImplementedError


@aim_way.register(type(None))
def _(flare, camera, rows, lane, x, y, u, v, draws):
    return aim(camera.pupils, x, y, u, v)


@aim_way.register(Reflections)
def _(flare, camera, rows, lane, x, y, u, v, draws):
    number, mix = sample_2d(draws.sampler, draws.key, draws.index, draws.dimension + GHOST)
    pair, first, last, probability = choose(flare.ways, number)
    rows[_WAY, lane], rows[_WAY + 1, lane] = first, last
    if first < 0:
        target_x, target_y, area = aim(camera.pupils, x, y, u, v)
        return target_x, target_y, area / probability
    # From the plane of the last vertex to that which is aimed at.
    target_x, target_y, area = aim_ghost(flare.ways, pair, x, y, u, v, mix)
    away = (camera.film.z - camera.plane) / flare.behind
    return x + away * (target_x - x), y + away * (target_y - y), area * away * away / probability


@generic
def go(flare, camera, rows):
    """Follow the rays of a packet to the scene."""
    raise NotImplementedError


@go.register(type(None))
def _(flare, camera, rows):
    packets.trace_packet(camera.surfaces, rows)


@go.register(Reflections)
def _(flare, camera, rows):
    for lane in range(WIDTH):
        if rows[packets.WEIGHT, lane] > 0.0:
            origin = rows[packets.ORIGIN, lane], rows[packets.ORIGIN + 1, lane], rows[packets.ORIGIN + 2, lane]
            way = rows[packets.DIRECTION, lane], rows[packets.DIRECTION + 1, lane], rows[packets.DIRECTION + 2, lane]
            first, last = int(rows[_WAY, lane]), int(rows[_WAY + 1, lane])
            wavelength = wavelength_in(camera.wavelengths, rows[packets.WAVELENGTH, lane])
            weight, origin, way = trace_way(camera.surfaces, origin, way, first, last, wavelength)
            rows[packets.WEIGHT, lane] *= weight
            for axis in range(3):
                rows[packets.ORIGIN + axis, lane] = origin[axis]
                rows[packets.DIRECTION + axis, lane] = way[axis]


@generic
def wavelength_in(wavelengths, wavelength):
    """The wavelength of light that has one, else None."""
    raise NotImplementedError


@wavelength_in.register(type(None))
def _(wavelengths, wavelength):
    return None


@wavelength_in.register(Spectra)
def _(wavelengths, wavelength):
    return wavelength


@rays_together.register(LensCamera)
def _(camera):
    return Together()


@kernel
def _on_film(film, x, y):
    """Where a film position of the picture is in the lens's frame (mm): the picture lies upside down there."""
    return -(film.left + film.pixel * x), film.pixel * y - film.top


@set_lane.register(LensCamera)
def _(camera, rows, lane, x, y, draws):
    film_x, film_y = _on_film(camera.film, x, y)
    u1, u2 = sample_2d(draws.sampler, draws.key, draws.index, draws.dimension + LENS)
    u, v = sample_disc(u1, u2)
    target_x, target_y, area = aim_way(camera.flare, camera, rows, lane, film_x, film_y, u, v, draws)
    rows[packets.ORIGIN, lane], rows[packets.ORIGIN + 1, lane] = film_x, film_y
    rows[packets.DIRECTION, lane], rows[packets.DIRECTION + 1, lane] = target_x - film_x, target_y - film_y
    rows[packets.WEIGHT, lane] = area
    draw_wavelength(camera.wavelengths, rows, lane, draws)


@trace_lanes.register(LensCamera)
def _(camera, rows):
    x, y = load(rows, packets.DIRECTION), load(rows, packets.DIRECTION + 1)
    behind = camera.film.z - camera.plane
    inverse = 1.0 / root(x * x + y * y + behind * behind)
    cosine = behind * inverse
    square = cosine * cosine
    store(rows, packets.ORIGIN + 2, camera.film.z)
    store(rows, packets.DIRECTION, x * inverse)
    store(rows, packets.DIRECTION + 1, y * inverse)
    store(rows, packets.DIRECTION + 2, -cosine)
    extent = load(rows, packets.WEIGHT) * (square * square)
    store(rows, packets.EXTENT, extent)
    store(rows, packets.WEIGHT, camera.gain * extent)
    go(camera.flare, camera, rows)


@share_lanes.register(LensCamera)
def _(camera, sharing, rows, others, x, y):
    # Back through the lens, which stands in a mirror.
    weight = load(rows, packets.WEIGHT)
    whole = camera.gain * load(rows, packets.EXTENT)
    store(others, packets.WEIGHT, select(weight > 0.0, whole / weight, 0.0))
    for axis in range(2):
        store(others, packets.ORIGIN + axis, load(rows, packets.ORIGIN + axis))
        store(others, packets.DIRECTION + axis, -load(rows, packets.DIRECTION + axis))
    store(others, packets.ORIGIN + 2, -load(rows, packets.ORIGIN + 2))
    store(others, packets.DIRECTION + 2, load(rows, packets.DIRECTION + 2))
    packets.trace_packet(sharing.back, others)

    # See where on the film that is, from the middle of the pixel on.
    along = load(others, packets.DIRECTION + 2)
    onward = (-camera.film.z - load(others, packets.ORIGIN + 2)) / along
    square = along * along
    store(others, packets.EXTENT, square * square)
    for axis in range(2):
        place = load(others, packets.ORIGIN + axis) + onward * load(others, packets.DIRECTION + axis)
        store(others, packets.ORIGIN + axis, place)
    middle_x, middle_y = _on_film(camera.film, x + 0.5, y + 0.5)
    reach = 0.5 * sharing.edge * camera.film.pixel
    for lane in range(WIDTH):
        film_x, film_y = others[packets.ORIGIN, lane], others[packets.ORIGIN + 1, lane]
        _, _, area = aim(camera.pupils, film_x, film_y, 0.0, 0.0)
        others[packets.EXTENT, lane] *= area
        if not (abs(film_x - middle_x) <= reach and abs(film_y - middle_y) <= reach and area > 0.0):
            others[packets.WEIGHT, lane] = 0.0


@kernel
def in_world(camera, origin, direction):
    """A ray before the lens (mm), in the scene (m)."""
    frame = camera.frame
    ahead = METRES_PER_MILLIMETRE * (camera.pupil - origin[2])
    side = scale(METRES_PER_MILLIMETRE * origin[0], frame.right)
    side = madd(side, METRES_PER_MILLIMETRE * origin[1], frame.up)
    start = add(frame.origin, madd(side, ahead, frame.forward))
    way = add(scale(direction[0], frame.right), scale(direction[1], frame.up))
    return start, madd(way, -direction[2], frame.forward)


@lane_ray.register(LensCamera)
def _(camera, rows, lane, x, y, time, draws):
    origin = rows[packets.ORIGIN, lane], rows[packets.ORIGIN + 1, lane], rows[packets.ORIGIN + 2, lane]
    way = rows[packets.DIRECTION, lane], rows[packets.DIRECTION + 1, lane], rows[packets.DIRECTION + 2, lane]
    start, direction = in_world(camera, origin, way)
    return start, direction, rows[packets.WEIGHT, lane]


@defocus_of.register(LensCamera)
def _(camera: LensCamera) -> Defocus:
    return camera.thin


@project.register(LensCamera)
def _(camera, point, time):
    right, up, depth = in_frame(camera.frame, point)
    x, y = seen_at(camera.seen, right, up, depth)
    return (x - camera.film.left) / camera.film.pixel, (camera.film.top - y) / camera.film.pixel, depth
