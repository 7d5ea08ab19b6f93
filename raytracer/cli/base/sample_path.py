"""The options `--pixel`, `--sample` and `--debug` of `rt render`: the path of one sample."""

import shlex
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from raytracer.cli.base.options import GivenOptions
from raytracer.cli.base.outputs import print_json
from raytracer.util.errors import InputError

if TYPE_CHECKING:
    from raytracer.rendering.options import RenderOptions
    from raytracer.scene.spec import SceneSpec


def parse_pixel(text: str) -> tuple[int, int]:
    """Parse the pixel of `--pixel X,Y`."""
    try:
        x, y = map(int, text.split(","))
    except ValueError:
        raise InputError(f"--pixel {text}: must be two integers, X,Y") from None
    return x, y


def check_debug_options(pixel: tuple[int, int] | None, sample: int | None, *, is_on: bool, as_json: bool) -> None:
    """Refuse --debug without --pixel, and options of it without --debug."""
    if is_on and pixel is None:
        raise InputError("--debug needs --pixel X,Y, the pixel whose path it is to print")
    for name, given in (("--pixel", pixel is not None), ("--sample", sample is not None), ("--json", as_json)):
        if given and not is_on:
            raise InputError(f"{name} needs --debug, which prints the path of one sample")


def print_path(
    spec: "SceneSpec", pixel: tuple[int, int], sample: int | None, options: "RenderOptions", *, as_json: bool
) -> None:
    """Print the path of one sample; see `path_debug.trace_sample`."""
    from raytracer.rendering.path_debug import trace_sample
    from raytracer.rendering.path_text import format_path

    path = trace_sample(spec, pixel, sample, options)
    if as_json:
        print_json(path.json())
    else:
        print(format_path(path), end="")


class DebugCommand(NamedTuple):
    """The options of a render that decide what a sample of its picture is, as they were given."""

    scene: str
    define: list[str]
    preview: bool
    given: GivenOptions

    def line(self, pixel: Sequence[int], sample: int | None = None) -> str:
        """Return the command line that prints the path of a sample."""
        words = ["rt", "render", self.scene]
        for text in self.define:
            words += ["-D", text]
        words += ["--preview"] if self.preview else []
        for name in ("spp", "seed", "noise", "time_limit"):
            value = self.given.words[name]
            words += [] if value is None else [f"--{name.replace('_', '-')}", str(value)]
        words += ["--pixel", ",".join(map(str, pixel))]
        words += [] if sample is None else ["--sample", str(sample)]
        return shlex.join([*words, "--debug"])
