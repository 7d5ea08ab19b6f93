"""Two folders of images compared: those that have the same name in both."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

from raytracer.comparison.metrics import METRICS
from raytracer.comparison.pairs import Checks, checked, judge
from raytracer.comparison.reading import read
from raytracer.comparison.result import Comparison
from raytracer.errors import InputError
from raytracer.film.output import SUFFIXES

# Columns of a line for each pair, where more was measured than there is room for: what says most.
_COLUMNS = ("relmse", "psnr", "ssim", "flip")


class Pair(NamedTuple):
    """One name that is in both folders: the comparison, or why there is none."""

    name: str
    comparison: Comparison | None
    error: str = ""

    @property
    def passed(self) -> bool | None:
        """Whether it passed; None if nothing was asked for."""
        return self.comparison.passed if self.comparison else False


class Folders(NamedTuple):
    """What `compare_folders` found: pairs by name, and the names that only one of the folders has."""

    a: str
    b: str
    pairs: tuple[Pair, ...]
    only_a: tuple[str, ...]
    only_b: tuple[str, ...]

    @property
    def failures(self) -> tuple[str, ...]:
        """What is not as it should be, in sentences."""
        found = []
        for pair in self.pairs:
            if pair.comparison is None:
                found.append(f"{pair.name}: {pair.error}")
            elif pair.comparison.failures:
                found.append(f"{pair.name}: {'; '.join(pair.comparison.failures)}")
        for names, folder in ((self.only_a, self.a), (self.only_b, self.b)):
            found += [f"{name}: only in {folder}" for name in names]
        return tuple(found)

    @property
    def passed(self) -> bool | None:
        """Whether there are no failures; None if nothing was asked for, and nothing is missing or broken."""
        if self.failures:
            return False
        return True if any(pair.passed is not None for pair in self.pairs) else None

    def json(self) -> dict[str, Any]:
        """Everything but pixels, as JSON can hold it."""
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
        """A line for each pair, and what is not as it should be."""
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


def _value(pair: Pair, name: str) -> str:
    value = pair.comparison.metrics.get(name) if pair.comparison else None
    return "" if value is None else f"{value:.4g}"


def compare_folders(
    a: str | Path,
    b: str | Path,
    *,
    metrics: tuple[str, ...] | None = None,
    checks: Checks = Checks(),  # noqa: B008
    done: Callable[[Pair, int, int], object] = lambda pair, number, count: None,
) -> Folders:
    """Compare images that have the same path within two folders; what is no image is left alone.

    A pair that cannot be compared has failed, and so has an image that only one of the folders has.

    Parameters
    ----------
    metrics, checks : as for `compare`.
    done : is called with each pair after it was compared, its number from 1, and how many there are; pixels are let go
        of when it returns.

    Raises
    ------
    InputError : one of the two is not a folder or cannot be read, or they have no image in common.
    """
    checks = checked(checks)
    first, second = _images(Path(a)), _images(Path(b))
    common = sorted(first & second)
    if not common:
        raise InputError(f"{a}, {b}: no image has the same name in both folders")
    pairs = []
    for number, name in enumerate(common, start=1):
        try:
            found = judge(read(Path(a) / name, "A"), read(Path(b) / name, "B"), metrics, checks)
            pair = Pair(name, found)
        except InputError as error:
            pair = Pair(name, None, str(error))
        done(pair, number, len(common))
        if pair.comparison is not None:
            pair = pair._replace(comparison=pair.comparison.without_pixels())
        pairs.append(pair)
    return Folders(str(a), str(b), tuple(pairs), tuple(sorted(first - second)), tuple(sorted(second - first)))


def _images(folder: Path) -> set[str]:
    """Paths of all images in a folder and those within, relative to it, with `/`."""
    if not folder.is_dir():
        raise InputError(f"{folder}: {'is not a folder' if folder.exists() else 'no such folder'}")
    try:
        return {path.as_posix() for path in _files(folder)}
    except OSError as error:
        raise InputError(f"{error.filename or folder}: cannot be read: {error.strerror}") from error


def _files(folder: Path) -> Iterator[Path]:
    """Images by their paths within, but for those that are hidden: what an editor keeps of earlier ones, or a Mac."""
    for path in folder.rglob("*"):
        inside = path.relative_to(folder)
        is_hidden = any(part.startswith(".") for part in inside.parts)
        if not is_hidden and path.suffix.lower() in SUFFIXES and path.is_file():
            yield inside
