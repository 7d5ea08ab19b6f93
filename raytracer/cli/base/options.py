"""Options that several commands have, and what they mean."""

import shlex
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from raytracer.errors import InputError
from raytracer.units import parse_bytes, parse_duration

if TYPE_CHECKING:
    from raytracer.cluster import Cluster

Define = Annotated[
    list[str] | None,
    typer.Option("--define", "-D", metavar="KEY=VALUE", help="Override a key of the scene: camera.vfov=40."),
]
Spp = Annotated[int | None, typer.Option(help="Samples per pixel.", min=1, max=2**31 - 1)]
Seed = Annotated[int | None, typer.Option(help="Seed of all random numbers.", min=0, max=2**32 - 1)]
Threads = Annotated[int | None, typer.Option(help="Threads that work.  Default: all.", min=1, max=1024)]
Crop = Annotated[
    str | None, typer.Option(metavar="X0,Y0,X1,Y1", help="Render only the pixels X0 <= x < X1, Y0 <= y < Y1.")
]
AllowFiles = Annotated[
    list[str] | None,
    typer.Option(
        "--allow-files",
        metavar="FOLDER",
        help="Where the scene may name files too, besides its own folder; may repeat.  Also: RT_ALLOW_FILES.",
        show_default=False,
    ),
]
MaxMemory = Annotated[
    str | None,
    typer.Option(
        metavar="SIZE",
        help="Refuse to start what would take more memory than this: 4GB, 500 MB.  Default: what is free.",
        show_default=False,
    ),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON.")]


class Call(NamedTuple):
    """How a command was called, which is its context's `obj`.

    began, the time of `time.perf_counter`; words, those of the command line after `rt`.
    """

    began: float
    words: tuple[str, ...]


def number(option: str, text: str, parse: Callable[[str], float]) -> float:
    """The number that an option gives, by a function of `raytracer.units`.

    Raises
    ------
    InputError : it is none, and why.
    """
    try:
        return parse(text)
    except ValueError as error:
        raise InputError(f"{option} {text}: {error}") from None


def size(option: str, text: str | None) -> int | None:
    """The bytes that an option gives; None if it is not given.

    Raises
    ------
    InputError : it is no amount of memory.
    """
    return None if text is None else int(number(option, text, parse_bytes))


def crop(text: str | None) -> tuple[int, int, int, int] | None:
    """The pixels that `--crop X0,Y0,X1,Y1` names.

    Raises
    ------
    InputError : they are not four whole numbers.
    """
    if text is None:
        return None
    try:
        left, top, right, bottom = map(int, text.split(","))
    except ValueError:
        raise InputError(f"--crop {text}: must be four whole numbers, X0,Y0,X1,Y1") from None
    return left, top, right, bottom


def aovs(lists: Sequence[str], remedy: str | None) -> tuple[str, ...]:
    """The AOVs that `--aov` names, in comma-separated lists.

    Parameters
    ----------
    remedy : how to have a file that holds layers written, where none is.

    Raises
    ------
    InputError : there is no such AOV, or no file for it.
    """
    if not lists:
        return ()
    if remedy is not None:
        raise InputError(f"--aov {lists[0]}: only .exr and .lf files hold layers: add {remedy}")
    from raytracer.aovs.recording import known_aovs

    try:
        return known_aovs([name.strip() for text in lists for name in text.split(",")])
    except InputError as error:
        raise InputError(f"--aov {','.join(lists)}: {error}") from None


def checkpoint(text: str | None) -> float | None:
    """Seconds between the checkpoints that `--checkpoint TIME|off` asks for; None for none.

    Raises
    ------
    InputError : it is no time.
    """
    from raytracer.checkpoints import EVERY

    if text is None:
        return EVERY
    return None if text == "off" else number("--checkpoint", text, parse_duration)


def resuming(words: Sequence[str]) -> str:
    """The command line that goes on where one with these words, after `rt`, has ended."""
    return shlex.join(["rt", *(word for word in words if word != "--resume"), "--resume"])


@contextmanager
def machines(address: str | None) -> "Iterator[Cluster | None]":
    """The cluster at an address; None for this machine."""
    if address is None:
        yield None
        return
    from raytracer.cluster import Cluster

    with Cluster(address, say=lambda sentence: print(f"rt: {sentence}", file=sys.stderr)) as cluster:
        yield cluster
