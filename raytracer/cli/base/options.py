"""Options that several commands have, and functions that parse their values."""

from collections.abc import Callable, Collection, Sequence
from pathlib import Path
from typing import Annotated, NamedTuple

import typer

from raytracer.scene.preview import EDGE, SPP
from raytracer.schema.units import Dimension, parse_bytes, parse_quantity
from raytracer.util.errors import InputError

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
Preview = Annotated[
    bool, typer.Option("--preview", help=f"A quick look: at most {EDGE} pixels wide or high, {SPP} spp.")
]
Stats = Annotated[Path | None, typer.Option(metavar="FILE.json", help="Write what the render took as JSON.")]
StrictSamples = Annotated[
    bool,
    typer.Option(
        "--strict",
        help="Take warnings for errors, and fail if a sample is not finite, or a pixel below zero without a reason.",
    ),
]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="No progress and no summary.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON.")]


class Invocation(NamedTuple):
    """The call of a command, which is the `obj` of its context.

    began : the time of `time.perf_counter`.
    words : those of the command line after `rt`.
    """

    began: float
    words: tuple[str, ...]


def parse_number(option: str, text: str, parse: Callable[[str], float]) -> float:
    """Parse the number that an option gives with a function of `raytracer.schema.units`.

    Raises
    ------
    InputError : it is none, and why.
    """
    try:
        return parse(text)
    except ValueError as error:
        raise InputError(f"{option} {text}: {error}") from None


def parse_dimension(option: str, text: str, dimension: Dimension) -> float:
    """Parse a quantity that an option gives, with its unit.

    Raises
    ------
    InputError : it is none, and why.
    """
    return parse_number(option, text, lambda part: parse_quantity(part, dimension))


def check_f_number(f_number: float | None) -> None:
    """Make sure that an f-number, if there is one, is such that a lens can have an aperture of it.

    Raises
    ------
    InputError : it is not.
    """
    if f_number is not None and not 0.0 < f_number < 1e6:
        raise InputError(f"--f-number {f_number:g}: must be greater than 0 and less than a million")


def parse_memory_size(option: str, text: str | None) -> int | None:
    """Parse an amount of memory in bytes; None if the option is not given.

    Raises
    ------
    InputError : it is no amount of memory.
    """
    return None if text is None else int(parse_number(option, text, parse_bytes))


def parse_crop(text: str | None) -> tuple[int, int, int, int] | None:
    """Parse the pixel bounds of `--crop X0,Y0,X1,Y1`.

    Raises
    ------
    InputError : they are not four integers.
    """
    if text is None:
        return None
    try:
        left, top, right, bottom = map(int, text.split(","))
    except ValueError:
        raise InputError(f"--crop {text}: must be four integers, X0,Y0,X1,Y1") from None
    return left, top, right, bottom


def parse_aovs(lists: Sequence[str], suffixes: Collection[str] | None = None, remedy: str = "") -> tuple[str, ...]:
    """Parse the comma-separated lists of AOVs that `--aov` gives.

    Parameters
    ----------
    suffixes : of the files that the command writes; None if they hold layers whatever they are.
    remedy : options that make it write a file that holds layers, if none of these does.

    Raises
    ------
    InputError : there is no such AOV, or no file for it.
    """
    if not lists:
        return ()
    from raytracer.film.formats.registry import layered_suffixes

    if suffixes is not None and not any(suffix.lower() in layered_suffixes() for suffix in suffixes):
        known = " and ".join(layered_suffixes())
        raise InputError(f"--aov {lists[0]}: only {known} files hold layers: add {remedy}")
    from raytracer.kernel.aovs.base.recording import unique_aovs

    try:
        return unique_aovs([name.strip() for text in lists for name in text.split(",")])
    except InputError as error:
        raise InputError(f"--aov {','.join(lists)}: {error}") from None
