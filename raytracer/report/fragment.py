"""Fragments of HTML, which notebooks show in place of a result's text: tables, pictures, folded parts; no scripts."""

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from raytracer.report.page import data_uri, jpeg

if TYPE_CHECKING:
    from markupsafe import Markup

THUMBNAIL = 240
"""Pixels of the longer edge of a small picture."""

_LEFT, _RIGHT = "text-align: left; vertical-align: top", "text-align: right; vertical-align: top"


def join(parts: Iterable[str]) -> "Markup":
    """Join fragments to one; texts that are none are escaped."""
    from markupsafe import Markup

    return Markup("\n").join(parts)


def heading(text: str, note: str = "") -> "Markup":
    """Make a line in bold, and a note behind it."""
    from markupsafe import Markup

    return Markup("<p><b>{}</b> {}</p>").format(text, note)


def table(head: Sequence[str], rows: Iterable[Sequence[str]], *, left: int = 1) -> "Markup":
    """Make a table; cells may be fragments.

    left : number of columns that are aligned to the left; the others are aligned to the right.
    """
    from markupsafe import Markup

    def line(cells: Sequence[str], element: str) -> Markup:
        form = Markup(f'<{element} style="{{}}">{{}}</{element}>')
        styled = (form.format(_LEFT if column < left else _RIGHT, cell) for column, cell in enumerate(cells))
        return Markup("<tr>{}</tr>").format(Markup("").join(styled))

    body = join(line(row, "td") for row in rows)
    return Markup("<table>\n<thead>{}</thead>\n<tbody>\n{}\n</tbody>\n</table>").format(line(head, "th"), body)


def folded(title: str, content: str) -> "Markup":
    """Make a part that is shown once its title is clicked."""
    from markupsafe import Markup

    return Markup("<details><summary>{}</summary>\n{}\n</details>").format(title, content)


def preformatted(text: str) -> "Markup":
    """Make a text whose lines and columns stay as they are."""
    from markupsafe import Markup

    return Markup("<pre>{}</pre>").format(text.rstrip())


def thumbnail(pixels: NDArray[np.uint8], label: str) -> "Markup":
    """Make a picture, uint8 (height, width, 3) in sRGB, at most THUMBNAIL pixels wide or high.

    label : what it shows, for those who do not see it.
    """
    import PIL.Image
    from markupsafe import Markup

    picture = PIL.Image.fromarray(np.ascontiguousarray(pixels))
    picture.thumbnail((THUMBNAIL, THUMBNAIL))
    return Markup('<img src="{}" alt="{}">').format(jpeg(np.asarray(picture), 90, full_colour=True), label)


def svg(file: bytes, label: str) -> "Markup":
    """Make a picture of an SVG file."""
    from markupsafe import Markup

    return Markup('<img src="{}" alt="{}">').format(data_uri(file, "image/svg+xml"), label)
