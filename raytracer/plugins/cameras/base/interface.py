"""Interface of cameras: the spec's methods for packing and reports, and the generic functions for kernels.

Every method and function that a camera may leave out has a default here.
"""

import math
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, NamedTuple, TypeAlias

import numpy as np
from pydantic import Field, model_validator

from raytracer.core.camera_shake import Shake
from raytracer.core.compiler.dispatch import generic, overridable
from raytracer.core.motion.spec import Motion
from raytracer.core.shutter.spec import ShutterField, exposure_timing
from raytracer.core.shutter.table import Shutter
from raytracer.core.shutter.timing import Timing
from raytracer.core.spectra import Spectra
from raytracer.core.vec import Vec3, add, dot, sub
from raytracer.film.light_field.layout import Layout
from raytracer.optics.lens_system.surfaces import LensSurfaces
from raytracer.optics.sensor_formats import SensorSpec
from raytracer.optics.thin_lens import AutoExposureField, ExposureSettings
from raytracer.plugins.apertures.base.vignetting import Opening
from raytracer.schema.fields import Name, Quantity, Time
from raytracer.schema.rules import never, only
from raytracer.schema.spec import Spec, field_error
from raytracer.schema.transform import TRANSFORM_ROUNDING, matrix_of
from raytracer.schema.warning_kind import WarningRecord

Assets: TypeAlias = Mapping[str, Any]
"""Contents of a camera's files, by the dotted path of the key that names each."""

NO_ASSETS: Assets = {}

# Slots of random numbers of a camera sample, each a dimension of its own; a slot not drawn costs nothing.
FILTER, LENS, TIME, WAVELENGTH, GHOST, SLOTS = 0, 1, 2, 3, 4, 8


