"""Comparison of two images: metrics, the z-test of their noise, and criteria to pass."""

import math
from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.analysis.compare.compared_image import Array, ComparedImage, Source, read
from raytracer.analysis.compare.image_pair import check_sizes, map_row_bands
from raytracer.analysis.compare.metrics import (
    METRICS,
    Domain,
    Sums,
    exposures,
    flip_map,
    mean_of_map,
    require_extra,
    ssim,
    sums,
)
from raytracer.analysis.compare.result import Comparison, NotFinite, verdict_sentence
from raytracer.analysis.compare.z_test import Verdict, z_test
from raytracer.util import srgb
from raytracer.util.errors import InputError, suggest_name

ALPHA = 1e-3
"""Rate at which two renders that differ by their noise only may fail."""

# Ratio of noise to variance below which that is mentioned; of independent samples it scatters by 0.05.
_NOTABLE = 0.9

# Pixels, times exposures, up to which FLIP is measured by default: some seconds on four cores.
_FLIP_UNASKED = 2**22


class PassCriteria(NamedTuple):
    """Criteria that a comparison has to meet.

    above, below : bounds by metric: a value above (below) fails.
    test : True if the z-test has to pass; None: if there are no bounds, and both images know their variances.
    alpha : significance level of the z-test.
    """

    above: Mapping[str, float] = {}
    below: Mapping[str, float] = {}
    test: bool | None = None
    alpha: float = ALPHA


def compare(
    a: Source,
    b: Source,
    *,
    metrics: Iterable[str] | None = None,
    fail_above: Mapping[str, float] | None = None,
    fail_below: Mapping[str, float] | None = None,
    test: bool | None = None,
    alpha: float = ALPHA,
    names: tuple[str, str] = ("A", "B"),
) -> Comparison:
    """Compare an image with a reference.

    Two linear images are compared in linear light, and in what a display shows of them, clipped and sRGB-encoded, by
    PSNR and SSIM.  As soon as one of them is a display image, both are compared as such, in steps of 8 bits.

    Parameters
    ----------
    a, b : image and reference: names of files (.png .jpg .exr .hdr .npy), images that were rendered, or arrays
        (height, width, 3), uint8 for display values, else linear light.
    metrics : names of the metrics to measure.  Default: all that are installed and quick.
    fail_above, fail_below : bounds by metric; a comparison beyond one has failed.
    test : True if the z-test has to pass; default: if there are no bounds, and both images know their variances.
    alpha : rate at which two renders that differ by their noise only may fail the z-test.
    names : of images without one.

    Raises
    ------
    InputError : a file cannot be read, the images differ in size, a metric is not known or cannot be measured here,
        or a test is asked for that takes variances which are not there.
    """
    checks = normalize_criteria(PassCriteria(fail_above or {}, fail_below or {}, test, alpha))
    wanted = normalize_metric_names(metrics)
    return compare_images(read(a, names[0]), read(b, names[1]), wanted, checks)


def normalize_metric_names(names: Iterable[str] | None) -> tuple[str, ...] | None:
    """Normalize the names of metrics to lower case.

    Raises
    ------
    InputError : one is not known.
    """
    if names is None:
        return None
    normalized = tuple(dict.fromkeys(name.strip().lower() for name in names))
    for name in normalized:
        if name not in METRICS:
            raise InputError(f"unknown metric {name!r}: {suggest_name(name, METRICS, 'metrics')}")
    return normalized


def normalize_criteria(checks: PassCriteria) -> PassCriteria:
    """Normalize criteria, with the metrics' names in lower case.

    Raises
    ------
    InputError : a metric is not known, a bound is on its wrong side or no number, or `alpha` is no probability.
    """
    above, below = _normalize_bounds(checks.above, is_below=False), _normalize_bounds(checks.below, is_below=True)
    if not 0.0 < checks.alpha < 1.0:
        raise InputError(f"alpha must lie between 0 and 1, got {checks.alpha:g}")
    return checks._replace(above=above, below=below)


