"""`rt lightfield views`: one view, one between others or from anywhere, all of them, or a montage."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Option

from raytracer.cli.base import options
from raytracer.cli.base.options import takes
from raytracer.cli.base.outputs import report_written
from raytracer.cli.lightfield import base
from raytracer.cli.lightfield.base import File, Memory, Quiet, parse_distance, parse_position, parse_view
from raytracer.util.errors import InputError

if TYPE_CHECKING:
    from raytracer.film.light_field.field import LightField
    from raytracer.film.light_field.posed_field import PosedLightField
    from raytracer.film.light_field.views import Views
    from raytracer.lightfield.views.free_camera import Point
    from raytracer.util.progress import Update

EXAMPLE = """\b
Examples:
  rt lightfield views array.lf -o montage.png                all views on one picture
  rt lightfield views array.lf --view 8,8 -o middle.exr      the one of row 8, column 8, from 0 at the top left
  rt lightfield views array.lf --at 3mm,-1mm -o between.png  what a pinhole there sees, from the views around
  rt lightfield views array.lf --at 3mm,-1mm --depth -o between.png
  rt lightfield views array.lf --view 8,8 --scale 2 -o fine.png
  rt lightfield views around.lf --from 1,0.5,3 --toward 0,0,0 -o new.png
  rt lightfield views array.lf --all -o views --format exr   a file for each
