"""Plan of a sweep: a scene, values that are the same for all points, and axes, from code or a sweep file; its points.

A file of a sweep:

    scene: cover.yaml                             # from the file's folder
    define: {film.width: 640, film.height: 360}   # the same for all points
    sweep:
      camera.f_number: 1.4..22                    # a string as on the command line
      camera.focus_distance: [4, 10, inf]         # or a list of values
    zip: false                                    # true: pairs of values in place of all combinations
"""

import math
import os
import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

from pydantic import Field, ValidationError

from raytracer.analysis.sweep.parse_values import ParsedValues, parse_value, single_value
from raytracer.analysis.sweep.results import Axis, SweepPoint
from raytracer.scene.files import check_names_allowed
from raytracer.scene.load import load
from raytracer.scene.overrides import apply_overrides
from raytracer.scene.spec import SceneSpec
from raytracer.schema.spec import Spec
from raytracer.schema.validation_errors import error_at, error_sentence
from raytracer.schema.yaml_nodes import Node, parse_path
from raytracer.schema.yaml_parser import parse, read
from raytracer.util.errors import InputError, SceneError, format_value
from raytracer.util.path_sandbox import AllowFiles, make_sandbox, unreadable_reason

MAX_POINTS = 1000
"""Most points of a sweep unless more are asked for: a slip of a count should not fill a disk."""

_NAME_LENGTH = 150
"""Letters of a file's stem; with four bytes a letter and a suffix, what file systems hold would be 255 bytes."""

# Letters that no file system, shell or address gives a meaning of its own.
_UNSAFE = re.compile(r"[^\w.,=+-]+")


class Plan(NamedTuple):
    """A scene and its axes.

    spec : the scene, with all values that are the same for all points.
    name : of the scene.
    axes : keys with several values.
    zipped : True if these are taken in pairs.
    """

    spec: SceneSpec
    name: str
    axes: tuple[Axis, ...]
    zipped: bool


_MOST_KEYS = 1000
"""Most keys in each section of a sweep file: each key rewrites what it is a part of."""


class SweepSpec(Spec):
    """A file of a sweep."""

    scene: str = Field(description="Scene file, from the folder of this file")
    sweep: dict[str, Any] = Field(
        max_length=_MOST_KEYS, description="Values by key of the scene: a text as after -D, or a list"
    )
    define: dict[str, Any] = Field(
        default={}, max_length=_MOST_KEYS, description="Values that are the same for all points, by key"
    )
    zip: bool = Field(default=False, description="Whether values are taken in pairs, in place of all combinations")


def make_plan(
    scene: SceneSpec | str | os.PathLike[str],
    values: Mapping[str, Any],
    *,
    zipped: bool = False,
    allow_files: AllowFiles = (),
) -> Plan:
    """Make the plan for a scene, a scene file, or a sweep file.

    Parameters
    ----------
    values : by dotted path, strings as on the command line, or lists of values; what is neither is the same for all
        points.  Those of a sweep file come before these, and are overridden by them.
    allow_files : folders in which a scene file, or a file of a sweep, may name files, besides its own.

    Raises
    ------
    InputError : a file or a value is wrong.
    """
    given: dict[str, ParsedValues] = {}
    for key, value in values.items():
        source = f"-D {key}={value}" if isinstance(value, str) else key
        try:
            parse_path(key)
            given[key] = parse_value(key, value, source)
        except ValueError as error:
            raise InputError(f"{source}: {error}") from None
    if isinstance(scene, SceneSpec):
        name = scene.file or "scene"
        return _plan(name, given, zipped, partial(apply_overrides, scene))
    root = _sweep_root(Path(scene))
    if root is not None:
        content, own = _read_file(root, os.fspath(scene), allow_files)
        given, zipped = {**own, **given}, zipped or content.zip
        scene = Path(scene).parent / content.scene
    return _plan(os.fspath(scene), given, zipped, partial(load, scene, allow_files=allow_files))


def parse_definitions(definitions: Iterable[str]) -> dict[str, str]:
    """Parse `-D` options, each `key.path=text`, to strings by key.

    Raises
    ------
    InputError : an option without `=`, or a key that is given twice.
    """
    result: dict[str, str] = {}
    for definition in definitions:
        key, equals, text = definition.partition("=")
        if not equals:
            raise InputError(f"-D {definition}: must be key.path=values, such as camera.f_number=1.4,2,2.8")
        if key in result:
            raise InputError(f"-D {definition}: {key} is given twice")
        result[key] = text
    return result


def _plan(
    name: str, given: Mapping[str, ParsedValues], zipped: bool, build: Callable[[dict[str, Any]], SceneSpec]
) -> Plan:
    fixed = {key: one.axis.values[0] for key, one in given.items() if one.fixed}
    axes = tuple(one.axis for one in given.values() if not one.fixed)
    # A scene may be whole only with a value for each key.
    first = {axis.key: axis.values[0] for axis in axes}
    try:
        spec = build({**fixed, **first})
    except SceneError as error:
        try:
            spec = build(fixed)
        except SceneError:
            raise error from None
    return Plan(spec, name, axes, zipped)


# ---- Files of sweeps

_SWEEP_KEY = re.compile(r"""\bsweep["']?\s*:""")


