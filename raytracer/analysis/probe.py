"""Probes of a scene's plenoptic function: the radiance at any point from any direction, at any time.

Reference: Adelson & Bergen 1991, "The Plenoptic Function and the Elements of Early Vision".
"""

import math
import os
from collections.abc import Callable, Sequence
from dataclasses import KW_ONLY, dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from pydantic import ValidationError

from raytracer.rendering.options import RenderOptions, called_with
from raytracer.rendering.progress import Progress
from raytracer.rendering.render import prepare_scene, render_prepared
from raytracer.rendering.session import Rendered
from raytracer.scene.load import load
from raytracer.scene.render_settings import Film
from raytracer.scene.spec import SceneSpec
from raytracer.schema.registry import CAMERAS
from raytracer.schema.validation_errors import error_sentence
from raytracer.util.errors import InputError

SAMPLES = 2**16
"""Default number of samples of one ray."""

EDGE = 64
"""Edge of the film on which they are taken (px): its tiles occupy all threads, and its pixels tell the noise."""

MAX_WIDTH = 2**14

WIDTH = 1024
"""Default width of a picture of all directions (px), which is half as high."""


# Names of arguments by keys of a camera.
_ARGUMENT_NAMES = {"look_from": "at", "look_at": "toward", "time": "time", "wavelength": "wavelength"}


class ProbeResult(NamedTuple):
    """Measured radiance along a ray.

    at : the point (m).
    towards : unit vector from it to where the light comes from.
    time : of the scene (s).
    wavelength : (nm), or None.
    radiance : red, green and blue, or at the one wavelength, relative to the scene's unit.
    standard_error : of each, from the differences of independent parts of the samples.
    samples : number of samples.
    dropped : number of further samples, which were not finite.
    """

    at: tuple[float, ...]
    towards: tuple[float, ...]
    time: float
    wavelength: float | None
    radiance: tuple[float, ...]
    standard_error: tuple[float, ...]
    samples: int
    dropped: int

    def json(self) -> dict[str, Any]:
        """Return the values that `rt probe --json` prints."""
        return self._asdict()


@dataclass(frozen=True)
class ProbeOptions(RenderOptions):
    """Options of `probe` and `probe_sphere`; see there."""

    scene: SceneSpec | str | os.PathLike[str]
    at: Sequence[float]
    _: KW_ONLY
    toward: Sequence[float] | None = None
    direction: Sequence[float] | None = None
    time: float | None = None
    wavelength: float | None = None
    width: int = WIDTH
    progress: Callable[[Progress], None] | None = None
    warn: Callable[[str], object] | None = None


@called_with(ProbeOptions, without=("crop", "noise", "time_limit", "aovs", "denoise", "width"))
def probe(options: ProbeOptions) -> ProbeResult:
    """Measure the radiance that comes to a point from a direction.

    Parameters
    ----------
    scene : a scene, or its file; medium and time are those of its camera.
    at : the point (m).
    toward, direction : a point (m) that the light comes from, or past, or the vector that points there: one of them.
    time : of the scene (s); when its camera's shutter opens, if None.
    wavelength : (nm), for the spectral radiance there, relative to D65; red, green and blue if None.
    spp : samples at least, 65536 if None; a few more where they do not go up in whole pixels.

    Other parameters are those of `rendering.render`.

    Raises
    ------
    InputError : neither or both of `toward` and `direction`, a direction without a length, or what `render` refuses.
    KeyboardInterrupt : Ctrl-C.
    """
    toward, direction = options.toward, options.direction
    spp = SAMPLES if options.spp is None else options.spp
    if (toward is None) == (direction is None):
        raise InputError("a ray needs either a point to look toward, or a direction")
    if isinstance(spp, bool) or not isinstance(spp, int) or spp < 1:
        raise InputError(f"spp must be an integer from 1 on, got {spp!r}")
    start = _three("at", options.at)
    target = start + _unit(_three("direction", direction)) if direction is not None else _three("toward", toward)
    rows = min(EDGE, math.ceil(spp / EDGE))
    samples = math.ceil(spp / (EDGE * rows))
    seen = _probe_scene(options, "ray", start, target, EDGE, rows)
    rendered = _render(seen, replace(options, spp=samples))
    if rendered.interrupted:
        # Some pixels may have no sample yet, so the mean would be wrong.
        raise KeyboardInterrupt
    # Each pixel has its own random numbers, so their means are independent, whatever the sampler is.
    means = rendered.image.radiance.reshape(-1, 3)[:, : 3 if options.wavelength is None else 1]
    error = means.std(axis=0, ddof=1) / math.sqrt(len(means))
    return ProbeResult(
        at=tuple(start.tolist()),
        towards=tuple(_unit(target - start).tolist()),
        time=seen.camera.shutter_interval().open,
        wavelength=options.wavelength,
        radiance=tuple(means.mean(axis=0).tolist()),
        standard_error=tuple(error.tolist()),
        samples=samples * EDGE * rows - rendered.stats.nan_samples,
        dropped=rendered.stats.nan_samples,
    )