"""


def views(
    file: File,
    output: Annotated[Path, options.output("OUT", "Picture; with --all, a folder.")],
    view: Annotated[str | None, takes("ROW,COLUMN", "One view, counted from 0.")] = None,
    at: Annotated[
        str | None, takes("X,Y", "What is seen from a place: lengths to the right and up from the middle.")
    ] = None,
    depth: Annotated[
        bool, Option("--depth", help="With --at: take each point from where its depth puts it in the views around.")
    ] = False,
    distance: Annotated[
        str | None,
        takes(
            "LENGTH",
            "With --at: the plane that is sharp, without --depth.  With --from: a plane so far away, in place of all "
            "surfaces.",
        ),
    ] = None,
    look_from: Annotated[
        str | None, takes("X,Y,Z", "What is seen from a point in the scene, also before or behind the views.", "--from")
    ] = None,
    toward: Annotated[str | None, takes("X,Y,Z", "With --from: the point in the middle of the picture.")] = None,
    up: Annotated[
        str | None, takes("X,Y,Z", "With --from: the direction that is up in the picture.  Default: 0,1,0.")
    ] = None,
    vfov: Annotated[
        str | None, takes("ANGLE", "With --from: vertical field of view, 40 deg.  Default: that of the views.")
    ] = None,
    size: Annotated[str | None, takes("WxH", "With --from: pixels of the picture.  Default: those of a view.")] = None,
    scale: Annotated[
        int, Option(min=1, max=4, help="With --view: pixels along one, from what all views know of it.")
    ] = 1,
    every: Annotated[bool, Option("--all", help="All views that got light, each in a file: view_ROW_COLUMN.")] = False,
    suffix: Annotated[str, takes("SUFFIX", "Of these files: png jpg exr hdr npy.", "--format")] = "png",
    width: Annotated[
        int | None, Option(min=1, max=65500, help="Of the montage in pixels, at most.  Default: 4096.")
    ] = None,
    memory: Memory = "2GB",
    quiet: Quiet = False,
) -> None:
    """Extract views of a light field: one, one between others or from anywhere, all, or all on one picture (default).

    Places are in metres (plain numbers too; 3mm, 1cm), with --at in the plane of the views, with --from in the scene:
    rt lightfield info says how far it goes.  With --from each point is taken from the views that see it best, by their
    layer depth if there is one.
    """
    if sum((view is not None, at is not None, look_from is not None, every)) > 1:
        raise InputError("--view, --at, --from and --all each ask for something else: give one of them")
    if depth and at is None:
        raise InputError("--depth says how a view between others is made: give --at too")
    if distance is not None and at is None and look_from is None:
        raise InputError("--distance says how a view between others is made: give --at or --from too")
    if (look_from is None) != (toward is None):
        raise InputError("--from and --toward say from where to look, and where to: give both")
    base.require_from(look_from, up, vfov, size)
    if depth and distance is not None:
        raise InputError("--depth and --distance: give one of them")
    if scale > 1 and view is None:
        raise InputError("--scale makes one view larger: give --view too")
    index, position = parse_view("--view", view), None if at is None else parse_position("--at", at)
    plane = parse_distance("--distance", distance)
    if every:
        if output.suffix.lower() in base.picture_suffixes() and not output.is_dir():
            raise InputError(f"-o {output}: --all writes a file for each view, and -o names their folder")
        base.check_folder(output)
        ending = f".{suffix.lower().removeprefix('.')}"
        if ending not in base.picture_suffixes():
            known = ", ".join(each.removeprefix(".") for each in base.picture_suffixes())
            raise InputError(f"--format {suffix}: must be one of {known}")
    else:
        base.check_outputs([output], base.picture_suffixes(), "a view")

    from raytracer.lightfield.coverage import require_lit
    from raytracer.lightfield.depth.depth_map import check_view, depth_map
    from raytracer.lightfield.super_resolution import supersampled
    from raytracer.lightfield.views.contact_sheet import montage
    from raytracer.lightfield.views.synthesis import view_at
    from raytracer.util.progress import Bar

    if look_from is not None and toward is not None:
        ends = base.parse_point("--from", look_from), base.parse_point("--toward", toward)
        with base.limit_memory(memory):
            _draw_from(file, output, ends, base.parse_framing(up, vfov, size), plane, quiet)
        return
    with base.limit_memory(memory), base.open_any(file) as field, Bar(" steps", quiet=quiet) as bar:
        geometry = field.views
        if every:
            _save_all(field, output, ending, bar.update, quiet)
            return
        with options.name_in_errors(file):
            if index is not None:
                chosen = check_view(geometry, *index)
                require_lit(field, *chosen)
                if scale == 1:
                    picture = field.view(*chosen)
                else:
                    planar = base.require_plane(field, "--scale")
                    depths = depth_map(planar, row=chosen[0], column=chosen[1], update=bar.update)
                    picture = supersampled(planar, scale, depths, update=bar.update)
            elif position is not None:
                planar = base.require_plane(field, "--at")
                _check_within(planar.views, at, position)
                around = depth_map(planar, update=bar.update) if depth else None
                picture = view_at(planar, *position, depth=around, distance=plane)
            else:
                picture = montage(field, width=4096 if width is None else width)
        base.save_picture(picture, output, field)
    report_written(output, quiet=quiet)


def _draw_from(
    file: str, output: Path, ends: tuple["Point", "Point"], framing: base.Framing, distance: float | None, quiet: bool
) -> None:
    """Draw and write the picture from a point in the scene towards another, and say how much of it is not known."""
    import numpy as np

    from raytracer.lightfield.views.unstructured import view_from
    from raytracer.util.progress import Bar

    place, toward = ends
    with base.open_any(file) as field, Bar(" steps", quiet=quiet) as bar, options.name_in_errors(file):
        (camera,) = base.aim_cameras([place], toward, base.posed_views(field), framing)
        depth = base.estimate_depth(field, distance=distance, update=bar.update)
        drawn = view_from(field, camera, depth=depth, distance=distance)
        base.report_unknown(drawn.unknown, quiet=quiet)
        base.save_picture(np.nan_to_num(drawn.radiance), output, field, {"depth": drawn.depth})
    report_written(output, quiet=quiet)


def _save_all(field: "LightField | PosedLightField", folder: Path, ending: str, update: "Update", quiet: bool) -> None:
    """Write all views that any light came to, each in a file with its row and column; say how many got none."""
    from raytracer.lightfield.coverage import lit_views
    from raytracer.util.progress import report_progress

    lit = lit_views(field)
    digits = len(str(max(lit.shape) - 1))
    wanted = list(zip(*lit.nonzero(), strict=True))
    for row, column in report_progress(wanted, update):
        base.save_picture(field.view(row, column), folder / f"view_{row:0{digits}}_{column:0{digits}}{ending}", field)
    if not quiet:
        left_out = lit.size - len(wanted)
        note = f"; {left_out} others got no light" if left_out else ""
        print(f"wrote {len(wanted)} views to {folder}{note}", file=sys.stderr)


def _check_within(views: "Views", option: str | None, position: tuple[float, float]) -> None:
    """Make sure that views are around a place: nothing is known beyond them."""
    import numpy as np

    from raytracer.lightfield.coverage import within_lens

    positions = views.position[within_lens(views)]
    low, high = positions.min(axis=0), positions.max(axis=0)
    # What rounding adds to the places is no reason.
    slack = float(np.finfo(np.float32).eps) * (high - low)
    if np.any(position < low - slack) or np.any(position > high + slack):
        (left, down), (right, up) = low, high
        raise InputError(
            f"--at {option}: is outside the views, which are from {left:g} to {right:g} m to the right and from "
            f"{down:g} to {up:g} m up"
        )
