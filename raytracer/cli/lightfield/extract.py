"""`rt lightfield extract`: what is inside the container of a Lytro's photograph."""

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from raytracer.cli.base.outputs import report_written
from raytracer.cli.lightfield.base import Quiet, check_outputs

EXAMPLE = """\b
Examples:
  rt lightfield extract IMG_0001.lfp -o raw.png            the raw picture, in 16 bits
  rt lightfield extract IMG_0001.lfp -o raw.npy            its codes, as the sensor gave them
  rt lightfield extract IMG_0001.lfr -o white.png --white  the white picture that some bring along
  rt lightfield extract IMG_0001.lfp -o metadata.json

\b
A .png holds the codes times a power of two that fills its 16 bits: 12 bits times 16, 10 bits times 64.  It is the
mosaic behind the colour filters, with the black level in it, which is what `rt lightfield decode --bayer` takes.
"""


def extract(
    photo: Annotated[str, Argument(metavar="PHOTO", help="Photograph of a Lytro: .lfp, .lfr.")],
    output: Annotated[list[Path], Option("--output", "-o", metavar="FILE", help="File to write: .png, .npy, .json.")],
    white: Annotated[bool, Option("--white", help="The white picture in the file in place of the raw one.")] = False,
    quiet: Quiet = False,
) -> None:
    """Write the raw picture of a Lytro's photograph, or its metadata, to files of other kinds."""
    check_outputs(output, (".png", ".npy", ".json"), "what a photograph holds")

    from raytracer.lightfield.decoding.lytro.export import write_metadata, write_raw
    from raytracer.lightfield.decoding.lytro.photo import open_photo
    from raytracer.util.errors import InputError

    opened = open_photo(photo)
    if white and not opened.has_white:
        raise InputError(f"--white: {photo} holds no white picture")
    raw = None
    for path in output:
        if path.suffix.lower() == ".json":
            write_metadata(path, opened)
        else:
            raw = raw or (opened.read_white() if white else opened.read())
            write_raw(path, raw)
        report_written(path, quiet=quiet)
