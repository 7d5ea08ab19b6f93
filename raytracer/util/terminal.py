"""Colours of text on a terminal."""

import os
import sys
from typing import TextIO

RED, YELLOW = 31, 33
"""Numbers of colours in ECMA-48, 8.3.117."""


def has_color(stream: TextIO) -> bool:
    """Return True if a stream is a terminal that shows colours, unless NO_COLOR, FORCE_COLOR or CLICOLOR decide that.

    References: https://no-color.org, https://force-color.org, https://bixense.com/clicolors
    """
    given = os.environ.get
    if given("NO_COLOR"):
        return False
    if any(given(name, "0") not in ("", "0") for name in ("FORCE_COLOR", "CLICOLOR_FORCE")):
        return True
    return given("CLICOLOR") != "0" and given("TERM") != "dumb" and stream.isatty()


def paint(text: str, color: int, stream: TextIO) -> str:
    """Give a text a colour, in bold, if a stream shows any."""
    return f"\x1b[1;{color}m{text}\x1b[0m" if has_color(stream) else text


def print_error(sentence: str) -> None:
    """Print an error on stderr."""
    print(f"{paint('rt:', RED, sys.stderr)} {sentence}", file=sys.stderr)
