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
    aim_cameras,
    check_outputs,
    estimate_depth,
    limit_memory,
    open_any,
    parse_distance,
    parse_framing,
    parse_point,
    posed_views,
    report_unknown,
    require_from,
    require_plane,
)
from raytracer.util.errors import InputError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from raytracer.lightfield.views.camera_paths import Path as PathName
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


_FEWER_FRAMES = "fewer --frames take less"


class _Path(NamedTuple):
    """A path in the plane of the views: its name, half its width (m; None for the widest), and its frames."""

    name: "PathName"
    radius: float | None
    frames: int


class Route(NamedTuple):
    """A way through the scene: places (m) that it goes through, or one to go round from; where to look; and frames."""

    places: "list[Point]"
    toward: "Point"
    frames: int


def move(
    file: File,
    output: Annotated[Path, options.output("OUT", ".gif or .webp, which runs for ever.")],
    path: Annotated[
        str | None,
        takes(
            "PATH",
            "Among the views: circle, right (and back), up (and back), or eight.  Default: circle.",
            autocompletion=complete_from("circle", "right", "up", "eight"),
        ),
    ] = None,
    radius: Annotated[
        str | None, takes("LENGTH", "Half the width of --path.  Default: as far as there are views.")
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
        str | None,
        takes(
            "X,Y,Z",
            "With --from: the direction that is up in the picture, and the axis to go round.  Default: 0,1,0.",
        ),
    ] = None,
    vfov: Annotated[
        str | None, takes("ANGLE", "With --from: vertical field of view, 40 deg.  Default: that of the views.")
    ] = None,
    size: Annotated[str | None, takes("WxH", "With --from: pixels of the picture.  Default: those of a view.")] = None,
    frames: Annotated[int, Option(min=2, max=1000, help="Of the animation.")] = 24,
    fps: Annotated[float, Option(help="Frames a second, at most 50.")] = 12.0,
    depth: Annotated[
        bool | None,
        Option(
            "--depth/--no-depth",
            help="Among the views: take each point from where its depth puts it, or blend views.  Default: --depth, "
            "but with --distance.",
        ),
    ] = None,
    distance: Annotated[
        str | None,
        takes(
            "LENGTH",
            "Among the views: the plane that is sharp, without depth.  With --from: a plane so far away, in place of "
            "all surfaces.",
        ),
    ] = None,
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
    from raytracer.lightfield.views.camera_paths import PATHS
    from raytracer.util.atomic_write import write_bytes

    kind = output.suffix.lower().removeprefix(".")
    check(kind, fps)
    if path is not None and path not in PATHS:
        raise InputError(f"--path {path}: must be one of {', '.join(PATHS)}")
    if bool(look_from) != (toward is not None):
        raise InputError("--from and --toward say from where to look, and where to: give both")
    if depth and plane is not None:
        raise InputError("--depth and --distance: give one of them")
    if look_from and toward is not None:
        if path is not None or path_radius is not None or depth is not None:
            raise InputError("--path, --radius and --depth are those of a path among the views, and --from is of none")
        places = [parse_point("--from", place) for place in look_from]
        route = Route(places, parse_point("--toward", toward), frames)
        framing = parse_framing(up, vfov, size)
        with limit_memory(memory):
            write_bytes(output, encode(_draw_route(file, route, framing, plane, quiet), kind, fps=fps))
        report_written(output, quiet=quiet)
        return
    require_from(look_from, up, vfov, size)
    way = _Path(path or "circle", path_radius, frames)
    with limit_memory(memory):
        pictures = _draw_path(file, way, plane is None and depth is not False, plane, quiet)
        write_bytes(output, encode(pictures, kind, fps=fps))
    report_written(output, quiet=quiet)


def _draw_path(file: str, way: _Path, by_depth: bool, distance: float | None, quiet: bool) -> list["NDArray[np.uint8]"]:
    """Draw the pictures of a path among the views, by the depth that is found first, or of a sharp plane."""
    from raytracer.lightfield.depth.depth_map import depth_map
    from raytracer.lightfield.memory import require_memory
    from raytracer.lightfield.views.camera_paths import look_around, path_places
    from raytracer.util import srgb
    from raytracer.util.progress import Bar

    with open_any(file) as opened, Bar(" steps", quiet=quiet) as bar:
        with options.name_in_errors(file):
            field = require_plane(opened, "a path among the views")
            positions = path_places(field.views, way.name, frames=way.frames, radius=way.radius)
            depth = depth_map(field, update=bar.update) if by_depth else None
            taken = _FRAME_BYTES * way.frames * field.views.width * field.views.height
            require_memory(taken, f"an animation of {way.frames} frames", _FEWER_FRAMES)
        pictures = []
        for number, view in enumerate(look_around(field, positions, depth=depth, distance=distance)):
            pictures.append(srgb.to_uint8(view))
            bar.update(number + 1, way.frames)
    return pictures


def _draw_route(
    file: str, route: Route, framing: Framing, distance: float | None, quiet: bool
) -> list["NDArray[np.uint8]"]:
    """Draw the pictures of a way through the scene, and say how much of them is not known."""
    import numpy as np

    from raytracer.lightfield.memory import reserved_memory
    from raytracer.lightfield.views.free_camera import orbit, path_through
    from raytracer.lightfield.views.unstructured import views_along
    from raytracer.util import srgb
    from raytracer.util.progress import Bar

    with open_any(file) as field, Bar(" steps", quiet=quiet) as bar, options.name_in_errors(file):
        views = posed_views(field)
        # What is wrong with a place is told of that, rather than of the way.
        aim_cameras(route.places, route.toward, views, framing)
        ways = (
            orbit(route.places[0], route.toward, up=framing.up, frames=route.frames)
            if len(route.places) == 1
            else path_through(route.places, frames=route.frames)
        )
        cameras = aim_cameras([(x, y, z) for x, y, z in ways.tolist()], route.toward, views, framing)
        taken = _FRAME_BYTES * route.frames * cameras[0].width * cameras[0].height
        with reserved_memory(taken, f"an animation of {route.frames} frames", _FEWER_FRAMES):
            depth = estimate_depth(field, distance=distance, update=bar.update)
            pictures, unknown = [], 0.0
            for number, drawn in enumerate(views_along(field, cameras, depth=depth, distance=distance)):
                pictures.append(srgb.to_uint8(np.nan_to_num(drawn.radiance)))
                unknown += drawn.unknown
                bar.update(number + 1, route.frames)
        report_unknown(unknown / route.frames, quiet=quiet)
    return pictures
