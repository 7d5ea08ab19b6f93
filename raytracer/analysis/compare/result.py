"""Result of a comparison of two images: metrics, the verdict of the z-test, and pass or fail."""

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.analysis.compare.compared_image import ComparedImage
from raytracer.analysis.compare.metrics import METRICS, Domain
from raytracer.analysis.compare.patterns import PATTERNS
from raytracer.analysis.compare.z_test import Verdict
from raytracer.report import fragment
from raytracer.report.page import to_plain
from raytracer.report.wording import plural
from raytracer.util.errors import InputError

_DOMAINS: dict[Domain, str] = {"linear": "linear light", "display": "display values"}


class NotFinite(NamedTuple):
    """Numbers of pixels of each image that are not finite, and the first of them (x, y), if any."""

    a: int = 0
    b: int = 0
    first: tuple[int, int] | None = None

    def sentence(self) -> str:
        """Say how many there are, and where the first is."""
        sides = ((self.a, "A"), (self.b, "B"))
        counts = [f"{n:,} {plural(n, 'pixel')} of {which}" for n, which in sides if n]
        x, y = self.first or (0, 0)
        return f"{' and '.join(counts)}, the first at x = {x}, y = {y}"


@dataclass(frozen=True, repr=False)
class Comparison:
    """Result of `compare`.

    Attributes
    ----------
    a, b : names of the images; `b` is the reference.
    width, height : pixels.
    metrics : values by name: mae, mse, rmse, relmse, mrse, psnr (dB), ssim, flip.
    domains : domain of each: `linear` light, or `display` values, sRGB-encoded in 0..1.
    unmeasured : reasons by name of metrics that are missing.
    noise_mse : mean squared error by the noise of both alone, or None if not known.
    verdict : of the z-test, or None for the reason that `untested` gives.
    alpha : significance level of the z-test.
    notes : sentences that belong to the verdict.
    not_finite : pixels that are not finite; metrics are of the others.
    failures : criteria that are not met, in sentences.
    passed : True without failures; None without criteria.
    is_display : True if display values are compared, False for linear light.
    flip : FLIP of each pixel, (height, width), or None where it was not measured or was released.
    pictures : the two images, or None where they were released.
    """

    a: str
    b: str
    width: int
    height: int
    metrics: dict[str, float]
    domains: dict[str, Domain]
    unmeasured: dict[str, str]
    noise_mse: float | None
    verdict: Verdict | None
    alpha: float
    untested: str
    notes: tuple[str, ...]
    not_finite: NotFinite
    failures: tuple[str, ...]
    passed: bool | None
    is_display: bool
    flip: NDArray[np.float32] | None
    pictures: tuple[ComparedImage, ComparedImage] | None

    def images(self) -> tuple[ComparedImage, ComparedImage]:
        """Return the two images.

        Raises
        ------
        InputError : they were released.
        """
        if self.pictures is None:
            raise InputError("the pixels of this comparison were released")
        return self.pictures

    def without_pixels(self) -> "Comparison":
        """Copy the comparison without the data that take memory."""
        verdict = self.verdict and replace(self.verdict, pixel_z=np.empty((0, 0, 3)))
        return replace(self, flip=None, pictures=None, verdict=verdict)

    def json(self) -> dict[str, Any]:
        """Return everything but pixels, as JSON can hold it."""
        verdict = self.verdict
        values: dict[str, Any] = to_plain(
            {
                "a": self.a,
                "b": self.b,
                "width": self.width,
                "height": self.height,
                "metrics": {
                    name: {"value": value, "domain": self.domains[name]} for name, value in self.metrics.items()
                },
                "unmeasured": self.unmeasured,
                "noise_mse": self.noise_mse,
                "z_test": verdict
                and {
                    "passed": verdict.passed,
                    "reason": verdict.reason,
                    "mean_z": verdict.mean_z,
                    "pattern_z": dict(zip(PATTERNS, verdict.pattern_z, strict=True)),
                    "squares_z": verdict.squares_z,
                    "squares_ratio": verdict.squares_ratio,
                    "p": verdict.p_values(),
                    "findings": verdict.findings,
                    "would_have_found": {name: float(value) for name, value in verdict.limits._asdict().items()},
                },
                "untested": self.untested or None,
                "notes": self.notes,
                "not_finite": self.not_finite._asdict(),
                "passed": self.passed,
                "failures": self.failures,
            }
        )
        return values

    def text(self) -> str:
        """Write a report as text."""
        domain = _DOMAINS["display" if self.is_display else "linear"]
        lines = [f"{self.a} against {self.b}: {self.width} x {self.height} pixels, {domain}"]
        for name, value in self.metrics.items():
            unit = " dB" if name == "psnr" else ""
            remark = "  of display values" if self.domains[name] == "display" and domain != "display values" else ""
            if name == "mse" and self.noise_mse is not None:
                remark = f"  (noise alone makes {self.noise_mse:.4g})"
            lines.append(f"  {METRICS[name].label:<7}{value:.6g}{unit}{remark}")
        lines += [f"  {METRICS[name].label:<7}-  {reason}" for name, reason in self.unmeasured.items()]
        if self.not_finite.first is not None:
            lines.append(f"not finite: {self.not_finite.sentence()}")
        if verdict := self.verdict_text():
            lines.append(verdict)
        lines += [f"  {note}" for note in self.notes]
        if self.passed is not None:
            lines.append("PASS" if self.passed else f"FAIL: {'; '.join(self.failures)}")
        lines += [f"  also: {finding}" for finding in self.other_findings()]
        return "\n".join(lines) + "\n"

    def _repr_html_(self) -> str:
        """Write the comparison for a notebook: the images, the metrics, and the verdict."""
        rows = []
        for name, value in self.metrics.items():
            unit = " dB" if name == "psnr" else ""
            rows.append((METRICS[name].label, f"{value:.6g}{unit}", f"of {_DOMAINS[self.domains[name]]}"))
        rows += [(METRICS[name].label, "-", reason) for name, reason in self.unmeasured.items()]
        domain = _DOMAINS["display" if self.is_display else "linear"]
        outcome = {True: "PASS", False: f"FAIL: {'; '.join(self.failures)}", None: ""}[self.passed]
        finite = "" if self.not_finite.first is None else f"not finite: {self.not_finite.sentence()}"
        sentences = (outcome, self.verdict_text(), finite, *self.notes, *self.other_findings())
        images = [] if self.pictures is None else [image.to_display_bytes() for image in self.pictures]
        shown = [fragment.thumbnail(pixels, label) for pixels, label in zip(images, self.labels, strict=False)]
        return fragment.join(
            [
                fragment.heading(f"{self.a} against {self.b}", f"{self.width} x {self.height} pixels, {domain}"),
                *([fragment.table(self.labels, [shown], left=2)] if shown else []),
                fragment.table(("metric", "value", ""), rows),
                *(fragment.heading("", sentence) for sentence in sentences if sentence),
            ]
        )

    @property
    def labels(self) -> tuple[str, str]:
        """Labels of the images: which of the two it is, and its name."""
        return _label("A", self.a), _label("B", self.b)

    def verdict_text(self) -> str:
        """Write the result of the z-test, or why there was none, unless it is among the failures."""
        if self.verdict is None:
            return f"no z-test: {self.untested}" if self.untested else ""
        sentence = verdict_sentence(self.verdict)
        return "" if sentence in self.failures else sentence

    def other_findings(self) -> tuple[str, ...]:
        """List the findings of the z-test besides the first."""
        return () if self.verdict is None else self.verdict.findings[1:]

    def __repr__(self) -> str:
        return self.text().rstrip()


def _label(side: str, name: str) -> str:
    return side if name == side else f"{side}  {name}"


def verdict_sentence(verdict: Verdict) -> str:
    """Write if the z-test passed, and why not."""
    return f"z-test {'passed' if verdict.passed else 'failed'}: {verdict.reason}"
