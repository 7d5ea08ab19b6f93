"""Contact sheet of a sweep: all images on one, each with its values.

Two axes are the rows and columns of a table.  One axis, or zipped ones, fill rows, with a caption under each picture.
Of more axes, the last two make a table for each combination of the others, with a title of its own.
"""

import io
import math
from collections.abc import Sequence
from itertools import product
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from raytracer.analysis.sweep.results import Images, PointResult, Slider, Sweep
from raytracer.report.lettering import load_font, truncate_text
from raytracer.report.palette import BAD, FAINT, INK, PAPER, WELL

if TYPE_CHECKING:
    import PIL.Image
    import PIL.ImageDraw

SHEET = "contact_sheet.png"

# Largest width and height of an image on the sheet, and the least width of an image with its text.
_LARGEST = (240, 180)
_LEAST = 96

# Largest side and area of the sheet, unless images are at their least width.
_SIDE = 8_000
_AREA = 16e6

# Noise hardly compresses more, and takes longer.
_COMPRESSION = 2

# Preferred ratio of width to height of a sheet.
_SHAPE = 1.5

_MARGIN, _GAP = 16, 6


class _Table(NamedTuple):
    """A table of images.

    rows : points, by their numbers in `Sweep.results`.
    title : of the table; "" for none.
    row_heads, column_heads, captions : each a name and a value; empty for none.
    """

    rows: list[list[int]]
    title: str = ""
    row_heads: Sequence[tuple[str, str]] = ()
    column_heads: Sequence[tuple[str, str]] = ()
    captions: Sequence[tuple[str, str]] = ()


class _Sizes(NamedTuple):
    """Sizes on the sheet (px).

    picture : width and height of an image.
    slot : width and height of its place, with the lines of a caption.
    text : of the font.
    line : height of a line of text.
    row_head : width of the heads of rows.
    column_head, title : heights.
    """

    picture: tuple[int, int]
    slot: tuple[int, int]
    text: int
    line: int
    row_head: int
    column_head: int
    title: int

    def table(self, table: _Table) -> tuple[int, int]:
        """Compute width and height of a table."""
        width = self.row_head + len(table.rows[0]) * (self.slot[0] + _GAP)
        return width, self.title + self.column_head + len(table.rows) * (self.slot[1] + _GAP)


def contact_sheet(sweep: Sweep, images: Images) -> bytes:
    """Encode the contact sheet as a PNG.

    At most 8,000 pixels a side and 16 million in all, unless there are so many points that their pictures would be
    less than 96 pixels wide.  None is larger than it is, or than 240 x 180.
    """
    buffer = io.BytesIO()
    draw_sheet(sweep, images).save(buffer, "PNG", compress_level=_COMPRESSION)
    return buffer.getvalue()


def draw_sheet(sweep: Sweep, images: Images) -> "PIL.Image.Image":
    """Draw the contact sheet as an image of Pillow; see `contact_sheet`."""
    import PIL.Image
    import PIL.ImageDraw

    # Choose how large everything is.
    chosen = sweep.sliders
    first = next((picture for picture in map(images, sweep.results) if picture is not None), None)
    height, width = (180, 320) if first is None else first.shape[:2]
    scale = min(1.0, _LARGEST[0] / width, _LARGEST[1] / height)
    while True:
        size = max(1, round(scale * width)), max(1, round(scale * height))
        tables = _tables(chosen, size)
        sizes = _measure(size, tables)
        across = _columns_for(len(tables), sizes.table(tables[0]))
        table = sizes.table(tables[0])
        heading = round(3.2 * sizes.line)
        total = (
            2 * _MARGIN + across * table[0] + (across - 1) * _MARGIN,
            2 * _MARGIN + heading + math.ceil(len(tables) / across) * (table[1] + _GAP),
        )
        if size[0] <= _LEAST or (max(total) <= _SIDE and total[0] * total[1] <= _AREA):
            break
        scale *= max(0.9, _LEAST / size[0])

    # Draw the heading, and the tables one after the other.
    sheet = PIL.Image.new("RGB", total, PAPER)
    painter = _Painter(sheet, PIL.ImageDraw.Draw(sheet), sizes)
    line_width = total[0] - 2 * _MARGIN
    painter.text((_MARGIN, _MARGIN), sweep.title, line_width, size=round(1.25 * sizes.text))
    painter.text((_MARGIN, _MARGIN + round(1.4 * sizes.line)), sweep.summary, line_width, FAINT)
    for number, entry in enumerate(tables):
        down, right = divmod(number, across)
        corner = (_MARGIN + right * (table[0] + _MARGIN), _MARGIN + heading + down * (table[1] + _GAP))
        painter.table(entry, corner, sweep.results, images)
    return sheet


