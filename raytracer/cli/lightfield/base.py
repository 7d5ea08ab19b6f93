"""Shared parts of the commands for light fields: options, and the files that they read and write.

Functions that check or parse raise an InputError for what is wrong.
"""

import sys
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

from typer import Argument, Option

from raytracer.cli.base import options
from raytracer.cli.base.options import parse_dimension, parse_sizing, parse_value, takes
from raytracer.schema.units import Dimension, parse_bytes
from raytracer.util.errors import InputError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from raytracer.film.light_field.field import LightField
    from raytracer.film.light_field.lf import OpenField, OpenPosedField
    from raytracer.film.light_field.posed_field import PosedLightField
    from raytracer.film.light_field.posed_views import PosedViews
    from raytracer.lightfield.depth.depth_map import Depth
    from raytracer.lightfield.views.free_camera import FreeCamera, Point
    from raytracer.util.progress import Update

File = Annotated[str, Argument(metavar="FILE", help="Light field: .lf.")]
Near = Annotated[str | None, takes("LENGTH", "Nothing is nearer: 80cm.  Default: searched for.")]
Far = Annotated[str | None, takes("LENGTH", "Nothing is farther: 5, inf.  Default: searched for.")]
Memory = Annotated[
    str,
    takes(
        "SIZE",
        "Memory that this may take, besides the program: 2GB, 500MB.  What takes more is done in parts, or refused.",
    ),
]
Quiet = Annotated[bool, Option("--quiet", "-q", help="Say nothing.")]

LAYOUTS = ("grid", "stanford", "hci", "array", "mosaic", "interleaved", "quilt", "transforms", "multiview")
"""Names of the formats of other programs that there are."""


def parse_view(option: str, text: str | None) -> tuple[int, int] | None:
    """Parse the row and the column of a view; None if the option is not given."""
    if text is None:
        return None
    try:
        row, column = (int(part) for part in text.split(","))
    except ValueError:
        raise InputError(f"{option} {text}: must be a row and a column of views, counted from 0: 4,4") from None
    return row, column


def parse_position(option: str, text: str) -> tuple[float, float]:
    """Parse a position in the plane of the views (m), to the right and up."""
    parts = text.split(",")
    if len(parts) != 2:
        raise InputError(f"{option} {text}: must be two lengths, to the right and up from the middle: 2mm,-1mm")
    right, up = (parse_dimension(option, part, "length") for part in parts)
    return right, up


def parse_positive(option: str, text: str, dimension: Dimension) -> float:
    """Parse a quantity greater than 0, which may be infinite."""
    value = parse_dimension(option, text, dimension)
    if not value > 0.0:
        raise InputError(f"{option} {text}: must be greater than 0")
    return value


def parse_distance(option: str, text: str | None) -> float | None:
    """Parse a distance (m) greater than 0, inf allowed; None if the option is not given."""
    if text is None:
        return None
    distance = float("inf") if text.strip() == "inf" else parse_dimension(option, text, "length")
    if not distance > 0.0:
        raise InputError(f"{option} {text}: must be a distance greater than 0")
    return distance


def parse_point(option: str, text: str) -> tuple[float, float, float]:
    """Parse a point or a direction in the scene: three lengths (m)."""
    from raytracer.schema.fields import Quantity

    parts = text.split(",")
    if len(parts) != 3:
        raise InputError(f"{option} {text}: must be three lengths, x, y and z: 1,0.5,3")
    x, y, z = (parse_value(option, part, Quantity("length")) for part in parts)
    return x, y, z


class Framing(NamedTuple):
    """Framing of a picture from a point in the scene.

    up : direction that is up in it.
    vfov (deg), size (px) : field of view, and width and height; None for those of the views.
    """

    up: tuple[float, float, float]
    vfov: float | None
    size: tuple[int, int] | None


def parse_framing(up: str | None, vfov: str | None, size: str | None) -> Framing:
    """Parse the options --up, --vfov and --size."""
    angle = None if vfov is None else parse_dimension("--vfov", vfov, "angle")
    if angle is not None and not 0.0 < angle < 180.0:
        raise InputError(f"--vfov {vfov}: must be greater than 0 and less than 180 deg")
    direction = (0.0, 1.0, 0.0) if up is None else parse_point("--up", up)
    if not any(direction):
        raise InputError(f"--up {up}: must be a direction, and 0,0,0 is none")
    return Framing(direction, angle, parse_sizing(size, None).size)


def require_from(look_from: str | list[str] | None, up: str | None, vfov: str | None, size: str | None) -> None:
    """Refuse options of a picture from a point in the scene, where --from gives none."""
    if not look_from and (up is not None or vfov is not None or size is not None):
        raise InputError("--up, --vfov and --size are those of pictures from points in the scene: give --from too")


