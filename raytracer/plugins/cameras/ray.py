"""A single ray: all of the film sees the same, what comes from one direction to one point.

In a scene:

    camera: {type: ray, look_from: [0, 1, 4], look_at: [0, 1, 0]}
    camera: {type: ray, look_from: [0, 1, 4], look_at: [0, 1, 0], wavelength: 550 nm, time: 0.5}
"""

from typing import Any, Literal, NamedTuple

import numpy as np

from raytracer.core.spectra import monochromatic_spectra
from raytracer.plugins.cameras.base.interface import NO_ASSETS, Assets, camera_ray
from raytracer.plugins.cameras.base.placement import CameraFrame, PlacedSpec, WavelengthField


class Ray(PlacedSpec):
    """The radiance that comes to `look_from` out of the direction of `look_at`: the plenoptic function at one place.

    Every sample of every pixel is of the same ray, with random numbers of its own, so pixels differ by noise alone and
    their mean is the measurement: `rt probe` takes it.  `up` has no say.

    References: Adelson & Bergen 1991, "The Plenoptic Function and the Elements of Early Vision".
    """

    type: Literal["ray"] = "ray"
    wavelength: WavelengthField = None

    def frame(self) -> CameraFrame:
        """Return the frame with the ray along its axis; its other directions are arbitrary.

        Raises
        ------
        ValueError : look_from and look_at are the same point.
        """
        across = np.zeros(3)
        across[np.abs(np.subtract(self.look_at, self.look_from)).argmin()] = 1.0
        return super(Ray, self.model_copy(update={"up": tuple(across.tolist())})).frame()

    def describe(self, width: int, height: int) -> dict[str, float]:
        field = {"hfov_deg": 0.0, "vfov_deg": 0.0}
        return field if self.wavelength is None else {**field, "wavelength_nm": self.wavelength}

    def pack(self, width: int, height: int, assets: Assets = NO_ASSETS) -> "RayCamera":
        return RayCamera(self.frame(), None if self.wavelength is None else monochromatic_spectra(self.wavelength))


class RayCamera(NamedTuple):
    """Packed ray.

    wavelengths : tables of spectra for one wavelength; None for light in red, green and blue.
    """

    frame: CameraFrame
    wavelengths: Any


@camera_ray.register(RayCamera)
def camera_ray_ray_camera(camera, x, y, time, draws):
    return camera.frame.origin, camera.frame.forward, 1.0
