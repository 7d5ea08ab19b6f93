"""Export of light fields to the formats of other programs."""

from dataclasses import replace
from pathlib import Path
from typing import Any

from raytracer.film.light_field.field import LightField
from raytracer.film.light_field.posed_field import PosedLightField
from raytracer.lightfield.formats.base.light_field_format import AnyField, Exported, ExportOptions, LightFieldFormat
from raytracer.lightfield.formats.folders import NAMINGS, Naming
from raytracer.lightfield.formats.registry import light_field_formats
from raytracer.util.atomic_write import check_file
from raytracer.util.errors import InputError
from raytracer.util.progress import Update


def choose_format(path: Path, layout: str | None) -> LightFieldFormat:
    """Choose the format of an output, by the name of a layout or by its own; an InputError says that there is none."""
    formats = light_field_formats()
    if layout is not None and layout not in formats:
        raise InputError(f"{path}: layout must be one of {', '.join(formats)}, got {layout!r}")
    chosen = formats[layout] if layout else next((each for each in formats.values() if each.is_output(path)), None)
    if chosen is None:
        raise InputError(f"{path}: names no format of light fields: choose one by --layout: {', '.join(formats)}")
    return chosen


def check_export(
    field: AnyField, path: str | Path, layout: str | None = None, options: ExportOptions | None = None
) -> LightFieldFormat:
    """Check, before anything is written, that a light field can be exported, and return the format.

    Raises InputError: the format is not known, cannot hold the light field, or has not the options.
    """
    path = Path(path)
    options = options or ExportOptions()
    chosen = choose_format(path, layout)
    folder = chosen.folder(path)
    if folder is not None and folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: is a file, not a folder")
    if folder == path and path.suffix[1:].isalpha() and not path.is_dir():
        raise InputError(
            f"{path}: {chosen.name} writes a file for each view, and the output names their folder: leave out "
            f"{path.suffix}, or choose another --layout"
        )
    check_file(path if folder is None else folder / "view")
    chosen.check_options(path, options)
    if isinstance(field, PosedLightField) and not chosen.takes_posed:
        known = [each.name for each in light_field_formats().values() if each.takes_posed]
        raise InputError(
            f"{path}: views have poses of their own, which {chosen.name} cannot tell: export as {', '.join(known)}"
        )
    chosen.check(field, path, options)
    return chosen


def export(
    field: LightField | PosedLightField,
    path: str | Path,
    *,
    layout: str | None = None,
    update: Update | None = None,
    **options: Any,
) -> Exported:
    """Export a light field to a format of another program.

    Parameters
    ----------
    path : a folder, or a file.
    layout : name of a format; default: by the name of `path`.
    update : called with the work that is done, and all of it.
    options : those of the format.  Of folders: `suffix` of the pictures, and `bits`, 16 for .png files of 16 bits.  Of
        one picture: `bits`, and `memory`, bytes of pixels that are held at a time.  Of quilts: `device`; `columns`,
        `rows`, `size` (width, height in px) and `aspect`; `row` of the views; `baseline` (m) or `view_cone` (degrees);
        `convergence` (m); `depth`, True to take each point from where its depth puts it, and `memory`, bytes for that.

    Raises
    ------
    InputError : the format is not known, cannot hold the light field, or has not the options.
    OutputError : a file cannot be written.
    """
    path = Path(path)
    asked = replace(ExportOptions(), **options)
    return check_export(field, path, layout, asked).write(field, path, asked, update)


def export_views(
    field: LightField | PosedLightField,
    folder: str | Path,
    *,
    naming: Naming = "grid",
    suffix: str = ".png",
    bits: int | None = None,
    update: Update | None = None,
) -> Exported:
    """Write views into a folder, a picture each, and files of their geometry.

    Parameters
    ----------
    naming : grid, stanford or hci; see the table of this package.
    suffix : of the pictures: .exr and .npy keep linear light, .png and .jpg what a display shows.
    bits : 16 for .png files of 16 bits a channel.
    update : called with the number of views that are written, and of all.

    Raises
    ------
    InputError : the naming cannot tell the geometry, the format is not known, or the folder holds other views.
    OutputError : a file cannot be written.
    """
    if naming not in NAMINGS:
        raise InputError(f"{folder}: naming must be one of {', '.join(NAMINGS)}, got {naming!r}")
    return export(field, folder, layout=naming, suffix=suffix, bits=bits, update=update)


def export_array(field: LightField | PosedLightField, path: str | Path) -> list[Path]:
    """Write the radiance as one array, .npy, view by view, and its geometry beside it.

    Raises
    ------
    OutputError : a file cannot be written.
    """
    return export(field, path, layout="array").files
