"""Whether scenes still look like their references: rendered again with other random numbers, judged by the noise."""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from raytracer.comparison import TESTS, Verdict, z_test
from raytracer.errors import InputError, suggestion
from raytracer.film.image import Image
from raytracer.noise.wording import percent
from raytracer.reach import AllowFiles
from raytracer.regression.inputs import changed, digests
from raytracer.regression.making import FEWEST_SPP, Source, gain_ratio, known_variance, measured_gains, source_of
from raytracer.regression.references import SUFFIX, Reference, load_reference
from raytracer.rendering import Progress, render

if TYPE_CHECKING:
    from raytracer.stock import Stock

ALPHA = 1e-3
"""How often a scene that has not changed may fail."""

LEAST_SPP = 256
"""Samples a pixel of a check, at least: single tiles and pixels take some, whatever the mean of the picture does."""

CHANGE = 0.01
"""The part of all light that a check is to find missing."""

TILE = 8
"""Width and height of the tiles whose means are judged (px)."""

_POWER = 0.99

# The test of the means looks at three channels.
_CHANNELS = 3


_SAID = {"passed": "passed", "failed": "FAILED", "error": "cannot be checked", "skipped": "left out"}


@dataclass(frozen=True)
class Checked:
    """What became of a reference.

    Attributes
    ----------
    name : of the reference: its file without the suffix.
    path : its file.
    passed : whether the scene looks as it did.
    reason : one sentence.
    error : whether it could not be judged, for a reason that is the input's: a file that is missing or broken.
    skipped : whether there was nothing to be judged by: only the test that builds a scene can render it.
    scene : the scene's file, if known.
    spp, seed : that it was rendered with; 0 if it was not.
    alpha : how often a scene that has not changed may fail.
    seconds : that this took.
    finds : the least change of all light that would have been found 99 times of 100, as a fraction; inf if not known.
    changes : names of what the scene is made of that is not as it was when the reference was rendered.
    reference, image, verdict : None if it did not come to that; the image is exposed as the reference is.
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
    finds: float = math.inf
    changes: tuple[str, ...] = ()
    reference: Reference | None = None
    image: Image | None = None
    verdict: Verdict | None = None

    @property
    def outcome(self) -> str:
        """`passed`, `failed`, `error` or `skipped`."""
        return "skipped" if self.skipped else "error" if self.error else "passed" if self.passed else "failed"

    def sentence(self) -> str:
        """What became of it, on one line."""
        text = f"{self.name}: {_SAID[self.outcome]}: {self.reason}"
        if self.changes and not self.passed:
            has = "has" if len(self.changes) == 1 else "have"
            text += f"; {', '.join(self.changes)} {has} changed since the reference was rendered"
        if self.outcome == "passed":
            text += f" ({self.spp} spp, which find {percent(self.finds)} more or less light"
            more = "" if self.verdict is None else self.verdict.limits.details()
            text += f", and {more})" if more else ")"
        return text

    def json(self) -> dict[str, Any]:
        """What `rt check --json` tells of it."""
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
            "finds": self.finds if math.isfinite(self.finds) else None,
            "p": None
            if verdict is None
            else {
                "means": verdict.mean_p,
                "tiles": verdict.tile_p,
                "pixels": verdict.pixel_p,
                "exceeding": verdict.exceeding_p,
                "patterns": verdict.pattern_p,
                "pattern_tiles": verdict.pattern_tile_p,
                "neighbours": verdict.neighbour_p,
                "squares": verdict.squares_p,
            },
            "findings": [] if verdict is None else list(verdict.findings),
            "would_have_found": None
            if verdict is None
            else {
                name: float(value) if math.isfinite(value) else None for name, value in verdict.limits._asdict().items()
            },
        }


def references_in(folder: str | Path, names: Sequence[str] = ()) -> list[Path]:
    """The references in a folder, or those of these names, in the order of their names.

    Raises
    ------
    InputError : there is no such folder, or none of that name, or none at all.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(f"{folder}: {'is no folder' if folder.exists() else 'no such folder'}")
    found = {path.stem: path for path in sorted(folder.glob(f"*{SUFFIX}"))}
    for name in names:
        if name not in found:
            raise InputError(f"{folder} has no reference {name!r}: {suggestion(name, found, 'references')}")
    if not found:
        raise InputError(f"{folder} has no references: rt reference SCENE -o {folder} renders one")
    return [path for name, path in found.items() if not names or name in names]


