"""A real disk that fills while a render writes there; `test_outputs` has files that fail where none can be mounted."""

from pathlib import Path

import pytest

from tests.reliability.full_disk import Figures, trials


def _fill(moments: int, folder: Path) -> Figures:
    try:
        return trials(moments, 2, 1, folder)
    except PermissionError as error:
        pytest.skip(f"a small disk cannot be mounted here: {error}")


def _assert_kept(figures: Figures, moments: int) -> None:
    assert figures.failures == []
    assert figures.moments == figures.resumed == moments
    assert set(figures.statuses) <= {0, 1}


@pytest.mark.slow
def test_50_disks_that_fill_leave_what_there_was(tmp_path: Path) -> None:
    figures = _fill(50, tmp_path)
    _assert_kept(figures, 50)
    assert figures.statuses[1] >= 20
