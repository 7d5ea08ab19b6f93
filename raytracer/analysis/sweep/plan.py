"""What a sweep is asked for: a scene, values that are the same for all points, and axes; in code, or as a file.

A file of a sweep:

    scene: cover.yaml                             # from the file's folder
    define: {film.width: 640, film.height: 360}   # the same for all points
    sweep:
      camera.f_number: 1.4..22                    # a text as on the command line
      camera.focus_distance: [4, 10, inf]         # or a list of values
    zip: false                                    # true: pairs of values in place of all combinations
"""

import os
import re
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from pydantic import Field, ValidationError

from raytracer.document import Node, error_at, parse, parse_path, read
from raytracer.errors import InputError, SceneError, shown
from raytracer.reach import AllowFiles, reach_of, unreadable
from raytracer.scene.edit import overridden
from raytracer.scene.load import check_values, load
from raytracer.scene.spec import SceneSpec
from raytracer.spec import Spec, sentence
from raytracer.sweeping.points import Axis
from raytracer.sweeping.values import Given, one_value, read_value


class Plan(NamedTuple):
    """A scene and what to do with it.

    spec, with all values that are the same for all points; name, what the scene is called; axes, keys with several
    values; zipped, whether these are taken in pairs.
    """

    spec: SceneSpec
    name: str
    axes: tuple[Axis, ...]
    zipped: bool


_MOST_KEYS = 1000
"""Of a file of a sweep, under each of its sections: each key rewrites what it is a part of."""


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


def planned(
    scene: SceneSpec | str | os.PathLike[str],
    values: Mapping[str, Any],
    *,
    zipped: bool = False,
    allow_files: AllowFiles = (),
) -> Plan:
    """The plan for a scene, a scene file, or a file of a sweep.

    Parameters
    ----------
    values : by dotted path, texts as on the command line, or lists of values; what is neither is the same for all
        points.  Those of a file of a sweep stand before these, and give way to them.
    allow_files : folders in which a scene file, or a file of a sweep, may name files, besides its own.

    Raises
    ------
    InputError : a file or a value is wrong.
    """
    given: dict[str, Given] = {}
    for key, value in values.items():
        source = f"-D {key}={value}" if isinstance(value, str) else key
        try:
            parse_path(key)
            given[key] = read_value(key, value, source)
        except ValueError as error:
            raise InputError(f"{source}: {error}") from None
    if isinstance(scene, SceneSpec):
        name = scene.file or "scene"
        return _plan(name, given, zipped, partial(overridden, scene))
    root = _sweep_root(Path(scene))
    if root is not None:
        asked, own = _read_file(root, os.fspath(scene), allow_files)
        given, zipped = {**own, **given}, zipped or asked.zip
        scene = Path(scene).parent / asked.scene
    return _plan(os.fspath(scene), given, zipped, partial(load, scene, allow_files=allow_files))


def parse_definitions(definitions: Iterable[str]) -> dict[str, str]:
    """The texts of `-D` options, each `key.path=text`, by key.

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


def _plan(name: str, given: Mapping[str, Given], zipped: bool, build: Callable[[dict[str, Any]], SceneSpec]) -> Plan:
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
    """The tree of a file of a sweep; None for a scene file."""
    text = read(str(path))
    if not _SWEEP_KEY.search(text):
        return None
    root = parse(text, str(path))
    return root if root is not None and root.entries is not None and "sweep" in root.entries else None


def _read_file(root: Node, file: str, allow_files: AllowFiles) -> tuple[SweepSpec, dict[str, Given]]:
    """What a file of a sweep says, and the values in it.

    Raises
    ------
    SceneError : something in it is wrong.
    """
    try:
        asked = SweepSpec.model_validate(root.plain())
    except ValidationError as error:
        found = [error_at(sentence(item), item["loc"], root, file) for item in error.errors(include_url=False)]
        raise min(found, key=lambda item: item.line or 0) from None
    reach = reach_of(Path(file).parent, allow_files)
    path = Path(file).parent / asked.scene
    if not reach.holds(asked.scene):
        raise error_at(reach.refusal(asked.scene), ("scene",), root, file)
    if reason := unreadable(path):
        raise error_at(f"{shown(asked.scene)} {reason}", ("scene",), root, file)
    if not os.path.exists(path):
        raise error_at(f"there is no file {shown(asked.scene)} in {reach.folder}", ("scene",), root, file)
    within = reach_of(path.parent, allow_files)
    given = {
        key: _at(root, file, "define", key, lambda key, value, source: Given(one_value(key, value), fixed=True))
        for key in asked.define
    }
    for key in asked.sweep:
        if key in asked.define:
            raise error_at(f"{key!r} is under define too", ("sweep", key), root, file)
        given[key] = _at(root, file, "sweep", key, read_value)
    for section, keys in (("define", asked.define), ("sweep", asked.sweep)):
        for key in keys:
            try:
                check_values(given[key].axis.values, within)
            except ValueError as error:
                raise error_at(str(error), (section, key), root, file) from None
    return asked, given


def _at(root: Node, file: str, section: str, key: str, read: Callable[[str, Any, str], Given]) -> Given:
    """The values of a key under a section of a file."""
    _, node = (root.entries or {})[section]
    place, value = (node.entries or {})[key]
    try:
        parse_path(key)
        return read(key, value.plain(), f"{file}:{place.line}: {section}.{key}")
    except ValueError as error:
        raise SceneError(str(error), file=file, line=place.line, key=f"{section}.{key}") from None