def check(
    path: str | Path,
    *,
    found: Source | None = None,
    spp: int | None = None,
    seed: int | None = None,
    alpha: float = ALPHA,
    threads: int | None = None,
    stock: "Stock | None" = None,
    progress: Callable[[Progress], None] | None = None,
    allow_files: AllowFiles = (),
) -> Checked:
    """Render the scene of a reference again, with another seed, and judge the two.

    What is wrong with the reference or its scene is told in what is returned.

    Parameters
    ----------
    path : of the reference.
    found : the scene; that which the reference names if None.
    spp : samples a pixel; as many as it takes to find 1 % of all light missing if None, but 256 at least and no more
        than the reference has.
    seed : of all random numbers; the one after the reference's if None.
    alpha : how often a scene that has not changed may fail.
    threads, stock, progress : see `rendering.render`.
    allow_files : see `making.source_of`.

    Raises
    ------
    InputError : `seed` is the reference's, or `spp` too small to tell anything.
    KeyboardInterrupt : the user has ended it.
    """
    if spp is not None and spp < FEWEST_SPP:
        raise InputError(f"a check takes at least {FEWEST_SPP} samples per pixel, to know its own noise; got {spp}")
    path = Path(path)
    begin = time.perf_counter()
    result = Checked(path.stem, path, passed=False, reason="", alpha=alpha)
    try:
        reference = load_reference(path)
        result = replace(result, reference=reference, scene=reference.recipe.scene)
        if found is None and reference.recipe.scene is None:
            return replace(result, passed=True, skipped=True, reason="its scene is built by a test, which checks it")
        found = source_of(reference.recipe, path.parent, allow_files) if found is None else found
        result = replace(result, changes=changed(reference.recipe.inputs, digests(found.spec)))
    except InputError as error:
        return replace(result, error=True, reason=str(error))
    height, width, _ = reference.mean.shape
    size = found.spec.film
    if (size.width, size.height) != (width, height):
        reason = f"the scene's picture has {size.width} x {size.height} pixels, and the reference {width} x {height}"
        return replace(result, error=True, reason=reason)

    # Other random numbers than the reference's: with the same ones no noise would be left to judge by.
    seed = (reference.recipe.seed + 1) % 2**32 if seed is None else seed
    if seed == reference.recipe.seed:
        raise InputError(f"{path.stem} was rendered with the seed {seed} itself; a check takes another one")
    spp = samples_to_find(reference, CHANGE, alpha) if spp is None else spp
    result = replace(result, spp=spp, seed=seed, finds=finds(reference, spp, alpha))
    try:
        rendered = render(found.spec, spp=spp, seed=seed, threads=threads, stock=stock, progress=progress)
        if rendered.interrupted:
            raise KeyboardInterrupt
        ratio = gain_ratio(reference.recipe.gains, measured_gains(found.spec, rendered.image))
        variance = ratio**2 * known_variance(rendered.image)
        image = replace(rendered.image, radiance=ratio * rendered.image.radiance, variance=variance)
    except InputError as error:
        return replace(result, error=True, reason=str(error), seconds=time.perf_counter() - begin)

    samples = reference.recipe.spp / spp
    verdict = z_test(image.radiance, variance, reference.mean, reference.variance, TILE, alpha, samples)
    passed, reason = verdict.passed, verdict.reason
    if passed and rendered.stats.nan_samples and not reference.recipe.dropped:
        dropped = rendered.stats.nan_samples
        passed = False
        reason = f"{dropped} sample{' is' if dropped == 1 else 's are'} not finite, as none of the reference is"
    seconds = time.perf_counter() - begin
    return replace(result, passed=passed, reason=reason, seconds=seconds, image=image, verdict=verdict)


# ---- what a check can find


def _of_means(reference: Reference) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Means of the channels (3,), and their variances (3,)."""
    pixels = reference.mean.shape[0] * reference.mean.shape[1]
    return reference.mean.mean(axis=(0, 1)), reference.variance.sum(axis=(0, 1)) / pixels**2


def _deviations(alpha: float) -> float:
    """How many standard deviations the mean of a channel has to be off to be found 99 times of 100."""
    from scipy.special import ndtri

    least = -math.expm1(math.log1p(-alpha / TESTS) / _CHANNELS)
    return float(-ndtri(0.5 * least) + ndtri(_POWER))


def finds(reference: Reference, spp: int, alpha: float = ALPHA) -> float:
    """The least change of all light, as a fraction of it, that a check of so many samples finds 99 times of 100."""
    mean, variance = _of_means(reference)
    both = variance * (1.0 + reference.recipe.spp / spp)
    with np.errstate(divide="ignore", invalid="ignore"):
        change = _deviations(alpha) * np.sqrt(both) / np.abs(mean)
    return float(np.min(np.where(mean != 0.0, change, np.inf)))


def samples_to_find(reference: Reference, change: float = CHANGE, alpha: float = ALPHA) -> int:
    """Samples a pixel by which a check finds `change`, a fraction of all light, 99 times of 100.

    `LEAST_SPP` at least, and no more than the reference has, beyond which its own noise is what hides changes.
    """
    kept = reference.recipe.spp
    mean, variance = _of_means(reference)
    # Of the variance of the difference that may be, the reference has its part already.
    left = (change * mean / _deviations(alpha)) ** 2 - variance
    with np.errstate(divide="ignore", invalid="ignore"):
        needed = np.where(variance == 0.0, 0.0, np.where(left > 0.0, kept * variance / left, np.inf))
    needed = np.where(mean != 0.0, needed, np.inf)
    return int(min(max(math.ceil(min(float(needed.min()), kept)), LEAST_SPP), max(kept, LEAST_SPP)))
