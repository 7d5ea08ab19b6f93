"""Checks of scenes against their references: a render with other random numbers, compared by the noise of both."""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.analysis.compare import TESTS, Verdict, z_test
from raytracer.analysis.regression.reference_file import SUFFIX, Reference, load_reference
from raytracer.analysis.regression.render_reference import (
    MIN_SPP,
    ReferenceScene,
    changed_inputs,
    digests,
    gain_ratio,
    load_recipe_scene,
    measured_gains,
    require_variance,
)
from raytracer.film.image import Image
from raytracer.rendering.progress import Progress
from raytracer.rendering.render import render
from raytracer.report.wording import format_percent
from raytracer.util.errors import InputError, suggest_name
from raytracer.util.path_sandbox import AllowFiles

if TYPE_CHECKING:
    from raytracer.scene.cache import RenderCache

ALPHA = 1e-3
"""Rate at which an unchanged scene may fail."""

MIN_CHECK_SPP = 256
"""Least samples per pixel of a check: single tiles and pixels take some, whatever the mean of the picture does."""

TARGET_CHANGE = 0.01
"""Least change of all light that a check has to find, as a fraction."""

TILE = 8
"""Width and height of the tiles whose means are judged (px)."""

# Probability with which it is found.
_POWER = 0.99

# The test of the means looks at three channels.
_CHANNELS = 3

# Names of the parts of the z-test in JSON, in the order of `Verdict.p_values`.
_P_NAMES = ("means", "tiles", "pixels", "exceeding", "patterns", "pattern_tiles", "neighbours", "squares")

_OUTCOMES = {"passed": "passed", "failed": "FAILED", "error": "cannot be checked", "skipped": "left out"}


@dataclass(frozen=True)
class CheckResult:
    """Result of a check.

    Attributes
    ----------
    name : of the reference: its file without the suffix.
    path : file of the reference.
    passed : True if the scene looks as it did.
    reason : one sentence.
    error : True if it could not be checked because of the input, such as a file that is missing or broken.
    skipped : True if only the test that builds the scene can render it.
    scene : the scene's file, if known.
    spp, seed : of the render; 0 without one.
    alpha : rate at which an unchanged scene may fail.
    seconds : duration of the check.
    detectable_change : the least change of all light that would have been found 99 times of 100, as a fraction; inf if
        not known.
    changes : names of the inputs that have changed since the reference was rendered.
    reference, image, verdict : None if the check ended before; the image is exposed as the reference is.
    """

    name: str
    path: Path
    passed: bool
    reason: str
    error: bool = False
    skipped: bool = False
    scene: str | None = None
    spp: int = 0
    seed: int = 0
    alpha: float = ALPHA
    seconds: float = 0.0
    detectable_change: float = math.inf
    changes: tuple[str, ...] = ()
    reference: Reference | None = None
    image: Image | None = None
    verdict: Verdict | None = None

    @property
    def outcome(self) -> str:
        """`passed`, `failed`, `error` or `skipped`."""
        return "skipped" if self.skipped else "error" if self.error else "passed" if self.passed else "failed"

    def sentence(self) -> str:
        """Describe the result on one line."""
        text = f"{self.name}: {_OUTCOMES[self.outcome]}: {self.reason}"
        if self.changes and not self.passed:
            has = "has" if len(self.changes) == 1 else "have"
            text += f"; {', '.join(self.changes)} {has} changed since the reference was rendered"
        if self.outcome == "passed":
            text += f" ({self.spp} spp, which find {format_percent(self.detectable_change)} more or less light"
            more = "" if self.verdict is None else self.verdict.limits.details()
            text += f", and {more})" if more else ")"
        return text

    def json(self) -> dict[str, Any]:
        """Return the values that `rt check --json` prints."""
        verdict = self.verdict
        return {
            "name": self.name,
            "reference": str(self.path),
            "scene": self.scene,
            "verdict": self.outcome,
            "reason": self.reason,
            "changes": list(self.changes),
            "spp": self.spp,
            "seed": self.seed,
            "alpha": self.alpha,
            "seconds": self.seconds,
            "finds": _finite(self.detectable_change),
            "p": verdict and dict(zip(_P_NAMES, verdict.p_values().values(), strict=True)),
            "findings": [] if verdict is None else list(verdict.findings),
            "would_have_found": verdict
            and {name: _finite(float(value)) for name, value in verdict.limits._asdict().items()},
        }


def _finite(value: float) -> float | None:
    """Return a number that JSON has; None for others."""
    return value if math.isfinite(value) else None


