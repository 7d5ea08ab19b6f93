"""Equirectangular camera: a panorama of all directions, as image environments are stored.

In a scene:

    camera: {type: equirectangular, look_from: [0, 1.5, 0], look_at: [0, 1.5, -1]}
"""

import math
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import Field

from raytracer.core.spectra import monochromatic_spectra
from raytracer.core.vec import norm, to_world
from raytracer.plugins.cameras.base.interface import NO_ASSETS, Assets, camera_ray, project
from raytracer.plugins.cameras.base.placement import CameraFrame, PlacedSpec, WavelengthField, to_camera_space
from raytracer.schema.fields import Quantity


class Equirectangular(PlacedSpec):
    """Longitude across the picture and latitude up it, both in equal steps; the poles are the camera's `up` and down.

    `look_at` is in the middle, and longitude grows to the right.  A film twice as wide as high has square pixels in
    the middle of the full panorama; other shapes stretch it.

    References: Snyder 1987, "Map Projections: A Working Manual", USGS Professional Paper 1395, pp. 90-91.
    """

    type: Literal["equirectangular"] = "equirectangular"
    hfov: Annotated[float, Quantity("angle", low=0.0, low_open=True, high=360.0)] = Field(
        default=360.0, description="longitudes (deg) from the left edge to the right, up to 360"
    )
    vfov: Annotated[float, Quantity("angle", low=0.0, low_open=True, high=180.0)] = Field(
        default=180.0, description="latitudes (deg) from the lower edge to the upper, up to 180"
    )
    wavelength: WavelengthField = None

    def describe(self, width: int, height: int) -> dict[str, float]:
        numbers = {
            "hfov_deg": self.hfov,
            "vfov_deg": self.vfov,
            "pixel_longitude_deg": self.hfov / width,
            "pixel_latitude_deg": self.vfov / height,
        }
        return numbers if self.wavelength is None else {**numbers, "wavelength_nm": self.wavelength}

    def pack(self, width: int, height: int, assets: Assets = NO_ASSETS) -> "EquirectangularCamera":
        longitude, latitude = math.radians(self.hfov) / width, math.radians(self.vfov) / height
        wavelengths = None if self.wavelength is None else monochromatic_spectra(self.wavelength)
        return EquirectangularCamera(self.frame(), longitude, latitude, 0.5 * width, 0.5 * height, wavelengths)


class EquirectangularCamera(NamedTuple):
    """Packed panorama.

    longitude, latitude (rad) : of a pixel.
    x, y (px) : middle of the film.
    wavelengths : tables of spectra for one wavelength; None for light in red, green and blue.
    """

    frame: CameraFrame
    longitude: float
    latitude: float
    x: float
    y: float
    wavelengths: Any


@camera_ray.register(EquirectangularCamera)
def camera_ray_equirectangular_camera(camera, x, y, time, draws):
    longitude = camera.longitude * (x - camera.x)
    latitude = camera.latitude * (camera.y - y)
    level = math.cos(latitude)
    local = (level * math.sin(longitude), math.sin(latitude), level * math.cos(longitude))
    frame = camera.frame
    return frame.origin, to_world(local, frame.right, frame.up, frame.forward), 1.0


@project.register(EquirectangularCamera)
def project_equirectangular_camera(camera, point, time):
    local = to_camera_space(camera.frame, point)
    # The camera's own place is in no direction.
    if norm(local) == 0.0:
        return math.nan, math.nan, 0.0
    right, up, forward = local
    longitude = math.atan2(right, forward)
    latitude = math.atan2(up, math.hypot(right, forward))
    return camera.x + longitude / camera.longitude, camera.y - latitude / camera.latitude, forward
