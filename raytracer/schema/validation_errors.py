"""Say in one sentence what pydantic found wrong, with the file, the line and the key."""

import re
from collections.abc import Mapping, Sequence
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from raytracer.schema.yaml_nodes import KeyPath, Node, locate, path_text
from raytracer.util.errors import SceneError, format_value, suggest_name

_MAX_ERRORS_SORTED = 200
"""Errors that are sorted by their line: to sort them takes time in proportion to the square of their number."""

_MAX_ERRORS_TOLD = 10

_BRANCH = re.compile(r"(function-\w+|tuple)\[.*\]", re.DOTALL)
"""Names that pydantic gives the branches of a union, in paths."""


def error_sentence(error: ErrorDetails) -> str:
    """Translate one of pydantic's errors to the words of YAML: the end of a sentence that begins with the path."""
    kind, given, context = error["type"], format_value(error["input"]), error.get("ctx", {})
    if kind == "value_error":
        return str(context["error"])
    if kind == "missing":
        last = error["loc"][-1]
        return "is missing" if isinstance(last, str) else f"is missing; the list needs at least {last + 1} values"
    if kind == "literal_error":
        known = [name.strip("'") for name in context["expected"].replace(" or ", ", ").split(", ")]
        return f"must be one of {', '.join(known)}, got {given}" + _meant(error["input"], known)
    if kind in ("too_short", "too_long"):
        bound = "at least" if kind == "too_short" else "at most"
        length = context["min_length"] if kind == "too_short" else context["max_length"]
        # pydantic does not count a mapping to its end.
        got = "more" if context["actual_length"] is None else context["actual_length"]
        return f"must hold {bound} {length} values, got {got}"
    if kind == "string_too_short":
        return "must not be empty"
    wanted = {
        "bool": "true or false",
        "string": "a string",
        "int": "an integer",
        "float": "a number",
        "tuple": "a list",
        "list": "a list",
        "dict": "a mapping",
        "model": "a mapping",
    }.get(kind.removesuffix("_type").removesuffix("_parsing"))
    if wanted:
        return f"must be {wanted}, got {given}"
    message = str(error["msg"])
    return message.replace("Input should be", "must be", 1) + (f", got {given}" if "Input should be" in message else "")


def _meant(value: Any, known: list[str]) -> str:
    hint = suggest_name(value, known, "") if isinstance(value, str) else ""
    return f"; {hint}" if hint.startswith("did you mean") else ""


def error_at(message: str, keys: KeyPath, root: Node | None, file: str | None, *, typed: bool = True) -> SceneError:
    """Make an error about the value at `keys` of the document `root`, with its line or the option that it came from.

    typed : as in `locate`.
    """
    if root is None:
        return SceneError(message, file=file, key=path_text(keys))
    place, path = locate(root, keys, typed=typed)
    return SceneError(message, file=file, line=place.line or None, key=path_text(path), source=place.option)


def first_error(error: ValidationError, root: Node | None, file: str | None) -> SceneError:
    """Return the error that stands first in the document, and as its `others` the next of it.

    Of the first `_MAX_ERRORS_SORTED` that pydantic lists.
    """
    items = _join_branches(error.errors(include_url=False)[:_MAX_ERRORS_SORTED])
    # pydantic counts only the right items of a list, so a list with a wrong item may seem too short as well.
    wrong = [
        item
        for item in items
        if item["type"] != "too_short" or not any(_is_below(other["loc"], item["loc"]) for other in items)
    ]
    errors = [error_at(error_sentence(item), item["loc"], root, file) for item in wrong]
    # A value of which several things could be made has an error of each.
    by_place: dict[object, SceneError] = {}
    for item in errors:
        by_place.setdefault((item.source, item.line, item.key), item)
    first, *others = sorted(by_place.values(), key=lambda item: (item.source is None, item.line or 0))
    first.others = others[: _MAX_ERRORS_TOLD - 1]
    return first


def _join_branches(items: Sequence[ErrorDetails]) -> list[ErrorDetails]:
    """Replace the errors of all branches of a union, each with the branch's name in its path, by those of the value.

    They are those of a list's items, if a branch takes a list of that length; else one of the value, which says of what
    length a list may be.
    """
    joined: list[ErrorDetails] = []
    unions: dict[KeyPath, dict[str, list[ErrorDetails]]] = {}
    for item in items:
        path = item["loc"]
        at, branch = next(
            ((at, step) for at, step in enumerate(path) if isinstance(step, str) and _BRANCH.fullmatch(step)), (0, "")
        )
        if not branch:
            joined.append(item)
            continue
        of_value: ErrorDetails = {**item, "loc": (*path[:at], *path[at + 1 :])}
        unions.setdefault(path[:at], {}).setdefault(branch, []).append(of_value)
    for path, branches in unions.items():
        of_items = [errors for errors in branches.values() if all(_is_of_item(error, path) for error in errors)]
        joined += of_items[0] if of_items else [_of_all(branches)]
    return joined


def _is_of_item(error: ErrorDetails, path: KeyPath) -> bool:
    """Tell if an error is of an item of the list at a path, not of that list or its length."""
    is_missing = error["type"] == "missing" and len(error["loc"]) == len(path) + 1
    return _is_below(error["loc"], path) and not is_missing


def _of_all(branches: Mapping[str, Sequence[ErrorDetails]]) -> ErrorDetails:
    """Return the error of the first branch of a union, with the lists that other branches take."""
    first = next(iter(branches.values()))[0]
    wanted, is_told, got = error_sentence(first).rpartition(", got ")
    lists = "".join(f", or a list of {_items(branch)}" for branch in branches if branch.startswith("tuple["))
    if not is_told or not lists:
        return first
    return {**first, "type": "value_error", "ctx": {"error": f"{wanted}{lists}{is_told}{got}"}}


def _items(branch: str) -> int:
    """Count the items of a tuple by the name that pydantic gives it: `tuple[...]`, with a name for each."""
    depth, count = 0, 1
    for letter in branch:
        depth += (letter in "[(") - (letter in "])")
        count += letter == "," and depth == 1
    return count


def _is_below(path: KeyPath, above: KeyPath) -> bool:
    return len(path) > len(above) and path[: len(above)] == above