def aim_cameras(
    places: Iterable["Point"], toward: "Point", views: "PosedViews", framing: Framing
) -> "list[FreeCamera]":
    """Make the cameras at places that have another place in the middle of their pictures."""
    from raytracer.lightfield.views.free_camera import free_camera

    cameras = []
    for place in places:
        if place == toward:
            raise InputError("--from and --toward: must be two places, and are one")
        with options.name_in_errors("--up"):
            cameras.append(free_camera(place, toward, views, **framing._asdict()))
    return cameras


def open_any(file: str) -> "OpenField | OpenPosedField":
    """Open the light field in a file, of views in one plane or with poses of their own, to use in a `with` block."""
    from raytracer.film.light_field import lf

    return lf.open_posed(file) if lf.is_posed(file) else lf.open(file)


def require_plane(field: "LightField | PosedLightField", what: str) -> "LightField":
    """Return a light field if its views stand in one plane; an InputError says that `what` needs that."""
    from raytracer.film.light_field.field import LightField

    if not isinstance(field, LightField):
        raise InputError(
            f"{what} needs views in one plane, and these have poses of their own: give --from and --toward"
        )
    return field


def posed_views(field: "LightField | PosedLightField") -> "PosedViews":
    """Return the geometry of a light field, each view with its pose."""
    from raytracer.film.light_field.posed_views import PosedViews
    from raytracer.film.light_field.views import Views

    return PosedViews.of(field.views) if isinstance(field.views, Views) else field.views


def estimate_depth(
    field: "LightField | PosedLightField", *, distance: float | None, update: "Update"
) -> "Depth | None":
    """Estimate the depth that pictures from any place are drawn by, if it takes an estimate; None if not."""
    from raytracer.film.light_field.field import DEPTH_LAYER, LightField
    from raytracer.lightfield.depth.depth_map import depth_map

    is_needed = distance is None and DEPTH_LAYER not in field.layers
    return depth_map(field, update=update) if is_needed and isinstance(field, LightField) else None


def report_unknown(share: float, *, quiet: bool) -> None:
    """Say of which share of a picture, or of the pictures of a path, nothing is known.

    Raises
    ------
    InputError : nothing is known of all of it.
    """
    if share == 1.0:
        raise InputError("nothing is known of what is seen from there: no view sees it")
    if share > 0.0 and not quiet:
        from raytracer.report.wording import format_percent

        print(
            f"nothing is known of {format_percent(share)} of the pixels, which are black: no view sees them",
            file=sys.stderr,
        )


def open_light_field(file: str) -> "OpenField":
    """Open the light field in a file, to use in a `with` block; see `lf.open`."""
    from raytracer.film.light_field import lf

    return lf.open(file)


def limit_memory(memory: str) -> "AbstractContextManager[None]":
    """Limit the memory of the work in a `with` block to that of `--memory`."""
    from raytracer.lightfield.memory import memory_limit

    return memory_limit(int(options.parse_value("--memory", memory, parse_bytes)))


@contextmanager
def open_within(file: str, memory: str) -> "Iterator[OpenField]":
    """Open the light field in a file in a `with` block, in which work takes at most the memory of `--memory`."""
    with limit_memory(memory), open_light_field(file) as field:
        yield field


def check_outputs(paths: Sequence[Path], suffixes: Collection[str], noun: str) -> None:
    """Make sure, before any work, that files can be written, and have one of these suffixes.

    noun : what is written, for the sentence: "a focal stack".
    """
    from raytracer.util.atomic_write import check_file
    from raytracer.util.safe_open import check_suffix

    for path in paths:
        check_suffix(path, suffixes, noun)
        check_file(path)


def check_folder(path: Path) -> None:
    """Make sure, before any work, that files can be written into a folder."""
    from raytracer.util.atomic_write import check_file

    if path.exists() and not path.is_dir():
        raise InputError(f"{path}: is a file, not a folder")
    check_file(path / "view")


def save_picture(
    radiance: "NDArray[np.float64]",
    path: Path,
    field: "LightField | PosedLightField",
    layers: "Mapping[str, Any] | None" = None,
) -> None:
    """Write a picture of a light field in the format that its suffix names."""
    from raytracer.film.image import Image

    Image(radiance=radiance, settings=dict(field.settings), layers=dict(layers or {})).save(path)


def picture_suffixes() -> tuple[str, ...]:
    """Return the suffixes of files that hold a picture."""
    from raytracer.film.formats import registry

    return registry.picture_suffixes()
