"""No camera at all: a bare sensor, which light reaches from everywhere before it.

In a scene:

    camera: {type: none, look_from: [0, 1, 4], look_at: [0, 1, 0], sensor: full_frame}
"""

import math
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import Field, model_validator

from raytracer.cameras.interface import LENS, NO_ASSETS, Assets, camera_ray, project
from raytracer.cameras.placement import Frame, PlacedSpec, in_frame
from raytracer.jit import kernel
from raytracer.sampling import sample_2d
from raytracer.sampling.warp import sample_cosine_hemisphere
from raytracer.sensors import SENSORS, SensorField, SensorSpec, Size, fitted
from raytracer.spec import Quantity, at
from raytracer.vec import add, madd, scale, to_world

_METRES_PER_MILLIMETRE = 1e-3


class BareSensor(PlacedSpec):
    """A sensor at `look_from`, facing `look_at`, with neither lens nor pinhole.

    Each of its pixels is lit by all that lies before it, so they record nearly the same.  Without `iso` a pixel is
    irradiance (W/m2), which is pi where all is of the radiance 1.  The picture is upright: its top is the sensor's top.
    """

    type: Literal["none"] = "none"
    sensor: SensorField = Field(
        default=SensorSpec(format="full_frame"),
        description=f"a name ({', '.join(SENSORS)}), or {{width: 36 mm, height: 24 mm}}",
    )
    sensor_fit: Literal["crop", "horizontal", "vertical", "overscan"] = Field(
        default="crop", description="how a picture of another shape than the sensor's lies on it, as for a pinhole"
    )
    iso: Annotated[float, Quantity(low=0.0, low_open=True, high=1e9)] | None = Field(
        default=None,
        description="speed of the sensor: asks for photographic exposure, by shutter and speed, after which 1 is what "
        "saturates the sensor",
    )

    @model_validator(mode="after")
    def _can_be_exposed(self) -> "BareSensor":
        if self.iso is not None and self.exposure_seconds() == 0.0:
            at("iso", "iso needs a shutter that is open for some time, such as shutter: 1/125 s")
        if self.sensor.size() is None:
            at("sensor", f"needs a size: a format ({', '.join(SENSORS)}), or width and height")
        return self

    def speed(self) -> float | None:
        return self.iso

    def is_radiometric(self) -> bool:
        return True

    def _film(self, width: int, height: int) -> Size:
        size = self.sensor.size()
        assert size is not None
        return fitted(size, width, height, self.sensor_fit)

    def describe(self, width: int, height: int) -> dict[str, float]:
        """Derived numbers: the film and a pixel of it."""
        film = self._film(width, height)
        return {
            "film_width_mm": film.width,
            "film_height_mm": film.height,
            "pixel_pitch_um": 1e3 * film.height / height,
        }

    def pack(self, width: int, height: int, assets: Assets = NO_ASSETS) -> "Bare":
        """The camera for a film of width x height pixels."""
        film = self._film(width, height)
        pixel = _METRES_PER_MILLIMETRE * film.height / height
        return Bare(self.frame(), pixel, -0.5 * pixel * width, 0.5 * pixel * height)


class Bare(NamedTuple):
    """Packed: width of a pixel, and the sensor's left and top edges, right and up from its middle (m)."""

    frame: Frame
    pixel: float
    left: float
    top: float


@kernel
def _place(camera: Any, x: float, y: float) -> Any:
    across = madd(camera.frame.origin, camera.left + camera.pixel * x, camera.frame.right)
    return add(across, scale(camera.top - camera.pixel * y, camera.frame.up))


@camera_ray.register(Bare)
def _(camera, x, y, time, draws):
    frame = camera.frame
    u1, u2 = sample_2d(draws.sampler, draws.key, draws.index, draws.dimension + LENS)
    # Drawn in proportion to the cosine, so that pi times the mean radiance is the irradiance.
    direction = to_world(sample_cosine_hemisphere(u1, u2), frame.right, frame.up, frame.forward)
    return _place(camera, x, y), direction, math.pi


@project.register(Bare)
def _(camera, point, time):
    # A point is seen everywhere, so it has no place in the picture.
    return math.nan, math.nan, in_frame(camera.frame, point)[2]
