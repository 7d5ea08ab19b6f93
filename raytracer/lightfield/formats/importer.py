"""Import of light fields of other programs: the format is found by the name, or chosen by `layout`.

Views are read from their files as they are asked for, where the format lets them.
"""

from pathlib import Path
from typing import TypedDict, Unpack

from raytracer.film.light_field.field import LightField
from raytracer.film.light_field.posed_field import PosedLightField
from raytracer.lightfield.formats.base.light_field_format import ImportOptions
from raytracer.lightfield.formats.geometry import ViewOptics
from raytracer.lightfield.formats.registry import light_field_formats
from raytracer.util.errors import InputError
from raytracer.util.path_sandbox import AllowFiles


class FurtherOptions(TypedDict, total=False):
    """Further keyword options of `import_views`: see there, and `ViewOptics`."""

    vfov: float | None
    focal_length: float | None
    sensor: float | None
    allow_files: AllowFiles


def import_views(
    path: str | Path,
    *,
    layout: str | None = None,
    rows: int | None = None,
    columns: int | None = None,
    spacing: float | tuple[float, float] | None = None,
    focus_distance: float | None = None,
    flip: str = "",
    interleaved: bool = False,
    **further: Unpack[FurtherOptions],
) -> LightField | PosedLightField:
    """Import a light field of another program; its views are read as they are asked for.

    Metres need `spacing`, `focus_distance`, and `vfov` or `focal_length` with `sensor`, or files that say as much: each
    option replaces what a file says.  Without metres places are in steps of one view and `settings["units"]` is
    "views".

    Parameters
    ----------
    path : a folder of views, an array (.npy), a picture or a file of all views, or a transforms.json.
    layout : of the views: the name of a format; default: found by the name and the contents of `path`.
    rows, columns : of views, where names do not say them.
    spacing : from view to view (m), or that to the right and that down.
    focus_distance : of the plane in which all views see the same (m); inf for parallel ones.
    flip : "x", "y", "xy": places in Stanford names run to the left, or up.
    interleaved : True if the pixels of one picture go from view to view, as under microlenses.
    vfov : vertical field of view of a view (degrees).
    focal_length, sensor : of a view, and the width of its sensor (mm).
    allow_files : folders that a transforms.json may name files in, besides its own.

    Raises
    ------
    InputError : files are missing, broken, of different sizes or not views; the options are not enough for metres, or
        not of this format.
    """
    path = Path(path)
    allow_files = further.get("allow_files") or ()
    optics = ViewOptics(further.get("vfov"), further.get("focal_length"), further.get("sensor"))
    options = ImportOptions(rows, columns, spacing, focus_distance, flip, interleaved, optics, allow_files)
    formats = light_field_formats()
    if layout is not None and layout not in formats:
        raise InputError(f"{path}: layout must be one of {', '.join(formats)}, got {layout!r}")
    chosen = formats[layout] if layout else next(each for each in formats.values() if each.is_input(path, options))
    chosen.check_options(path, options)
    return chosen.read(path, options)
