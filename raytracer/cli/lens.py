"""`rt lens`: a lens by itself, its import from other programs' files, and its distortion."""

import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer
import typer.core
from typer import Argument, Option

from raytracer.cli.base import options
from raytracer.cli.base.options import takes
from raytracer.cli.base.outputs import check_files, print_json, report_written, to_json, warn
from raytracer.util.errors import InputError

if TYPE_CHECKING:
    from raytracer.analysis.lens_design.performance.results import Settings
    from raytracer.optics.lens_system.lens import Lens

EXAMPLE = """\b
Examples:
  rt lens scenes/lenses/double-gauss-50mm.yaml
  rt lens scenes/lenses/double-gauss-50mm.yaml --f-number 5.6 --focus-distance 2m
  rt lens scenes/lenses/double-gauss-50mm.yaml -o outputs/gauss.html -o outputs/gauss.svg
  rt lens scenes/lenses/double-gauss-50mm.yaml --wavelengths d,F,C --json

\b
Other commands on lenses:
  rt lens import FILE [-o LENS.yaml]       take over a .dat or .zmx file: rt lens import --help
  rt lens distortion FILE [-o MAP.npz]     distortion, and OpenCV's models of it: rt lens distortion --help
"""

EXAMPLE_IMPORT = """\b
Example:
  rt lens import wide.22mm.dat -o wide.yaml
  rt lens import table.dat --thickness before -o table.yaml
  rt lens import achromat.zmx
"""

EXAMPLE_DISTORTION = """\b
Examples:
  rt lens distortion scenes/lenses/wide-22mm.yaml
  rt lens distortion scenes/lenses/wide-22mm.yaml --width 1920 -o outputs/wide.npz -o outputs/wide.yaml

\b
With OpenCV, a picture that was made through the lens is straightened by
  maps = numpy.load("outputs/wide.npz")
  straight = cv2.remap(picture, maps["map_x"], maps["map_y"], cv2.INTER_CUBIC)
"""

_DEFAULT = "report"

File = Annotated[str, Argument(metavar="FILE", help="Lens file: .yaml, or .dat or .zmx of other programs.")]
Number = Annotated[float | None, takes("N", "Stop down to this; default: wide open.")]
Distance = Annotated[str, takes("LENGTH", "Plane that is sharp, from the entrance pupil: 2m.")]
Sensor = Annotated[
    str | None,
    takes(
        "SIZE",
        "A sensor's name, or width and height: aps_c, 36x24 (mm).  Default: full_frame, or as much of it as the "
        "lens's image circle holds.",
    ),
]
Wavelengths = Annotated[
    str,
    takes(
        "NM,...",
        "Wavelengths (nm), or the lines d, F, C; the first is focused on, chromatic aberration is between the others.",
    ),
]
Quiet = Annotated[bool, Option("--quiet", "-q", help="Print no summary.")]


class _WithDefault(typer.core.TyperGroup):
    """A group whose first command runs when the first word names no other command."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        if not args or args[0] not in self.commands:
            args = [_DEFAULT, *args]
        return super().parse_args(ctx, args)


lens = typer.Typer(
    cls=_WithDefault,
    rich_markup_mode=None,
    add_completion=False,
    help="Show a lens by itself: its numbers, aberrations and cross-section.",
)


@lens.command(_DEFAULT, epilog=EXAMPLE)
def report(
    file: File,
    output: Annotated[
        list[Path] | None,
        options.output(
            "OUT", "A report, .html or .pdf; the cross-section, .svg or .png; or all numbers, .json.  May repeat."
        ),
    ] = None,
    f_number: Number = None,
    focus_distance: Distance = "inf",
    sensor: Sensor = None,
    wavelengths: Wavelengths = "d,F,C",
    as_json: options.AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Show a lens by itself: first-order data, aberrations, spots, MTF, Seidel sums, tolerances.

    Numbers come by ray transfer matrices and by rays that are traced through its surfaces.
    """
    from raytracer.analysis.lens_design.report_files import find_writer

    outputs = output or []
    writers = [find_writer(path) for path in outputs]
    settings = _settings(f_number, focus_distance, sensor, wavelengths)
    check_files(outputs)

    from raytracer.analysis.lens_design import text
    from raytracer.analysis.lens_design.performance.lens_study import study_lens
    from raytracer.scene.assets.lenses import read_lens
    from raytracer.util.atomic_write import write_bytes

    lens = read_lens(Path(file))
    warnings = _report_import(file, lens, quiet=quiet)
    with options.name_in_errors(file, ValueError):
        studied = study_lens(lens, _fit_settings(settings, sensor, lens))
    # What cannot be drawn is known before anything is written.
    contents = [make(lens, studied) for make in writers]
    for path, content in zip(outputs, contents, strict=True):
        write_bytes(path, content)
        report_written(path, quiet=quiet)
    if as_json:
        print_json(studied.as_dict(), ensure_ascii=False)
    elif not quiet:
        # Warnings that stderr has already.
        notes = tuple(note for note in studied.notes if note.reason not in warnings)
        print(text.summary(studied._replace(notes=notes)), end="")