def find_references(folder: str | Path, names: Sequence[str] = ()) -> list[Path]:
    """Find the references in a folder, or those of these names, in the order of their names.

    Raises
    ------
    InputError : there is no such folder, or none of that name, or none at all.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(f"{folder}: {'is no folder' if folder.exists() else 'no such folder'}")
    paths = {path.stem: path for path in sorted(folder.glob(f"*{SUFFIX}"))}
    for name in names:
        if name not in paths:
            raise InputError(f"{folder} has no reference {name!r}: {suggest_name(name, paths, 'references')}")
    if not paths:
        raise InputError(f"{folder} has no references: rt reference SCENE -o {folder} renders one")
    return [path for name, path in paths.items() if not names or name in names]


class CheckOptions(NamedTuple):
    """Options of a check.

    spp : samples per pixel; as many as it takes to find 1 % of all light missing if None, but 256 at least and no more
        than the reference has.
    seed : of all random numbers; the one after the reference's if None.
    alpha : rate at which an unchanged scene may fail.
    """

    spp: int | None = None
    seed: int | None = None
    alpha: float = ALPHA


_DEFAULTS = CheckOptions()


def check_reference(
    path: str | Path,
    options: CheckOptions = _DEFAULTS,
    *,
    scene: ReferenceScene | None = None,
    threads: int | None = None,
    cache: "RenderCache | None" = None,
    progress: Callable[[Progress], None] | None = None,
    allow_files: AllowFiles = (),
) -> CheckResult:
    """Render the scene of a reference again, with another seed, and compare the two.

    Errors of the reference or its scene are stored in the result.

    Parameters
    ----------
    path : of the reference.
    scene : the scene to render; the one that the reference names if None.
    threads, cache, progress : see `rendering.render`.
    allow_files : see `render_reference.load_recipe_scene`.

    Raises
    ------
    InputError : the seed is the reference's, or there are too few samples.
    KeyboardInterrupt : the user has ended it.
    """
    if options.spp is not None and options.spp < MIN_SPP:
        raise InputError(
            f"a check takes at least {MIN_SPP} samples per pixel, to know its own noise; got {options.spp}"
        )
    path, alpha, begin = Path(path), options.alpha, time.perf_counter()
    result = CheckResult(path.stem, path, passed=False, reason="", alpha=alpha)
    try:
        reference = load_reference(path)
        recipe = reference.recipe
        result = replace(result, reference=reference, scene=recipe.scene)
        if scene is None and recipe.scene is None:
            return replace(result, passed=True, skipped=True, reason="its scene is built by a test, which checks it")
        scene = load_recipe_scene(recipe, path.parent, allow_files) if scene is None else scene
        result = replace(result, changes=changed_inputs(recipe.inputs, digests(scene.spec)))
    except InputError as error:
        return replace(result, error=True, reason=str(error))
    height, width, _ = reference.mean.shape
    size = scene.spec.film
    if (size.width, size.height) != (width, height):
        reason = f"the scene's picture has {size.width} x {size.height} pixels, and the reference {width} x {height}"
        return replace(result, error=True, reason=reason)

    # Other random numbers than the reference's: with the same ones no noise would be left to judge by.
    seed = (recipe.seed + 1) % 2**32 if options.seed is None else options.seed
    if seed == recipe.seed:
        raise InputError(f"{path.stem} was rendered with the seed {seed} itself; a check takes another one")
    spp = samples_to_detect(reference, TARGET_CHANGE, alpha) if options.spp is None else options.spp
    result = replace(result, spp=spp, seed=seed, detectable_change=detectable_change(reference, spp, alpha))
    try:
        rendered = render(scene.spec, spp=spp, seed=seed, threads=threads, cache=cache, progress=progress)
        if rendered.interrupted:
            raise KeyboardInterrupt
        image = rendered.image
        gain = gain_ratio(recipe.gains, measured_gains(scene.spec, image))
        image = replace(image, radiance=gain * image.radiance, variance=gain**2 * require_variance(image))
    except InputError as error:
        return replace(result, error=True, reason=str(error), seconds=time.perf_counter() - begin)

    verdict = z_test(
        image.radiance, image.variance, reference.mean, reference.variance, TILE, alpha, ratio=recipe.spp / spp
    )
    passed, reason = verdict.passed, verdict.reason
    dropped = rendered.stats.nan_samples
    if passed and dropped and not recipe.dropped:
        passed = False
        reason = f"{dropped} sample{' is' if dropped == 1 else 's are'} not finite, as none of the reference is"
    seconds = time.perf_counter() - begin
    return replace(result, passed=passed, reason=reason, seconds=seconds, image=image, verdict=verdict)


# ---- Detectable changes


def _channel_means(reference: Reference) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Compute means of the channels (3,), and their variances (3,)."""
    pixels = reference.mean.shape[0] * reference.mean.shape[1]
    return reference.mean.mean(axis=(0, 1)), reference.variance.sum(axis=(0, 1)) / pixels**2


def _detectable_deviations(alpha: float) -> float:
    """Compute the standard deviations of the mean of a channel that are found 99 times of 100."""
    from scipy.special import ndtri

    least = -math.expm1(math.log1p(-alpha / TESTS) / _CHANNELS)
    return float(-ndtri(0.5 * least) + ndtri(_POWER))


def detectable_change(reference: Reference, spp: int, alpha: float = ALPHA) -> float:
    """Compute the least relative change of all light that a check of so many samples finds 99 times of 100."""
    mean, variance = _channel_means(reference)
    both = variance * (1.0 + reference.recipe.spp / spp)
    with np.errstate(divide="ignore", invalid="ignore"):
        change = _detectable_deviations(alpha) * np.sqrt(both) / np.abs(mean)
    return float(np.min(np.where(mean != 0.0, change, np.inf)))


def samples_to_detect(reference: Reference, change: float = TARGET_CHANGE, alpha: float = ALPHA) -> int:
    """Compute the samples per pixel by which a check finds `change`, a fraction of all light, 99 times of 100.

    `MIN_CHECK_SPP` at least, and no more than the reference has, beyond which its own noise is what hides changes.
    """
    reference_spp = reference.recipe.spp
    mean, variance = _channel_means(reference)
    # The reference already has its part of the variance that the difference may have.
    left = (change * mean / _detectable_deviations(alpha)) ** 2 - variance
    with np.errstate(divide="ignore", invalid="ignore"):
        needed = np.where(variance == 0.0, 0.0, np.where(left > 0.0, reference_spp * variance / left, np.inf))
    needed = np.where(mean != 0.0, needed, np.inf)
    return max(math.ceil(min(float(needed.min()), reference_spp)), MIN_CHECK_SPP)
