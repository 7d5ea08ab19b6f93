"""The options of a render: as they are asked for, and as they are once checked against the scene."""

import inspect
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, TypedDict, TypeVar

import numpy as np

from raytracer.film.window import Window, crop_window
from raytracer.rendering.worker_pool import available_threads
from raytracer.scene.render_settings import MAX_PIXELS
from raytracer.scene.spec import SceneSpec
from raytracer.util.errors import InputError

Function = TypeVar("Function", bound=Callable[..., Any])

# Counters of the kernels have so many bits, and a machine may have so many threads.
_MAX_SPP, _MAX_SEED, _MAX_THREADS = 2**31 - 1, 2**32 - 1, 1024


@dataclass(frozen=True)
class RenderOptions:
    """The options of a render, as they are asked for.

    Attributes
    ----------
    spp : samples per pixel, in place of the scene's.
    seed : in place of the scene's.
    threads : threads that render; all processors if None.
    crop (px) : (x0, y0, x1, y1), only the pixels x0 <= x < x1, y0 <= y < y1.  They are those of the whole picture, but
        that `exposure: auto` and `white_balance: auto` measure these alone, and a Bayer mosaic ends at their edges.
    noise : relative error to stop at, 0.01 for 1 %.  Samples go where they are needed, at most `spp` a pixel, without a
        limit if that is None.
    time_limit (s) : time after which the image is to be there, loading included; sampling then ends early, but no
        sooner than with 8 samples a pixel.  Without `spp` samples go where they are needed.
    aovs : names of AOVs, which become layers of the image (docs/aovs.md); the radiance keeps its bits.
    denoise : True to denoise the image with Open Image Denoise, which makes it biased.
    strict : True to take warnings for errors.
    max_memory (bytes) : memory that this process may take; what the machine has, as far as it is known, if None.
    """

    spp: int | None = None
    seed: int | None = None
    threads: int | None = None
    crop: tuple[int, int, int, int] | None = None
    noise: float | None = None
    time_limit: float | None = None
    aovs: Sequence[str] = ()
    denoise: bool = False
    strict: bool = False
    max_memory: int | None = None


class RenderKeywords(TypedDict, total=False):
    """Keywords of functions that render, all of them optional: the fields of `RenderOptions` but `max_memory`."""

    spp: int | None
    seed: int | None
    threads: int | None
    crop: tuple[int, int, int, int] | None
    noise: float | None
    time_limit: float | None
    aovs: Sequence[str]
    denoise: bool
    strict: bool


def show_keywords(function: Function) -> Function:
    """Show `RenderKeywords` in the signature of a function that takes them as **keywords, for help and completion."""
    signature = inspect.signature(function)
    options = inspect.signature(RenderOptions).parameters
    own = [known for known in signature.parameters.values() if known.kind is not inspect.Parameter.VAR_KEYWORD]
    given = [options[name].replace(kind=inspect.Parameter.KEYWORD_ONLY) for name in RenderKeywords.__annotations__]
    positional = [known for known in own if known.kind is not inspect.Parameter.KEYWORD_ONLY]
    keyword_only = [known for known in own if known.kind is inspect.Parameter.KEYWORD_ONLY]
    parameters = [*positional, *given, *keyword_only]
    function.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]
    return function


def check_keywords(given: Iterable[str]) -> None:
    """Check that keywords are among `RenderKeywords`.

    Raises
    ------
    TypeError : one is not.
    """
    for name in given:
        if name not in RenderKeywords.__annotations__:
            raise TypeError(f"render() got an unexpected keyword argument {name!r}")


class CheckedOptions(NamedTuple):
    """Options of a render that its scene can have.

    Attributes
    ----------
    window : pixels of the picture to render.
    crop : as asked for.
    aovs, denoise, noise, time_limit : see `RenderOptions`.
    max_spp : samples a pixel at most, None without a limit.
    is_adaptive : True if samples go where they are needed.
    threads : threads of this machine.
    """

    window: Window
    crop: tuple[int, int, int, int] | None
    aovs: tuple[str, ...]
    denoise: bool
    noise: float | None
    time_limit: float | None
    max_spp: int | None
    is_adaptive: bool
    threads: int

    def check_aovs(self) -> None:
        """Check that all pixels get as many samples, if an AOV needs that.

        Raises
        ------
        InputError : they do not.
        """
        if self.is_adaptive and self.aovs:
            from raytracer.kernel.aovs.base.recording import per_sample_aovs

            for name in per_sample_aovs(self.aovs):
                raise InputError(f"the AOV {name} needs as many samples in every pixel: give spp and no noise")


def check_options(spec: SceneSpec, options: RenderOptions) -> tuple[SceneSpec, CheckedOptions]:
    """Check the options of a render of a scene, and return the scene with its spp and seed as asked for.

    Raises
    ------
    InputError : a number is out of range, the crop lies outside of the film, or there is no denoiser.
    """
    if options.denoise:
        from raytracer.film.denoise import require_denoiser

        require_denoiser()
    if options.noise is not None and not 0.0 < options.noise < 1.0:
        raise InputError(f"noise must lie between 0 and 1, and is 0.01 for 1 %, got {options.noise:g}")
    if options.time_limit is not None and not 0.0 < options.time_limit < math.inf:
        raise InputError(f"a time limit must be greater than 0 and finite, got {options.time_limit:g}")
    threads = _check_integer("threads", options.threads, 1, _MAX_THREADS)
    spec = _override_settings(spec, options)
    is_adaptive = options.noise is not None or (options.time_limit is not None and options.spp is None)
    checked = CheckedOptions(
        window=crop_window(spec.picture(), options.crop, "the film"),
        crop=options.crop,
        aovs=tuple(options.aovs),
        denoise=options.denoise,
        noise=options.noise,
        time_limit=options.time_limit,
        max_spp=None if is_adaptive and options.spp is None else spec.render.spp,
        is_adaptive=is_adaptive,
        threads=threads or available_threads(),
    )
    return spec, checked


def _override_settings(spec: SceneSpec, options: RenderOptions) -> SceneSpec:
    asked = {
        "spp": _check_integer("spp", options.spp, 1, _MAX_SPP),
        "seed": _check_integer("seed", options.seed, 0, _MAX_SEED),
    }
    given = {name: value for name, value in asked.items() if value is not None}
    return spec.model_copy(update={"render": spec.render.model_copy(update=given)})


def _check_integer(name: str, value: int | None, least: int, most: int) -> int | None:
    """Check an integer's range, and return it as Python's own; None if there is none."""
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or not least <= value <= most:
        raise InputError(f"{name} must be an integer from {least} to {most}, got {value!r}")
    return int(value)


def check_picture_size(window: Window) -> None:
    """Check that a picture is small enough to be rendered at once.

    Raises
    ------
    InputError : it is not.
    """
    if window.pixels > MAX_PIXELS:
        size = f"{window.right - window.left} x {window.bottom - window.top} is {window.pixels:,} pixels"
        raise InputError(
            f"the picture is too large: {size}, at most {MAX_PIXELS:,} are possible at once; rt lightfield render "
            "takes the views of an array in parts"
        )
