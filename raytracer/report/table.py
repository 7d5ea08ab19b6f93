"""Tables: as data that terminals, pages and paper share, as plain text, and as CSV."""

import csv
import io
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple


class Row(NamedTuple):
    """Row of a table.

    name : first column.
    cells : other columns.
    meaning : explanation, "" where none is needed.
    """

    name: str
    cells: tuple[str, ...]
    meaning: str = ""


class Table(NamedTuple):
    """Table: all columns but the first are numbers or short words, aligned to the right."""

    title: str
    head: tuple[str, ...]
    rows: tuple[Row, ...]
    text: str = ""


def align_columns(rows: Sequence[Sequence[str]], *, left: int = 1, gap: str = "  ") -> list[str]:
    """Pad the cells of each column to one width, and join each row to a line.

    Parameters
    ----------
    rows : cells; a row may be shorter than others.
    left : number of columns that are aligned to the left; the others are aligned to the right.
    gap : between columns.
    """
    columns = max(map(len, rows), default=0)
    widths = [max(len(row[column]) for row in rows if column < len(row)) for column in range(columns)]
    return [
        gap.join(
            f"{cell:<{width}}" if column < left else f"{cell:>{width}}"
            for column, (cell, width) in enumerate(zip(row, widths, strict=False))
        )
        for row in rows
    ]


def csv_text(header: Iterable[str], rows: Iterable[Iterable[Any]]) -> str:
    """Write a table as CSV, floats in full; None and nan are empty cells, sequences and mappings are JSON."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows([_csv_cell(value) for value in row] for row in rows)
    return text.getvalue()


def _csv_cell(value: Any) -> Any:
    if isinstance(value, float):
        return "" if math.isnan(value) else repr(float(value))
    if isinstance(value, list | tuple | Mapping):
        return json.dumps(value)
    return "" if value is None else value
