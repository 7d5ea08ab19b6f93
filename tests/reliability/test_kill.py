"""Renders that are killed and resumed end in the bits of one that nobody has killed; no file is broken at any time."""

from pathlib import Path

import pytest

from tests.reliability.kill import OUTPUTS, Figures, kill


def _assert_equal(figures: Figures, renders: int) -> None:
    assert figures.failures == []
    assert figures.broken == []
    assert (figures.renders, figures.equal) == (renders, renders)
    assert all(figures.reads[name] > 0 for name in OUTPUTS)


def test_killed_and_resumed_a_picture_is_the_same(tmp_path: Path) -> None:
    # Of these some are killed before the first checkpoint, some after, some while they write one.
    figures = kill(4, 2, 11, tmp_path, kinds=["plain"])
    _assert_equal(figures, 4)
    assert sum(figures.kills.values()) >= 2
    assert figures.resumed >= 1


@pytest.mark.slow
def test_200_killed_and_resumed_are_the_same(tmp_path: Path) -> None:
    figures = kill(200, 3, 1, tmp_path)
    _assert_equal(figures, 200)
    assert figures.resumed >= 50
    assert figures.kills["while a file was written"] >= 20