def _sweep_root(path: Path) -> Node | None:
    """Parse a sweep file to its tree; None for a scene file."""
    text = read(str(path))
    if not _SWEEP_KEY.search(text):
        return None
    root = parse(text, str(path))
    return root if root is not None and root.entries is not None and "sweep" in root.entries else None


def _read_file(root: Node, file: str, allow_files: AllowFiles) -> tuple[SweepSpec, dict[str, ParsedValues]]:
    """Read a sweep file, and the values in it.

    Raises
    ------
    SceneError : something in it is wrong.
    """
    try:
        content = SweepSpec.model_validate(root.plain())
    except ValidationError as error:
        errors = [error_at(error_sentence(item), item["loc"], root, file) for item in error.errors(include_url=False)]
        raise min(errors, key=lambda item: item.line or 0) from None
    sandbox = make_sandbox(Path(file).parent, allow_files)
    path = Path(file).parent / content.scene
    if not sandbox.allows(content.scene):
        raise error_at(sandbox.refusal_message(content.scene), ("scene",), root, file)
    if reason := unreadable_reason(path):
        raise error_at(f"{format_value(content.scene)} {reason}", ("scene",), root, file)
    if not os.path.exists(path):
        raise error_at(f"there is no file {format_value(content.scene)} in {sandbox.folder}", ("scene",), root, file)
    within = make_sandbox(path.parent, allow_files)
    given = {
        key: _at(root, file, "define", key, lambda key, value, _: single_value(key, value)) for key in content.define
    }
    for key in content.sweep:
        if key in content.define:
            raise error_at(f"{key!r} is under define too", ("sweep", key), root, file)
        given[key] = _at(root, file, "sweep", key, parse_value)
    for section, keys in (("define", content.define), ("sweep", content.sweep)):
        for key in keys:
            try:
                check_names_allowed(given[key].axis.values, within)
            except ValueError as error:
                raise error_at(str(error), (section, key), root, file) from None
    return content, given


def _at(root: Node, file: str, section: str, key: str, read: Callable[[str, Any, str], ParsedValues]) -> ParsedValues:
    """Parse the values of a key under a section of a sweep file."""
    _, node = (root.entries or {})[section]
    place, value = (node.entries or {})[key]
    try:
        parse_path(key)
        return read(key, value.plain(), f"{file}:{place.line}: {section}.{key}")
    except ValueError as error:
        raise SceneError(str(error), file=file, line=place.line, key=f"{section}.{key}") from None


# ---- Points


def enumerate_points(axes: Sequence[Axis], *, zipped: bool = False, most: int = MAX_POINTS) -> tuple[SweepPoint, ...]:
    """Enumerate the points of axes: all combinations of their values, or pairs of them.

    Raises
    ------
    InputError : no axes, more than `most` points, or axes of different lengths that were to be zipped.
    """
    if not axes:
        raise InputError(
            "nothing to sweep: give a key several values, such as -D camera.f_number=1.4,2,2.8 or "
            "-D camera.focus_distance=2:10:5"
        )
    lengths = [len(axis.values) for axis in axes]
    if zipped and len(set(lengths)) > 1:
        counts = ", ".join(f"{axis.key} has {len(axis.values)}" for axis in axes)
        raise InputError(f"--zip takes the values of all keys in pairs, so each needs as many: {counts}")
    count = lengths[0] if zipped else math.prod(lengths)
    if count > most:
        sizes = "" if zipped or len(axes) == 1 else f" ({' x '.join(map(str, lengths))})"
        raise InputError(f"the sweep has {count:,} points{sizes}, more than the {most:,} that --max-points allows")
    indices = [(i,) * len(axes) for i in range(count)] if zipped else list(product(*map(range, lengths)))
    parts = [_name_parts(axis, key) for axis, key in zip(axes, _short_keys(axes), strict=True)]
    names = ["_".join(part[i] for part, i in zip(parts, index, strict=True)) for index in indices]
    shared = Counter(name.casefold() for name in names)
    points = []
    for index, name in zip(indices, names, strict=True):
        values = {axis.key: axis.values[i] for axis, i in zip(axes, index, strict=True)}
        fits = len(name.encode()) <= _NAME_LENGTH and shared[name.casefold()] == 1
        points.append(SweepPoint(index, values, name if fits else "point_" + "_".join(str(i + 1) for i in index)))
    return tuple(points)


def _short_keys(axes: Sequence[Axis]) -> list[str]:
    """Shorten keys for names of files: to their last steps, but for keys whose last step is another's too."""
    steps = [re.split(r"[.\[\]]+", axis.key.rstrip("]")) for axis in axes]
    last = [step[-1] for step in steps]
    return [_safe(own[-1] if last.count(own[-1]) == 1 else ".".join(own)) for own in steps]


def _name_parts(axis: Axis, key: str) -> list[str]:
    """Make the part of a file's name for each value, as `f_number=2.8`; all differ, whatever their case."""
    texts = [_safe(label) for label in axis.labels]
    times = Counter(text.casefold() for text in texts)
    return [
        f"{key}={text}" if text and times[text.casefold()] == 1 else f"{key}={text}.{i + 1}"
        for i, text in enumerate(texts)
    ]


def _safe(text: str) -> str:
    """Turn a text into a part of a file's name: `1/125 s` is `1-125s`, `[-1, 0, 0]` is `-1,0,0`."""
    marked = _UNSAFE.sub("\0", re.sub(r"\s+", "", text))
    return marked.strip("\0.").replace("\0", "-")
