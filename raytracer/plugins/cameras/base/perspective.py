"""Keys of perspective cameras: the field of view, and the size of the opening."""

import math
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from raytracer.optics import thin_lens
from raytracer.optics.sensor_formats import SensorSize
from raytracer.plugins.cameras.base.exposed import ExposedSpec
from raytracer.plugins.cameras.base.perspective_camera import FlatPupil, ImagePlane, Irradiance, PerspectiveCamera
from raytracer.schema.fields import FieldOfView, FNumberOrInf, PositiveLensLength
from raytracer.schema.rules import exclusive, only
from raytracer.schema.spec import field_error
from raytracer.schema.units import METRES_PER_MILLIMETRE

# The field of view where a scene says nothing of it (deg).
_VFOV = 90.0

ANGLES = ("vfov", "hfov", "dfov")
LENGTHS = ("focal_length", "equivalent_focal_length")


class CameraOptics(NamedTuple):
    """Optics of a perspective camera, with all that its keys leave open worked out.

    All but `top` are None where only an angle of view is given, which has no size.

    top : half the film's height over the image distance.
    sensor (mm) : its size; where it is not given, that of the film.
    film (mm) : size of the part of the sensor that the picture shows.
    focal_length (mm) : of the lens.
    image_distance (mm) : of the film from the lens.
    """

    top: float
    sensor: SensorSize | None
    film: SensorSize | None
    focal_length: float | None
    image_distance: float | None


class ApertureSize(NamedTuple):
    """Size of a lens's opening as the keys of a camera give it: one of the two, or none for a point.

    diameter (m) : of the opening.
    f_number : focal length over the diameter.
    """

    diameter: float | None = None
    f_number: float | None = None

    def is_open(self) -> bool:
        """Tell if the opening has a size, and is no point."""
        return self.diameter is not None or (self.f_number is not None and math.isfinite(self.f_number))

    def diameter_at(self, focal_length: float | None) -> float:
        """Return the diameter (m) for a focal length (mm), None for one that is not known; 0 for a point."""
        if self.diameter is not None:
            return self.diameter
        if self.f_number is None or focal_length is None:
            return 0.0
        return METRES_PER_MILLIMETRE * focal_length / self.f_number


