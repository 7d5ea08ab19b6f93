"""The options of a render once they are checked against its scene."""

import math
from dataclasses import dataclass

import numpy as np

from raytracer.film.window import Window, crop_window
from raytracer.rendering.options import OPTIONS, RenderOptions
from raytracer.rendering.worker_pool import available_threads
from raytracer.scene.spec import SceneSpec
from raytracer.util.errors import InputError


@dataclass(frozen=True, kw_only=True)
class CheckedOptions(RenderOptions):
    """Options of a render that its scene can have.

    threads : threads of this machine.
    window : pixels of the picture to render.
    max_spp : samples a pixel at most, None without a limit.
    """

    threads: int
    window: Window
    max_spp: int | None


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
    threads = _check_integer("threads", options.threads)
    spec = override_settings(spec, options)
    # The values alone: a record that adds others may hold what is not to live as long as these.
    values = options.as_keywords() | {
        "threads": threads or available_threads(),
        "window": crop_window(spec.picture(), options.crop, "the film"),
        "max_spp": None if options.spp_limit(spec) is None else spec.render.spp,
    }
    return spec, CheckedOptions(**values)


def override_settings(spec: SceneSpec, options: RenderOptions) -> SceneSpec:
    """Return a scene with the spp and the seed that are asked for.

    Raises
    ------
    InputError : they are out of range.
    """
    asked = {name: _check_integer(name, getattr(options, name)) for name in ("spp", "seed")}
    given = {name: value for name, value in asked.items() if value is not None}
    return spec.model_copy(update={"render": spec.render.model_copy(update=given)})


def _check_integer(name: str, value: int | None) -> int | None:
    """Check an integer's range, and return it as Python's own; None if there is none."""
    if value is None:
        return None
    least, most = OPTIONS[name].least, OPTIONS[name].most
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or not least <= value <= most:
        raise InputError(f"{name} must be an integer from {least} to {most}, got {value!r}")
    return int(value)
