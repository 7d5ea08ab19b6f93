"""Errors for users, each in one sentence that can be printed as it is."""

import difflib
import itertools
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from raytracer.util.other_names import EXPLAINED, name_here

_NAMES_LISTED = 16
_MAX_TEXT = 40

_MAX_SENTENCE, _SENTENCE_TAIL = 2000, 500
"""Characters of a sentence that are printed, and how many of them come from its end: a name may have millions."""

_MAX_NAME, _MAX_COMPARED = 100, 2000
"""Limits of the search for the nearest name, which takes time in proportion to names and the product of lengths."""


class InputError(Exception):
    """A wrong command line or input file; exit status 2."""


class SceneError(InputError):
    """A wrong scene file: the place (`file`, `line` from 1, `key` as a path) and a message.

    `file` and `line` are None where the value came from the command line; `source` then names the option.  `others`
    are what else was found wrong in the same file.
    """

    others: Sequence["SceneError"] = ()

    def __init__(
        self,
        message: str,
        *,
        file: str | None = None,
        line: int | None = None,
        key: str = "",
        source: str | None = None,
    ) -> None:
        self.message = message
        self.file = file
        self.line = line
        self.key = key
        self.source = source
        super().__init__(str(self))

    def __str__(self) -> str:
        place = self.source or (f"{self.file}:{self.line}" if self.line is not None else self.file)
        return one_line(": ".join(part for part in (place, self.key, self.message) if part))


class Interrupted(Exception):  # noqa: N818
    """The user has interrupted the work, and a message has been printed; exit status 130."""


class SceneWarning(UserWarning):
    """Warning of a probable mistake in a scene, or of what float32 cannot hold."""


class StrictError(InputError):
    """Warnings that count as errors; `sentences` has them all."""

    def __init__(self, sentences: Sequence[str]) -> None:
        self.sentences = tuple(sentences)
        more = f" (and {len(sentences) - 1} more)" if len(sentences) > 1 else ""
        super().__init__(f"{sentences[0]}{more}")


class OutputError(Exception):
    """Reading or writing failed while the work was under way; exit status 1."""


def one_line(text: str) -> str:
    """Put a text on one line, with control characters escaped, and without the middle if it is long."""
    if len(text) > _MAX_SENTENCE:
        text = f"{text[: _MAX_SENTENCE - _SENTENCE_TAIL]} ... {text[-_SENTENCE_TAIL:]}"
    printable = (c if c.isprintable() else ascii(c)[1:-1] for c in " ".join(text.split()))
    return "".join(printable)


def closest_name(name: str, known: Iterable[str]) -> str | None:
    """Find the known name that is spelt most like `name`; None if none comes near."""
    if len(name) > _MAX_NAME:
        return None
    compared = itertools.islice((item for item in known if len(item) <= _MAX_NAME), _MAX_COMPARED)
    by_lower = {candidate.lower(): candidate for candidate in compared}
    matches = difflib.get_close_matches(name.lower(), by_lower, n=1, cutoff=0.6)
    return by_lower[matches[0]] if matches else None


def suggest_name(name: str, known: Iterable[str], noun: str) -> str:
    """End a sentence about an unknown `name`: with what it is called here, or the nearest known name, or with all."""
    names = list(known)
    if close := name_here(name, names) or closest_name(name, names):
        return f"did you mean {close!r}?"
    if name in EXPLAINED:
        return EXPLAINED[name]
    if not names:
        return f"there are no {noun}"
    listed = ", ".join(map(abbreviate, names[:_NAMES_LISTED])) + (", ..." if len(names) > _NAMES_LISTED else "")
    return f"known {noun}: {listed}"


def abbreviate(text: str) -> str:
    """Cut a text that is too long for a sentence."""
    return text if len(text) <= _MAX_TEXT else text[: _MAX_TEXT - 3] + "..."


def format_value(value: Any) -> str:
    """Format a value for a sentence: short, and in the words of YAML."""
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return repr(value).removesuffix(".0")
    if isinstance(value, str):
        return repr(abbreviate(value))
    if isinstance(value, Mapping):
        return "a mapping"
    if isinstance(value, Sequence):
        return f"a list of {len(value)}"
    return abbreviate(repr(value))
