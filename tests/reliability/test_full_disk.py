"""A real disk that fills while a render writes there; `test_outputs` has files that fail where none can be mounted."""

import pytest

from tests.reliability.full_disk import trials


@pytest.mark.slow
def test_50_disks_that_fill_leave_what_there_was(tmp_path):
    try:
        counts, failures = trials(50, 2, 1, tmp_path)
    except PermissionError as error:
        pytest.skip(f"a small disk cannot be mounted here: {error}")
    assert failures == []
    assert counts["moments"] == counts["resumed"] == 50
    assert counts["exit status 0"] + counts["exit status 1"] == 50
    assert counts["exit status 1"] >= 20