def _normalize_bounds(bounds: Mapping[str, float], *, is_below: bool) -> dict[str, float]:
    normalized = {name.strip().lower(): float(bound) for name, bound in bounds.items()}
    normalize_metric_names(normalized)
    for name, bound in normalized.items():
        metric = METRICS[name]
        if metric.is_better_larger != is_below:
            better, other = ("larger", "below") if metric.is_better_larger else ("smaller", "above")
            wanted = f"{metric.label} is better when it is {better}, so it fails {other} its bound"
            raise InputError(f"{wanted}: --fail-{other} {name}=...")
        if math.isnan(bound):
            raise InputError(f"the bound of {metric.label} must be a number")
    return normalized


def compare_images(
    a: ComparedImage, b: ComparedImage, wanted: tuple[str, ...] | None, checks: PassCriteria
) -> Comparison:
    """Compare two images as `compare` does."""
    try:
        check_sizes(a.values, b.values)
    except InputError as error:
        raise InputError(f"{a.name}, {b.name}: {error}") from None
    height, width, _ = a.values.shape
    is_display = a.is_display or b.is_display
    if is_display:
        a, b = _as_display(a), _as_display(b)
    domain: Domain = "display" if is_display else "linear"

    # Leave out what is not finite, in both.
    first, second, not_finite, count = _zero_non_finite(a.values, b.values)
    measured, domains, unmeasured, seen = _measure(first, second, domain, wanted, checks, count)
    verdict, untested, notes = _run_z_test(a, b, checks)
    noise = None
    if not is_display and a.variance is not None and b.variance is not None:
        noise = float(np.mean(a.variance) + np.mean(b.variance))

    # Compare with the criteria.
    failures = []
    for word, limits in (("above", checks.above), ("below", checks.below)):
        for name, bound in limits.items():
            value = measured[name]
            if math.isnan(value) or (value > bound if word == "above" else value < bound):
                failures.append(f"{METRICS[name].label} is {value:.4g}, {word} {bound:g}")
    has_bounds = bool(checks.above or checks.below)
    is_tested = checks.test or (checks.test is None and not has_bounds and verdict is not None)
    is_asked = has_bounds or bool(is_tested)
    if is_asked and not_finite.first is not None:
        failures.append(f"not finite: {not_finite.sentence()}")
    elif is_tested and verdict is not None and not verdict.passed:
        failures.append(verdict_sentence(verdict))
    return Comparison(
        a.name,
        b.name,
        width,
        height,
        measured,
        domains,
        unmeasured,
        noise,
        verdict,
        checks.alpha,
        untested,
        notes,
        not_finite,
        tuple(failures),
        not failures if is_asked else None,
        is_display,
        seen,
        (a, b),
    )


def _as_display(picture: ComparedImage) -> ComparedImage:
    """Convert an image to display values, in steps of 8 bits as in a file."""
    if picture.is_display:
        return picture._replace(unknown="holds display values")
    values = picture.to_display_bytes() / 255.0
    return picture._replace(values=values, is_display=True, variance=None, unknown="is compared as a display shows it")


def _zero_non_finite(a: Array, b: Array) -> tuple[Array, Array, NotFinite, int]:
    """Set pixels that are not finite in one image to 0 in both, and count the values that are left."""
    if np.isfinite(a).all() and np.isfinite(b).all():
        return a, b, NotFinite(), a.size
    broken_a, broken_b = (np.any(~np.isfinite(image), axis=2) for image in (a, b))
    broken = np.asarray(broken_a | broken_b)
    y, x = divmod(int(np.argmax(broken)), a.shape[1])
    first, second = (np.where(broken[..., None], 0.0, image) for image in (a, b))
    not_finite = NotFinite(int(np.count_nonzero(broken_a)), int(np.count_nonzero(broken_b)), (x, y))
    return first, second, not_finite, 3 * int(np.count_nonzero(~broken))


