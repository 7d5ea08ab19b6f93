"""What a target is, and one execution of it: what it may raise, and how what it must not raise is written down."""

import contextlib
import functools
import importlib
import re
import shutil
import traceback
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import raytracer
from raytracer.util.errors import InputError, OutputError, SceneWarning

CORPUS = Path(__file__).parent / "corpus"
"""What fuzzing has found, a folder a target; each is loaded by a test since."""

SECONDS_LIMIT = 5
"""Longer than this no input may take."""

MEMORY_LIMIT = 2**29
"""Bytes of memory that an input of a few kilobytes may take at most."""

_SOURCES = Path(raytracer.__file__).parent
_TARGETS = Path(__file__).parent / "targets"


class Target(NamedTuple):
    """A loader that is fuzzed: small valid files of every kind that it takes, and what loads bytes in a folder.

    The dictionary is of words of the format; an input has at most `max_length` bytes, and may ask for at most
    `address_limit` bytes of address space, whether it uses them or not.
    """

    name: str
    seeds: Callable
    run: Callable
    dictionary: list[bytes]
    max_length: int
    address_limit: int


_KNOWN = {}


def target(name, *, seeds, file=None, words="", max_length=4096, address_limit=2**30):
    """Declare a function of bytes and a folder, or of the path of a `file` that holds the bytes, as a target.

    It may raise InputError, or OutputError, and nothing else; what it has loaded it checks: that numbers are finite,
    indices within range, sizes within their limits.

    seeds : a list, or a function that makes them.
    words : of the dictionary, with ~ between them; bytes that are no UTF-8 as of `surrogateescape`.
    """

    def declare(load):
        def run(data, folder):
            path = folder / file
            path.write_bytes(data)
            load(path)

        dictionary = [word.encode(errors="surrogateescape") for word in words.split("~") if word]
        made = seeds if callable(seeds) else lambda: seeds
        _KNOWN[name] = Target(name, made, run if file else load, dictionary, max_length, address_limit)
        return load

    return declare


def _modules():
    """Modules by the names of the targets that they declare, read off their sources: importing is done later."""
    sources = {path.stem: path.read_text(encoding="utf-8") for path in sorted(_TARGETS.glob("*.py"))}
    return {
        name: stem for stem in sources for name in re.findall(r'^@?target\(\s*"(\w+)"', sources[stem], re.MULTILINE)
    }


def target_names():
    return sorted(name for name in _modules() if not name.startswith("planted"))


def load_target(name):
    importlib.import_module(f"tests.fuzz.targets.{_modules()[name]}")
    return _KNOWN[name]


@contextlib.contextmanager
def strict():
    """Numerical and other warnings are errors: users would read them among the sentences. Those for users are not."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for harmless in (SceneWarning, DeprecationWarning, PendingDeprecationWarning, ResourceWarning):
            warnings.simplefilter("ignore", harmless)
        yield


def execute(target, data, folder):
    """Load `data`; what is raised is no refusal."""
    with contextlib.suppress(InputError, OutputError):
        target.run(data, folder)


def emptied(folder):
    """Remove what an execution has left in its folder."""
    for path in folder.iterdir():
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        else:
            path.unlink()


# ---- Findings: mistakes by where they lie, an input and a text each


def write_finding(folder, name, data, text):
    """Keep a finding, unless there is one of its name with a shorter input; `text` is one, or makes it."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{name}.input"
    if path.exists() and path.stat().st_size <= len(data):
        return
    path.write_bytes(data)
    path.with_suffix(".txt").write_text(text if isinstance(text, str) else text(), encoding="utf-8")


def write_exception(folder, error, data):
    """Keep an exception, named by its class and the innermost line of raytracer that it went through."""
    found = "nowhere"
    for frame, line in traceback.walk_tb(error.__traceback__):
        if place := _place(frame.f_code.co_filename):
            found = f"{place}-{line}"
    text = lambda: "".join(traceback.format_exception(error, limit=-200, chain=True))  # noqa: E731
    write_finding(folder, f"{type(error).__name__}-{found}", data, text)


def write_stack(folder, kind, stack, data):
    """Keep the end of a process without an exception, named by the stack that `faulthandler` wrote."""
    lines = re.findall(r'File "(.*)", line (\d+)', stack)
    places = (f"{place}-{line}" for file, line in lines if (place := _place(file)))
    write_finding(folder, f"{kind}-{next(places, 'unknown')}", data, stack)


@functools.cache
def _place(file):
    """`film.light_field.lf` of a source file of raytracer, `targets.lenses` of targets; None of any other."""
    for base in (_SOURCES, _TARGETS.parent):
        if base in Path(file).parents:
            return ".".join(Path(file).relative_to(base).with_suffix("").parts)
    return None


def findings_in(folder):
    """Names of what has been found."""
    return sorted(path.stem for path in folder.glob("*.input"))
