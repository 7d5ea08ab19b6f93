"""`rt lightfield decode`: raw pictures of cameras with microlenses."""

import sys
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from typer import Argument, Option

from raytracer.cli.base import options
from raytracer.cli.base.options import takes
from raytracer.cli.base.outputs import print_json, report_written
from raytracer.cli.lightfield.base import Memory, Quiet, check_outputs, limit_memory, parse_positive
from raytracer.util.errors import InputError

if TYPE_CHECKING:
    from raytracer.lightfield.calibrating.camera import CameraModel
    from raytracer.lightfield.decoding.decoder import Decoded
    from raytracer.lightfield.decoding.focused import DecodedFocused, FocusedOptics
    from raytracer.lightfield.decoding.microlens_grid import Grid, Optics

_FOCUSED = "--microlens-focal-length"

EXAMPLE = """\b
Examples:
  rt lightfield decode raw.png --white white.png                    what the grid of microlenses is
  rt lightfield decode raw.png --white white.png --dark dark.png -o shot.lf
  rt lightfield decode raw.png --white white.png --bayer grbg -o shot.lf --views 13
  rt lightfield decode raw.png --white white.png -o shot.lf --pixel-pitch 1.4um \\
      --focal-length 9.5mm --f-number 2 --focus-distance 1.5m       distances in metres
  rt lightfield decode raw.png --white white.png --json > grid.json
  rt lightfield decode other.png --white white.png --grid grid.json -o other.lf
  rt lightfield decode IMG_0001.lfp --white caldata/ -o shot.lf     a Lytro's, with its metadata
  rt lightfield decode raw.png --white white.png --calibration camera.json -o shot.lf
  rt lightfield decode raw.png --white white.png -o shot.lf --pixel-pitch 13.3um \\
      --focal-length 80mm --f-number 4 --focus-distance 1.01m --microlens-distance 1.87mm \\
      --microlens-focal-length 1.38mm,1.45mm,1.52mm                 focused microlenses of three kinds

\b
Pictures are .png or .tif of 8 or 16 bits, .exr or .npy, in linear light, upright, all of one size.  The white picture
is of something evenly bright, at the same zoom and focus; 1.0 in the light field is as bright as it was.

\b
Containers of Lytro's, .lfp and .lfr, say themselves what colour filters and optics they are of; options say it better.
Of the white pictures that came with the camera, in a folder, data.C.0 or caldata-SERIAL.tar, the nearest in zoom and
focus is taken; 1.0 is the largest code of the sensor.
"""


