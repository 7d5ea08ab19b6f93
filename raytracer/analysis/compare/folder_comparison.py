"""Comparison of two folders: of the images that have the same name in both."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from raytracer.analysis.compare.compared_image import read
from raytracer.analysis.compare.image_comparison import PassCriteria, compare_images, normalize_criteria
from raytracer.analysis.compare.metrics import METRICS
from raytracer.analysis.compare.result import Comparison
from raytracer.film.formats.registry import image_suffixes
from raytracer.util.errors import InputError

# Columns of a line for each pair, if more were measured: the most telling metrics.
_COLUMNS = ("relmse", "psnr", "ssim", "flip")


class FolderPair(NamedTuple):
    """A name that is in both folders.

    comparison : of the two images; None for the reason that `error` gives.
    """

    name: str
    comparison: Comparison | None
    error: str = ""

    @property
    def passed(self) -> bool | None:
        """True if it passed; None without criteria."""
        return self.comparison.passed if self.comparison else False


class FolderComparison(NamedTuple):
    """Result of `compare_folders`.

    a, b : the folders.
    pairs : by name.
    only_a, only_b : names that only one of the folders has.
    """

    a: str
    b: str
    pairs: tuple[FolderPair, ...]
    only_a: tuple[str, ...]
    only_b: tuple[str, ...]

    @property
    def failures(self) -> tuple[str, ...]:
        """Failures, in sentences."""
        reasons = [
            (pair.name, "; ".join(pair.comparison.failures) if pair.comparison else pair.error) for pair in self.pairs
        ]
        reasons += [(name, f"only in {self.a}") for name in self.only_a]
        reasons += [(name, f"only in {self.b}") for name in self.only_b]
        return tuple(f"{name}: {reason}" for name, reason in reasons if reason)

    @property
    def passed(self) -> bool | None:
        """True if there are no failures; None without criteria, if nothing is missing or broken."""
        if self.failures:
            return False
        return True if any(pair.passed is not None for pair in self.pairs) else None

    def json(self) -> dict[str, Any]:
        """Return everything but pixels, as JSON can hold it."""
        return {
            "a": self.a,
            "b": self.b,
            "pairs": [
                {"name": pair.name, **pair.comparison.json()}
                if pair.comparison
                else {"name": pair.name, "passed": False, "failures": [pair.error]}
                for pair in self.pairs
            ],
            "only_in_a": list(self.only_a),
            "only_in_b": list(self.only_b),
            "passed": self.passed,
        }

    def text(self) -> str:
        """Write a line for each pair, and the failures."""
        width = max((len(pair.name) for pair in self.pairs), default=4)
        columns = [name for name in METRICS if any(_value(pair, name) for pair in self.pairs)]
        if len(columns) > len(_COLUMNS):
            columns = [name for name in columns if name in _COLUMNS]
        header = [f"{METRICS[name].label:>10}" for name in columns]
        lines = [f"{self.a} against {self.b}", " ".join(["", f"{'':<{width}}", *header]).rstrip()]
        for pair in self.pairs:
            values = [f"{_value(pair, name) or '-':>10}" for name in columns]
            word = {True: "pass", False: "FAIL", None: ""}[pair.passed]
            lines.append(" ".join(["", f"{pair.name:<{width}}", *values, "", word]).rstrip())
        lines += self.failures
        if self.passed is not None:
            # Each name has one sentence at most.
            names = len(self.pairs) + len(self.only_a) + len(self.only_b)
            lines.append("PASS" if self.passed else f"FAIL: {len(self.failures)} of {names} images")
        return "\n".join(lines) + "\n"


def _value(pair: FolderPair, name: str) -> str:
    value = pair.comparison.metrics.get(name) if pair.comparison else None
    return "" if value is None else f"{value:.4g}"


def compare_folders(
    a: str | Path,
    b: str | Path,
    *,
    metrics: tuple[str, ...] | None = None,
    checks: PassCriteria = PassCriteria(),  # noqa: B008
    done: Callable[[FolderPair, int, int], object] = lambda pair, number, count: None,
) -> FolderComparison:
    """Compare images that have the same path within two folders; other files are ignored.

    A pair that cannot be compared has failed, and so has an image that only one of the folders has.

    Parameters
    ----------
    metrics, checks : as for `compare`.
    done : called with each pair after it was compared, its number from 1, and the number of pairs; pixels are released
        when it returns.

    Raises
    ------
    InputError : one of the two is not a folder or cannot be read, or they have no image in common.
    """
    checks = normalize_criteria(checks)
    first, second = _images(Path(a)), _images(Path(b))
    common = sorted(first & second)
    if not common:
        raise InputError(f"{a}, {b}: no image has the same name in both folders")
    pairs = []
    for number, name in enumerate(common, start=1):
        try:
            pair = FolderPair(
                name, compare_images(read(Path(a) / name, "A"), read(Path(b) / name, "B"), metrics, checks)
            )
        except InputError as error:
            pair = FolderPair(name, None, str(error))
        done(pair, number, len(common))
        if pair.comparison is not None:
            pair = pair._replace(comparison=pair.comparison.without_pixels())
        pairs.append(pair)
    return FolderComparison(str(a), str(b), tuple(pairs), tuple(sorted(first - second)), tuple(sorted(second - first)))


def _images(folder: Path) -> set[str]:
    """List the paths of all images in a folder and its subfolders, relative to it, with `/`.

    Hidden ones, such as backups of editors and files of macOS, are left out.
    """
    if not folder.is_dir():
        raise InputError(f"{folder}: {'is not a folder' if folder.exists() else 'no such folder'}")
    try:
        files = [path for path in folder.rglob("*") if path.suffix.lower() in image_suffixes() and path.is_file()]
    except OSError as error:
        raise InputError(f"{error.filename or folder}: cannot be read: {error.strerror}") from error
    inside = [path.relative_to(folder) for path in files]
    return {path.as_posix() for path in inside if not any(part.startswith(".") for part in path.parts)}
