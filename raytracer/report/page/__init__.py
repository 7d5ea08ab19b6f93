"""Self-contained pages of HTML: they make no requests, and work from the file system and in dark mode.

A page `<name>` is made of files in this folder: `<name>.html` is a template of Jinja that extends `skeleton.html`,
`<name>.css` and `<name>.js` are its own style and script, if there are any; `style.css` and `base.js` are those of
every page, and the parts that it asks for (`wipe`) have a style and a script too.  What it shows are values of its
template, which are escaped, and data as JSON, of which scripts make text and never HTML.
"""

import base64
import io
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from raytracer.report import palette
from raytracer.util.errors import one_line

if TYPE_CHECKING:
    from jinja2 import Environment

# Characters that would end the element that holds the data, or begin a comment in it.
_ESCAPES = str.maketrans({"<": "\\u003c", ">": "\\u003e", "&": "\\u0026"})


def page(
    name: str,
    title: str,
    data: Mapping[str, Any],
    *,
    parts: Sequence[str] = (),
    values: Mapping[str, Any] | None = None,
) -> bytes:
    """Make one self-contained HTML file (UTF-8).

    Parameters
    ----------
    name : of the page's files in this folder.
    title : of the window; its first heading is in the body.
    data : of the scripts, as `data`: mappings, sequences, strings, numbers, NumPy's too; numbers that JSON cannot hold
        become the strings "inf", "-inf" and "nan".
    parts : that the page's script builds on: names of further scripts and styles in this folder, in order.
    values : of the page's template.

    Raises
    ------
    TypeError : a value in `data` is of another type.
    """
    from markupsafe import Markup

    sources, styles = ("base", *parts, name), ("style", *parts, name)
    template = _templates().select_template([f"{name}.html", "skeleton.html"])
    filled = template.render(
        title=one_line(title),
        light=palette.LIGHT,
        dark=palette.DARK,
        styles=[Markup(text) for text in _texts(styles, ".css")],
        scripts=[Markup(text) for text in _texts(sources, ".js")],
        data=Markup(_json(data)),
        **(values or {}),
    )
    # Names of files may hold bytes that are no text.
    return f"{filled}\n".encode(errors="backslashreplace")


@cache
def _templates() -> "Environment":
    """Find the templates in this folder; whatever is put into them is escaped."""
    from jinja2 import Environment, FunctionLoader, StrictUndefined

    return Environment(
        loader=FunctionLoader(lambda name: next(_texts((name,), ""), None)),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def joined(names: Sequence[str], suffix: str) -> str:
    """Join those of the files in this folder that exist, for a page that a server sends in parts."""
    return "\n".join(_texts(names, suffix))


def _texts(names: Sequence[str], suffix: str) -> Iterator[str]:
    """Read those of the files in this folder that exist."""
    for name in names:
        file = files(__name__).joinpath(name + suffix)
        if file.is_file():
            yield file.read_text(encoding="utf-8")


def _json(data: Any) -> str:
    """Write JSON in ASCII that may stand in HTML."""
    return json.dumps(to_plain(data), allow_nan=False, separators=(",", ":")).translate(_ESCAPES)


def to_plain(value: Any) -> Any:
    """Convert data, NumPy's too, to values of JSON; numbers that it cannot hold become strings: "inf", "nan"."""
    if isinstance(value, Mapping):
        return {str(key): to_plain(entry) for key, entry in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return to_plain(value.tolist())
    if isinstance(value, Sequence) and not isinstance(value, str | bytes):
        return [to_plain(entry) for entry in value]
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value


def data_uri(content: bytes, media_type: str) -> str:
    """Write a file's content as a data URI: `data:image/png;base64,...`."""
    return f"data:{media_type};base64,{base64.b64encode(content).decode()}"


def png(pixels: NDArray[np.uint8]) -> str:
    """Encode a picture, uint8 (height, width[, 3 or 4]), as the data URI of a PNG, lossless."""
    return _encoded(pixels, "PNG")


def webp(pixels: NDArray[np.uint8], quality: int | None = None) -> str:
    """Encode a picture, uint8 (height, width[, 3 or 4]), as the data URI of a WebP of a quality in 0..100.

    Without a quality it is lossless, and smaller than a PNG.
    """
    if quality is None:
        return _encoded(pixels, "WEBP", lossless=True, quality=20, method=2, exact=True)
    return _encoded(pixels, "WEBP", quality=quality)


def jpeg(pixels: NDArray[np.uint8], quality: int = 90, *, full_colour: bool = False) -> str:
    """Encode a picture, uint8 (height, width[, 3]), as the data URI of a JPEG of a quality in 0..100.

    Its colours are subsampled to half the size, unless `full_colour` is set.
    """
    return _encoded(pixels, "JPEG", quality=quality, subsampling="4:4:4" if full_colour else "4:2:0")


def _encoded(pixels: NDArray[np.uint8], kind: str, **settings: Any) -> str:
    """Encode a picture in a format of Pillow's."""
    import PIL.Image

    buffer = io.BytesIO()
    PIL.Image.fromarray(np.ascontiguousarray(pixels)).save(buffer, kind, **settings)
    return data_uri(buffer.getvalue(), f"image/{kind.lower()}")