def _tables(chosen: Sequence[Slider], size: tuple[int, int]) -> list[_Table]:
    if len(chosen) == 1:
        (slider,) = chosen
        count = len(slider.labels)
        across = _columns_for(count, (max(size[0], _LEAST), size[1]))
        rows = [list(range(start, min(start + across, count))) for start in range(0, count, across)]
        return [_Table(rows, captions=[(slider.name, label) for label in slider.labels])]

    *others, row, column = chosen
    tables, count = [], len(row.labels) * len(column.labels)
    for number, labels in enumerate(product(*(other.labels for other in others))):
        start = number * count
        rows = np.arange(start, start + count).reshape(len(row.labels), -1).tolist()
        title = ", ".join(f"{other.name} {label}" for other, label in zip(others, labels, strict=True))
        heads = ([(slider.name, label) for label in slider.labels] for slider in (row, column))
        tables.append(_Table(rows, title, *heads))
    return tables


def _measure(picture: tuple[int, int], tables: Sequence[_Table]) -> _Sizes:
    width = max(picture[0], _LEAST)
    text = min(16, max(11, width // 14))
    line = round(1.35 * text)
    table = tables[0]
    words = [word for head in table.row_heads for word in head]
    row_head = round(min(max((load_font(text).getlength(word) for word in words), default=0.0), 260.0)) + 2 * _GAP
    return _Sizes(
        picture,
        (width, picture[1] + (line if table.captions else 0)),
        text,
        line,
        row_head if words else 0,
        2 * line if table.column_heads else 0,
        round(1.5 * line) if table.title else 0,
    )


def _columns_for(count: int, size: tuple[int, int]) -> int:
    """Choose the number of columns for `count` cells of a size, for a good shape and few empty cells."""

    def badness(across: int) -> float:
        down = math.ceil(count / across)
        shape, waste = across * size[0] / (down * size[1]), across * down / count
        return abs(math.log(shape / _SHAPE)) + math.log(waste)

    return min(range(1, count + 1), key=badness)


class _Painter(NamedTuple):
    """A sheet that is drawn on, and the sizes of what is on it."""

    sheet: "PIL.Image.Image"
    draw: "PIL.ImageDraw.ImageDraw"
    sizes: _Sizes

    def text(
        self,
        place: tuple[float, float],
        words: str,
        width: float,
        ink: str = INK,
        *,
        anchor: str | None = None,
        size: int | None = None,
    ) -> None:
        """Write one line of text of at most a width."""
        size = size or self.sizes.text
        self.draw.text(place, truncate_text(words, size, width), ink, load_font(size), anchor=anchor)

    def table(self, table: _Table, corner: tuple[int, int], results: Sequence[PointResult], images: Images) -> None:
        """Draw a table with its heads and captions."""
        sizes, (left, top) = self.sizes, corner
        if table.title:
            self.text((left, top), table.title, sizes.table(table)[0])
        left, top = left + sizes.row_head, top + sizes.title + sizes.column_head
        (width, height), step = sizes.slot, (sizes.slot[0] + _GAP, sizes.slot[1] + _GAP)

        # The heads: a name, and below it the value.
        above, beside = top - 2 * sizes.line, left - 1.5 * _GAP
        heads = [
            (head, (left + column * step[0] + width / 2, above), width, "ma")
            for column, head in enumerate(table.column_heads)
        ] + [
            (head, (beside, top + row * step[1] + height / 2 - sizes.line), sizes.row_head - _GAP, "ra")
            for row, head in enumerate(table.row_heads)
        ]
        for head, (x, y), room, anchor in heads:
            self.text((x, y), head[0], room, FAINT, anchor=anchor)
            self.text((x, y + sizes.line), head[1], room, anchor=anchor)

        for row, numbers in enumerate(table.rows):
            for column, number in enumerate(numbers):
                x, y = left + column * step[0], top + row * step[1]
                self._picture(results[number], images, (x, y))
                if table.captions:
                    name, value = table.captions[number]
                    whole = f"{name} {value}"
                    words = whole if load_font(sizes.text).getlength(whole) <= width else value
                    self.text((x + width / 2, y + sizes.picture[1] + 1), words, width, anchor="ma")

    def _picture(self, result: PointResult, images: Images, corner: tuple[int, int]) -> None:
        """Draw an image, or why there is none, into the middle of its slot."""
        import PIL.Image

        sizes, (width, height) = self.sizes, self.sizes.picture
        x, y = corner[0] + (sizes.slot[0] - width) // 2, corner[1]
        pixels = images(result)
        if pixels is None:
            self.draw.rectangle((x, y, x + width - 1, y + height - 1), fill=WELL)
            words = "no picture" if result.status == "done" else result.status
            self.text((x + width / 2, y + height / 2), words, sizes.slot[0], BAD, anchor="mm")
            return
        with PIL.Image.fromarray(pixels) as picture:
            fitting = fit_image(picture, sizes.picture)
            self.sheet.paste(fitting, (x + (width - fitting.width) // 2, y + (height - fitting.height) // 2))


def fit_image(picture: "PIL.Image.Image", size: tuple[int, int]) -> "PIL.Image.Image":
    """Resize an image to be as large as possible within a size (width, height): those of points may differ."""
    import PIL.Image

    if picture.size == size:
        return picture
    ratio = min(size[0] / picture.width, size[1] / picture.height)
    inside = max(1, round(ratio * picture.width)), max(1, round(ratio * picture.height))
    return picture.resize(inside, PIL.Image.Resampling.LANCZOS)
