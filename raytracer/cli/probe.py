"""`rt probe`: the radiance along one ray, or along all that come to a point."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Option

from raytracer.cli.base import options
from raytracer.cli.base.options import takes
from raytracer.cli.base.outputs import join_paths, print_json, report_written, say, warn
from raytracer.schema.units import Dimension
from raytracer.util.errors import InputError, Interrupted

if TYPE_CHECKING:
    from raytracer.analysis.probe import ProbeResult
    from raytracer.rendering.session import Rendered

EXAMPLE = """\b
Examples:
  rt probe scenes/cornell.yaml --at 278,278,-800 --toward 278,278,0
  rt probe scenes/cornell.yaml --at 278,10,278 --direction 0,1,0 --json
  rt probe scenes/prism.yaml --at 0,0,1 --toward 0,0,0 --wavelength 550nm
  rt probe scenes/bouncing.yaml --at 13,2,3 --toward 0,1,0 --time 0.5
  rt probe scenes/cover.yaml --at 4,1,2 -o sphere.exr -o sphere.png

\b
The number is the radiance of the light that comes to `--at` from the side of `--toward`, in the scene's unit, with its
standard error.  With -o it is a picture of all directions, equirectangular, with `--toward` (or -z) in its middle.
"""


@options.render_options(
    "spp",
    "seed",
    "threads",
    "strict",
    spp="Samples: of the ray, 65536 by default; with -o of each pixel, the scene's number by default.",
    strict="Take warnings for errors.",
)
def probe(
    scene: options.Scene,
    *,
    at: Annotated[str, takes("X,Y,Z", "The point (m) that light comes to.", "--at")],
    toward: Annotated[str | None, takes("X,Y,Z", "A point (m) that it comes from, or past.")] = None,
    direction: Annotated[str | None, takes("X,Y,Z", "Or the direction in which one looks from `--at`.")] = None,
    time: Annotated[
        str | None, takes("TIME", "Time of the scene: 0.5, 20ms.  Default: when its shutter opens.")
    ] = None,
    wavelength: Annotated[
        str | None,
        takes(
            "NM",
            "Spectral radiance at this wavelength, 380 to 780 nm, relative to that of white light (D65).  "
            "Default: red, green and blue.",
        ),
    ] = None,
    output: Annotated[
        list[Path] | None, options.output("FILE", "A picture of all directions, .exr .hdr .npy .png .jpg; may repeat.")
    ] = None,
    width: Annotated[
        int | None, Option(help="With -o: pixels across, twice as many as down.  Default: 1024.", min=2)
    ] = None,
    define: options.Define = None,
    allow_files: options.AllowFiles = None,
    given: options.GivenOptions,
    as_json: options.AsJson = False,
    quiet: Annotated[bool, Option("--quiet", "-q", help="No progress.")] = False,
) -> None:
    """Measure the plenoptic function: the radiance that comes to a point out of a direction, or out of all."""
    outputs = output or []
    for path in outputs:
        if path.suffix.lower() == ".lf":
            raise InputError(f"{path}: a picture of all directions from one point is no light field: write an .exr")
    _check(toward, direction, width, outputs, as_json=as_json)
    start = _point("--at", at)
    ahead = None if toward is None else _point("--toward", toward)
    look = None if direction is None else _point("--direction", direction, "number")
    scene_time = None if time is None else options.parse_dimension("--time", time, "time")
    nm = None if wavelength is None else options.parse_dimension("--wavelength", wavelength, "wavelength")

    wanted: dict[str, Any] = {"toward": ahead, "time": scene_time, "wavelength": nm, **given.parse().as_keywords()}

    from raytracer.analysis.probe import WIDTH, probe_sphere
    from raytracer.analysis.probe import probe as measure
    from raytracer.film.image_file import check_writable
    from raytracer.rendering.progress import SampleBar

    spec = options.load_scene(scene, define, allow_files)
    for path in outputs:
        check_writable(path)
    with SampleBar(quiet=quiet) as bar:
        wanted |= {"progress": bar.show, "warn": warn}
        if outputs:
            _write(probe_sphere(spec, start, width=width or WIDTH, **wanted), outputs, quiet=quiet)
            return
        measurement = measure(spec, start, direction=look, **wanted)
    if as_json:
        print_json(measurement.json())
    else:
        print(_format(measurement))


def _check(toward: str | None, direction: str | None, width: int | None, outputs: list[Path], *, as_json: bool) -> None:
    """Refuse options that do not go together."""
    if toward is not None and direction is not None:
        raise InputError("--toward and --direction both say where to look: give one of them")
    if outputs and direction is not None:
        raise InputError("--direction is of one ray, and -o is a picture of all: --toward says what is in its middle")
    if outputs and as_json:
        raise InputError("--json prints the radiance of one ray, and -o is a picture of all: give one of them")
    if not outputs and toward is None and direction is None:
        raise InputError("give --toward X,Y,Z or --direction X,Y,Z for one ray, or -o FILE for a picture of all")
    if width is not None and not outputs:
        raise InputError("--width is of the picture that -o FILE writes")


def _write(rendered: "Rendered", outputs: list[Path], *, quiet: bool) -> None:
    """Write the picture of all directions."""
    for path in outputs:
        rendered.image.save(path)
        report_written(path, quiet=quiet)
    if rendered.interrupted:
        say(f"interrupted; {join_paths(outputs)} has fewer samples than were asked for")
        raise Interrupted


def _format(measurement: "ProbeResult") -> str:
    """Format a measurement as lines of text."""
    light = (
        "red, green, blue" if measurement.wavelength is None else f"at {measurement.wavelength:g} nm, relative to D65"
    )
    dropped = f", and {measurement.dropped} that were not finite" if measurement.dropped else ""
    lines = [
        f"at               {_numbers(measurement.at)} m",
        f"towards          {_numbers(measurement.towards)}",
        f"time             {measurement.time:g} s",
        f"radiance         {_numbers(measurement.radiance)}  ({light})",
        f"standard error   {_numbers(measurement.standard_error)}",
        f"samples          {measurement.samples}{dropped}",
    ]
    return "\n".join(lines)


def _numbers(values: tuple[float, ...]) -> str:
    # No sign of zero.
    return "  ".join(f"{value + 0.0:.6g}" for value in values)


def _point(option: str, text: str, dimension: Dimension = "length") -> list[float]:
    parts = text.split(",")
    if len(parts) != len("xyz"):
        raise InputError(f"{option} {text}: must be three numbers, X,Y,Z")
    return [options.parse_dimension(option, part, dimension) for part in parts]
