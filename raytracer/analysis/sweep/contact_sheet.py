"""A contact sheet: all pictures of a sweep on one, each with its values.

Two axes are the rows and columns of a table.  One axis, or zipped ones, fill rows, with a caption under each picture.
Of more axes, the last two make a table for each combination of the others, with a title of its own.
"""

import io
import math
from collections.abc import Sequence
from functools import cache
from itertools import product
from typing import TYPE_CHECKING, Any, NamedTuple

from raytracer.errors import one_line
from raytracer.film.output import write_bytes
from raytracer.sweeping.points import Sweep, Taken
from raytracer.sweeping.sliders import Images, Slider, extent, sliders, title_of

if TYPE_CHECKING:
    from pathlib import Path

    import PIL.Image
    import PIL.ImageFont

SHEET = "contact_sheet.png"

# Largest width and height of a picture on the sheet, and the width that it and its words always have.
_LARGEST = (240, 180)
_LEAST = 96

# Largest side and area of the sheet, unless pictures are at their least width.
_SIDE = 8_000
_AREA = 16e6

# Noise is hardly smaller with more, and takes longer.
_COMPRESSION = 2

# How much wider than high a sheet should be, where that is free.
_SHAPE = 1.5

_MARGIN, _GAP = 16, 6
_PAPER, _INK, _FAINT, _WELL, _BAD = (255, 255, 255), (27, 29, 33), (92, 98, 107), (226, 229, 234), (179, 38, 30)


class _Table(NamedTuple):
    """Points (numbers of `Sweep.taken`) in rows; a title, and heads of rows and columns or captions, where not empty.

    A head or caption is a name and a value.
    """

    rows: list[list[int]]
    title: str = ""
    row_heads: Sequence[tuple[str, str]] = ()
    column_heads: Sequence[tuple[str, str]] = ()
    captions: Sequence[tuple[str, str]] = ()


class _Sizes(NamedTuple):
    """Of a picture, of the slot that it lies in (with a caption's lines), of text, and of what tables have besides."""

    picture: tuple[int, int]
    slot: tuple[int, int]
    text: int
    line: int
    row_head: int
    column_head: int
    title: int

    def table(self, table: _Table) -> tuple[int, int]:
        """Width and height of a table."""
        width = self.row_head + len(table.rows[0]) * (self.slot[0] + _GAP)
        return width, self.title + self.column_head + len(table.rows) * (self.slot[1] + _GAP)


def contact_sheet(sweep: Sweep, images: Images) -> bytes:
    """The contact sheet as a PNG.

    At most 8,000 pixels a side and 16 million in all, unless there are so many points that their pictures would be
    less than 96 pixels wide.  None is larger than it is, or than 240 x 180.
    """
    buffer = io.BytesIO()
    draw_sheet(sweep, images).save(buffer, "PNG", compress_level=_COMPRESSION)
    return buffer.getvalue()


def write_sheet(sweep: Sweep, images: Images) -> "Path":
    """Write the contact sheet into the sweep's folder.

    Returns
    -------
    The file.

    Raises
    ------
    ValueError : the sweep has no folder.
    OutputError : the file cannot be written.
    """
    if sweep.folder is None:
        raise ValueError("a sweep in memory has no folder for a contact sheet")
    path = sweep.folder / SHEET
    write_bytes(path, contact_sheet(sweep, images))
    return path


def draw_sheet(sweep: Sweep, images: Images) -> "PIL.Image.Image":
    """The contact sheet as an image of Pillow; see `contact_sheet`."""
    import PIL.Image
    import PIL.ImageDraw

    # Choose how large everything is.
    chosen = sliders(sweep.axes, zipped=sweep.zipped)
    first = next((picture for picture in map(images, sweep.taken) if picture is not None), None)
    height, width = (180, 320) if first is None else first.shape[:2]
    scale = min(1.0, _LARGEST[0] / width, _LARGEST[1] / height)
    while True:
        size = max(1, round(scale * width)), max(1, round(scale * height))
        tables = _tables(chosen, size)
        sizes = _sizes(size, tables)
        across = _across(len(tables), sizes.table(tables[0]))
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
    sheet = PIL.Image.new("RGB", total, _PAPER)
    draw = PIL.ImageDraw.Draw(sheet)
    room = total[0] - 2 * _MARGIN
    large = round(1.25 * sizes.text)
    draw.text((_MARGIN, _MARGIN), cut(title_of(sweep), large, room), _INK, font(large))
    below = (_MARGIN, _MARGIN + round(1.4 * sizes.line))
    draw.text(below, cut(extent(sweep), sizes.text, room), _FAINT, font(sizes.text))
    for number, entry in enumerate(tables):
        down, right = divmod(number, across)
        corner = (_MARGIN + right * (table[0] + _MARGIN), _MARGIN + heading + down * (table[1] + _GAP))
        _draw_table(sheet, draw, entry, corner, sizes, sweep.taken, images)
    return sheet


def _tables(chosen: Sequence[Slider], size: tuple[int, int]) -> list[_Table]:
    if len(chosen) == 1:
        (slider,) = chosen
        count = len(slider.labels)
        across = _across(count, (max(size[0], _LEAST), size[1]))
        rows = [list(range(start, min(start + across, count))) for start in range(0, count, across)]
        return [_Table(rows, captions=[(slider.name, label) for label in slider.labels])]

    *others, row, column = chosen
    tables = []
    count = len(row.labels) * len(column.labels)
    for number, labels in enumerate(product(*(other.labels for other in others))):
        start = number * count
        rows = [
            list(range(start + down * len(column.labels), start + (down + 1) * len(column.labels)))
            for down in range(len(row.labels))
        ]
        title = ", ".join(f"{other.name} {label}" for other, label in zip(others, labels, strict=True))
        heads = ([(slider.name, label) for label in slider.labels] for slider in (row, column))
        tables.append(_Table(rows, title, *heads))
    return tables


