"""Options that several commands have, and functions that parse their values and raise an InputError if they cannot."""

import functools
import inspect
import re
import sys
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from inspect import Parameter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple, TypeVar

from typer import Argument, Option

from raytracer.cli.base.completion import complete_scene
from raytracer.rendering.options import OPTIONS, RenderOptions
from raytracer.scene.preview import EDGE, SPP
from raytracer.schema.units import Dimension, parse_quantity
from raytracer.util.errors import InputError

if TYPE_CHECKING:
    from raytracer.rendering.cluster.connection import Cluster
    from raytracer.scene.spec import SceneSpec

Value = TypeVar("Value")

# Of a percentage without its sign one gets pictures that no memory holds.
_LARGEST_FACTOR = 20


def takes(metavar: str, text: str, *names: str, **limits: Any) -> Any:
    """Declare an option that takes a value, which `metavar` stands for in the help; its name is the parameter's.

    text : its help.
    names : in place of the parameter's name.
    """
    return Option(*names, metavar=metavar, help=text, **limits)


def output(metavar: str, text: str) -> Any:
    """Declare the option `--output` or `-o`; see `takes`."""
    return takes(metavar, text, "--output", "-o")


def scene_argument(text: str) -> Any:
    """Declare an argument that names a scene file, or several; `text` is its help."""
    return Argument(metavar="SCENE", help=text, autocompletion=complete_scene)


Scene = Annotated[str, scene_argument("Scene file; - for standard input.")]
Define = Annotated[
    list[str] | None, takes("KEY=VALUE", "Override a key of the scene: camera.vfov=40.", "--define", "-D")
]
AllowFiles = Annotated[
    list[str] | None,
    takes("FOLDER", "Where the scene may name files too, besides its own folder; may repeat.  Also: RT_ALLOW_FILES."),
]
Preview = Annotated[bool, Option("--preview", help=f"A quick look: at most {EDGE} pixels wide or high, {SPP} spp.")]
Size = Annotated[
    str | None,
    takes("WxH", "Pixels of the picture: 640x360, in place of film.width and film.height.  The camera stays as it is."),
]
Scale = Annotated[str | None, takes("PERCENT", "Make the picture so much smaller or larger, of the same framing: 50%.")]
Stats = Annotated[Path | None, takes("FILE.json", "Write what the render took as JSON.")]
Quiet = Annotated[bool, Option("--quiet", "-q", help="No progress and no summary.")]
Findings = Annotated[bool, Option("--quiet", "-q", help="No progress; what was found is printed.")]
AsJson = Annotated[bool, Option("--json", help="Print JSON.")]


class Invocation(NamedTuple):
    """The call of a command, which is the `obj` of its context.

    began : the time of `time.perf_counter`.
    words : those of the command line after `rt`.
    """

    began: float
    words: tuple[str, ...]


def parse_value(option: str, text: str, parse: Callable[[str], Value]) -> Value:
    """Parse the value of an option by a function that raises a ValueError if it cannot."""
    try:
        return parse(text)
    except ValueError as error:
        raise InputError(f"{option} {text}: {error}") from None


def parse_dimension(option: str, text: str, dimension: Dimension) -> float:
    """Parse a quantity that an option gives, with its unit."""
    return parse_value(option, text, lambda part: parse_quantity(part, dimension))


def check_f_number(f_number: float | None) -> None:
    """Make sure that an f-number, if there is one, is such that a lens can have an aperture of it."""
    if f_number is not None and not 0.0 < f_number < 1e6:
        raise InputError(f"--f-number {f_number:g}: must be greater than 0 and less than a million")


@contextmanager
def name_in_errors(file: str, kind: type[Exception] = InputError) -> Iterator[None]:
    """Begin what is said of wrong input, by errors of a kind, with the name of the file that it is wrong for."""
    try:
        yield
    except kind as error:
        raise InputError(f"{file}: {error}") from None


class Sizing(NamedTuple):
    """The size of a picture as `--size` or `--scale` gives it, parsed.

    size (px) : width and height.
    factor : by which the scene's own size is multiplied.
    """

    size: tuple[int, int] | None = None
    factor: float | None = None

    def of(self, width: int, height: int) -> tuple[int, int]:
        """Return the size of a picture that has width x height pixels by itself."""
        if self.size is not None:
            return self.size
        factor = 1.0 if self.factor is None else self.factor
        return max(1, round(factor * width)), max(1, round(factor * height))

    def apply(self, spec: "SceneSpec") -> "SceneSpec":
        """Give the film of a scene this size, if there is one."""
        width, height = self.of(spec.film.width, spec.film.height)
        return spec if self == Sizing() else spec.replace({"film.width": width, "film.height": height})


def parse_sizing(size: str | None, scale: str | None) -> Sizing:
    """Parse the values of `--size` and `--scale`."""
    if size is not None and scale is not None:
        raise InputError("--size and --scale exclude each other")
    return Sizing(
        None if size is None else parse_value("--size", size, _parse_size),
        None if scale is None else parse_value("--scale", scale, _parse_scale),
    )


def _parse_size(text: str) -> tuple[int, int]:
    numbers = re.fullmatch(r"([1-9]\d{0,8})x([1-9]\d{0,8})", text, re.ASCII)
    if numbers is None:
        raise ValueError("must be width and height in pixels, such as 640x360")
    return int(numbers[1]), int(numbers[2])


