"""`rt lightfield move`: a pinhole that moves within the aperture."""

from pathlib import Path
from typing import Annotated

from typer import Option

from raytracer.cli.base import options
from raytracer.cli.base.completion import complete_from
from raytracer.cli.base.options import takes
from raytracer.cli.base.outputs import report_written
from raytracer.cli.lightfield.base import File, Memory, Quiet, check_outputs, open_within, parse_distance
from raytracer.util.errors import InputError

EXAMPLE = """\b
Examples:
  rt lightfield move array.lf -o around.gif                  once round the aperture
  rt lightfield move array.lf --path right --radius 4mm -o swing.webp
  rt lightfield move array.lf --path eight --frames 48 --fps 24 -o eight.gif
  rt lightfield move array.lf --distance 3 -o around.gif     what is 3 m away stands still between views
"""

_FRAME_BYTES = 6
"""Bytes a pixel of a frame, until all are encoded."""


def move(
    file: File,
    output: Annotated[Path, options.output("OUT", ".gif or .webp, which runs for ever.")],
    path: Annotated[
        str,
        Option(
            help="circle, right (and back), up (and back), or eight.",
            autocompletion=complete_from("circle", "right", "up", "eight"),
        ),
    ] = "circle",
    radius: Annotated[
        str | None, takes("LENGTH", "Half the path's width.  Default: as far as there are views.")
    ] = None,
    frames: Annotated[int, Option(min=2, max=1000, help="Of the animation.")] = 24,
    fps: Annotated[float, Option(help="Frames a second, at most 50.")] = 12.0,
    depth: Annotated[
        bool, Option("--depth/--no-depth", help="Take each point from where its depth puts it, or blend views.")
    ] = True,
    distance: Annotated[str | None, takes("LENGTH", "The plane that is sharp between views, with --no-depth.")] = None,
    memory: Memory = "2GB",
    quiet: Quiet = False,
) -> None:
    """Move a pinhole about in the plane of the views, and look: parallax as an animation.

    Between views each frame is made of those around, by the depth that is found first.
    """
    from raytracer.film.formats.registry import animation_suffixes

    check_outputs([output], animation_suffixes(with_images=False), "an animation")
    path_radius = None if radius is None else options.parse_dimension("--radius", radius, "length")
    plane = parse_distance("--distance", distance)

    from raytracer.film.animation import check, encode
    from raytracer.lightfield.depth.depth_map import depth_map
    from raytracer.lightfield.memory import require_memory
    from raytracer.lightfield.views.camera_paths import PATHS, look_around, path_places
    from raytracer.util import srgb
    from raytracer.util.atomic_write import write_bytes
    from raytracer.util.progress import Bar

    kind = output.suffix.lower().removeprefix(".")
    check(kind, fps)
    if path not in PATHS:
        raise InputError(f"--path {path}: must be one of {', '.join(PATHS)}")
    is_known = depth and plane is None
    with open_within(file, memory) as field, Bar(" steps", quiet=quiet) as bar:
        with options.name_in_errors(file):
            positions = path_places(field.views, path, frames=frames, radius=path_radius)
            depths = depth_map(field, update=bar.update) if is_known else None
            size = _FRAME_BYTES * frames * field.views.width * field.views.height
            require_memory(size, f"an animation of {frames} frames", "fewer --frames take less")
        pictures = []
        for number, view in enumerate(look_around(field, positions, depth=depths, distance=plane)):
            pictures.append(srgb.to_uint8(view))
            bar.update(number + 1, frames)
        write_bytes(output, encode(pictures, kind, fps=fps))
    report_written(output, quiet=quiet)