class CameraSpec(Spec):
    """Base of the cameras."""

    bound_fields: ClassVar[tuple[str, ...]] = ()
    """Keys whose files the camera's numbers depend on, so that they are read when a scene is checked."""

    type: str
    medium: Name | None = Field(
        default=None, description="name of the medium that the camera stands in; the scene's `medium` by default"
    )
    shutter: ShutterField | None = Field(
        default=None,
        description="when light is gathered: {open: 0, close: 1} in seconds of scene time, or for how long from `time` "
        "on, such as 1/125 s, or {duration: 1/125 s, opening, ramp, readout, direction, curtain}; without it the "
        "picture is of one moment",
    )
    time: Time | None = Field(
        default=None, description="time of the scene (s) at which a shutter given by its duration opens; default 0"
    )
    motion: Motion | None = Field(
        default=None, description="how the camera moves: velocity (m/s), spin {axis, rate, center} or keyframes"
    )
    shake: Shake | None = Field(
        default=None,
        description="how the hand that holds the camera turns it: {amplitude: 0.1 deg, bandwidth: 10 Hz, seed: 0}; "
        "the amplitude is the root mean square of the angle about each of three axes",
    )

    exposure: AutoExposureField | None = Field(
        default=None,
        description="auto, or {metering: spot, at: [x, y], size}: exposes the picture by what is metered in it; "
        "without it and `iso`, pixels are plain radiance",
    )
    exposure_compensation: Annotated[float, Quantity(low=-50.0, high=50.0)] | None = Field(
        default=None, description="stops (EV) by which the picture is made brighter than `iso` or `exposure` make it"
    )

    _one_exposure = never(
        "exposure",
        where=lambda camera: camera.iso_speed() is not None,
        message="exposure and iso both set how bright the picture is: give one of them",
    )
    _compensates_something = only(
        "exposure_compensation",
        where=lambda camera: camera.exposure is not None or camera.iso_speed() is not None,
        message="exposure_compensation needs iso or exposure: auto, which it is relative to",
    )

    @model_validator(mode="after")
    def _opens_once(self) -> Any:
        try:
            self.shutter_interval()
        except ValueError as error:
            field_error("shutter" if self.time is None else "time", str(error))
        return self

    @model_validator(mode="after")
    def _shakes_slowly(self) -> Any:
        if self.shake is not None:
            try:
                self.shake.segments(self.shutter_interval())
            except ValueError as error:
                field_error(("shake", "bandwidth"), str(error))
        return self

    @model_validator(mode="after")
    def _moves_rigidly(self) -> Any:
        for number, key in enumerate((self.motion and self.motion.keyframes) or ()):
            turn = matrix_of(key.transform)[:3, :3]
            if np.linalg.det(turn) < 0.0 or np.abs(turn @ turn.T - np.eye(3)).max() > TRANSFORM_ROUNDING:
                field_error(
                    ("motion", "keyframes", number, "transform"), "a camera can be moved and turned, but not scaled"
                )
        return self

    def timing(self) -> Timing:
        """Return the times at which the shutter exposes each part of the film."""
        return exposure_timing(self.shutter, self.time)

    def shutter_interval(self) -> Shutter:
        """Return the time from when the shutter begins to open until all of it is closed: when anything can move."""
        return self.timing().span()

    def exposure_seconds(self) -> float:
        """Return the exposure time of every place of the film (s): the integral of the shutter's transmission."""
        return self.timing().seconds()

    def iso_speed(self) -> float | None:
        """Return the ISO speed that is given; None where there is none, or where metering chooses it."""
        return None

    def simulated_sensor(self) -> SensorSpec | None:
        """Return the sensor whose noise and limits are part of the picture; None for an ideal one."""
        return None

    def relative_aperture(self, width: int, height: int) -> float | None:
        """Return the f-number; None where it is not known."""
        return None

    def is_radiometric(self) -> bool:
        """Tell if rays are weighted so that the film gathers irradiance (W/m2) in place of radiance."""
        return False

    def exposure_settings(self, width: int, height: int) -> ExposureSettings | None:
        """Return the settings by which a film of width x height pixels is exposed; None where it records radiance."""
        if self.iso_speed() is None and self.exposure is None:
            return None
        seconds, sensor = self.exposure_seconds(), self.simulated_sensor()
        return ExposureSettings(
            seconds=seconds if seconds > 0.0 else None,
            iso=self.iso_speed(),
            compensation=self.exposure_compensation or 0.0,
            metering=None if self.exposure is None else self.exposure.meter(),
            f_number=self.relative_aperture(width, height),
            radiometric=self.is_radiometric(),
            base_iso=None if sensor is None else sensor.base_iso,
        )

    def bound_files(self) -> dict[tuple[str | int, ...], tuple[str, str]]:
        """Return the files of `files` that the camera's numbers depend on."""
        return {keys: file for keys, file in self.files().items() if keys[0] in self.bound_fields}

    def bind_assets(self, assets: Assets) -> "CameraSpec":
        """Return the camera with the contents of those files that its numbers depend on; itself without such files.

        Raises
        ------
        ValidationError : an asset and the camera's keys do not go together; it points at one of these.
        """
        return self

    def picture(self, width: int, height: int) -> tuple[int, int]:
        """Return the size of the whole picture (px) for a film of width x height pixels, which each view has."""
        return width, height

    def film_margin(self, width: int, height: int) -> float:
        """Return how many pixels the film reaches beyond the picture, of width x height pixels, or beyond each view."""
        return math.inf

    def layout(self, width: int, height: int) -> Layout | None:
        """Return the layout of the light field that the picture holds, for a film of width x height pixels, or None."""
        return None

    def why_no_views(self, width: int, height: int) -> str | None:
        """Say why a film of width x height pixels holds no views, of a camera whose pictures do; None for any other."""
        return None

    def thin_lens_equivalent(self, width: int, height: int) -> dict[str, Any] | None:
        """Return the keys of the thin-lens camera in place of one with a lens of glass; None for any other."""
        return None

    def warnings(self, width: int, height: int) -> list[WarningRecord]:
        """List probable mistakes, each by the key that it is about and a predicate of that key's value."""
        return []

    def focused_object(self) -> str | None:
        """Return the name of the object that the camera is focused on; None where it is not focused so."""
        return None

    def focused_place(self) -> tuple[float, float] | None:
        """Return the place in the frame that the camera is focused at, see the key `focus_at`; None without it."""
        return None

    def opening(self) -> Opening:
        """Return the specs that shape the lens's opening."""
        return Opening()

    def pack(self, width: int, height: int, assets: Assets = NO_ASSETS) -> Any:
        """Pack the camera for a film of width x height pixels; `assets` holds the contents of its files.

        Raises
        ------
        ValidationError : an asset does not suit the camera; it points at the key that names the file.
        """
        raise NotImplementedError

    def trade_off(self, width: int, height: int) -> list[dict[str, float]]:
        """List what microlenses of several sizes, its own among them, would give: numbers by name with unit."""
        return []

    def describe(self, width: int, height: int) -> dict[str, float]:
        """Return derived numbers, by name with unit."""
        raise NotImplementedError


@overridable
def film_corner(camera, x, y):
    """Return the film position of the top left corner of pixel (x, y) of the picture; (x, y) itself by default.

    Where a picture is made of many views, their films lie so far apart that what a filter draws around a pixel is still
    of its own view.
    """
    return x, y


@overridable
def film_to_view(camera, x, y):
    """Return a film position in pixels from the top left corner of its own view; itself by default."""
    return x, y


