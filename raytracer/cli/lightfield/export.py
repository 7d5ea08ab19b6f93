"""`rt lightfield export`: light fields for other programs."""

import sys
from pathlib import Path
from typing import Annotated

from raytracer.cli.base import options
from raytracer.cli.base.completion import complete_from
from raytracer.cli.base.options import takes
from raytracer.cli.base.outputs import report_written
from raytracer.cli.lightfield.base import File, Quiet, check_folder, check_outputs, open_light_field
from raytracer.util.errors import InputError

EXAMPLE = """\b
Examples:
  rt lightfield export array.lf -o views                          views/view_00_00.png and so on
  rt lightfield export array.lf -o views --format exr
  rt lightfield export array.lf -o cotton --naming hci            input_Cam000.png, parameters.cfg, .pfm
  rt lightfield export array.lf -o knights --naming stanford
  rt lightfield export array.lf -o array.npy

\b
A geometry.json beside them says what their names do not: rt lightfield import takes all back.
"""


def export(
    file: File,
    output: Annotated[Path, options.output("FOLDER", "Folder to write, or a .npy file.")],
    naming: Annotated[
        str | None,
        takes(
            "NAME",
            "grid, stanford or hci.  Default: grid.",
            autocompletion=complete_from("grid", "stanford", "hci"),
        ),
    ] = None,
    suffix: Annotated[
        str | None, takes("SUFFIX", "Of the views: png jpg exr hdr npy.  Default: png.", "--format")
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Write the views of a light field for other programs: a folder of pictures, or one array."""
    from raytracer.lightfield.formats.exporter import check_export, export_array, export_views
    from raytracer.lightfield.formats.folders import NAMINGS

    is_array = output.suffix.lower() == ".npy" and not output.is_dir()
    if is_array and (naming is not None or suffix is not None):
        raise InputError(f"{output}: is one file: --naming and --format are of folders")
    if is_array:
        check_outputs([output], (".npy",), "an array")
    elif output.suffix.lower() == ".lf":
        raise InputError(f"{output}: is no folder of views, and no .npy")
    else:
        check_folder(output)
    named = next((known for known in NAMINGS if known == (naming or "grid")), None)
    if named is None:
        raise InputError(f"--naming {naming}: must be {', '.join(NAMINGS)}")

    from raytracer.util.progress import Bar

    with open_light_field(file) as field, Bar(" views", quiet=quiet) as bar:
        if is_array:
            report_written(*export_array(field, output), quiet=quiet)
            return
        ending = f".{(suffix or 'png').lower().removeprefix('.')}"
        check_export(field, output, named, ending)
        result = export_views(field, output, naming=named, suffix=ending, update=bar.update)
    if not quiet:
        print(f"wrote {len(result.files)} files to {output}", file=sys.stderr)
        if result.clipped > 0.0:
            share = f"{100.0 * result.clipped:.2g} % of the values are brighter than 1"
            print(f"note: {share} and were clipped: --format exr keeps them", file=sys.stderr)
