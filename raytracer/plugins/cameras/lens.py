"""Camera with a lens of glass: rays go through all of its surfaces, so it has the errors of a real one.

In a scene:

    camera: {type: lens, lens: lenses/double-gauss-50mm.yaml, look_from: [0, 1, 4], look_at: [0, 1, 0],
             sensor: full_frame, f_number: 2, focus_distance: 2}
    camera: {type: lens, lens: lenses/cooke-triplet-50mm.yaml, look_from: [0, 1.6, 4], look_at: [0, 1, 0],
             f_number: 5.6, focus_distance: 3, shutter: 1/125 s, iso: 400}
"""

import math
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PrivateAttr

from raytracer.cameras.exposed import ExposedSpec
from raytracer.cameras.focused import FocusedSpec
from raytracer.cameras.glass import draw_wavelength, set_out, stop_for_key, traced_ray
from raytracer.cameras.interface import (
    GHOST,
    LENS,
    NO_ASSETS,
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
from raytracer.lanes import WIDTH, load, select, store
from raytracer.lenses import packets
from raytracer.lenses.doubts import doubts as lens_doubts
from raytracer.lenses.focusing import film_place
from raytracer.lenses.ghosts import Flare, aim_ghost, choose, flare_of, trace_way
from raytracer.lenses.lens import Lens
from raytracer.lenses.pupils import aim, aiming_plane, light_on_axis, middle, pupils_of, rear_reach
from raytracer.lenses.setting import Setting, set_lens
from raytracer.lenses.sights import angles_of, seen_at, traced, view_of
from raytracer.lenses.surfaces import LensSurfaces
from raytracer.photography import airy_diameter_um, crop_factor, exposure_value
from raytracer.sampling import sample_2d
from raytracer.sampling.warp import sample_disc
from raytracer.sensors import SENSORS, Size
from raytracer.spec import Quantity, at
from raytracer.spectra import FIRST, LAST, Spectra, spectra
from raytracer.units import METRES_PER_MILLIMETRE

# Wavelengths (nm) for which the pupil is looked for: what glass does is monotonous between them.
_SEEN = (FIRST, 500.0, LAST)

# Rows of a packet in which the way through the lens is: the surfaces that reflect.
_WAY = packets.FREE

_SPARE_PIXELS = 8
"""By how many pixels the film for which the pupil is known is larger than the picture: filters reach out of it."""


class RealLens(FocusedSpec):
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
    focus: Literal["marginal", "rms"] = Field(
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
    _bound: Lens | None = PrivateAttr(default=None)

    # ---- What it is with its lens

    def bound(self, assets: Assets) -> "RealLens":
        bound = self.model_copy()
        bound._bound = assets["lens"]
        radius = stop_for_key(bound.glass(), bound.f_number)
        try:
            film_place(bound.glass(), self.focus, stop_radius=radius)
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

    def _check_focus(self) -> None:
        """Refuse a plane of focus that the lens cannot have."""
        try:
            self.setting()
        except ValueError as error:
            at("lens" if self.focus_distance is None else "focus_distance", str(error))

    def setting(self) -> Setting:
        """The lens as it is set.

        Raises
        ------
        ValueError : it cannot be focused so.
        """
        return set_lens(
            self.glass(), stop_for_key(self.glass(), self.f_number), 1e3 * self.focal_distance(), self.focus
        )

    def sight(self, x: float, y: float, width: int, height: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The ray through the middle of the pupil: see `PerspectiveSpec.sight`."""
        setting, film = self.setting(), self._film(width, height)
        place = ((0.5 - x) * film.width, (y - 0.5) * film.height)
        target = middle(setting.surfaces, setting.film, *place, LINE_D)
        if target is None:
            raise ValueError("no light arrives there: the lens's image circle does not reach so far")
        points, ways = traced(setting, np.array([place]), target[None])
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
            **angles_of(setting, film),
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
        found = [("lens", message) for message in lens_doubts(self.glass(), self.setting().shift)]
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
            # First what tells quickly that no light comes through.
            light = light_on_axis(bare, setting.film, LINE_D, is_round=lens.is_round())
            pupils = pupils_of(bare, setting.film, half, seen, is_round=lens.is_round())
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
            seen=view_of(setting, pupils),
            thin=Defocus(
                METRES_PER_MILLIMETRE * setting.thin.aperture,
                pixel / setting.thin.image_distance,
                1.0 / self.focal_distance(),
            ),
        )


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
    square = set_out(rows, camera.film.z, camera.film.z - camera.plane)
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


@lane_ray.register(LensCamera)
def _(camera, rows, lane, x, y, time, draws):
    return traced_ray(camera, rows, lane)


@defocus_of.register(LensCamera)
def _(camera: LensCamera) -> Defocus:
    return camera.thin


@project.register(LensCamera)
def _(camera, point, time):
    right, up, depth = in_frame(camera.frame, point)
    x, y = seen_at(camera.seen, right, up, depth)
    return (x - camera.film.left) / camera.film.pixel, (camera.film.top - y) / camera.film.pixel, depth
