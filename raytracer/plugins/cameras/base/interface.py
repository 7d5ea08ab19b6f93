"""What every camera kind gives to packing and to kernels."""

import math
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, NamedTuple, TypeAlias

import numpy as np
from pydantic import Field, model_validator

from raytracer.jit import generic
from raytracer.motion import Motion
from raytracer.photography import AutoExposureField, Exposure
from raytracer.plenoptic.layout import Layout
from raytracer.sensors import SensorSpec
from raytracer.shake import Shake
from raytracer.shutter import Shutter, ShutterField, Timing, timing_of
from raytracer.spec import TRANSFORM_ROUNDING, Name, Quantity, Spec, Time, at, matrix_of
from raytracer.vec import Vec3, add

Assets: TypeAlias = Mapping[str, Any]
"""What a camera's files held, by the dotted path of the key that names each."""

NO_ASSETS: Assets = {}

# Slots of random numbers of a camera sample, each a dimension of its own; a slot not drawn costs nothing.
FILTER, LENS, TIME, WAVELENGTH, GHOST, SLOTS = 0, 1, 2, 3, 4, 8


class CameraSpec(Spec):
    """Base of the cameras: what packing and `rt explain` ask of each."""

    binds: ClassVar[tuple[str, ...]] = ()
    """Keys of `loads` whose files the camera's numbers depend on, so that they are read when a scene is checked."""

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

    @model_validator(mode="after")
    def _compensates_something(self) -> Any:
        if self.exposure is not None and self.speed() is not None:
            at("exposure", "exposure and iso both set how bright the picture is: give one of them")
        if self.exposure_compensation is not None and self.exposure is None and self.speed() is None:
            at("exposure_compensation", "exposure_compensation needs iso or exposure: auto, which it is relative to")
        return self

    @model_validator(mode="after")
    def _opens_once(self) -> Any:
        try:
            self.opening()
        except ValueError as error:
            at("shutter" if self.time is None else "time", str(error))
        return self

    @model_validator(mode="after")
    def _shakes_slowly(self) -> Any:
        if self.shake is not None:
            try:
                self.shake.segments(self.opening())
            except ValueError as error:
                at(("shake", "bandwidth"), str(error))
        return self

    @model_validator(mode="after")
    def _moves_rigidly(self) -> Any:
        for number, key in enumerate((self.motion and self.motion.keyframes) or ()):
            turn = matrix_of(key.transform)[:3, :3]
            if np.linalg.det(turn) < 0.0 or np.abs(turn @ turn.T - np.eye(3)).max() > TRANSFORM_ROUNDING:
                at(("motion", "keyframes", number, "transform"), "a camera can be moved and turned, but not scaled")
        return self

    def timing(self) -> Timing:
        """When the shutter exposes which part of the film."""
        return timing_of(self.shutter, self.time)

    def opening(self) -> Shutter:
        """When the shutter begins to open, and when all of it is closed again: the span in which anything can move."""
        return self.timing().span()

    def exposure_seconds(self) -> float:
        """For how long every place of the film is exposed (s): the integral of the shutter's transmission."""
        return self.timing().seconds()

    def speed(self) -> float | None:
        """The ISO speed that is given; None where there is none, or where metering chooses it."""
        return None

    def simulated_sensor(self) -> SensorSpec | None:
        """The sensor whose noise and limits are part of the picture; None for an ideal one."""
        return None

    def relative_aperture(self, width: int, height: int) -> float | None:
        """The f-number, where it is known."""
        return None

    def is_radiometric(self) -> bool:
        """Whether rays are weighted so that the film gathers irradiance (W/m2) in place of radiance."""
        return False

    def photograph(self, width: int, height: int) -> Exposure | None:
        """What a film of width x height pixels is told of the exposure; None where it records radiance."""
        if self.speed() is None and self.exposure is None:
            return None
        seconds, sensor = self.exposure_seconds(), self.simulated_sensor()
        return Exposure(
            seconds=seconds if seconds > 0.0 else None,
            iso=self.speed(),
            compensation=self.exposure_compensation or 0.0,
            metering=None if self.exposure is None else self.exposure.meter(),
            f_number=self.relative_aperture(width, height),
            radiometric=self.is_radiometric(),
            slowest=None if sensor is None else sensor.base_iso,
        )

    def bound(self, assets: Assets) -> "CameraSpec":
        """The camera with what its files held, which its numbers depend on; itself where they do not.

        Raises
        ------
        ValidationError : an asset and the camera's keys do not go together; it points at one of these.
        """
        return self

    def picture(self, width: int, height: int) -> tuple[int, int]:
        """Width and height (px) of the whole picture, for a film of width x height pixels: a view each, if many."""
        return width, height

    def margin(self, width: int, height: int) -> float:
        """How far from a pixel (px) the film may reach, for a film of width x height pixels."""
        return math.inf

    def layout(self, width: int, height: int) -> Layout | None:
        """How the whole picture, for a film of width x height pixels, holds a light field; None where it holds none."""
        return None

    def equivalent(self, width: int, height: int) -> dict[str, Any] | None:
        """The thin-lens camera in place of one with a lens of glass, as keys of a scene file; None for any other."""
        return None

    def doubts(self, width: int, height: int) -> list[tuple[str, str]]:
        """What is probably not meant: the key that it is about, and a predicate of that key's value."""
        return []

    def pack(self, width: int, height: int, assets: Assets = NO_ASSETS) -> Any:
        """The packed camera for a film of width x height pixels; `assets` holds what its files did.

        Raises
        ------
        ValidationError : an asset does not suit the camera; it points at the key that names the file.
        """
        raise NotImplementedError

    def trade_off(self, width: int, height: int) -> list[dict[str, float]]:
        """What others in place of its microlenses would give, its own among them: numbers by name with unit."""
        return []

    def describe(self, width: int, height: int) -> dict[str, float]:
        """Derived numbers, by name with unit."""
        raise NotImplementedError


