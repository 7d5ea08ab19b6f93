"""`rt lightfield all-in-focus`: a picture that is sharp everywhere."""

import functools
from pathlib import Path
from typing import Annotated

from typer import Option

from raytracer.cli.base import options
from raytracer.cli.base.options import takes
from raytracer.cli.base.outputs import report_written
from raytracer.cli.lightfield import base
from raytracer.cli.lightfield.base import Far, File, Memory, Near, Quiet, parse_distance, parse_view

EXAMPLE = """\b
Examples:
  rt lightfield all-in-focus array.lf -o sharp.png
  rt lightfield all-in-focus array.lf --scale 2 -o large.exr     twice as many pixels along each side
  rt lightfield all-in-focus lytro.lf --near 50cm --far 4 -o sharp.png
"""


def all_in_focus(
    file: File,
    output: Annotated[list[Path], options.output("OUT", "Picture.  May repeat.")],
    scale: Annotated[int, Option(min=1, max=4, help="Pixels along one of a view.")] = 1,
    view: Annotated[str | None, takes("ROW,COLUMN", "As seen from there.  Default: the middle.")] = None,
    near: Near = None,
    far: Far = None,
    threads: options.Threads = None,
    memory: Memory = "2GB",
    quiet: Quiet = False,
) -> None:
    """Make a picture that is sharp at all distances from the light of all views.

    Each point is taken from where its depth puts it in every view that sees it: as sharp as through a pinhole, with
    less noise.  With --scale finer than any view, since views see a point between each other's pixels.
    """
    base.check_outputs(output, base.picture_suffixes(), "a picture")
    row, column = parse_view("--view", view) or (None, None)
    nearest, farthest = parse_distance("--near", near), parse_distance("--far", far)

    from raytracer.lightfield.depth.depth_map import depth_map
    from raytracer.lightfield.super_resolution import all_in_focus as fuse
    from raytracer.lightfield.super_resolution import supersampled
    from raytracer.util.progress import Bar

    with base.open_within(file, memory) as field, Bar(" steps", quiet=quiet) as bar:
        with options.name_in_errors(file):
            depths = depth_map(
                field, row=row, column=column, near=nearest, far=farthest, threads=threads, update=bar.update
            )
            make = fuse if scale == 1 else functools.partial(supersampled, factor=scale)
            picture = make(field, depth=depths, threads=threads, update=bar.update)
        for path in output:
            base.save_picture(picture, path, field)
    report_written(*output, quiet=quiet)
