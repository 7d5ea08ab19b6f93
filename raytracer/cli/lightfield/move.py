"""`rt lightfield move`: a pinhole that moves within the aperture, or anywhere in the scene."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

from typer import Option

from raytracer.cli.base import options
from raytracer.cli.base.completion import complete_from
from raytracer.cli.base.options import takes
from raytracer.cli.base.outputs import report_written
from raytracer.cli.lightfield.base import (
    File,
    Framing,
    Memory,
    Quiet,
    check_outputs,
    estimate_depth,
    limit_memory,
    open_any,
    open_within,
    parse_distance,
    parse_framing,
    parse_point,
    posed_views,
    report_unknown,
)
from raytracer.util.errors import InputError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from raytracer.lightfield.views.free_camera import Point

EXAMPLE = """\b
Examples:
  rt lightfield move array.lf -o around.gif                  once round the aperture
  rt lightfield move array.lf --path right --radius 4mm -o swing.webp
  rt lightfield move array.lf --path eight --frames 48 --fps 24 -o eight.gif
  rt lightfield move array.lf --distance 3 -o around.gif     what is 3 m away stands still between views
  rt lightfield move around.lf --from 0,1,4 --toward 0,0,0 -o orbit.webp                        once round a point
  rt lightfield move around.lf --from 0,1,4 --from 3,2,1 --from 0,4,0.5 --toward 0,0,0 -o path.gif  through places
"""

_FRAME_BYTES = 6
"""Bytes a pixel of a frame, until all are encoded."""


class Route(NamedTuple):
    """A way through the scene: places (m) that it goes through, or one to go round from; where to look; and frames."""

    places: "list[Point]"
    toward: "Point"
    frames: int


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
    look_from: Annotated[
        list[str] | None,
        takes(
            "X,Y,Z",
            "A place in the scene to begin at, from where the pinhole goes once round --toward; several, for a smooth "
            "path through all of them.",
            "--from",
        ),
    ] = None,
    toward: Annotated[str | None, takes("X,Y,Z", "With --from: the point that stays in the middle.")] = None,
    up: Annotated[
        str, takes("X,Y,Z", "With --from: the direction that is up in the picture, and the axis to go round.")
    ] = "0,1,0",
    vfov: Annotated[
        str | None, takes("ANGLE", "With --from: vertical field of view, 40 deg.  Default: that of the views.")
    ] = None,
    size: Annotated[str | None, takes("WxH", "With --from: pixels of the picture.  Default: those of a view.")] = None,
    frames: Annotated[int, Option(min=2, max=1000, help="Of the animation.")] = 24,
    fps: Annotated[float, Option(help="Frames a second, at most 50.")] = 12.0,
    depth: Annotated[
        bool, Option("--depth/--no-depth", help="Take each point from where its depth puts it, or blend views.")
    ] = True,
    distance: Annotated[str | None, takes("LENGTH", "The plane that is sharp between views, with --no-depth.")] = None,
    memory: Memory = "2GB",
    quiet: Quiet = False,
) -> None:
    """Move a pinhole about in the plane of the views, or with --from in the scene: parallax as an animation.

    Between views each frame is made of those around, by the depth that is found first; in the scene by the layer depth
    if there is one.
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
    if bool(look_from) != (toward is not None):
        raise InputError("--from and --toward say from where to look, and where to: give both")
    if look_from and toward is not None:
        places = [parse_point("--from", place) for place in look_from]
        route = Route(places, parse_point("--toward", toward), frames)
        framing = parse_framing(up, vfov, size)
        with limit_memory(memory):
            write_bytes(output, encode(_draw_route(file, route, framing, plane, quiet), kind, fps=fps))
        report_written(output, quiet=quiet)
        return
    if vfov is not None or size is not None:
        raise InputError("--vfov and --size are those of pictures from places in the scene: give --from too")
    is_known = depth and plane is None
    with open_within(file, memory) as field, Bar(" steps", quiet=quiet) as bar:
        with options.name_in_errors(file):
            positions = path_places(field.views, path, frames=frames, radius=path_radius)
            depths = depth_map(field, update=bar.update) if is_known else None
            taken = _FRAME_BYTES * frames * field.views.width * field.views.height
            require_memory(taken, f"an animation of {frames} frames", "fewer --frames take less")
        pictures = []
        for number, view in enumerate(look_around(field, positions, depth=depths, distance=plane)):
            pictures.append(srgb.to_uint8(view))
            bar.update(number + 1, frames)
        write_bytes(output, encode(pictures, kind, fps=fps))
    report_written(output, quiet=quiet)


def _draw_route(
    file: str, route: Route, framing: Framing, distance: float | None, quiet: bool
) -> list["NDArray[np.uint8]"]:
    """Draw the pictures of a way through the scene, and say how much of them is not known."""
    import numpy as np

    from raytracer.lightfield.views.free_camera import free_camera, orbit, path_through
    from raytracer.lightfield.views.unstructured import views_along
    from raytracer.util import srgb
    from raytracer.util.progress import Bar

    with open_any(file) as field, Bar(" steps", quiet=quiet) as bar, options.name_in_errors(file):
        views = posed_views(field)
        ways = (
            orbit(route.places[0], route.toward, up=framing.up, frames=route.frames)
            if len(route.places) == 1
            else path_through(route.places, frames=route.frames)
        )
        cameras = [free_camera((x, y, z), route.toward, views, **framing._asdict()) for x, y, z in ways.tolist()]
        depth = estimate_depth(field, distance=distance, update=bar.update)
        pictures, unknown = [], 0.0
        for number, drawn in enumerate(views_along(field, cameras, depth=depth, distance=distance)):
            pictures.append(srgb.to_uint8(np.nan_to_num(drawn.radiance)))
            unknown += drawn.unknown / route.frames
            bar.update(number + 1, route.frames)
        report_unknown(unknown, quiet=quiet)
    return pictures
