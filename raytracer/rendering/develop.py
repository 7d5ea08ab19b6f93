"""What becomes of a film after the render: an image with its layers, clean if that was asked for, and exposed."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING

from raytracer.cameras.moving import camera_at
from raytracer.film.exposure import Frame, Setting
from raytracer.film.film import Film, develop
from raytracer.film.image import Image
from raytracer.film.negative import causes_of
from raytracer.film.photograph import RADIANCE, Process, check_process, photograph
from raytracer.integrator import Scene
from raytracer.kinds import AOVS
from raytracer.plenoptic.layout import Layout
from raytracer.scene.focus import middle_of
from raytracer.scene.pack import Packed
from raytracer.scene.spec import SceneSpec
from raytracer.scheduling import Window

if TYPE_CHECKING:
    from raytracer.aovs.recording import Recording

# What the denoiser is guided by, and how much of a pixel it holds for.
_GUIDES = ("albedo", "normal", "coverage")


def process_of(spec: SceneSpec) -> Process:
    """How the picture is to be developed."""
    return Process(
        exposure=spec.camera.photograph(spec.film.width, spec.film.height),
        sensor=spec.camera.simulated_sensor(),
        white_balance=spec.film.white_balance,
        tone_curve=spec.film.tone_curve,
    )


def check_development(spec: SceneSpec, window: Window) -> None:
    """Make sure, before it is rendered, that this part of the picture can be developed.

    Raises
    ------
    InputError : see `photograph.check_process`.
    """
    frame = _frame(spec, window)
    check_process(process_of(spec), frame, window.bottom - window.top, window.right - window.left)


def negative_causes(spec: SceneSpec, scene: Scene) -> tuple[str, ...]:
    """List what of a packed scene may bring pixels of its picture below zero."""
    process = process_of(spec)
    spectrum = scene.spectrum
    return causes_of(
        has_negative_lobes=spec.film.filter.has_negative_lobes(),
        is_spectral=spectrum is not None and bool((spectrum.spectra.response < 0.0).any()),
        has_read_noise=process.sensor is not None and process.exposure is not None,
    )


def recording_of(
    spec: SceneSpec, packed: Packed, height: int, width: int, aovs: Sequence[str], *, denoise: bool
) -> "Recording | None":
    """What is to be gathered on a film besides radiance; None where that is nothing.

    Raises
    ------
    InputError : there is no AOV of that name.
    """
    if not aovs and not denoise:
        return None
    from raytracer.aovs.recording import Recording, known_aovs
    from raytracer.scene.identities import identify

    names = known_aovs([*aovs, *(_GUIDES if denoise else ())])
    return Recording(names, height, width, identify(spec, packed))


def finish(
    film: Film,
    spec: SceneSpec,
    window: Window | None = None,
    settings: Mapping[str, str | float | int] | None = None,
    recording: "Recording | None" = None,
    aovs: Sequence[str] = (),
    denoise_threads: int | None = None,
    lap: Callable[[str], object] = lambda phase: None,
    *,
    is_final: bool = False,
) -> tuple[Image, Setting | None]:
    """The image on a film, and how it was exposed; None for plain radiance.

    Parameters
    ----------
    window : the part of the picture that the film is; the whole one if None.
    settings : for the headers of files.
    recording, aovs : what was gathered besides radiance, and which of it becomes layers.
    denoise_threads : threads for Open Image Denoise; None not to denoise.
    lap : called with the name of a phase, "develop" or "denoise", at its end.
    is_final : whether nothing will be added to the film, so that the image may be its memory.
    """
    image = develop(film, settings or {}, is_final=is_final)
    if recording is not None:
        image = replace(
            image,
            settings={**image.settings, **recording.settings(aovs)},
            layers={name: recording.develop(name, film) for name in aovs},
            channels=recording.channels(aovs),
        )
        if denoise_threads is not None:
            lap("develop")
            image = _denoised(image, film, recording, denoise_threads, _views_in(spec, window))
            lap("denoise")
    whole = Window(0, 0, *spec.picture())
    if window in (None, whole):
        image = replace(image, layout=layout_of(spec))
    frame = _frame(spec, window or whole)
    # The picture that a denoiser has left as it was is a layer too.
    units = {"noisy": RADIANCE, **{name: AOVS.specs()[name].unit for name in aovs}}
    image, setting = photograph(image, process_of(spec), frame, spec.render.seed, units)
    lap("develop")
    return image, setting


def _frame(spec: SceneSpec, window: Window) -> Frame:
    """Where a part of the picture lies in it."""
    size = spec.film.width, spec.film.height
    whole = spec.picture()
    return Frame(*whole, window.left, window.top, None if whole == size else size)


def layout_of(spec: SceneSpec) -> Layout | None:
    """How the whole picture holds a light field, with its camera where it is in the middle of the exposure."""
    return camera_at(spec.camera, middle_of(spec)).layout(spec.film.width, spec.film.height)


def _views_in(spec: SceneSpec, window: Window | None) -> list[tuple[slice, slice]]:
    """Rows and columns of what each view has in a part of the picture."""
    window = window or Window(0, 0, *spec.picture())

    def spans(begin: int, end: int, size: int) -> list[slice]:
        edges = [begin, *range(begin - begin % size + size, end, size), end]
        return [slice(low - begin, high - begin) for low, high in pairwise(edges)]

    columns = spans(window.left, window.right, spec.film.width)
    rows = spans(window.top, window.bottom, spec.film.height)
    return [(row, column) for row in rows for column in columns]


def _denoised(
    image: Image, film: Film, recording: "Recording", threads: int, parts: Sequence[tuple[slice, slice]]
) -> Image:
    """The image without its noise, as far as the denoiser can tell."""
    from raytracer.film.denoise import denoise

    albedo, normal, coverage = (recording.develop(name, film) for name in _GUIDES)
    return denoise(image, coverage[..., None] * albedo, coverage[..., None] * normal, threads=threads, parts=parts)