def _parse_scale(text: str) -> float:
    number = re.fullmatch(r"(\d{1,6}|\d{0,6}\.\d{1,6})(%?)", text, re.ASCII)
    factor = 0.0 if number is None else float(number[1]) / (100.0 if number[2] else 1.0)
    if factor == 0.0:
        raise ValueError("must be a share of the scene's own size, such as 50% or 0.5")
    if factor >= _LARGEST_FACTOR:
        raise ValueError(f"must be below {_LARGEST_FACTOR}; did you mean {text.removesuffix('%')}%?")
    return factor


def load_scene(
    file: str, define: list[str] | None, allow_files: list[str] | None, sizing: Sizing | None = None
) -> "SceneSpec":
    """Load the scene of a command, with the keys that `-D` overrides, and the size that `--size` or `--scale` gives."""
    from raytracer.scene.load import load
    from raytracer.scene.overrides import parse_overrides

    spec = load(file, parse_overrides(define or []), allow_files=allow_files or [])
    return spec if sizing is None else sizing.apply(spec)


@contextmanager
def connect_cluster(address: str | None, say: Callable[[str], object] | None = None) -> "Iterator[Cluster | None]":
    """Connect to the cluster of `--cluster` for the time of a `with` block; None stands for this machine.

    say : shows a line about workers that come and go; on stderr by default.
    """
    if address is None:
        yield None
        return
    from raytracer.rendering.cluster.connection import Cluster

    show = say or functools.partial(print, file=sys.stderr)
    with Cluster(address, say=lambda sentence: show(f"rt: {sentence}")) as cluster:
        yield cluster


# ---- Options of a render


def _flag(name: str) -> str:
    """Return the word of the command line for a field of `RenderOptions`."""
    return "--aov" if name == "aovs" else f"--{name.replace('_', '-')}"


def declare(name: str, text: str | None = None, *default: Any) -> Any:
    """Declare the option that sets a field of `RenderOptions`; `text` is its help, where a command has its own."""
    option = OPTIONS[name]
    least, most = (option.least, option.most) if option.most else (None, None)
    return Option(*default, _flag(name), metavar=option.metavar, help=text or option.help, min=least, max=most)


Seed = Annotated[int | None, declare("seed")]
Threads = Annotated[int | None, declare("threads")]
Crop = Annotated[str | None, declare("crop")]


def _parameter(name: str, text: str | None) -> Parameter:
    """Make the parameter of a command that sets a field of `RenderOptions`."""
    if name == "aovs":
        kind: object = list[str] | None
    elif OPTIONS[name].most:
        kind = int | None
    else:
        kind = bool if isinstance(getattr(RenderOptions, name), bool) else str | None
    default = False if kind is bool else None
    return Parameter(name, Parameter.KEYWORD_ONLY, default=declare(name, text, default), annotation=kind)


class GivenOptions(NamedTuple):
    """Options of a render as they are given, by the names of their fields; the parameter `given` of a command.

    words : integers, flags, and text that is still to be parsed.
    """

    words: Mapping[str, Any]

    def parse(self, suffixes: Collection[str] | None = None, remedy: str = "") -> RenderOptions:
        """Parse them.

        suffixes : of the files that the command writes; None if they hold layers whatever they are.
        remedy : options that make it write a file that holds layers, if none of these does.

        Raises InputError: one cannot be parsed, or there is no file for the AOVs.
        """
        values = {name: word for name, word in self.words.items() if word not in (None, [])}
        for name, word in values.items():
            parse = OPTIONS[name].parse
            if name == "aovs":
                values[name] = _parse_aovs(word, suffixes, remedy)
            elif parse is not None:
                values[name] = parse_value(_flag(name), word, parse)
        return RenderOptions(**values)


def render_options(*names: str, **texts: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Give a command options of a render, in place of its parameter `given`.

    names : fields of `RenderOptions`, in the order of the help.
    texts : help of those that mean something else to this command.
    """

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        signature = inspect.signature(command)
        parameters: list[Parameter] = []
        for parameter in signature.parameters.values():
            is_given = parameter.name == "given"
            parameters += [_parameter(name, texts.get(name)) for name in names] if is_given else [parameter]

        @functools.wraps(command)
        def call(**values: Any) -> None:
            words = {name: values.pop(name) for name in names}
            command(**values, given=GivenOptions(words))

        call.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]
        return call

    return decorate


def _parse_aovs(lists: Sequence[str], suffixes: Collection[str] | None, remedy: str) -> tuple[str, ...]:
    """Parse the comma-separated lists of AOVs that `--aov` gives; see `GivenOptions.parse`."""
    from raytracer.film.formats.registry import layered_suffixes

    if suffixes is not None and not any(suffix.lower() in layered_suffixes() for suffix in suffixes):
        known = " and ".join(layered_suffixes())
        raise InputError(f"--aov {lists[0]}: only {known} files hold layers: add {remedy}")
    from raytracer.kernel.aovs.base.interface import unique_aovs

    try:
        return unique_aovs([name.strip() for text in lists for name in text.split(",")])
    except InputError as error:
        raise InputError(f"--aov {','.join(lists)}: {error}") from None
