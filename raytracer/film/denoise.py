"""Denoising by Intel's Open Image Denoise, which the extra `raytracer[denoise]` installs.

A denoised picture is no longer an unbiased estimate: a neural network may remove detail with the noise.  So every file
that has a header says so, and .exr files keep the picture as it was rendered as the layer `noisy`.

References: https://www.openimagedenoise.org/documentation.html, section "RT" of "Filters".
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytracer.film.image import Image
from raytracer.util.errors import InputError, OutputError

_MISSING = "denoising needs Open Image Denoise, which is not installed: pip install 'raytracer[denoise]'"

_LARGEST = float(np.finfo(np.float32).max)


def require_denoiser() -> None:
    """Raise an InputError, before a render, if the denoiser is not installed or does not run on this machine."""
    _Device(threads=1).release()


class _Device:
    """The processor, as a device of the library."""

    def __init__(self, threads: int | None) -> None:
        try:
            import pyoidn
        except ImportError as error:
            raise InputError(_MISSING) from error
        self.library: Any = pyoidn
        try:
            self.device: Any = pyoidn.Device(pyoidn.OIDN_DEVICE_TYPE_CPU)
            if threads is not None:
                self.device.set_int("numThreads", threads)
            self.device.commit()
            problem = self.device.get_error()
        except (OSError, AttributeError, TypeError) as error:
            # A wheel without this platform's library, or of a version that lacks these calls.
            raise InputError(f"Open Image Denoise cannot be loaded: {error}") from error
        if problem:
            self.release()
            raise InputError(f"Open Image Denoise does not run on this machine: {problem}")

    def version(self) -> str:
        return ".".join(str(self.device.get_int(f"version{part}")) for part in ("Major", "Minor", "Patch"))

    def run(self, images: dict[str, NDArray[np.float32]], **settings: bool) -> NDArray[np.float32]:
        """Run the ray tracing filter on the first of `images`, guided by the others."""
        result = np.empty_like(next(iter(images.values())))
        with self.library.Filter(self.device, self.library.OIDN_FILTER_TYPE_RT) as ray_filter:
            for name, values in {**images, "output": result}.items():
                ray_filter.set_image(name, values, self.library.OIDN_FORMAT_FLOAT3)
            for name, value in settings.items():
                ray_filter.set_bool(name, value)
            ray_filter.commit()
            ray_filter.execute()
        if problem := self.device.get_error():
            raise OutputError(f"the picture could not be denoised: {problem}")
        return result

    def release(self) -> None:
        self.device.release()


def _single(values: NDArray[Any], low: float, high: float) -> NDArray[np.float32]:
    """Convert to finite float32 values within bounds."""
    return np.ascontiguousarray(np.clip(np.nan_to_num(values), low, high), dtype=np.float32)


def denoise(
    image: Image,
    albedo: NDArray[Any],
    normal: NDArray[Any],
    *,
    threads: int | None = None,
    parts: Sequence[tuple[slice, slice]] = ((slice(None), slice(None)),),
) -> Image:
    """Denoise an image; the result is the same for any number of threads.

    albedo, normal : (height, width, 3), means over a pixel in which rays that meet no surface count as 0.
    threads : number of threads; all processors if None.
    parts : rows and columns of each picture in the image, which are filtered apart from each other.

    Raises InputError: see `require_denoiser`.
    Raises OutputError: the filter failed.
    """
    device = _Device(threads)
    try:
        # Guides that are noisy themselves, behind a lens or in motion, are filtered first, as its authors advise.
        radiance = np.empty(image.radiance.shape)
        for part in parts:
            guides = {"albedo": _single(albedo[part], 0.0, 1.0), "normal": _single(normal[part], -1.0, 1.0)}
            guides = {name: device.run({name: values}) for name, values in guides.items()}
            color = _single(image.radiance[part], 0.0, _LARGEST)
            radiance[part] = device.run({"color": color, **guides}, hdr=True, cleanAux=True)
        version = device.version()
    finally:
        device.release()
    return replace(
        image,
        radiance=radiance,
        # The variance is that of the noisy picture.
        variance=None,
        settings={**image.settings, "denoised": f"oidn {version}, guided by albedo and normal (biased)"},
        layers={**image.layers, "noisy": image.radiance},
    )
