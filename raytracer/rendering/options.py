"""The options of a render: one record, of which the command line's options and the keywords of Python are made."""

import functools
import inspect
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any, NamedTuple, ParamSpec, TypeVar

from raytracer.schema.units import parse_bytes, parse_duration, parse_percentage

if TYPE_CHECKING:
    from raytracer.scene.spec import SceneSpec

Given = ParamSpec("Given")
Record = TypeVar("Record")
Result = TypeVar("Result")


class Option(NamedTuple):
    """An option of the command line.

    help : what it does.
    metavar : stands for its value in the help.
    parse : parses its value, and raises a ValueError where it cannot; None for integers, flags and names.
    least, most : range of an integer.
    """

    help: str
    metavar: str | None = None
    parse: Callable[[str], object] | None = None
    least: int = 0
    most: int = 0


def parse_crop(text: str) -> tuple[int, int, int, int]:
    """Parse the pixel bounds `X0,Y0,X1,Y1`.

    Raises
    ------
    ValueError : they are not four integers.
    """
    try:
        left, top, right, bottom = map(int, text.split(","))
    except ValueError:
        raise ValueError("must be four integers, X0,Y0,X1,Y1") from None
    return left, top, right, bottom


# Counters of the kernels have so many bits, and a machine may have so many threads.
_SPP = Option("Samples per pixel.", least=1, most=2**31 - 1)
_SEED = Option("Seed of all random numbers.", least=0, most=2**32 - 1)
_THREADS = Option("Threads that work.  Default: all.", least=1, most=1024)
_CROP = Option("Render only the pixels X0 <= x < X1, Y0 <= y < Y1.", "X0,Y0,X1,Y1", parse_crop)
_NOISE = Option(
    "Stop when the picture's relative error is down to this: 1%, 0.01.  Samples go where they are needed; --spp is "
    "then the most that a pixel may get.  Default: no limit.",
    "PERCENT",
    parse_percentage,
)
_TIME_LIMIT = Option(
    "Be done after this time, from start to written files: 30s, 5 min.  Samples go where they are needed, unless --spp "
    "says how many a pixel gets at most.",
    "TIME",
    parse_duration,
)
_AOVS = Option(
    "What else to record, as layers of an .exr or .lf file: depth, distance, normal, geometric_normal, albedo, "
    "position, motion, object_id, material_id, direct, indirect, coverage, samples, variance, rays.  May repeat; see "
    "docs/aovs.md.",
    "NAME,...",
)
_DENOISE = Option(
    "Take out the noise with Intel Open Image Denoise (pip install 'raytracer[denoise]').  The picture is then biased, "
    "and its header says so; an .exr file keeps the layer `noisy`."
)
_STRICT = Option(
    "Take warnings for errors, and fail if a sample is not finite, or a pixel below zero without a reason."
)
_MAX_MEMORY = Option(
    "Refuse to start what would take more memory than this: 4GB, 500 MB.  Default: what is free.",
    "SIZE",
    lambda text: int(parse_bytes(text)),
)


@dataclass(frozen=True, kw_only=True)
class RenderOptions:
    """The options of a render, as they are asked for; `checked_options.check_options` checks them.

    spp : samples per pixel, in place of the scene's.
    seed : in place of the scene's.
    threads : threads that render; all processors if None.
    crop (px) : (x0, y0, x1, y1), only the pixels x0 <= x < x1, y0 <= y < y1.  They are those of the whole picture, but
        that `exposure: auto` and `white_balance: auto` measure these alone, and a Bayer mosaic ends at their edges.
    noise : relative error to stop at, 0.01 for 1 %.  Samples go where they are needed, at most `spp` a pixel, without a
        limit if that is None.
    time_limit (s) : time after which the image is to be there, loading included; sampling then ends early, but no
        sooner than with 8 samples a pixel.  Without `spp` samples go where they are needed.
    aovs : names of AOVs, or one name, which become layers of the image (docs/aovs.md); the radiance keeps its bits.
    denoise : True to denoise the image with Open Image Denoise, which makes it biased.
    strict : True to take warnings for errors.
    max_memory (bytes) : memory that this process may take; what the machine has, as far as it is known, if None.
    """

    spp: int | None = field(default=None, metadata={"option": _SPP})
    seed: int | None = field(default=None, metadata={"option": _SEED})
    threads: int | None = field(default=None, metadata={"option": _THREADS})
    crop: tuple[int, int, int, int] | None = field(default=None, metadata={"option": _CROP})
    noise: float | None = field(default=None, metadata={"option": _NOISE})
    time_limit: float | None = field(default=None, metadata={"option": _TIME_LIMIT})
    aovs: Sequence[str] = field(default=(), metadata={"option": _AOVS})
    denoise: bool = field(default=False, metadata={"option": _DENOISE})
    strict: bool = field(default=False, metadata={"option": _STRICT})
    max_memory: int | None = field(default=None, metadata={"option": _MAX_MEMORY})

    def __post_init__(self) -> None:
        """Make a tuple of the names of AOVs."""
        object.__setattr__(self, "aovs", (self.aovs,) if isinstance(self.aovs, str) else tuple(self.aovs))

    def as_keywords(self) -> dict[str, Any]:
        """Return the options that are not their defaults, by name, without those that a record has besides."""
        given = {known.name: (getattr(self, known.name), known.default) for known in fields(RenderOptions)}
        return {name: value for name, (value, default) in given.items() if value != default}

    @property
    def is_adaptive(self) -> bool:
        """Tell if samples go where they are needed."""
        return self.noise is not None or (self.time_limit is not None and self.spp is None)

    def spp_limit(self, spec: "SceneSpec") -> int | None:
        """Return the samples per pixel of a scene's picture, or the most of them; None without a limit."""
        if self.spp is not None:
            return self.spp
        return None if self.is_adaptive else spec.render.spp


OPTIONS: Mapping[str, Option] = {known.name: known.metadata["option"] for known in fields(RenderOptions)}
"""Options of the command line, by the names of the fields that they set."""


def called_with(
    record: Callable[Given, Record], *, without: Collection[str] = ()
) -> Callable[[Callable[[Record], Result]], Callable[Given, Result]]:
    """Have a function that takes a record called with the record's fields, which help and completion then show.

    without : fields that it does not take.
    """
    fields_of_record = inspect.signature(record).parameters.values()
    parameters = [parameter for parameter in fields_of_record if parameter.name not in without]

    def decorate(function: Callable[[Record], Result]) -> Callable[Given, Result]:
        signature = inspect.signature(function).replace(parameters=parameters)

        @functools.wraps(function)
        def call(*given: Given.args, **keywords: Given.kwargs) -> Result:
            try:
                signature.bind(*given, **keywords)
            except TypeError as error:
                raise TypeError(f"{function.__name__}() {error}") from None
            return function(record(*given, **keywords))

        call.__signature__ = signature  # type: ignore[attr-defined]
        return call

    return decorate