@lens.command("import", epilog=EXAMPLE_IMPORT)
def import_file(
    file: Annotated[str, Argument(metavar="FILE", help="Table of another program: .dat (pbrt) or .zmx (Zemax).")],
    output: Annotated[Path | None, options.output("LENS.yaml", "Lens file to write; default: stdout.")] = None,
    glass: Annotated[
        list[str] | None,
        takes("NAME=INDEX/ABBE", "What a glass is that is not in the catalogue: SK16=1.62041/60.3.  May repeat."),
    ] = None,
    thickness: Annotated[
        Literal["after", "before"] | None,
        takes(
            "PLACE",
            "Where thickness stands in a .dat table: in the row of the surface before the way (after it), or of "
            "that behind it (before it).  Default: decided by the numbers.",
        ),
    ] = None,
    quiet: Annotated[bool, Option("--quiet", "-q", help="Say nothing but warnings.")] = False,
) -> None:
    """Take over another program's lens: write it as a lens file.

    Of .zmx files the sequential surfaces that are round, in air, with glasses of the catalogue or by index and Abbe
    number; what is none of these is an error that says so.
    """
    from raytracer.optics.lens_system.importers import Choices, as_yaml, import_lens, parse_glasses
    from raytracer.util.atomic_write import write_bytes

    if output is not None:
        if output.suffix.lower() not in (".yaml", ".yml"):
            raise InputError(f"{output}: a lens file is written as .yaml")
        check_files([output])
    if thickness is not None and not file.lower().endswith(".dat"):
        raise InputError(f"--thickness {thickness}: goes with tables, .dat; {file} says itself where it stands")
    try:
        glasses = parse_glasses(glass or [])
    except ValueError as error:
        raise InputError(f"--glass: {error}") from None
    imported_file = import_lens(Path(file), Choices(glasses, thickness))
    _report_import(file, imported_file.lens(), quiet=quiet)
    text = as_yaml(imported_file.spec)
    if output is None:
        print(text, end="")
        return
    write_bytes(output, text.encode())
    report_written(output, quiet=quiet)


