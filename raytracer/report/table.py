"""Tables as plain text."""

from collections.abc import Sequence


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
