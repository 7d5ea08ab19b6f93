"""`rt lightfield export`: light fields for other programs, and for displays."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Option

from raytracer.cli.base import options
from raytracer.cli.base.completion import complete_from
from raytracer.cli.base.options import takes
from raytracer.cli.base.outputs import report_written
from raytracer.cli.lightfield.base import LAYOUTS, File, Quiet, open_any, parse_distance, parse_positive
from raytracer.report.wording import format_percent
from raytracer.schema.units import parse_bytes
from raytracer.util.errors import InputError

if TYPE_CHECKING:
    from raytracer.lightfield.formats.base.light_field_format import Exported

DEVICES = (
    *("portrait", "go", "16-landscape", "16-portrait", "32-landscape", "32-portrait", "65", "16-gen2", "32-gen2"),
)
"""Names of the displays whose quilts are known."""

SUFFIXES = ("png", "jpg", "jpeg", "exr", "hdr", "npy", "pfm")
"""Suffixes that views of a folder can have."""

EXAMPLE = """\b
Examples:
  rt lightfield export array.lf -o views                          views/view_00_00.png and so on
  rt lightfield export array.lf -o views --format png --bits 16
  rt lightfield export array.lf -o cotton --layout hci            input_Cam000.png, parameters.cfg, .pfm
  rt lightfield export array.lf -o knights --layout stanford
  rt lightfield export array.lf -o array.npy
  rt lightfield export array.lf -o all.png --layout mosaic        all views side by side
  rt lightfield export array.lf -o eslf.png --layout interleaved --bits 16 --memory 500MB
  rt lightfield export array.lf -o array.exr                      one file, a part for each view
  rt lightfield export array.lf -o nerf --layout transforms       images, depths, transforms.json
  rt lightfield export array.lf -o dragons.png --device portrait --convergence 1.4m --depth
  rt lightfield export row.lf -o row_qs8x6a0.75.png               a quilt: the name says its layout

\b
Without --layout the output's name chooses it: a folder is a grid, NAME_qs8x6a0.75.png a quilt, .npy an array, .exr
views of one file, another picture a mosaic; so do transforms.json and --device.  What names do not say is in
geometry.json beside them, or in the file: rt lightfield import takes all back.
"""


def export(
    file: File,
    output: Annotated[Path, options.output("OUT", "Folder or file to write.")],
    layout: Annotated[
        str | None,
        takes(
            "NAME",
            f"{', '.join(LAYOUTS[:-1])} or {LAYOUTS[-1]}.  Default: by the output's name.",
            "--layout",
            "--naming",
            autocompletion=complete_from(*LAYOUTS),
        ),
    ] = None,
    suffix: Annotated[
        str | None, takes("SUFFIX", f"Of the views of a folder: {' '.join(SUFFIXES)}.  Default: png.", "--format")
    ] = None,
    bits: Annotated[int | None, takes("8|16", "Of the channels of .png files.  Default: 8.")] = None,
    memory: Annotated[
        str | None,
        takes("SIZE", "Of a mosaic's pixels held at a time, or for a quilt's --depth: 500MB.  Default: 2GB."),
    ] = None,
    device: Annotated[
        str | None,
        takes(
            "NAME",
            f"Quilt: Looking Glass display it is for: {', '.join(DEVICES)}.",
            autocompletion=complete_from(*DEVICES),
        ),
    ] = None,
    columns: Annotated[int | None, Option(help="Quilt: views in a row of the picture.", min=1, max=999)] = None,
    rows: Annotated[int | None, Option(help="Quilt: rows of views.", min=1, max=999)] = None,
    size: Annotated[str | None, takes("WIDTHxHEIGHT", "Quilt: its pixels: 3360x3360.")] = None,
    aspect: Annotated[float | None, takes("RATIO", "Quilt: width over height of the display: 0.75.")] = None,
    row: Annotated[
        int | None, Option(help="Quilt: row of the light field that it shows, from 0.  Default: the middle.", min=0)
    ] = None,
    baseline: Annotated[
        str | None, takes("LENGTH", "Quilt: from its first view to its last.  Default: all of the row, or the cone.")
    ] = None,
    view_cone: Annotated[
        str | None, takes("ANGLE", "Quilt: of its baseline, seen from the plane of convergence: 40deg.")
    ] = None,
    convergence: Annotated[
        str | None, takes("LENGTH", "Quilt: plane that stands still, at the display's surface: 1.4m, inf.")
    ] = None,
    depth: Annotated[
        bool, Option("--depth", help="Quilt: take views between others from where each point's depth puts it.")
    ] = False,
    quiet: Quiet = False,
) -> None:
    """Write a light field for other programs: views in folders, in one picture or file, with cameras, or as a quilt."""
    if layout is not None and layout not in LAYOUTS:
        raise InputError(f"--layout {layout}: must be {', '.join(LAYOUTS)}")
    if device is not None and device not in DEVICES:
        raise InputError(f"--device {device}: must be {', '.join(DEVICES)}")
    if bits not in (None, 8, 16):
        raise InputError(f"--bits {bits}: must be 8 or 16")
    if aspect is not None and not 0.0 < aspect < float("inf"):
        raise InputError(f"--aspect {aspect:g}: must be greater than 0, and finite")
    cone = None if view_cone is None else parse_positive("--view-cone", view_cone, "angle")
    if cone is not None and cone >= 180.0:
        raise InputError(f"--view-cone {view_cone}: must be less than 180 degrees")
    asked = {
        "suffix": None if suffix is None else f".{suffix.lower().removeprefix('.')}",
        "bits": bits,
        "memory": None if memory is None else int(options.parse_value("--memory", memory, parse_bytes)),
        "device": device,
        "columns": columns,
        "rows": rows,
        "size": options.parse_sizing(size, None).size,
        "aspect": aspect,
        "row": row,
        "baseline": None if baseline is None else parse_positive("--baseline", baseline, "length"),
        "view_cone": cone,
        "convergence": parse_distance("--convergence", convergence),
        "depth": depth or None,
    }
    # A display names the layout.
    chosen = "quilt" if layout is None and (device, columns, rows) != (None, None, None) else layout
    from raytracer.lightfield.formats.exporter import export as export_field
    from raytracer.util.progress import Bar

    with open_any(file) as field, Bar(" steps", quiet=quiet) as bar:
        result = export_field(field, output, layout=chosen, update=bar.update, **asked)
    _report(result, output, quiet=quiet)


def _report(result: "Exported", output: Path, *, quiet: bool) -> None:
    """Say on stderr what was written, and what is not as in the light field."""
    if quiet:
        return
    if output.is_dir():
        print(f"wrote {len(result.files)} files to {output}", file=sys.stderr)
    else:
        report_written(*result.files, quiet=quiet)
    if result.clipped > 0.0:
        share = f"{format_percent(result.clipped)} of the values are brighter than 1"
        how = "--format exr" if output.is_dir() else ".exr"
        print(f"note: {share} and were clipped: {how} keeps them", file=sys.stderr)
    for note in result.notes:
        print(f"note: {note}", file=sys.stderr)
