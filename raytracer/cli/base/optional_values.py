"""Options whose value may be left out, which Typer does not know: `--tev` is `--tev 127.0.0.1:14158`."""

import re
from collections.abc import Mapping, Sequence
from typing import NamedTuple


class _OptionalValue(NamedTuple):
    """The value of an option.

    default : that of the option without a value.
    form : pattern of values, by which the next word is told from an argument.
    """

    default: str
    form: str


OPTIONAL_VALUES: Mapping[str, _OptionalValue] = {"--tev": _OptionalValue("127.0.0.1:14158", r"\S+:\d+")}
"""Options by name."""


def add_left_out_values(words: Sequence[str]) -> list[str]:
    """Add the values that a command line leaves out."""
    added: list[str] = []
    for word, following in zip(words, [*words[1:], ""], strict=False):
        added.append(word)
        value = OPTIONAL_VALUES.get(word)
        if value is not None and not re.fullmatch(value.form, following):
            added.append(value.default)
    return added