@generic
def camera_ray(camera, x, y, time, draws):
    """Make the ray (origin, unit direction, weight) of film position (x, y), in pixels from the top left corner.

    The weight multiplies the radiance that the ray brings; 0 where the film position sees nothing.

    time : the fraction of the shutter's opening that has passed, 0 to 1; None if nothing moves.
    draws : source of random numbers, see `materials.base.interface.Draws`; `LENS` and others above are its slots.
    """


class PacketRays(NamedTuple):
    """Mark of a camera that makes the rays of a packet together: by `set_lane` for each, then `trace_lanes` once."""


@overridable
def packet_rays(camera):
    """Return `PacketRays()` for a camera that makes the rays of a packet together; None by default."""


@generic
def set_lane(camera, rows, lane, x, y, draws):
    """Set up a sample at film position (x, y) as a lane of a packet, see `camera_ray`.

    rows : float64 (16, packet), the camera's own.
    """


@generic
def trace_lanes(camera, rows):
    """Make the rays of all lanes that were set."""


class WavelengthSharing(NamedTuple):
    """Data by which light of several wavelengths shares the rays of a camera whose lens disperses.

    tolerance (px) : edge of the square round a pixel's middle in which all places of the film count the same.
    back : the camera's lens for the way from the scene to the film.
    """

    tolerance: float
    back: Any


@generic
def share_wavelengths(camera, sharing, rows, others, x, y):
    """Weight the light of other wavelengths that comes to pixel (x, y) by the rays that `trace_lanes` made.

    rows : the packet, after `trace_lanes`.
    others : float64 (16, packet), for one other wavelength of each ray: its row `packets.WAVELENGTH` is given.  Its row
        `packets.WEIGHT` becomes the transmittance of the lens for it over that for the ray's own wavelength, or 0 if it
        does not come to this pixel; its row `packets.EXTENT`, like that of `rows`, one over the density with which the
        camera draws such rays at that wavelength, in units common to all.
    """


@overridable
def lane_ray(camera, rows, lane, x, y, time, draws):
    """Make the ray of a lane of a packet, as `camera_ray` does; by default without a packet."""
    return camera_ray(camera, x, y, time, draws)


@overridable
def project(camera, point, time):
    """Project a point to the film: position (x, y) in pixels, NaN if not seen, and its depth along the axis (m).

    By default a point has no place in the picture, as where it is seen everywhere.
    """
    return math.nan, math.nan, dot(sub(point, camera.frame.origin), camera.frame.forward)


@overridable
def axial_depth(camera, point, start, time):
    """Return the depth (m) of a point along the axis of the view that sees it by a ray from `start`; as `project` does.

    It is another than `project` gives only where views have axes of their own.
    """
    return project(camera, point, time)[2]


class Defocus(NamedTuple):
    """Thin lens that a camera has, or that blurs near the axis as its lens of glass does.

    diameter (m) : of the opening, 0 for a point.
    pixel : edge of a pixel's image at a distance of 1.
    inverse_focus (1/m) : one over the distance of the plane of focus; 0 for infinity, negative for one behind the
        camera, as of a mere hole.
    """

    diameter: float
    pixel: float
    inverse_focus: float


@overridable
def camera_defocus(camera: Any) -> Any:
    """Return the thin lens of a packed camera, a Defocus: by default its `thin`; None where it shows no perspective."""
    return getattr(camera, "thin", None)


class CameraParts(NamedTuple):
    """Parts of a packed camera that the scene is packed by, and that reports name.

    lens : opening of an ideal lens or of a hole, with `shape` and `rim`; None for a point, and for a lens of glass.
    glass : the surfaces of a lens of glass, which rays are traced through; None without one.
    has_flare : surfaces of the glass reflect light to the film.
    spectra : tables by which rays are of one wavelength each; None where they carry red, green and blue.
    shares_wavelengths : light of several wavelengths may share a ray, by `share_wavelengths`.
    ray_radius (m) : distance from the camera's position, or that of a view, within which rays begin; inf if not known.
    moves : the camera moves while the shutter is open.
    """

    lens: Any = None
    glass: LensSurfaces | None = None
    has_flare: bool = False
    spectra: Spectra | None = None
    shares_wavelengths: bool = False
    ray_radius: float = math.inf
    moves: bool = False


@overridable
def camera_parts(camera: Any) -> CameraParts:
    """Return the parts of a packed camera; by default none but its `wavelengths`."""
    return CameraParts(spectra=getattr(camera, "wavelengths", None))


@overridable
def translate_camera(camera: Any, by: Vec3) -> Any:
    """Move a packed camera with the world by a vector (m); by default its `frame`."""
    return camera._replace(frame=camera.frame._replace(origin=add(camera.frame.origin, by)))
