"""`rt lightfield view`: a page to focus and look around in, or to go round what views look at."""

import sys
from pathlib import Path
from typing import Annotated

from raytracer.cli.base import options
from raytracer.cli.base.options import takes
from raytracer.cli.lightfield.base import File, Memory, Quiet, check_outputs, limit_memory, open_any
from raytracer.util.errors import InputError

EXAMPLE = """\b
Examples:
  rt lightfield view outputs/array.lf                      writes outputs/array.html
  rt lightfield view outputs/array.lf -o array.html --size 10MB
  rt lightfield view outputs/night.lf --exposure +3
  rt lightfield view around.lf -o around.html              views with poses of their own

\b
In a browser, a click focuses there, a drag looks around, and sliders focus (in metres) and open the aperture.
Of views with poses of their own, a drag goes round what they look at, and the wheel comes nearer.
"""

_UNITS = {"": 1, "b": 1, "kb": 1_000, "mb": 1_000_000, "gb": 1_000_000_000}
_MOST_EV = 64.0


def view(
    file: File,
    output: Annotated[Path | None, options.output("PAGE.html", "Default: outputs/FILE.html.")] = None,
    size: Annotated[str, takes("BYTES", "Size that the page has at most: 10MB.")] = "40MB",
    exposure: Annotated[
        str | None, takes("EV", "Exposure with which it is first shown: +2.  Default: 0, unless it is dark.")
    ] = None,
    memory: Memory = "2GB",
    quiet: Quiet = False,
) -> None:
    """Write one page of HTML in which a light field is focused and looked around in.

    If its views have poses of their own, one goes round what they look at; render it with --aov depth.  The page holds
    all it shows, and works without a network.  What does not fit into its size is left out, and said: first every
    second view of many, then pixels.
    """
    path = Path("outputs", f"{Path(file).stem}.html") if output is None else output
    check_outputs([path], [".html", ".htm"], "a page")
    max_bytes = _bytes(size)
    ev = None if exposure is None else options.parse_value("--exposure", exposure, _ev)

    from raytracer.film.light_field.posed_field import PosedLightField
    from raytracer.lightfield.viewer import page, posed_page
    from raytracer.util.progress import Bar

    with limit_memory(memory), open_any(file) as field, Bar(" steps", quiet=quiet) as bar, options.name_in_errors(file):
        title = Path(file).stem
        if isinstance(field, PosedLightField):
            made = posed_page.page(field, title=title, size=max_bytes, exposure=ev, update=bar.update)
        else:
            made = page.page(field, title=title, size=max_bytes, exposure=ev, update=bar.update)
        notes = made.write(path)
    if not quiet:
        print(*notes, f"wrote {path}", sep="\n", file=sys.stderr)


def _bytes(text: str) -> int:
    from raytracer.lightfield.viewer.page import MIN_BYTES

    digits = text.strip().rstrip("BbKkMmGg ")
    unit = text.strip()[len(digits) :].strip().lower()
    try:
        size = float(digits) * _UNITS[unit]
    except (ValueError, KeyError):
        raise InputError(f"--size {text}: must be a number of bytes, such as 10MB") from None
    if not MIN_BYTES <= size < _UNITS["gb"]:
        raise InputError(f"--size {text}: must be at least {MIN_BYTES / 1e6:g}MB, and below 1GB")
    return int(size)


def _ev(text: str) -> float:
    try:
        value = float(text.lower().removesuffix("ev").strip())
    except ValueError:
        raise ValueError("must be a number of stops, such as +2") from None
    if not abs(value) <= _MOST_EV:
        raise ValueError(f"must be from {-_MOST_EV:g} to {_MOST_EV:g} stops")
    return value
