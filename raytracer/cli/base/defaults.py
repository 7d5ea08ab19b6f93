"""Defaults of options, from a file of the user and from variables RT_...; the command line comes before both.

In rt.toml, by the names of options:

    threads = 8
    spp = 256
    max-memory = "4GB"
"""

import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from raytracer.rendering.options import OPTIONS
from raytracer.schema.units import parse_duration
from raytracer.util.errors import InputError, format_value, suggest_name

_PICTURE = ("spp", "seed", "noise", "time-limit", "denoise", "strict")
_MACHINE = ("threads", "max-memory", "cluster", "checkpoint", "progress")

KEYS = (*_PICTURE, *_MACHINE)
"""Options with defaults: those of a picture, for commands that make pictures, and those of the machine, for all."""

_MAKE_PICTURES = ("render", "sweep", "lightfield")

_PROGRESS = ("bar", "json", "off")

_FLAGS = {"1": True, "true": True, "yes": True, "on": True, "0": False, "false": False, "no": False, "off": False}


class Default(NamedTuple):
    """A default: its value, and the variable or the file that it comes from."""

    value: Any
    source: str


def defaults_file(environment: Mapping[str, str]) -> Path:
    """Return the path of the user's file, which need not be there."""
    if sys.platform == "win32":
        return Path(environment.get("APPDATA") or Path.home() / "AppData" / "Roaming") / "rt.toml"
    # The XDG Base Directory Specification has relative paths ignored.
    given = environment.get("XDG_CONFIG_HOME", "")
    if os.path.isabs(given):
        return Path(given, "rt.toml")
    # A container's user may have no home.
    home = os.path.expanduser("~")
    return Path(home if os.path.isabs(home) else os.sep, ".config", "rt.toml")


def variable(key: str) -> str:
    """Return the name of the variable for a key: RT_MAX_MEMORY for `max-memory`."""
    return f"RT_{key.replace('-', '_').upper()}"


def read_defaults(environment: Mapping[str, str]) -> dict[str, Default]:
    """Read all defaults; a variable comes before the file.

    Raises InputError: the file is no TOML, a key is unknown, or a value is wrong.
    """
    file = defaults_file(environment)
    found = {}
    for key, value in _read_file(file).items():
        found[key] = Default(_check(key, value, f"{file}: {key}"), str(file))
    for key in KEYS:
        name = variable(key)
        if text := environment.get(name):
            found[key] = Default(_check(key, text, name), name)
    return found


def default_map(words: tuple[str, ...], environment: Mapping[str, str]) -> dict[str, Any]:
    """Make the defaults of the options of the command in these words, as Typer takes them."""
    if not words or words[0].startswith("-"):
        return {}
    keys = KEYS if words[0] in _MAKE_PICTURES else _MACHINE
    values = {key.replace("-", "_"): one.value for key, one in read_defaults(environment).items() if key in keys}
    # Those of a command, or of the one below a group.
    return {words[0]: {**values, **({words[1]: values} if len(words) > 1 else {})}}


def _read_file(file: Path) -> dict[str, Any]:
    """Read the keys of a file, if it is there."""
    try:
        text = file.read_text(encoding="utf-8")
    except (FileNotFoundError, NotADirectoryError, PermissionError):
        # The folder of another user, as whom the process was started, is as good as none.
        return {}
    except (OSError, ValueError) as error:
        raise InputError(f"{file}: cannot be read: {getattr(error, 'strerror', None) or 'is not UTF-8'}") from None
    import tomllib

    try:
        values = {key.replace("_", "-"): value for key, value in tomllib.loads(text).items()}
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{file}: is not valid TOML: {error}") from None
    for key in values:
        if key not in KEYS:
            raise InputError(f"{file}: unknown key {key!r}; {suggest_name(key, KEYS, 'keys')}")
    return values


def _check(key: str, value: Any, source: str) -> Any:
    """Check a value as the option of the key would, and return it in the option's type."""
    if isinstance(value, dict | list):
        raise InputError(f"{source}: must be a single value, got {format_value(value)}")
    option = OPTIONS.get(key.replace("-", "_"))
    text = format_value(value) if isinstance(value, bool) else str(value)
    if key == "progress" and text not in _PROGRESS:
        raise InputError(f"{source}: must be {', '.join(_PROGRESS)}, got {format_value(value)}")
    if key in ("denoise", "strict"):
        if text.lower() not in _FLAGS:
            raise InputError(f"{source}: must be true or false, got {format_value(value)}")
        return _FLAGS[text.lower()]
    if option is not None and option.most:
        if not text.isdecimal() or not option.least <= int(text) <= option.most:
            limits = f"from {option.least} to {option.most}"
            raise InputError(f"{source}: must be an integer {limits}, got {format_value(value)}")
        return int(text)
    parse = parse_duration if key == "checkpoint" and text != "off" else option.parse if option else None
    try:
        if parse is not None:
            parse(text)
    except ValueError as error:
        raise InputError(f"{source}: {error}") from None
    return text
