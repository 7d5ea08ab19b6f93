"""`rt lightfield import`: light fields of other programs."""

import sys
from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from raytracer.cli.base import options
from raytracer.cli.base.completion import complete_from
from raytracer.cli.base.options import takes
from raytracer.cli.base.outputs import report_written
from raytracer.cli.lightfield.base import LAYOUTS, Quiet, check_outputs, parse_positive
from raytracer.schema.units import Dimension
from raytracer.util.errors import InputError

EXAMPLE = """\b
Examples:
  rt lightfield import knights/rectified -o knights.lf
  rt lightfield import knights/rectified -o knights.lf --spacing 8mm --vfov 20 --focus-distance 1.2m
  rt lightfield import benchmark/cotton -o cotton.lf          parameters.cfg says the metres
  rt lightfield import views -o views.lf --rows 9 --columns 9
  rt lightfield import all.png -o all.lf --rows 9 --columns 9
  rt lightfield import lytro_eslf.png -o lytro.lf --rows 14 --columns 14 --interleaved
  rt lightfield import letters_qs8x6a0.75.png -o row.lf       a quilt: one row of 48 views
  rt lightfield import nerf/transforms_train.json -o nerf.lf  cameras anywhere
  rt lightfield import stereo.exr -o stereo.lf --spacing 65mm --vfov 40 --focus-distance 2m

\b
Names that are known: out_ROW_COLUMN_Y_X_.png (Stanford), input_Cam032.png (HCI), and all that end in row and column,
view_03_05.png, or in one number, by rows; NAME_qs8x6a0.75.png (Looking Glass); a folder with transforms.json (NeRF).
Also .npy of (rows, columns, height, width, 3), and .exr with several views.
"""


def import_(
    path: Annotated[
        str, Argument(metavar="PATH", help="Folder of views, picture or file of all views, or transforms.json.")
    ],
    output: Annotated[Path, options.output("FILE.lf", "File to write.")],
    layout: Annotated[
        str | None,
        takes(
            "NAME",
            "Of the views: grid, array, mosaic, interleaved, quilt, transforms or multiview.  Default: found by name.",
            autocompletion=complete_from(*LAYOUTS),
        ),
    ] = None,
    rows: Annotated[
        int | None, Option(help="Rows of views, where names and files do not say.", min=1, max=4096)
    ] = None,
    columns: Annotated[int | None, Option(help="Views in a row.", min=1, max=4096)] = None,
    spacing: Annotated[
        str | None, takes("LENGTH[,LENGTH]", "From view to view: 8mm; or to the right and down, 8mm,10mm.")
    ] = None,
    focus_distance: Annotated[
        str | None, takes("LENGTH", "Plane in which all views see the same: 1.2m; inf for parallel views.")
    ] = None,
    vfov: Annotated[str | None, takes("ANGLE", "Vertical field of view of a view.")] = None,
    focal_length: Annotated[str | None, takes("LENGTH", "Of a view's lens, with --sensor.")] = None,
    sensor: Annotated[str | None, takes("LENGTH", "Width of a view's sensor: 36mm.")] = None,
    flip: Annotated[str, takes("x|y|xy", "Axes along which places in Stanford names run the other way.")] = "",
    interleaved: Annotated[
        bool, Option("--interleaved", help="Of one picture: pixels of all views lie beside each other (ESLF).")
    ] = False,
    dtype: Annotated[
        str,
        takes(
            "TYPE",
            "Of the numbers in the file: float16, float32, float64.",
            autocompletion=complete_from("float16", "float32", "float64"),
        ),
    ] = "float32",
    allow_files: Annotated[
        list[str] | None,
        takes("FOLDER", "Where transforms.json may name files too, besides its own folder; may repeat."),
    ] = None,
    compress: Annotated[bool, Option("--compress", help="Smaller, and slower to write and to read.")] = False,
    quiet: Quiet = False,
) -> None:
    """Take over a light field of another program: write it as an .lf file.

    Metres need --spacing, --focus-distance, and --vfov or --focal-length with --sensor, unless a parameters.cfg,
    geometry.json or transforms.json says them; of the first two, each option replaces what the file says.  Without
    metres places are in steps of one view, and distances in pixels from view to view.
    """
    check_outputs([output], (".lf",), "a light field")
    if flip not in ("", "x", "y", "xy", "yx"):
        raise InputError(f"--flip {flip}: must be x, y or xy")
    steps = None if spacing is None else _spacing(spacing)
    asked: list[tuple[str, str | None, Dimension]] = [
        ("focus_distance", focus_distance, "length"),
        ("vfov", vfov, "angle"),
        ("focal_length", focal_length, "optic"),
        ("sensor", sensor, "optic"),
    ]
    lengths = {
        name: None if text is None else parse_positive(f"--{name.replace('_', '-')}", text, dimension)
        for name, text, dimension in asked
    }
    if lengths["vfov"] is not None and lengths["vfov"] >= 180.0:
        raise InputError(f"--vfov {vfov}: must be less than 180 degrees")

    from raytracer.film.light_field import lf
    from raytracer.lightfield.formats.importer import import_views
    from raytracer.util.progress import Bar

    if layout is not None and layout not in LAYOUTS:
        raise InputError(f"--layout {layout}: must be {', '.join(LAYOUTS)}")
    if dtype not in lf.TYPES:
        raise InputError(f"--dtype {dtype}: must be {', '.join(lf.TYPES)}")
    field = import_views(
        path,
        layout=layout,
        rows=rows,
        columns=columns,
        spacing=steps,
        flip=flip,
        interleaved=interleaved,
        allow_files=allow_files or (),
        **lengths,
    )
    with Bar(" rows of views", quiet=quiet) as bar:
        lf.write(output, field, dtype=dtype, compress=compress, update=bar.update)
    report_written(output, quiet=quiet)
    if not quiet and not field.is_metric:
        how = "--spacing, --focus-distance and --vfov say them"
        print(f"note: metres are not known ({how}): 1 / distance is in pixels per view", file=sys.stderr)


def _spacing(text: str) -> tuple[float, float]:
    lengths = [parse_positive("--spacing", part.strip(), "length") for part in text.split(",")]
    right, down = (lengths * 2)[:2]
    if len(lengths) > 2 or right + down == float("inf"):
        raise InputError(f"--spacing {text}: must be one length, or two, to the right and down")
    return right, down