class PerspectiveSpec(ExposedSpec):
    """Base of the perspective cameras, whose film lies as that of a lens focused at infinity.

    The angle of view is given by itself (one of `vfov`, `hfov`, `dfov`), or follows from a sensor and a focal length.
    An angle with one of those two gives the other.
    """

    aperture_hint: ClassVar[str] = "give a finite f_number"
    """The keys that give the camera an aperture, as errors say them."""

    vfov: FieldOfView | None = Field(
        default=None,
        description="vertical field of view (deg), between 0 and 180; 90 where nothing says how much is seen",
    )
    hfov: FieldOfView | None = Field(default=None, description="horizontal field of view (deg), in place of `vfov`")
    dfov: FieldOfView | None = Field(default=None, description="diagonal field of view (deg), in place of `vfov`")
    focal_length: PositiveLensLength | None = Field(default=None, description="focal length (mm)")
    equivalent_focal_length: PositiveLensLength | None = Field(
        default=None,
        description="focal length (mm) that has the same diagonal field of view on 36 x 24 mm, in place of "
        "`focal_length`",
    )
    f_number: FNumberOrInf | None = Field(
        default=None, description="focal length over the diameter of the entrance pupil; inf for a pinhole"
    )

    _one_angle = exclusive(*ANGLES, sets="the field of view")
    _one_length = exclusive(*LENGTHS, sets="the focal length")

    @model_validator(mode="after")
    def _one_scale(self) -> Any:
        angles = [key for key in ANGLES if getattr(self, key) is not None]
        lengths = [key for key in LENGTHS if getattr(self, key) is not None]
        if angles and lengths and self.given_sensor() is not None:
            field_error(
                angles[0],
                f"{angles[0]} is set twice, by itself and by sensor and {lengths[0]}: give two of the three at most",
            )
        if angles and self.equivalent_focal_length is not None:
            field_error(
                angles[0], f"{angles[0]} and equivalent_focal_length both set the field of view: give one of them"
            )
        if self.sensor_fit is not None and self.given_sensor() is None and not (lengths and not angles):
            field_error(
                "sensor_fit", "sensor_fit says how the picture lies on the sensor, and there is none: give sensor"
            )
        return self

    _has_a_focal_length = only(
        "f_number",
        where=lambda camera: math.isinf(camera.f_number) or camera.has_scale(),
        message="f_number needs a focal length: give focal_length, or sensor",
    )
    _is_exposed_by_its_size = only(
        "iso",
        where=lambda camera: camera.has_scale(),
        message="iso needs the size of the optics, which an angle does not have: give focal_length or sensor",
    )
    _is_exposed_through_an_aperture = only(
        "iso",
        where=lambda camera: camera.has_aperture(),
        message="iso needs an aperture that lets light in: {spec.aperture_hint}",
    )

    def plane_of_focus(self) -> float:
        """Return the distance (m) for which the film lies behind the lens."""
        return math.inf

    def aperture_size(self) -> ApertureSize:
        """Return the size of the opening as the keys give it."""
        return ApertureSize(f_number=self.f_number)

    def film_irradiance(self, image: float, area: float) -> Irradiance | FlatPupil:
        """Pack the weight of rays through a pupil of this area (m2), at this distance from the film (m)."""
        return Irradiance(area / (image * image))

    def has_scale(self) -> bool:
        """Tell if the optics have a size, and not just an angle."""
        lengths = (self.focal_length, self.equivalent_focal_length, self.given_sensor())
        return any(value is not None for value in lengths)

    def has_aperture(self) -> bool:
        """Tell if the entrance pupil has a size."""
        return self.aperture_size().is_open()

    def pupil_diameter(self, width: int, height: int) -> float:
        """Return the diameter of the entrance pupil (m) for a film of width x height pixels; 0 for a point."""
        return self.aperture_size().diameter_at(self.optics(width, height).focal_length)

    def given_focal_length(self) -> float | None:
        """Return the focal length (mm); None where it follows from an angle."""
        if self.equivalent_focal_length is None:
            return self.focal_length
        return self.equivalent_focal_length / thin_lens.crop_factor(*self.sensor_size())

    def _given_slope(self, width: int, height: int) -> float:
        """Return half the film's height over its distance, as an angle gives it."""
        if self.hfov is not None:
            return math.tan(math.radians(self.hfov) / 2.0) * height / width
        if self.dfov is not None:
            return math.tan(math.radians(self.dfov) / 2.0) * height / math.hypot(width, height)
        return math.tan(math.radians(_VFOV if self.vfov is None else self.vfov) / 2.0)

    def optics(self, width: int, height: int) -> CameraOptics:
        """Work out the optics for a film of width x height square pixels."""
        has_angle = any(getattr(self, key) is not None for key in ANGLES)
        focal_length, focus = self.given_focal_length(), 1e3 * self.plane_of_focus()
        has_sensor = self.given_sensor() is not None or (focal_length is not None and not has_angle)
        sensor, film = (self.sensor_size(), self.film_size(width, height)) if has_sensor else (None, None)

        # The film and the focal length give the angle; or the angle with one of them the other.
        if film is not None and focal_length is not None:
            image = thin_lens.image_distance(focal_length, focus)
            return CameraOptics(0.5 * film.height / image, sensor, film, focal_length, image)
        top = self._given_slope(width, height)
        if focal_length is not None:
            image = thin_lens.image_distance(focal_length, focus)
            film = SensorSize(2.0 * image * top * width / height, 2.0 * image * top)
            return CameraOptics(top, film, film, focal_length, image)
        if film is not None:
            image = 0.5 * film.height / top
            return CameraOptics(top, sensor, film, thin_lens.focal_length_from_distances(image, focus), image)
        return CameraOptics(top, None, None, None, None)

    def film_to_ray(
        self, x: float, y: float, width: int, height: int
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the ray of a place in the frame as its start (m) and direction (3,), each right, up and forward.

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
        pupil = 1e3 * self.pupil_diameter(width, height)
        return None if pupil == 0.0 or optics.focal_length is None else optics.focal_length / pupil

    def is_radiometric(self) -> bool:
        asked = self.iso is not None or self.exposure is not None
        return asked and self.has_scale() and self.has_aperture()

    def describe(self, width: int, height: int) -> dict[str, float]:
        optics = self.optics(width, height)
        right = optics.top * width / height
        numbers = {
            "vfov_deg": thin_lens.field_of_view(2.0 * optics.top, 1.0),
            "hfov_deg": thin_lens.field_of_view(2.0 * right, 1.0),
            "dfov_deg": thin_lens.field_of_view(2.0 * math.hypot(right, optics.top), 1.0),
            "pixel_at_1m_mm": 1e3 * 2.0 * optics.top / height,
        }
        if optics.sensor is None or optics.film is None or optics.focal_length is None or optics.image_distance is None:
            return numbers
        crop = thin_lens.crop_factor(*optics.sensor)
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
        pupil = 1e3 * self.pupil_diameter(width, height)
        if pupil > 0.0:
            f_number, seconds = optics.focal_length / pupil, self.exposure_seconds()
            numbers |= {"f_number": f_number, "entrance_pupil_mm": pupil}
            numbers["airy_disc_um"] = thin_lens.airy_diameter_um(optics.image_distance / pupil)
            if seconds > 0.0:
                numbers["ev100"] = thin_lens.exposure_value(f_number, seconds, self.iso or 100.0)
        return numbers

    def pack_with_lens(self, width: int, height: int, lens: Any) -> PerspectiveCamera:
        """Pack the camera for a film of width x height square pixels, with a packed lens or None."""
        optics = self.optics(width, height)
        pixel = 2.0 * optics.top / height
        irradiance = None
        if self.is_radiometric():
            assert optics.image_distance is not None
            area = math.pi * (0.5 * self.pupil_diameter(width, height)) ** 2
            irradiance = self.film_irradiance(METRES_PER_MILLIMETRE * optics.image_distance, area)
        return PerspectiveCamera(self.frame(), ImagePlane(pixel, -0.5 * pixel * width, optics.top), lens, irradiance)
