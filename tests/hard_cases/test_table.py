"""The table of hard cases: what it says of what was measured, and that the page has it."""

import math

import pytest

from tests.hard_cases.__main__ import BEGIN, END, PAGE, Cost, Finding, figure, markdown, measured, rows_of, write
from tests.hard_cases.harness import HardCase, Measured, cases


def _case(*rows: Measured) -> HardCase:
    def measure(trials: int) -> list[Measured]:
        """A made-up case.

        More words.
        """
        return list(rows)

    return HardCase(3, "03_made_up", "a book", measure, 1, 1, "03_ground.yaml")


RIGHT = Measured("misses", naive=0.5, ours=0.0, tolerance=0.0)
WRONG = Measured("error", naive=1.0, ours=2e-5, tolerance=1e-5)
TELLS_NOTHING = Measured("error", naive=0.0, ours=0.0, tolerance=0.0)
NOT_A_NUMBER = Measured("error", naive=math.nan, ours=math.nan, tolerance=1.0)


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "0"), (-0.0, "0"), (123456.0, "123,456"), (0.00012345, "0.00012"), (math.inf, "inf"), (math.nan, "NaN")],
)
def test_figures_are_short(value: float, text: str) -> None:
    assert figure(value) == text


@pytest.mark.parametrize(
    ("row", "word"),
    [
        (RIGHT, "passes"),
        (WRONG, "FAILS"),
        (TELLS_NOTHING, "FAILS: the naive way passes"),
        (NOT_A_NUMBER, "FAILS"),
    ],
)
def test_a_row_tells_whether_it_passes(row: Measured, word: str) -> None:
    finding = measured(_case(RIGHT, row), quick=True)
    assert [line[5] for line in rows_of([finding])] == ["passes", word]
    assert finding.passes == (word == "passes")


def test_a_case_that_raises_is_told_and_fails() -> None:
    def measure(trials: int) -> list[Measured]:
        """It breaks."""
        raise ValueError("no such thing")

    finding = measured(_case(RIGHT)._replace(measure=measure), quick=True)
    assert not finding.passes
    assert rows_of([finding])[0][1] == "ValueError: no such thing"


def test_a_case_is_named_once_with_its_cost() -> None:
    finding = Finding(_case(RIGHT, RIGHT), [RIGHT, RIGHT], "", 0.1, Cost(1.25, 1.2, 1.3))
    first, second = rows_of([finding])
    assert (first[0], first[-1]) == ("3. A made-up case", "1.25 (1.20 .. 1.30)")
    assert (second[0], second[-1]) == ("", "")


def test_what_was_measured_takes_its_place_in_the_page(tmp_path) -> None:
    page = tmp_path / "page.md"
    page.write_text(f"before\n{BEGIN}old\n{END}after\n")
    finding = measured(_case(RIGHT), quick=True)
    write(page, markdown([finding], {"cover": Cost(1.1, 1.0, 1.2)}, "a machine"))
    text = page.read_text()
    assert text.startswith(f"before\n{BEGIN}")
    assert text.endswith(f"{END}after\n")
    assert "old" not in text
    assert "| 3. A made-up case | misses | 0.5 | 0 | 0 | passes |" in text
    page.write_text("no place")
    with pytest.raises(ValueError, match="no place for a table"):
        write(page, "text")


def test_the_page_has_every_case() -> None:
    text = PAGE.read_text(encoding="utf-8")
    missing = [case.name for case in cases() if f"| {case.number}. {case.title} |" not in text]
    assert not missing, "run `make hard-cases`"
    assert "FAILS" not in text
