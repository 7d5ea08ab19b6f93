"""Figures by Matplotlib, in one style for files and for pages, and their SVG.

Figures are made without `pyplot`: no state is shared, no display looked for, and no setting of the user's taken over.
In a page lines and text have the page's own colour, so that they can be read in dark mode, and text is text; in files
they are dark on white, and text is drawn as outlines, so that it looks the same without its fonts.
"""

import html
import io
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from numpy.typing import ArrayLike

from raytracer.report.palette import INK, PAPER

if TYPE_CHECKING:
    from markupsafe import Markup
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

POINTS_PER_INCH = 72.0

_NAMESPACES = 'xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink"'

# Placeholder that is replaced by the colour of the page's text.
_INK_OF_PAGE = "#010203"


class Theme(NamedTuple):
    """Colours of lines and text, and of the background; text as outlines ("path") or as text ("none")."""

    ink: str
    paper: str
    text: Literal["path", "none"]


ON_PAPER = Theme(INK, PAPER, "path")
IN_PAGE = Theme(_INK_OF_PAGE, "none", "none")


class Curve(NamedTuple):
    """Curve of a chart, whose points are told where the pointer is."""

    label: str
    x: ArrayLike
    y: ArrayLike


class PageFigure(NamedTuple):
    """Figure of a page: its picture, and the data by which the page's script answers the pointer."""

    picture: "Markup"
    data: dict[str, Any]


@contextmanager
def style(theme: Theme, size: float = 10.0) -> Iterator[None]:
    """Set Matplotlib to the style of a theme, with letters of a size (pt)."""
    import matplotlib as mpl

    settings: dict[Any, Any] = {
        "svg.hashsalt": "raytracer",
        "svg.fonttype": theme.text,
        "pdf.fonttype": 42,
        "font.family": ["sans-serif"],
        "font.sans-serif": ["DejaVu Sans", "Verdana", "sans-serif"],
        "font.size": size,
        # A dollar sign in a name begins no formula.
        "text.parse_math": False,
        "text.color": theme.ink,
        "axes.edgecolor": theme.ink,
        "axes.labelcolor": theme.ink,
        "axes.facecolor": theme.paper,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "figure.facecolor": theme.paper,
        "savefig.facecolor": theme.paper,
        "xtick.color": theme.ink,
        "ytick.color": theme.ink,
        "grid.color": theme.ink,
        "grid.alpha": 0.15,
        "legend.frameon": False,
    }
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(settings)
        yield


def ink() -> str:
    """Return the colour of lines and text in the style that is set."""
    import matplotlib as mpl

    return str(mpl.rcParams["text.color"])


def new_figure(width: float, height: float, layout: Literal["constrained"] | None = None) -> "Figure":
    """Make a figure of a size (inches)."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout=layout)


def series_id(number: int) -> str:
    """Name the drawn curve of a number, so that the page's script finds it."""
    return f"series-{number}"


def to_png(figure: "Figure", dpi: float, *, tight: bool = False) -> bytes:
    """Draw a figure as PNG; cut to what is drawn if it is `tight`."""
    data = io.BytesIO()
    cut = "tight" if tight else None
    figure.savefig(data, format="png", dpi=dpi, bbox_inches=cut, metadata={"Software": None})
    return data.getvalue()


def to_svg(
    figure: "Figure", *, title: str | None = None, names: Mapping[str, str] | None = None, tight: bool = False
) -> bytes:
    """Write a figure as an SVG file, the same each time.

    Parameters
    ----------
    names : what is said of parts of it under the pointer, by their `gid`.
    tight : cut to what is drawn.
    """
    data = io.BytesIO()
    # Without a date the same figure gives the same file.
    facts: Any = dict.fromkeys(("Date", "Creator", "Format", "Type")) | ({"Title": title} if title else {})
    figure.savefig(data, format="svg", dpi=200, bbox_inches="tight" if tight else None, metadata=facts)
    text = data.getvalue().decode()
    for gid, name in (names or {}).items():
        text = text.replace(f'<g id="{gid}">', f'<g id="{gid}"><title>{html.escape(name)}</title>', 1)
    return text.encode()


def inline_svg(svg: bytes, label: str, key: str) -> "Markup":
    """Turn an SVG file into an element of a page: described by `label`, with ids that begin with `key`."""
    from markupsafe import Markup

    text = svg.decode()
    text = re.sub(r"<metadata>.*?</metadata>|(?<=>)\s+(?=<)", "", text, flags=re.DOTALL)
    said = html.escape(label)
    start = re.search(r'<svg [^>]*?(viewBox="[^"]*")[^>]*>', text)
    assert start is not None
    text = f'<svg {_NAMESPACES} role="img" aria-label="{said}" {start[1]}>{text[start.end() :]}'
    text = text.replace(_INK_OF_PAGE, "currentColor")
    text = re.sub(r'\bid="', f'id="{key}-', text)
    text = re.sub(r'href="#', f'href="#{key}-', text)
    text = text.replace("url(#", f"url(#{key}-")
    return Markup(text)


def page_figure(
    axes: "Axes",
    key: str,
    title: str,
    labels: tuple[str, str],
    curves: Sequence[Curve],
    factors: tuple[float, float] = (1.0, 1.0),
) -> PageFigure:
    """Finish a figure for a page.

    Parameters
    ----------
    axes : the one that answers the pointer.
    key : name of the figure in the page.
    labels : of x and y, with their units.
    curves : as they are drawn, each with the `gid` of its number (`series_id`).
    factors : of x and y, from the units of the axes to those of the labels and curves.
    """
    figure = axes.get_figure(root=True)
    assert figure is not None
    # Saving lays the figure out.
    picture = inline_svg(to_svg(figure), title, key)
    (width, height), place = POINTS_PER_INCH * figure.get_size_inches(), axes.get_position()
    data = {
        "title": title,
        "labels": labels,
        "box": [place.x0 * width, place.x1 * width, (1.0 - place.y0) * height, (1.0 - place.y1) * height],
        "ranges": [
            [factor * end for end in ends]
            for factor, ends in zip(factors, (axes.get_xlim(), axes.get_ylim()), strict=True)
        ],
        "log": [scale == "log" for scale in (axes.get_xscale(), axes.get_yscale())],
        "series": [curve._asdict() for curve in curves],
    }
    return PageFigure(picture, data)