@generic
def film_corner(camera, x, y):
    """The film position of the top left corner of pixel (x, y) of the picture; (x, y) itself by default.

    Where a picture is made of many views, their films lie so far apart that what a filter draws around a pixel is still
    of its own view.
    """
    raise NotImplementedError


@film_corner.register(tuple)
def _(camera, x, y):
    return x, y


@generic
def place_in_view(camera, x, y):
    """A film position in pixels from the top left corner of its own view; itself by default."""
    raise NotImplementedError


@place_in_view.register(tuple)
def _(camera, x, y):
    return x, y


@generic
def camera_ray(camera, x, y, time, draws):
    """The ray (origin, unit direction, weight) of film position (x, y), in pixels from the top left corner.

    The weight multiplies what the ray brings; 0 where the film position sees nothing.

    `time` is None if nothing moves, else the fraction of the shutter's opening that has passed, 0 to 1.
    """
    raise NotImplementedError


class Together(NamedTuple):
    """The camera makes the rays of a packet of samples together: by `set_lane` for each, then `trace_lanes` once."""


@generic
def rays_together(camera):
    """`Together()` for a camera that makes the rays of a packet together; None for the others, and by default."""
    raise NotImplementedError


@rays_together.register(tuple)
def _(camera):
    return None


@generic
def set_lane(camera, rows, lane, x, y, draws):
    """Tell a camera that makes rays together of a sample, at film position (x, y): see `camera_ray`.

    rows : float64 (16, packet), the camera's own.
    """
    raise NotImplementedError


@generic
def trace_lanes(camera, rows):
    """Make the rays of all lanes that were set."""
    raise NotImplementedError


class Sharing(NamedTuple):
    """Light of several wavelengths shares the rays of a camera whose lens bends each in its own way.

    edge, that of the square round a pixel's middle, in which all places of the film count the same (pixels); back, the
    camera's lens for the way from the scene to the film.
    """

    edge: float
    back: Any


@generic
def share_lanes(camera, sharing, rows, others, x, y):
    """Find out whether light of other wavelengths too comes to pixel (x, y) by the rays that `trace_lanes` made.

    rows : the packet, after `trace_lanes`.
    others : float64 (16, packet), for one other wavelength of each ray: its row `packets.WAVELENGTH` is given.  Its row
        `packets.WEIGHT` becomes the part that the lens lets through of it, over that of the ray's own wavelength, or 0
        if it does not come to this pixel; its row `packets.EXTENT`, as that of `rows` is, one over how densely the
        camera draws such rays at that wavelength, in units common to all.
    """
    raise NotImplementedError


@generic
def lane_ray(camera, rows, lane, x, y, time, draws):
    """As `camera_ray`, of a lane of a packet; by default there is nothing to know of packets."""
    raise NotImplementedError


@lane_ray.register(tuple)
def _(camera, rows, lane, x, y, time, draws):
    return camera_ray(camera, x, y, time, draws)


@generic
def project(camera, point, time):
    """Where a point is seen: film position (x, y) in pixels, and its depth along the axis (m); NaN if nowhere."""
    raise NotImplementedError


class Defocus(NamedTuple):
    """What blurs what is out of focus, near the axis: the thin lens that a camera has, or that stands for its glass.

    diameter, of the opening (m), 0 for a point; pixel, the edge of its image at a distance of 1; inverse_focus, one
    over the distance of the plane of focus (1/m), 0 for infinity, negative behind the camera as for a mere hole.
    """

    diameter: float
    pixel: float
    inverse_focus: float


@generic
def defocus_of(camera: Any) -> Defocus | None:
    """What blurs what a packed camera at rest sees; None for cameras without a perspective."""
    raise NotImplementedError(type(camera))


@defocus_of.register(tuple)
def _(camera: Any) -> Defocus | None:
    return None


@generic
def moved(camera: Any, by: Vec3) -> Any:
    """The packed camera in a world that is moved by a vector (m); of any kind with a `frame`, by default."""
    raise NotImplementedError(type(camera))


@moved.register(tuple)
def _(camera: Any, by: Vec3) -> Any:
    return camera._replace(frame=camera.frame._replace(origin=add(camera.frame.origin, by)))