@lens.command("distortion", epilog=EXAMPLE_DISTORTION)
def distortion(
    file: File,
    output: Annotated[
        list[Path] | None,
        options.output(
            "OUT",
            "The maps and their inverse, .npz; OpenCV's model of them, .yaml; or all numbers but the maps, "
            ".json.  May repeat.",
        ),
    ] = None,
    width: Annotated[int, Option(help="Pixels across the sensor.", min=2, max=16_384)] = 1200,
    ideal: Annotated[
        Literal["rectilinear", "equidistant"] | None,
        takes(
            "NAME",
            "Projection to compare with: rectilinear or equidistant.  Default: rectilinear, and equidistant for "
            "lenses that see 65 degrees from the axis or more.",
        ),
    ] = None,
    f_number: Number = None,
    focus_distance: Distance = "inf",
    sensor: Sensor = None,
    wavelengths: Wavelengths = "d",
    as_json: options.AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Trace a lens's distortion over the sensor, and fit OpenCV's models to it.

    The residual of each model is said: how far it is from the traced rays, in pixels.
    """
    from raytracer.util.safe_open import check_suffix

    outputs = output or []
    for path in outputs:
        if path.suffix.lower() != ".yml":
            check_suffix(path, (".npz", ".yaml", ".json"), "a map of distortion")
    settings = _settings(f_number, focus_distance, sensor, wavelengths)
    check_files(outputs)

    from raytracer.analysis.lens_design.distortion_maps import distortion_map as maps
    from raytracer.analysis.lens_design.performance.optical_bench import set_up_bench
    from raytracer.scene.assets.lenses import read_lens
    from raytracer.util.atomic_write import write_bytes

    lens = read_lens(Path(file))
    _report_import(file, lens, quiet=quiet)
    with options.name_in_errors(file, ValueError):
        result = maps.trace_distortion_map(
            set_up_bench(lens, _fit_settings(settings, sensor, lens)), width, ideal=ideal
        )
    as_text = to_json(maps.as_dict(result))
    for path in outputs:
        kind = path.suffix.lower()
        if kind == ".json":
            write_bytes(path, as_text.encode())
        else:
            write_bytes(path, maps.to_npz(result) if kind == ".npz" else maps.to_opencv_yaml(result))
        report_written(path, quiet=quiet)
    if as_json:
        print(as_text, end="")
    elif not quiet:
        print(maps.to_text(result), end="")


# ---- What commands share


def _settings(f_number: float | None, focus_distance: str, sensor: str | None, wavelengths: str) -> "Settings":
    from raytracer.analysis.lens_design.performance.results import Settings

    options.check_f_number(f_number)
    distance = 1000.0 * options.parse_dimension("--focus-distance", focus_distance, "length")
    if distance <= 0.0:
        raise InputError(f"--focus-distance {focus_distance}: must be greater than 0")
    size = _sensor(sensor or "full_frame")
    return Settings(
        f_number=f_number, focus_distance_mm=distance, sensor_mm=size, wavelengths_nm=_wavelengths(wavelengths)
    )


def _fit_settings(settings: "Settings", sensor: str | None, lens: "Lens") -> "Settings":
    """Fit settings to a lens: without --sensor, choose one that its image circle covers."""
    from raytracer.optics.lens_system.lens_setup import widest_f_number

    # What is engraved on a lens is rounded, and stands for wide open.
    engraved, wanted = lens.f_number, settings.f_number
    if wanted is not None and engraved is not None and engraved <= wanted < widest_f_number(lens):
        settings = settings._replace(f_number=None)
    diagonal = math.hypot(*settings.sensor_mm)
    if sensor is not None or lens.image_circle is None or lens.image_circle >= diagonal:
        return settings
    width, height = settings.sensor_mm
    share = lens.image_circle / diagonal
    return settings._replace(sensor_mm=(share * width, share * height))


def _sensor(text: str) -> tuple[float, float]:
    """Parse a sensor's name or size to its width and height (mm)."""
    from raytracer.optics.sensor_formats import SENSORS, SensorSpec

    parts = text.lower().split("x")
    if len(parts) == 2 and text not in SENSORS:
        width, height = (options.parse_dimension("--sensor", part, "optic") for part in parts)
        if not (0.0 < width < 1e4 and 0.0 < height < 1e4):
            raise InputError(f"--sensor {text}: must be larger than 0 and smaller than 10 m")
        return width, height
    from pydantic import ValidationError

    try:
        size = SensorSpec(format=text).size()
    except ValidationError as error:
        reason = str(error.errors()[0]["msg"]).removeprefix("Value error, ")
        raise InputError(f"--sensor {text}: {reason}; or a size such as 36x24 (mm)") from None
    assert size is not None
    return size.width, size.height


def _wavelengths(text: str) -> tuple[float, ...]:
    from raytracer.optics.glass import LINE_C, LINE_D, LINE_F

    lines = {"d": LINE_D, "f": LINE_F, "c": LINE_C}
    wavelengths = []
    for part in text.split(","):
        name = part.strip().lower().removesuffix("nm").strip()
        try:
            nm = lines[name] if name in lines else float(name)
        except ValueError:
            raise InputError(f"--wavelengths {text}: must be wavelengths in nm, or the lines d, F, C") from None
        if not 300.0 <= nm <= 2500.0:
            raise InputError(f"--wavelengths {text}: must be from 300 to 2500 nm")
        if nm in wavelengths:
            raise InputError(f"--wavelengths {text}: has {part.strip()} twice")
        wavelengths.append(nm)
    return tuple(wavelengths)


def _report_import(file: str, lens: "Lens", *, quiet: bool) -> list[str]:
    """Say how an ambiguous file was read; warn of what is probably a mistake in the lens, and return these warnings."""
    from raytracer.optics.lens_system.warnings import lens_warnings

    if lens.reading is not None and not lens.reading.is_guess and not quiet:
        print(f"{file}: {lens.reading.text}", file=sys.stderr)
    warnings = lens_warnings(lens)
    for warning in warnings:
        warn(f"{file}: {warning}")
    return warnings
