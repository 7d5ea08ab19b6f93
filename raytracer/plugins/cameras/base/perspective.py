"""What the perspective cameras share: a frame, an image plane, and a lens or None."""

import math
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from raytracer.cameras.exposed import ExposedSpec
from raytracer.cameras.interface import Defocus, camera_ray, defocus_of, project
from raytracer.cameras.placement import Frame, in_frame
from raytracer.jit import generic, kernel
from raytracer.photography import (
    airy_diameter_um,
    crop_factor,
    exposure_value,
    field_of_view,
)
from raytracer.sensors import SENSORS, Size
from raytracer.spec import FieldOfView, PositiveOptic, Quantity, at
from raytracer.units import METRES_PER_MILLIMETRE
from raytracer.vec import add, dot, madd, normalize, scale

# The field of view where a scene says nothing of it (deg).
_VFOV = 90.0

_ANGLES = ("vfov", "hfov", "dfov")
_LENGTHS = ("focal_length", "equivalent_focal_length")


class ImagePlane(NamedTuple):
    """The film's image at distance 1: width of a pixel, and its left and top edges, right and up from the axis."""

    pixel: float
    left: float
    top: float


class Irradiance(NamedTuple):
    """What a film needs to gather irradiance in place of radiance: the pupil's area over the square of its distance."""

    scale: float


class FlatPupil(NamedTuple):
    """As `Irradiance`, of a pupil that is an evenly radiating disc; its distance from the film (m), and area (m2)."""

    image_distance: float
    area: float


class PerspectiveCamera(NamedTuple):
    """Packed; `lens` is None for a pinhole, `irradiance` where the film gathers radiance."""

    frame: Frame
    plane: ImagePlane
    lens: Any
    irradiance: Any


class Optics(NamedTuple):
    """The optics of a perspective camera, with all that its keys leave open worked out.

    top, half the film's height over the image distance; sensor, its size (mm); film, the part of it that the picture
    shows (mm); focal_length and image_distance (mm).  All but the first are None where only an angle of view is given,
    which has no size; where the sensor is not given, it is as large as the film.
    """

    top: float
    sensor: Size | None
    film: Size | None
    focal_length: float | None
    image_distance: float | None


def _both(keys: list[str], what: str) -> str:
    return f"{' and '.join(keys)} both set {what}: give one of them"