def _measure(
    a: Array, b: Array, domain: Domain, wanted: tuple[str, ...] | None, checks: PassCriteria, count: int
) -> tuple[dict[str, float], dict[str, Domain], dict[str, str], NDArray[np.float32] | None]:
    """Measure the metrics: values, their domains, reasons for missing ones, and the map of FLIP."""
    must = {*(wanted or ()), *checks.above, *checks.below}
    names = [name for name in METRICS if wanted is None or name in must]
    pairs: dict[Domain, tuple[Array, Array]] = {domain: (a, b)}
    totals: dict[str, Sums] = {}
    values: dict[str, float] = {}
    domains: dict[str, Domain] = {}
    missing: dict[str, str] = {}
    seen: NDArray[np.float32] | None = None
    for name in names:
        metric = METRICS[name]
        own: Domain = "display" if metric.always_display else domain
        if own not in pairs:
            pairs[own] = _encoded(a), _encoded(b)
        first, second = pairs[own]
        if not count:
            values[name] = math.nan
        elif metric.of is not None:
            if own not in totals:
                totals[own] = sums(first, second)
            values[name] = metric.of(totals[own], count)
        else:
            try:
                if name not in must:
                    _refuse_slow(name, second, own)
                if name == "ssim":
                    values[name] = ssim(first, second)
                else:
                    seen = flip_map(first, second, own)
                    values[name] = mean_of_map(seen)
            except InputError as error:
                if name in must:
                    raise
                missing[name] = str(error)
                continue
        domains[name] = own
    return values, domains, missing, seen


def _encoded(linear: Array) -> Array:
    """Encode linear light as display values in 0..1."""
    encoded = np.empty_like(linear)

    def encode(top: int, bottom: int) -> None:
        encoded[top:bottom] = srgb.encode(linear[top:bottom])

    map_row_bands(encode, len(linear))
    return encoded


def _refuse_slow(name: str, reference: Array, domain: Domain) -> None:
    """Refuse a metric that takes long."""
    require_extra(name)
    height, width, _ = reference.shape
    if name == "flip":
        times = exposures(reference) if domain == "linear" else 1
        if times * height * width > _FLIP_UNASKED:
            in_exposures = f" in {times} exposures" if times > 1 else ""
            raise InputError(f"takes long for {width} x {height} pixels{in_exposures}, so only if it is asked for")


def _run_z_test(
    a: ComparedImage, b: ComparedImage, checks: PassCriteria
) -> tuple[Verdict | None, str, tuple[str, ...]]:
    """Run the z-test: the verdict, or why there is none, and notes on it."""
    if checks.test is False:
        return None, "", ()
    for picture in (a, b):
        if picture.variance is None:
            why = f"{picture.name} {picture.unknown}"
            if checks.test:
                raise InputError(f"the z-test takes the variances of both images: {why}")
            # Display images are not expected to have a variance.
            return None, "" if picture.is_display else why, ()
    # The same number of samples from the same sampler have like noise.
    alike = bool(a.sampler) and a.spp is not None and (a.sampler, a.spp) == (b.sampler, b.spp)
    gain, notes = _gain_between(a, b), list[str]()
    values, variance = a.values, a.variance
    if gain is not None and variance is not None:
        values, variance = gain * values, gain**2 * variance
        factors = ", ".join(dict.fromkeys(f"{factor:.6g}" for factor in gain.tolist()))
        notes.append(
            f"A is judged at the gains that `auto` exposure or white balance measured on B: its light times {factors}"
        )
    verdict = z_test(values, variance, b.values, b.variance, alpha=checks.alpha, alike=alike)
    return verdict, "", (*notes, *_notes(a, b, verdict, alike=alike))


def _gain_between(a: ComparedImage, b: ComparedImage) -> Array | None:
    """Compute the factors from the gains of a to those of b (3,), if they were measured on the pictures; else None.

    The noise of measured gains is common to all pixels, and in no pixel's variance.
    """
    gain = np.ones(3)
    for kind, own in a.measured_gains.items():
        gain = gain * b.measured_gains.get(kind, own) / own
    return None if (gain == 1.0).all() else gain


def _notes(a: ComparedImage, b: ComparedImage, verdict: Verdict, *, alike: bool) -> Iterator[str]:
    """Describe the smallest differences that would have been found, and if variances are larger than the noise."""
    if not verdict.passed:
        return
    if limits := verdict.limits.sentence():
        yield limits
    samplers = sorted({picture.sampler for picture in (a, b)} - {"", "independent"})
    if not samplers or not verdict.squares_ratio < _NOTABLE:
        return
    known = f"the noise is {verdict.squares_ratio:.2f} of what the variances of {' and '.join(samplers)} samples tell"
    if alike:
        yield (
            f"{known}: changes of scattered single pixels may hide in that, and are found with "
            "`render.sampler: independent`; brightness, shifts, blur and what neighbours share are judged by the "
            "noise itself"
        )
    else:
        yield f"{known}; with the same sampler and `--spp` in both, less is found by the noise itself"