def decode(
    raw: Annotated[str, Argument(metavar="RAW", help="Picture of the sensor behind microlenses; .lfp, .lfr.")],
    white: Annotated[
        str | None,
        takes(
            "WHITE",
            "Picture of something evenly bright, or a folder or archive of a Lytro's; default: the grid is sought in "
            "RAW.",
        ),
    ] = None,
    dark: Annotated[str | None, takes("DARK", "Picture without light, taken off both.")] = None,
    grid: Annotated[
        str | None, takes("GRID.json", "Grid of microlenses that --json printed, not to be sought.")
    ] = None,
    output: Annotated[Path | None, options.output("FILE.lf", "Light field to write.")] = None,
    bayer: Annotated[
        str | None,
        takes(
            "ORDER",
            "Colour filters on the first two pixels of the first two rows: rggb, bggr, grbg, gbrg "
            "(needs pip install 'raytracer[bayer]').",
        ),
    ] = None,
    views: Annotated[
        int | None,
        Option(help="Views in a row and in a column; default: the largest odd number that fits under a microlens."),
    ] = None,
    srgb: Annotated[bool, Option("--srgb", help="Files of 8 and 16 bits hold display values, not light.")] = False,
    calibration: Annotated[
        str | None, takes("CAMERA.json", "Metres, and the lens's distortion, as rt lightfield calibrate wrote them.")
    ] = None,
    pixel_pitch: Annotated[str | None, takes("LENGTH", "Of the sensor: 1.4um.")] = None,
    focal_length: Annotated[str | None, takes("LENGTH", "Of the main lens: 50mm.")] = None,
    f_number: Annotated[float | None, takes("N", "Of the main lens.")] = None,
    microlens_distance: Annotated[
        str | None,
        takes("LENGTH", "From microlenses to sensor: 25um; default: what fits the f-number, if they are not focused."),
    ] = None,
    microlens_focal_length: Annotated[
        str | None,
        takes(
            "LENGTHS",
            "Of microlenses that focus the scene on the sensor (plenoptic 2.0): one, or three of interleaved kinds, "
            "1.4mm,1.5mm,1.6mm; needs --white and all other lengths.",
        ),
    ] = None,
    focus_distance: Annotated[
        str | None,
        takes(
            "LENGTH",
            "Plane that is sharp on the microlenses, from the lens: 1.5m; default: by the metadata of a .lfp or .lfr "
            "file, else inf.  Of focused ones, the plane that those of the middle focal length show on the sensor.",
        ),
    ] = None,
    colors: Annotated[
        Literal["camera", "white"] | None,
        Option(
            help="Of a .lfp or .lfr file: by the camera's gains and matrix, or with WHITE's colour as white; default: "
            "camera."
        ),
    ] = None,
    memory: Memory = "2GB",
    as_json: options.AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Turn the raw picture of a camera with microlenses into a light field.

    Pitch, rotation and offset of the grid of microlenses are found by themselves, whether it is square or hexagonal.
    Metres need --calibration, or --pixel-pitch, --focal-length, and --f-number or --microlens-distance; without,
    distances are in pixels from view to view.  --microlens-focal-length is for focused cameras, whose pixels become
    rays, for the method of that name of rt lightfield refocus.
    """
    if output is not None:
        check_outputs([output], (".lf",), "a light field")
    options.check_f_number(f_number)
    distance = None if focus_distance is None else parse_positive("--focus-distance", focus_distance, "length")
    pitch = _length("--pixel-pitch", pixel_pitch, "um")
    focal = _length("--focal-length", focal_length, "mm")
    behind = _length("--microlens-distance", microlens_distance, "um")

    from raytracer.lightfield.decoding.decoder import decode as decode_picture
    from raytracer.lightfield.decoding.focused import decode_focused
    from raytracer.lightfield.decoding.lytro.container import is_container
    from raytracer.lightfield.decoding.lytro.decode import decode_photo
    from raytracer.lightfield.decoding.lytro.white_pictures import check_plain_white
    from raytracer.lightfield.decoding.microlens_grid import read_grid
    from raytracer.util.progress import Bar

    known = None if grid is None else read_grid(grid)
    given = {
        "--pixel-pitch": pitch,
        "--focal-length": focal,
        "--f-number": f_number,
        "--microlens-distance": behind,
        "--focus-distance": distance,
    }
    optics = _plenoptic_optics(calibration, given)
    make: Callable[..., Decoded | DecodedFocused]
    if microlens_focal_length is not None:
        others = {"--views": views, "--calibration": calibration, "--colors": colors}
        focused = _focused_optics(microlens_focal_length, given, others)
        if is_container(raw):
            raise InputError(f"{_FOCUSED}: {raw} is a photograph of a Lytro, whose microlenses are not focused")
        if white is not None:
            check_plain_white(white, raw)
        make = partial(decode_focused, optics=focused, dark=dark, bayer=bayer, srgb=srgb)
    elif is_container(raw):
        for option, value in (("--dark", dark), ("--bayer", bayer), ("--srgb", srgb or None)):
            if value is not None:
                raise InputError(f"{option}: {raw} is a container, whose metadata say that")
        make = partial(decode_photo, colors=colors or "camera", views=views, optics=optics)
    else:
        if colors is not None:
            raise InputError(f"--colors: is for photographs of a Lytro, .lfp and .lfr, and {raw} is none")
        if white is not None:
            check_plain_white(white, raw)
        make = partial(decode_picture, dark=dark, bayer=bayer, srgb=srgb, views=views, optics=optics)
    with limit_memory(memory):
        light_field = make(raw, white, grid=known)
    for note in () if quiet else light_field.notes:
        print(f"note: {note}", file=sys.stderr)
    if output is not None:
        with Bar(" views", quiet=quiet) as bar:
            light_field.write(output, bar.update)
        report_written(output, quiet=quiet)
    if as_json:
        print_json(light_field.grid.as_dict())
    elif not quiet:
        print(_summary(light_field.grid))
        size = light_field.views
        print(f"views        {size.columns} x {size.rows}, of {size.width} x {size.height} pixels")


def _plenoptic_optics(calibration: str | None, given: Mapping[str, float | None]) -> "Optics | CameraModel":
    """Return the optics of a camera by its calibration, or by the lengths that are given by option."""
    from raytracer.lightfield.calibrating.camera import read_camera
    from raytracer.lightfield.decoding.microlens_grid import Optics

    if calibration is None:
        return Optics(
            pixel_pitch=given["--pixel-pitch"],
            focal_length=given["--focal-length"],
            f_number=given["--f-number"],
            microlens_distance=given["--microlens-distance"],
            focus_distance=given["--focus-distance"],
        )
    _exclude("--calibration", given, "a calibration has the metres")
    return read_camera(calibration)


def _exclude(option: str, others: Mapping[str, object], reason: str) -> None:
    """Check that none of the options is given that exclude another one; an InputError gives the reason."""
    for other, value in others.items():
        if value is not None:
            raise InputError(f"{option} and {other} exclude each other: {reason}")


def _focused_optics(
    focal_lengths: str, given: Mapping[str, float | None], others: Mapping[str, object]
) -> "FocusedOptics":
    """Return the optics of a focused camera.

    given : all other lengths by option.
    others : options that are not for such cameras.
    """
    from raytracer.lightfield.decoding.focused import FocusedOptics

    _exclude(_FOCUSED, others, "focused cameras have no such choice")
    lengths = {option: value for option, value in given.items() if value is not None}
    for option in given:
        if option not in lengths:
            raise InputError(f"{_FOCUSED}: needs {option}, too: a pixel is a ray, which all lengths together tell")
    kinds = tuple(1e3 * _finite(_FOCUSED, part) for part in focal_lengths.split(","))
    return FocusedOptics(
        pixel_pitch=lengths["--pixel-pitch"],
        focal_length=lengths["--focal-length"],
        f_number=lengths["--f-number"],
        focus_distance=lengths["--focus-distance"],
        microlens_distance=lengths["--microlens-distance"],
        microlens_focal_lengths=kinds,
    )


def _summary(grid: "Grid") -> str:
    lattice = grid.lattice
    right, down = lattice.origin
    lines = [
        f"microlenses  {grid.layout}, {lattice.pitch:.4f} pixels apart, turned by {lattice.rotation:.4f} degrees",
        f"offset       {right:.3f}, {down:.3f} (pixels right and down, of the one nearest to the middle)",
        f"sub-images   {grid.diameter:.2f} pixels wide",
    ]
    used, measured = grid.microlenses
    if measured:
        lines.append(f"residual     {grid.residual:.3f} pixels, over {used} of {measured} microlenses")
    return "\n".join(lines)


def _length(option: str, text: str | None, unit: Literal["mm", "um"]) -> float | None:
    """Parse a finite length, in a unit; None if the option is not given."""
    if text is None:
        return None
    millimetres = _finite(option, text)
    return millimetres if unit == "mm" else 1e3 * millimetres


def _finite(option: str, text: str) -> float:
    """Parse a finite length (mm)."""
    millimetres = parse_positive(option, text, "optic")
    if millimetres == float("inf"):
        raise InputError(f"{option} {text}: must be finite")
    return millimetres
