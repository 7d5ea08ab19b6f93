"""What goes wrong by a user's doing, each in one sentence that can be printed as it is."""

import difflib
import itertools
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

_NAMES_LISTED = 16
_TEXT_SHOWN = 40

_SENTENCE_SHOWN, _END_SHOWN = 2000, 500
"""Characters of a sentence that are printed, and how many of them are its last: a name may have millions."""

_LONGEST_NAME, _NAMES_COMPARED = 100, 2000
"""What is compared to find the nearest name takes the product of both lengths, and as often as there are names."""


class InputError(Exception):
    """A wrong command line or input file; exit status 2."""


class SceneError(InputError):
    """A wrong scene file: where it is wrong (`file`, `line` from 1, `key` as a path) and what is wrong there.

    `file` and `line` are None where the value came from the command line; `source` then names the option.
    """

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
    """The user has ended the work early, and has been told so; exit status 130."""


class SceneWarning(UserWarning):
    """Something in a scene that is probably not meant, or that numbers cannot hold."""


class StrictError(InputError):
    """Warnings that were to count as errors; `sentences` has them all."""

    def __init__(self, sentences: Sequence[str]) -> None:
        self.sentences = tuple(sentences)
        more = f" (and {len(sentences) - 1} more)" if len(sentences) > 1 else ""
        super().__init__(f"{sentences[0]}{more}")


class OutputError(Exception):
    """Reading or writing failed while the work was under way; exit status 1."""


def one_line(text: str) -> str:
    """`text` on one line, with what a terminal would act upon written out, and without the middle if it is long."""
    if len(text) > _SENTENCE_SHOWN:
        text = f"{text[: _SENTENCE_SHOWN - _END_SHOWN]} ... {text[-_END_SHOWN:]}"
    printable = (c if c.isprintable() else ascii(c)[1:-1] for c in " ".join(text.split()))
    return "".join(printable)


def nearest(name: str, known: Iterable[str]) -> str | None:
    """The known name that is spelt most like `name`, or None where none comes near."""
    if len(name) > _LONGEST_NAME:
        return None
    compared = itertools.islice((item for item in known if len(item) <= _LONGEST_NAME), _NAMES_COMPARED)
    by_lower = {candidate.lower(): candidate for candidate in compared}
    found = difflib.get_close_matches(name.lower(), by_lower, n=1, cutoff=0.6)
    return by_lower[found[0]] if found else None


def suggestion(name: str, known: Iterable[str], noun: str) -> str:
    """End of a sentence about an unknown `name`: the nearest known name, or all of them where none comes near."""
    names = list(known)
    if close := nearest(name, names):
        return f"did you mean {close!r}?"
    if not names:
        return f"there are no {noun}"
    listed = ", ".join(map(shortened, names[:_NAMES_LISTED])) + (", ..." if len(names) > _NAMES_LISTED else "")
    return f"known {noun}: {listed}"


def shortened(text: str) -> str:
    """The beginning of a text that would swamp a sentence."""
    return text if len(text) <= _TEXT_SHOWN else text[: _TEXT_SHOWN - 3] + "..."


def shown(value: Any) -> str:
    """A value as a sentence names it: short, and in the words of YAML."""
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return repr(value).removesuffix(".0")
    if isinstance(value, str):
        return repr(shortened(value))
    if isinstance(value, Mapping):
        return "a mapping"
    if isinstance(value, Sequence):
        return f"a list of {len(value)}"
    return shortened(repr(value))
