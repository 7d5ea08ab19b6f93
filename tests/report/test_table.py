"""Tables as plain text."""

from raytracer.report.table import align_columns


def test_columns_have_one_width():
    assert align_columns([["name", "m"], ["a", "1.25"]]) == ["name     m", "a     1.25"]
    assert align_columns([["name", "m"], ["a", "1.25"]], left=0) == ["name     m", "   a  1.25"]


def test_rows_may_be_short():
    assert align_columns([["a", "b", "c"], ["ab"]], gap=" ") == ["a  b c", "ab"]
    assert align_columns([]) == []
