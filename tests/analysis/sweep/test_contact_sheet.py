"""The contact sheet: every picture is on it, at its place, and said to be what it is."""

import io
from itertools import pairwise

import numpy as np
import PIL.Image
import pytest

from raytracer.analysis.sweep import contact_sheet
from raytracer.analysis.sweep.results import Axis
from tests.analysis.sweep.made_up import ALBEDO, F_NUMBER, FOCUS, HEIGHT, WIDTH, images, made_up, picture


def drawn(sweep):
    with PIL.Image.open(io.BytesIO(contact_sheet.contact_sheet(sweep, images))) as file:
        return np.asarray(file)


def places(sweep):
    whole = drawn(sweep)
    found = {}
    for taken in sweep.results:
        if taken.status != "done":
            continue
        own = picture(taken.point)
        rows, columns = np.nonzero(np.all(whole == own[0, 0], axis=-1))
        (place,) = (
            (row, column)
            for row, column in zip(rows.tolist(), columns.tolist(), strict=True)
            if np.array_equal(whole[row : row + HEIGHT, column : column + WIDTH], own)
        )
        found[taken.point.index] = place
    return found


def test_two_axes_are_rows_and_columns_with_heads_beside_and_above():
    sweep = made_up(None, failed=((2, 1),))
    found, ink = places(sweep), np.any(drawn(sweep) < 128, axis=-1)
    assert len(found) == 11
    rows = [{found[row, column][0] for column in range(3) if (row, column) in found} for row in range(4)]
    columns = [{found[row, column][1] for row in range(4) if (row, column) in found} for column in range(3)]
    assert all(len(line) == 1 for line in (*rows, *columns))
    for lines, size in ((rows, HEIGHT), (columns, WIDTH)):
        assert all(max(a) + size <= min(b) for a, b in pairwise(lines))
    # Words are ink on white: some left of each row, above each column, and none below.
    top, left = found[0, 0]
    assert all(ink[first : first + HEIGHT, :left].any() for (first,) in rows)
    assert all(ink[top - 40 : top, first : first + WIDTH].any() for (first,) in columns)
    assert not ink[found[3, 2][0] + HEIGHT :].any()


@pytest.mark.parametrize("zipped", [False, True])
def test_one_axis_fills_rows(zipped):
    axis = Axis("camera.f_number", (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0), tuple("1234567"))
    axes = (axis, axis._replace(key="camera.iso")) if zipped else (axis,)
    sweep = made_up(None, axes, zipped=zipped)
    order = [place for _, place in sorted(places(sweep).items())]
    assert order == sorted(order)
    assert 1 < len({row for row, _ in order}) < 7

    # Under each there is a caption.
    ink = np.any(drawn(sweep) < 128, axis=-1)
    assert all(ink[row + HEIGHT : row + HEIGHT + 20, column : column + WIDTH].any() for row, column in order)


def test_a_sheet_of_many_large_pictures_is_bounded(monkeypatch):
    monkeypatch.setattr(contact_sheet, "_AREA", 1.0e6)
    axes = tuple(Axis(f"a.{name}", tuple(range(10)), tuple("0123456789")) for name in "xy")
    large = np.zeros((240, 320, 3), dtype=np.uint8)
    size = contact_sheet.draw_sheet(made_up(None, axes), lambda taken: large).size
    assert 0.7e6 < size[0] * size[1] <= 1.0e6

    # Words need their room, whatever the bounds.
    monkeypatch.setattr(contact_sheet, "_AREA", 1.0)
    assert contact_sheet.draw_sheet(made_up(None, axes), lambda taken: large).width > 10 * 96


def test_of_three_axes_each_value_of_the_first_has_a_table():
    found = places(made_up(None, (ALBEDO, F_NUMBER, FOCUS)))
    assert len(found) == 24
    offsets = {
        tuple(np.subtract(found[1, row, column], found[0, row, column])) for row in range(4) for column in range(3)
    }
    assert len(offsets) == 1


@pytest.mark.parametrize("text", ["x" * 400, "tab\tand\nline", ""])
def test_long_names_are_cut_and_lines_are_one(text):
    axis = F_NUMBER._replace(labels=(text, "2", "2.8", "4"))
    assert len(places(made_up(None, (axis, FOCUS)))) == 12


def test_pictures_of_other_sizes_keep_their_shape():
    """All are fitted into the first one's place."""
    sizes = {1.4: (90, 160), 2.0: (160, 90), 2.8: (20, 20), 4.0: (45, 80)}
    colors = {1.4: (200, 0, 0), 2.0: (0, 200, 0), 2.8: (0, 0, 200), 4.0: (200, 0, 200)}

    def of_its_size(taken):
        f_number = taken.point.values["camera.f_number"]
        return np.full((*sizes[f_number], 3), colors[f_number], dtype=np.uint8)

    whole = np.asarray(contact_sheet.draw_sheet(made_up(None, (F_NUMBER,)), of_its_size))
    seen = {f_number: np.all(whole == color, axis=-1) for f_number, color in colors.items()}
    shapes = {key: (int(at.any(axis=1).sum()), int(at.any(axis=0).sum())) for key, at in seen.items()}
    assert shapes == {1.4: (90, 160), 2.0: (90, 51), 2.8: (90, 90), 4.0: (90, 160)}


def test_a_sheet_of_nothing_says_so():
    assert drawn(made_up(None, (F_NUMBER,), failed=((0,), (1,), (2,), (3,)))).shape[0] > 180
