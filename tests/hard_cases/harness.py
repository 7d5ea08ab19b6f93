"""What a hard case is: something measured twice, by what a naive program would do and by what this one does."""

import importlib
import pkgutil
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import tests.hard_cases

SCENES = Path(__file__).parent / "scenes"

ULP32 = 2.0**-23
ROUNDING = 2.0**-53
"""By how much of a number rounding to float64 changes it, at most."""


class Measured(NamedTuple):
    """An error as measured: what it is, with its unit; of the naive way, and of ours; and the most that ours may be.

    tolerance : derived, not found: 0, an error bound, or a multiple of the standard deviation of what is measured.
    """

    what: str
    naive: float
    ours: float
    tolerance: float

    @property
    def passes(self) -> bool:
        """Tell if our error is within the tolerance; NaN is not."""
        return self.ours <= self.tolerance

    @property
    def tells(self) -> bool:
        """Tell if the naive way fails, so that the case can tell right from wrong; NaN fails."""
        return not self.naive <= self.tolerance


def _merged(a: Any, b: Any) -> int | float:
    """Merge errors: integers and truth values are counts, which add up; of numbers the largest magnitude counts."""
    a, b = np.asarray(a), np.asarray(b)
    if a.dtype.kind in "biu" and b.dtype.kind in "biu":
        return int(a.sum()) + int(b.sum())
    return float(np.maximum(np.abs(a).max(), np.abs(b).max()))


class HardCase(NamedTuple):
    """A case: its number, name and source, what yields its errors, and trials, quick and thorough.

    scene : a file in `scenes/` that shows its geometry, or None.
    """

    number: int
    name: str
    source: str
    errors: Callable[[int], Iterable[tuple[Any, ...]]]
    quick: int
    thorough: int
    scene: str | None

    @property
    def title(self) -> str:
        """The first line of its docstring."""
        return (self.errors.__doc__ or "").strip().splitlines()[0].rstrip(".")

    def measure(self, trials: int) -> list[Measured]:
        """Measure the case in so many trials; errors of one name become one."""
        found: dict[str, Measured] = {}
        # What is naive overflows, and divides by zero.
        with np.errstate(all="ignore"):
            for what, naive, ours, *tolerance in self.errors(trials):
                _, *before, most = found.get(what, (what, 0, 0, 0.0))
                both = (_merged(*pair) for pair in zip(before, (naive, ours), strict=True))
                found[what] = Measured(what, *both, max(most, *map(float, tolerance), 0.0))
        return list(found.values())


_CASES: dict[str, HardCase] = {}


def hard_case(number: int, source: str, scene: str | None = None, quick: int = 1, thorough: int | None = None) -> Any:
    """Declare a generator, of a number of trials, of errors as a hard case.

    It yields `what, naive, ours, tolerance`, as of `Measured`; the errors are numbers or arrays of them, or truth
    values, of which the true ones are counted; the tolerance is 0 if there is none.

    Parameters
    ----------
    number : the case's; several functions may share one.
    source : where the case is known from: a paper, a book's section, or an issue of another program.
    scene : without its number and suffix.
    quick, thorough : trials in `make test`, and in `make test-slow` and `make hard-cases`.
    """

    def declare(errors: Any) -> Any:
        name = f"{number:02}_{errors.__name__}"
        if name in _CASES or not errors.__doc__:
            raise ValueError(f"{name} is declared twice, or does not say what it is")
        shown = scene and f"{number:02}_{scene}.yaml"
        _CASES[name] = HardCase(number, name, source, errors, quick, thorough or quick, shown)
        return errors

    return declare


def cases() -> list[HardCase]:
    """All cases, by number and name."""
    for module in pkgutil.iter_modules(tests.hard_cases.__path__):
        if not module.name.startswith(("test_", "__")):
            importlib.import_module(f"tests.hard_cases.{module.name}")
    return [_CASES[name] for name in sorted(_CASES)]
