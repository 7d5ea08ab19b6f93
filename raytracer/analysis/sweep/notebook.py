"""A sweep as notebooks show it: its pictures, one row for each combination of all axes but the last."""

from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from raytracer.report import fragment

if TYPE_CHECKING:
    from markupsafe import Markup

    from raytracer.analysis.sweep.results import Sweep

# Pictures that a notebook shows; more are for the sweep's own page.
_MOST = 64


def sweep_html(sweep: "Sweep") -> str:
    """Write a sweep as a fragment of HTML."""
    shown = sweep.results[:_MOST]
    *rows, columns = sweep.sliders
    cells = [_cell(sweep, number) for number in range(len(shown))]

    def row_of(number: int) -> tuple[int, ...]:
        return shown[number].point.index[: len(rows)]

    lines = []
    for index, numbers in groupby(range(len(shown)), row_of):
        labels = [slider.labels[place] for slider, place in zip(rows, index, strict=True)]
        lines.append([*labels, *(cells[number] for number in numbers)])
    head = [*(slider.name for slider in rows), *(f"{columns.name} {label}" for label in columns.labels)]
    left = len(sweep.results) - len(shown)
    return fragment.join(
        [
            fragment.heading(sweep.title, sweep.summary),
            fragment.table(head, lines, left=len(head)),
            *([fragment.heading("", f"and {left} more")] if left else []),
        ]
    )


def _cell(sweep: "Sweep", number: int) -> "Markup | str":
    """Show the picture of a point, or say why there is none."""
    result = sweep.results[number]
    pixels = _pixels(sweep, number)
    if pixels is None:
        return result.reason or (result.files[0] if result.files else result.status)
    return fragment.thumbnail(pixels, result.point.name)


def _pixels(sweep: "Sweep", number: int) -> NDArray[np.uint8] | None:
    """Return the picture of a point for display; None if it is not done, or its file is gone."""
    result = sweep.results[number]
    if sweep.folder is None:
        image = sweep.pictures[number]
        return None if image is None else image.display()
    if not result.files:
        return None
    import PIL.Image

    try:
        with PIL.Image.open(sweep.folder / result.files[0]) as file:
            return np.asarray(file.convert("RGB"))
    except OSError:
        # It is gone, or of a format that is not for display.
        return None