@called_with(ProbeOptions, without=("direction",))
def probe_sphere(options: ProbeOptions) -> Rendered:
    """Render the light at a point from all directions: an equirectangular picture, with `toward` in its middle.

    Parameters are those of `probe` and `rendering.render`; width, of the picture (px), which is half as high.

    Raises
    ------
    InputError : a width that is odd or too large, or what `render` refuses.
    """
    width = options.width
    if not 2 <= width <= MAX_WIDTH or width % 2:
        raise InputError(
            "a picture of all directions is twice as wide as high: its width must be even, "
            f"from 2 to {MAX_WIDTH}, got {width}"
        )
    start = _three("at", options.at)
    ahead = start - np.array([0.0, 0.0, 1.0]) if options.toward is None else _three("toward", options.toward)
    return _render(_probe_scene(options, "equirectangular", start, ahead, width, width // 2), options)


def _render(scene: SceneSpec, options: ProbeOptions) -> Rendered:
    """Render what is seen from the point."""
    return render_prepared(prepare_scene(scene, options, warn=options.warn), progress=options.progress)


def _probe_scene(options: ProbeOptions, camera: str, at: Any, toward: Any, width: int, height: int) -> SceneSpec:
    """Replace the camera of a scene by one that is open for no time and records radiance."""
    scene = options.scene
    spec = load(scene) if isinstance(scene, str | os.PathLike) else scene
    if np.array_equal(at, toward):
        raise InputError(f"the point to look toward is the point that light comes to, {at.tolist()}: it needs another")
    # Any direction that is not the view's can be up.
    up = (0.0, 1.0, 0.0) if at[0] != toward[0] or at[2] != toward[2] else (0.0, 0.0, 1.0)
    keys = {
        "up": up,
        "look_from": at.tolist(),
        "look_at": toward.tolist(),
        "time": spec.camera.shutter_interval().open if options.time is None else options.time,
        "medium": spec.camera.medium,
        "wavelength": options.wavelength,
    }
    try:
        seen = CAMERAS.spec(camera).model_validate(keys)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        raise InputError(f"{_ARGUMENT_NAMES[str(first['loc'][0])]}: {error_sentence(first)}") from None
    return spec.model_copy(update={"camera": seen, "film": Film(width=width, height=height)})


def _three(name: str, numbers: Any) -> Any:
    try:
        vector = np.asarray(numbers, np.float64)
    except (TypeError, ValueError):
        vector = np.empty(0)
    if vector.shape != (3,):
        raise InputError(f"{name} must be three numbers, got {numbers!r}")
    return vector


def _unit(vector: Any) -> Any:
    length = float(np.linalg.norm(vector))
    if not 0.0 < length < math.inf:
        raise InputError(f"a direction must have a length, got {vector.tolist()}")
    return vector / length
