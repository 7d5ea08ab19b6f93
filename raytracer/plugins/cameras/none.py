"""No camera at all: a bare sensor, which light reaches from everywhere before it.

In a scene:

    camera: {type: none, look_from: [0, 1, 4], look_at: [0, 1, 0], sensor: full_frame}
"""

import math
from typing import Any, Literal, NamedTuple

from raytracer.core.compiler.dispatch import kernel
from raytracer.core.sampling import sample_2d
from raytracer.core.sampling.warp import sample_cosine_hemisphere
from raytracer.core.vec import add, madd, scale, to_world
from raytracer.plugins.cameras.base.exposed import ExposedSpec
from raytracer.plugins.cameras.base.interface import LENS, NO_ASSETS, Assets, camera_ray
from raytracer.plugins.cameras.base.placement import CameraFrame
from raytracer.schema.units import METRES_PER_MILLIMETRE


class BareSensor(ExposedSpec):
    """A sensor at `look_from`, facing `look_at`, with neither lens nor pinhole.

    Each of its pixels is lit by all that lies before it, so they record nearly the same.  Without `iso` a pixel is
    irradiance (W/m2), which is pi where all is of the radiance 1.  The picture is upright: its top is the sensor's top.
    """

    type: Literal["none"] = "none"

    def is_radiometric(self) -> bool:
        return True

    def describe(self, width: int, height: int) -> dict[str, float]:
        film = self.film_size(width, height)
        return {
            "film_width_mm": film.width,
            "film_height_mm": film.height,
            "pixel_pitch_um": 1e3 * film.height / height,
        }

    def pack(self, width: int, height: int, assets: Assets = NO_ASSETS) -> "LenslessCamera":
        film = self.film_size(width, height)
        pixel = METRES_PER_MILLIMETRE * film.height / height
        return LenslessCamera(self.frame(), pixel, -0.5 * pixel * width, 0.5 * pixel * height)


class LenslessCamera(NamedTuple):
    """Packed bare sensor.

    pixel (m) : width of a pixel.
    left, top (m) : edges of the sensor, right and up from its middle.
    """

    frame: CameraFrame
    pixel: float
    left: float
    top: float


@kernel
def _sensor_point(camera: Any, x: float, y: float) -> Any:
    across = madd(camera.frame.origin, camera.left + camera.pixel * x, camera.frame.right)
    return add(across, scale(camera.top - camera.pixel * y, camera.frame.up))


@camera_ray.register(LenslessCamera)
def camera_ray_lensless_camera(camera, x, y, time, draws):
    frame = camera.frame
    u1, u2 = sample_2d(draws.sampler, draws.key, draws.index, draws.dimension + LENS)
    # Drawn in proportion to the cosine, so that pi times the mean radiance is the irradiance.
    direction = to_world(sample_cosine_hemisphere(u1, u2), frame.right, frame.up, frame.forward)
    return _sensor_point(camera, x, y), direction, math.pi
