"""`rt lightfield calibrate`: intrinsics of a light-field camera, by pictures of a checkerboard."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Argument, Option

from raytracer.cli.base import options
from raytracer.cli.base.options import takes
from raytracer.cli.base.outputs import print_json, report_written
from raytracer.cli.lightfield.base import Memory, Quiet, check_outputs, limit_memory, parse_positive
from raytracer.util.errors import InputError

if TYPE_CHECKING:
    from raytracer.film.light_field.field import LightField
    from raytracer.lightfield.calibrating.bundle_adjustment import Calibration

EXAMPLE = """\b
Examples:
  rt lightfield calibrate one.lf two.lf three.lf four.lf --corners 8x6 --square 20mm -o camera.json
  rt lightfield calibrate board*.png --white white.png --corners 8x6 --square 20mm -o camera.json
  rt lightfield decode raw.png --white white.png --calibration camera.json -o shot.lf

\b
The board must be seen whole in the middle view, and be tilted by 20 degrees and more, to different sides; the nearest
should be half as far away as the farthest.  Six to ten pictures are enough.
"""


def calibrate(
    pictures: Annotated[
        list[str], Argument(metavar="PICTURE...", help="Light fields, .lf, or raw pictures of a board.")
    ],
    corners: Annotated[str, takes("COLUMNSxROWS", "Inner corners of the board: 8x6.")],
    square: Annotated[str, takes("LENGTH", "Edge of a square of the board: 20mm.")],
    output: Annotated[Path | None, options.output("CAMERA.json", "Calibration to write.")] = None,
    white: Annotated[str | None, takes("WHITE", "White picture of raw ones; see rt lightfield decode.")] = None,
    dark: Annotated[str | None, takes("DARK", "Dark picture of raw ones.")] = None,
    grid: Annotated[str | None, takes("GRID.json", "Grid of microlenses of raw pictures.")] = None,
    bayer: Annotated[str | None, takes("ORDER", "Colour filters of raw pictures: rggb, bggr, grbg, gbrg.")] = None,
    views: Annotated[int | None, Option(help="Views of raw pictures, in a row and in a column.")] = None,
    distortion: Annotated[
        bool, Option("--distortion/--no-distortion", help="Estimate the lens's distortion; else it is 0.")
    ] = True,
    memory: Memory = "2GB",
    as_json: options.AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Estimate the intrinsics of a light-field camera by pictures of a checkerboard.

    Pixels, axis, spacing of the views, plane of focus and distortion of the lens are found together with the poses of
    the board.  `rt lightfield decode --calibration` makes views in metres, and without distortion, by them.
    """
    if output is not None:
        check_outputs([output], (".json",), "a calibration")
    size = parse_positive("--square", square, "length")

    from raytracer.lightfield.calibrating.calibrate import as_dict, to_json
    from raytracer.lightfield.calibrating.calibrate import calibrate as estimate
    from raytracer.lightfield.decoding.decoder import decode as decode_picture
    from raytracer.lightfield.decoding.lytro.white_pictures import check_plain_white
    from raytracer.lightfield.decoding.microlens_grid import read_grid
    from raytracer.util.atomic_write import write_bytes

    grids = [] if grid is None else [read_grid(grid)]

    def decode_raw(picture: str | Path) -> "LightField":
        if white is not None:
            check_plain_white(white, picture)
        known = grids[0] if grids else None
        decoded = decode_picture(picture, white, dark=dark, grid=known, bayer=bayer, views=views)
        if white is not None:
            # The grid of the white picture is that of all.
            grids.append(decoded.grid)
        # The last note is that there are no metres.
        for note in () if quiet else decoded.notes[:-1]:
            print(f"note: {picture}: {note}", file=sys.stderr)
        return decoded.light_field()

    with limit_memory(memory):
        found = estimate(pictures, _parse_corners(corners), size, decode=decode_raw, distorted=distortion)
    if output is not None:
        write_bytes(output, to_json(found))
        report_written(output, quiet=quiet)
    if as_json:
        print_json(as_dict(found))
    elif not quiet:
        print(_summary(found))


def _parse_corners(text: str) -> tuple[int, int]:
    try:
        columns, rows = (int(part) for part in text.lower().split("x"))
    except ValueError:
        raise InputError(f"--corners {text}: must be two numbers, of inner corners in a row and of rows: 8x6") from None
    return columns, rows


def _summary(found: "Calibration") -> str:
    camera, errors = found.camera, found.errors
    focus = "infinity" if camera.inverse_focus == 0.0 else f"{1.0 / camera.inverse_focus:.5g} m"
    right, down = (1e3 * length for length in camera.spacing)
    lines = [
        f"pixel           {camera.pixel:.6g} at a distance of 1 (+- {errors[0]:.2%})",
        f"axis            {camera.centre[0]:.2f}, {camera.centre[1]:.2f} pixels (+- {errors[1]:.2f}, {errors[2]:.2f})",
        f"view to view    {right:.5g} mm to the right, {down:.5g} mm down (+- {errors[3]:.2%}, {errors[4]:.2%})",
        f"focus distance  {focus}",
        f"distortion      {camera.distortion[0]:.4g}, {camera.distortion[1]:.4g} (+- {errors[6]:.2g}, {errors[7]:.2g})",
        f"residual        {found.residual:.3f} pixels, {1e3 * found.residual_rays:.3f} mm at the board, RMS",
        f"corners         {found.corners} in {len(found.poses)} pictures",
    ]
    return "\n".join(lines)