class PerspectiveSpec(ExposedSpec):
    """Where a camera stands, what it looks at, and how much of it.

    The angle of view is given by itself (one of `vfov`, `hfov`, `dfov`), or follows from a sensor and a focal length.
    An angle with one of those two gives the other.
    """

    vfov: FieldOfView | None = Field(
        default=None,
        description="vertical field of view (deg), between 0 and 180; 90 where nothing says how much is seen",
    )
    hfov: FieldOfView | None = Field(default=None, description="horizontal field of view (deg), in place of `vfov`")
    dfov: FieldOfView | None = Field(default=None, description="diagonal field of view (deg), in place of `vfov`")
    focal_length: PositiveOptic | None = Field(default=None, description="focal length (mm)")
    equivalent_focal_length: PositiveOptic | None = Field(
        default=None,
        description="focal length (mm) that has the same diagonal field of view on 36 x 24 mm, in place of "
        "`focal_length`",
    )
    f_number: Annotated[float, Quantity(low=0.0, low_open=True, infinite=True)] | None = Field(
        default=None, description="focal length over the diameter of the entrance pupil; inf for a pinhole"
    )

    @model_validator(mode="after")
    def _one_scale(self) -> Any:
        angles = [key for key in _ANGLES if getattr(self, key) is not None]
        lengths = [key for key in _LENGTHS if getattr(self, key) is not None]
        if len(angles) > 1:
            at(angles[1], _both(angles[:2], "the field of view"))
        if len(lengths) > 1:
            at(lengths[1], _both(lengths, "the focal length"))
        if angles and lengths and self._sensor() is not None:
            at(
                angles[0],
                f"{angles[0]} is set twice, by itself and by sensor and {lengths[0]}: give two of the three at most",
            )
        if angles and self.equivalent_focal_length is not None:
            at(angles[0], _both([angles[0], "equivalent_focal_length"], "the field of view"))
        if self.sensor_fit is not None and self._sensor() is None and not (lengths and not angles):
            at("sensor_fit", "sensor_fit says how the picture lies on the sensor, and there is none: give sensor")
        if self.f_number is not None and math.isfinite(self.f_number) and not self._has_scale():
            at("f_number", "f_number needs a focal length: give focal_length, or sensor")
        return self

    @model_validator(mode="after")
    def _can_be_exposed(self) -> Any:
        if self.iso is None:
            return self
        if not self._has_scale():
            at("iso", "iso needs the size of the optics, which an angle does not have: give focal_length or sensor")
        if not self._lets_light_in():
            at("iso", f"iso needs an aperture that lets light in: {self._openings()}")
        return self

    def _openings(self) -> str:
        """How to give the camera an aperture, as an error says it."""
        return "give a finite f_number"

    def _has_scale(self) -> bool:
        """Whether the optics have a size, and not just an angle."""
        lengths = (self.focal_length, self.equivalent_focal_length, self._sensor())
        return any(value is not None for value in lengths)

    def _given_focal_length(self) -> float | None:
        """The focal length (mm), where it does not follow from an angle."""
        if self.equivalent_focal_length is None:
            return self.focal_length
        return self.equivalent_focal_length / crop_factor(*(self._sensor() or SENSORS["full_frame"]))

    def _image_distance(self, focal_length: float) -> float:
        """Distance of the film from the pupil (mm), for a focal length (mm)."""
        return focal_length

    def _focal_length(self, image: float) -> float:
        """Focal length (mm), for a distance of the film from the pupil (mm)."""
        return image

    def _pupil(self, optics: Optics) -> float:
        """Diameter of the entrance pupil (m), 0 for a pinhole without a size."""
        if self.f_number is None or optics.focal_length is None:
            return 0.0
        return METRES_PER_MILLIMETRE * optics.focal_length / self.f_number

    def _lets_light_in(self) -> bool:
        """Whether the entrance pupil has a size."""
        return self.f_number is not None and math.isfinite(self.f_number)

    def _slope(self, width: int, height: int) -> float:
        """Half the film's height over its distance, where an angle says it."""
        if self.hfov is not None:
            return math.tan(math.radians(self.hfov) / 2.0) * height / width
        if self.dfov is not None:
            return math.tan(math.radians(self.dfov) / 2.0) * height / math.hypot(width, height)
        return math.tan(math.radians(_VFOV if self.vfov is None else self.vfov) / 2.0)

    def optics(self, width: int, height: int) -> Optics:
        """The optics for a film of width x height square pixels."""
        sensor = self._sensor()
        has_angle = any(getattr(self, key) is not None for key in _ANGLES)
        focal_length = self._given_focal_length()
        if sensor is None and not has_angle and focal_length is not None:
            sensor = Size(*SENSORS["full_frame"])
        film = None if sensor is None else self._fitted(sensor, width, height)

        # The film and the focal length give the angle; or the angle with one of them the other.
        if film is not None and focal_length is not None:
            image = self._image_distance(focal_length)
            return Optics(0.5 * film.height / image, sensor, film, focal_length, image)
        top = self._slope(width, height)
        if focal_length is not None:
            image = self._image_distance(focal_length)
            film = Size(2.0 * image * top * width / height, 2.0 * image * top)
            return Optics(top, film, film, focal_length, image)
        if film is not None:
            image = 0.5 * film.height / top
            return Optics(top, sensor, film, self._focal_length(image), image)
        return Optics(top, None, None, None, None)

    def sight(self, x: float, y: float, width: int, height: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The ray that a place in the frame sees along: as right, up, forward, its start (m) and direction (3,).

        x, y : fractions of the frame's width and height, from the top left.

        Raises
        ------
        ValueError : the camera cannot be focused as it is said to be, or sees nothing there.
        """
        top = self.optics(width, height).top
        right, up = (2.0 * x - 1.0) * top * width / height, (1.0 - 2.0 * y) * top
        return np.zeros(3), np.array([right, up, 1.0])

    def relative_aperture(self, width: int, height: int) -> float | None:
        if self.f_number is not None:
            return self.f_number
        optics = self.optics(width, height)
        pupil = 1e3 * self._pupil(optics)
        return None if pupil == 0.0 or optics.focal_length is None else optics.focal_length / pupil

    def is_radiometric(self) -> bool:
        asked = self.iso is not None or self.exposure is not None
        return asked and self._has_scale() and self._lets_light_in()

    def _irradiance(self, image: float, area: float) -> Any:
        """How irradiance is gathered through a pupil of this area (m2), at this distance from the film (m)."""
        return Irradiance(area / (image * image))

    def describe(self, width: int, height: int) -> dict[str, float]:
        """Derived numbers for `rt explain`, by name with unit."""
        optics = self.optics(width, height)
        right = optics.top * width / height
        numbers = {
            "vfov_deg": field_of_view(2.0 * optics.top, 1.0),
            "hfov_deg": field_of_view(2.0 * right, 1.0),
            "dfov_deg": field_of_view(2.0 * math.hypot(right, optics.top), 1.0),
            "pixel_at_1m_mm": 1e3 * 2.0 * optics.top / height,
        }
        if optics.sensor is None or optics.film is None or optics.focal_length is None or optics.image_distance is None:
            return numbers
        crop = crop_factor(*optics.sensor)
        numbers |= {
            "sensor_width_mm": optics.sensor.width,
            "sensor_height_mm": optics.sensor.height,
            "film_width_mm": optics.film.width,
            "film_height_mm": optics.film.height,
            "pixel_pitch_um": 1e3 * optics.film.height / height,
            "crop_factor": crop,
            "focal_length_mm": optics.focal_length,
            "equivalent_focal_length_mm": crop * optics.focal_length,
            "image_distance_mm": optics.image_distance,
        }
        pupil = 1e3 * self._pupil(optics)
        if pupil > 0.0:
            f_number, seconds = optics.focal_length / pupil, self.exposure_seconds()
            numbers |= {"f_number": f_number, "entrance_pupil_mm": pupil}
            numbers["airy_disc_um"] = airy_diameter_um(optics.image_distance / pupil)
            if seconds > 0.0:
                numbers["ev100"] = exposure_value(f_number, seconds, self.iso or 100.0)
        return numbers

    def camera(self, width: int, height: int, lens: Any) -> PerspectiveCamera:
        """The packed camera for a film of width x height square pixels."""
        optics = self.optics(width, height)
        pixel = 2.0 * optics.top / height
        irradiance = None
        if self.is_radiometric():
            assert optics.image_distance is not None
            area = math.pi * (0.5 * self._pupil(optics)) ** 2
            irradiance = self._irradiance(METRES_PER_MILLIMETRE * optics.image_distance, area)
        return PerspectiveCamera(self.frame(), ImagePlane(pixel, -0.5 * pixel * width, optics.top), lens, irradiance)


@generic
def lens_ray(lens, frame, irradiance, direction, draws):
    """The ray (origin, unit direction, weight) into the scene of the ray through the lens's centre along `direction`.

    `direction` is not a unit vector: its component along the axis is 1.
    """
    raise NotImplementedError


@lens_ray.register(type(None))
def _(lens, frame, irradiance, direction, draws):
    return frame.origin, normalize(direction), gathered(irradiance, direction, (0.0, 0.0, 0.0), direction)


@generic
def gathered(irradiance, direction, shift, towards):
    """Weight of the radiance that a ray brings, if it is to be gathered as irradiance.

    Parameters
    ----------
    direction : as in `lens_ray`.
    shift : where the ray goes through the pupil, from its middle (m).
    towards : where it goes from there, not a unit vector: the component along the axis is 1.
    """
    raise NotImplementedError


@gathered.register(type(None))
def _(irradiance, direction, shift, towards):
    return 1.0


@gathered.register(Irradiance)
def _(irradiance, direction, shift, towards):
    # What a patch of the plane of focus, at the distance F, sends through an element dA of the pupil arrives in the
    # patch's image, which is z / F times as large: E = integral of L cos^4 / F^2 (F / z)^2 dA.
    square = dot(towards, towards)
    return irradiance.scale / (square * square)


@gathered.register(FlatPupil)
def _(irradiance, direction, shift, towards):
    # E = integral of L cos^4 / z^2 dA, with the angle at which the film sees the element of the pupil.
    z = irradiance.image_distance
    way = madd(shift, z, direction)
    ratio = z / dot(way, way)
    return irradiance.area * ratio * ratio


@kernel
def film_direction(frame, plane, x, y):
    """From the lens's centre to the image of film position (x, y) in the plane at distance 1."""
    across = scale(plane.left + plane.pixel * x, frame.right)
    return add(madd(across, plane.top - plane.pixel * y, frame.up), frame.forward)


@camera_ray.register(PerspectiveCamera)
def _(camera, x, y, time, draws):
    direction = film_direction(camera.frame, camera.plane, x, y)
    return lens_ray(camera.lens, camera.frame, camera.irradiance, direction, draws)


@defocus_of.register(PerspectiveCamera)
def _(camera: Any) -> Defocus:
    lens, pixel = camera.lens, float(camera.plane.pixel)
    return Defocus(0.0, pixel, 0.0) if lens is None else Defocus(2.0 * float(lens.radius), pixel, lens.inverse_focus)


@kernel
def place_on_film(plane, right, up, depth):
    """Film position (px) of a point (m) in the camera's frame, and its depth; NaN for what is not in front of it."""
    if depth <= 0.0:
        return math.nan, math.nan, depth
    return (right / depth - plane.left) / plane.pixel, (plane.top - up / depth) / plane.pixel, depth


@project.register(PerspectiveCamera)
def _(camera, point, time):
    right, up, depth = in_frame(camera.frame, point)
    return place_on_film(camera.plane, right, up, depth)