def _sizes(picture: tuple[int, int], tables: Sequence[_Table]) -> _Sizes:
    width = max(picture[0], _LEAST)
    text = min(16, max(11, width // 14))
    line = round(1.35 * text)
    table = tables[0]
    words = [word for head in table.row_heads for word in head]
    row_head = round(min(max((font(text).getlength(word) for word in words), default=0.0), 260.0)) + 2 * _GAP
    return _Sizes(
        picture,
        (width, picture[1] + (line if table.captions else 0)),
        text,
        line,
        row_head if words else 0,
        2 * line if table.column_heads else 0,
        round(1.5 * line) if table.title else 0,
    )


def _across(count: int, size: tuple[int, int]) -> int:
    """How many of a size go side by side, so that the sheet is of a good shape and little of it is left empty."""

    def badness(across: int) -> float:
        down = math.ceil(count / across)
        shape, waste = across * size[0] / (down * size[1]), across * down / count
        return abs(math.log(shape / _SHAPE)) + math.log(waste)

    return min(range(1, count + 1), key=badness)


def _draw_table(
    sheet: "PIL.Image.Image",
    draw: Any,
    table: _Table,
    corner: tuple[int, int],
    sizes: _Sizes,
    taken: Sequence[Taken],
    images: Images,
) -> None:
    left, top = corner
    letters = font(sizes.text)
    if table.title:
        room = sizes.table(table)[0]
        draw.text((left, top), cut(table.title, sizes.text, room), _INK, letters)
    left, top = left + sizes.row_head, top + sizes.title + sizes.column_head
    step = sizes.slot[0] + _GAP, sizes.slot[1] + _GAP

    # The heads: a name, and below it the value.
    for column, head in enumerate(table.column_heads):
        middle = left + column * step[0] + sizes.slot[0] / 2
        for line, (words, ink) in enumerate(zip(head, (_FAINT, _INK), strict=True)):
            above = middle, top - (2 - line) * sizes.line
            draw.text(above, cut(words, sizes.text, sizes.slot[0]), ink, letters, anchor="ma")
    for row, head in enumerate(table.row_heads):
        middle = top + row * step[1] + sizes.slot[1] / 2
        for line, (words, ink) in enumerate(zip(head, (_FAINT, _INK), strict=True)):
            beside = left - 1.5 * _GAP, middle + (line - 1) * sizes.line
            draw.text(beside, cut(words, sizes.text, sizes.row_head - _GAP), ink, letters, anchor="ra")

    for row, numbers in enumerate(table.rows):
        for column, number in enumerate(numbers):
            x, y = left + column * step[0], top + row * step[1]
            _draw_picture(sheet, draw, taken[number], images, (x, y), sizes)
            if table.captions:
                name, value = table.captions[number]
                whole = f"{name} {value}"
                words = whole if letters.getlength(whole) <= sizes.slot[0] else value
                below = x + sizes.slot[0] / 2, y + sizes.picture[1] + 1
                draw.text(below, cut(words, sizes.text, sizes.slot[0]), _INK, letters, anchor="ma")


def _draw_picture(
    sheet: "PIL.Image.Image",
    draw: Any,
    taken: Taken,
    images: Images,
    corner: tuple[int, int],
    sizes: _Sizes,
) -> None:
    """Put a picture, or why there is none, into the middle of its slot."""
    import PIL.Image

    x, y = corner[0] + (sizes.slot[0] - sizes.picture[0]) // 2, corner[1]
    width, height = sizes.picture
    pixels = images(taken)
    if pixels is None:
        draw.rectangle((x, y, x + width - 1, y + height - 1), fill=_WELL)
        words = "no picture" if taken.status == "done" else taken.status
        middle = x + width / 2, y + height / 2
        draw.text(middle, cut(words, sizes.text, sizes.slot[0]), _BAD, font(sizes.text), anchor="mm")
        return
    with PIL.Image.fromarray(pixels) as picture:
        fitting = fitted(picture, sizes.picture)
        sheet.paste(fitting, (x + (width - fitting.width) // 2, y + (height - fitting.height) // 2))


def fitted(picture: "PIL.Image.Image", size: tuple[int, int]) -> "PIL.Image.Image":
    """A picture as large as it can be within a size (width, height): those of points may differ."""
    import PIL.Image

    if picture.size == size:
        return picture
    ratio = min(size[0] / picture.width, size[1] / picture.height)
    inside = max(1, round(ratio * picture.width)), max(1, round(ratio * picture.height))
    return picture.resize(inside, PIL.Image.Resampling.LANCZOS)


@cache
def font(size: int) -> "PIL.ImageFont.FreeTypeFont":
    """Pillow's own font."""
    import PIL.ImageFont

    loaded = PIL.ImageFont.load_default(size)
    # Pillow has had FreeType in it, and with it a font of any size, since it has had this argument.
    assert isinstance(loaded, PIL.ImageFont.FreeTypeFont)
    return loaded


def cut(text: str, size: int, room: float) -> str:
    """A text on one line, as much of it as there is room for."""
    text, letters = one_line(text), font(size)
    if letters.getlength(text) <= room:
        return text
    while text and letters.getlength(f"{text}...") > room:
        text = text[:-1]
    return f"{text}..."
