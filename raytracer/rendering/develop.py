"""Develop a film after the render: make an image with its layers, denoise it if that is asked for, and expose it."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from raytracer.film.exposure import CropWindow, ExposureResult
from raytracer.film.film import develop
from raytracer.film.image import Image
from raytracer.film.light_field.layout import Layout
from raytracer.film.negative_pixels import find_negative_causes
from raytracer.film.photograph import RADIANCE, DevelopSettings, check_develop_settings, develop_photograph
from raytracer.film.window import Window
from raytracer.kernel.packed_scene import Scene
from raytracer.plugins.cameras.base.moving import camera_at_time
from raytracer.rendering.checked_options import CheckedOptions
from raytracer.rendering.film_region import DENOISER_GUIDES, FilmRegion
from raytracer.scene.pack.autofocus import mid_exposure_time
from raytracer.scene.spec import SceneSpec
from raytracer.schema.registry import AOVS

if TYPE_CHECKING:
    pass


def film_process(spec: SceneSpec) -> DevelopSettings:
    """Return the settings by which a scene's picture is developed."""
    return DevelopSettings(
        exposure=spec.camera.exposure_settings(spec.film.width, spec.film.height),
        sensor=spec.camera.simulated_sensor(),
        white_balance=spec.film.white_balance,
        tone_curve=spec.film.tone_curve,
    )


def check_development(spec: SceneSpec, window: Window) -> None:
    """Check, before it is rendered, that this part of the picture can be developed.

    Raises
    ------
    InputError : see `photograph.check_develop_settings`.
    """
    frame = _crop_frame(spec, window)
    check_develop_settings(film_process(spec), frame, window.bottom - window.top, window.right - window.left)


def negative_causes(spec: SceneSpec, scene: Scene) -> tuple[str, ...]:
    """List what in a packed scene may make pixels of its picture negative."""
    process = film_process(spec)
    spectrum = scene.spectrum
    return find_negative_causes(
        has_negative_lobes=spec.film.filter.has_negative_lobes(),
        is_spectral=spectrum is not None and bool((spectrum.spectra.response < 0.0).any()),
        has_read_noise=process.sensor is not None and process.exposure is not None,
    )


def develop_image(
    region: FilmRegion,
    spec: SceneSpec,
    options: CheckedOptions | None = None,
    header: Mapping[str, str | float | int] | None = None,
    lap: Callable[[str], object] = lambda phase: None,
    *,
    is_final: bool = False,
) -> tuple[Image, ExposureResult | None]:
    """Make the image of a film, and tell how it was exposed; None for plain radiance.

    Parameters
    ----------
    options : which AOVs become layers, and whether it is denoised; None for neither.
    header : settings for the headers of files.
    lap : called with the name of a phase, "develop" or "denoise", at its end.
    is_final : True if nothing will be added to the film, so that the image may share its memory.
    """
    aovs = () if options is None else options.aovs
    film, recording, window = region.film, region.recording, region.window
    image = develop(film, header or {}, is_final=is_final)
    if recording is not None:
        image = replace(
            image,
            settings={**image.settings, **recording.settings(aovs)},
            layers={name: recording.develop(name, film) for name in aovs},
            channels=recording.channels(aovs),
        )
        if options is not None and options.denoise:
            from raytracer.film.denoise import denoise

            lap("develop")
            albedo, normal, coverage = (recording.develop(name, film) for name in DENOISER_GUIDES)
            guides = coverage[..., None] * albedo, coverage[..., None] * normal
            # Each view by itself.
            image = denoise(image, *guides, threads=options.threads, parts=_view_slices(spec, window))
            lap("denoise")
    if window == Window(0, 0, *spec.picture()):
        image = replace(image, layout=light_field_layout(spec))
    # The picture that a denoiser has left as it was is a layer too.
    units = {"noisy": RADIANCE, **{name: AOVS.specs()[name].unit for name in aovs}}
    image, exposure = develop_photograph(image, film_process(spec), _crop_frame(spec, window), spec.render.seed, units)
    lap("develop")
    return image, exposure


def is_radiance(process: DevelopSettings) -> bool:
    """Tell if pixels of the picture are those of the film, without an exposure."""
    return process.exposure is None and process.white_balance is None


def expose_radiance(mean: NDArray[np.float64], spec: SceneSpec) -> NDArray[np.float64]:
    """Expose a whole picture as the camera says, without its variance and layers: for a look at it."""
    process = film_process(spec)
    if is_radiance(process):
        return mean
    frame = _crop_frame(spec, Window(0, 0, *spec.picture()))
    return develop_photograph(Image(mean), process, frame, spec.render.seed, {})[0].radiance


def _crop_frame(spec: SceneSpec, window: Window) -> CropWindow:
    """Return the place of a part of the picture in the whole."""
    size = spec.film.width, spec.film.height
    whole = spec.picture()
    return CropWindow(*whole, window.left, window.top, None if whole == size else size)


def light_field_layout(spec: SceneSpec) -> Layout | None:
    """Return the layout of the light field in the whole picture at the middle of the exposure; None if it is none."""
    return camera_at_time(spec.camera, mid_exposure_time(spec)).layout(spec.film.width, spec.film.height)


def _view_slices(spec: SceneSpec, window: Window) -> list[tuple[slice, slice]]:
    """Return rows and columns of the part of each view that a part of the picture holds."""

    def spans(begin: int, end: int, size: int) -> list[slice]:
        edges = [begin, *range(begin - begin % size + size, end, size), end]
        return [slice(low - begin, high - begin) for low, high in pairwise(edges)]

    columns = spans(window.left, window.right, spec.film.width)
    rows = spans(window.top, window.bottom, spec.film.height)
    return [(row, column) for row in rows for column in columns]
