"""What a hard case is: something measured twice, by what a naive program would do and by what this one does."""

import importlib
import pkgutil
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple, TypeAlias

import tests.hard_cases

SCENES = Path(__file__).parent / "scenes"


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


Measure: TypeAlias = Callable[[int], Sequence[Measured]]


class HardCase(NamedTuple):
    """A case: its number, name, source, and what it measures in so many trials, quickly and thoroughly.

    scene : a file in `scenes/` that shows its geometry, or None.
    """

    number: int
    name: str
    source: str
    measure: Measure
    quick: int
    thorough: int
    scene: str | None

    @property
    def title(self) -> str:
        """The first line of its docstring."""
        return (self.measure.__doc__ or "").strip().splitlines()[0].rstrip(".")


_CASES: dict[str, HardCase] = {}


def hard_case(
    number: int, source: str, *, quick: int = 1, thorough: int | None = None, scene: str | None = None
) -> Callable[[Measure], Measure]:
    """Declare a function of a number of trials, which returns what it measured, as a hard case.

    Parameters
    ----------
    number : the case's; several functions may share one.
    source : where the case is known from: a paper, a book's section, or an issue of another program.
    quick, thorough : trials in `make test`, and in `make test-slow` and `make hard-cases`.
    """

    def declare(measure: Measure) -> Measure:
        name = f"{number:02}_{measure.__name__}"
        if name in _CASES or not measure.__doc__:
            raise ValueError(f"{name} is declared twice, or does not say what it is")
        _CASES[name] = HardCase(number, name, source, measure, quick, thorough or quick, scene)
        return measure

    return declare


def cases() -> list[HardCase]:
    """All cases, by number and name."""
    for module in pkgutil.iter_modules(tests.hard_cases.__path__):
        if not module.name.startswith(("test_", "__")):
            importlib.import_module(f"tests.hard_cases.{module.name}")
    return [_CASES[name] for name in sorted(_CASES)]
