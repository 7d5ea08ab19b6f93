"""The record by which a module declares a format of light fields, and the options of imports and exports."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

from raytracer.film.light_field.field import LightField
from raytracer.film.light_field.posed_field import PosedLightField
from raytracer.lightfield.formats.geometry import ViewOptics
from raytracer.util.errors import InputError
from raytracer.util.path_sandbox import AllowFiles
from raytracer.util.progress import Update

MEMORY = 2 * 10**9
"""Bytes of pixels that are held at a time, where a format can be written in parts."""


AnyField: TypeAlias = LightField | PosedLightField
"""A light field of views in one plane, or of views with poses of their own."""


class Exported(NamedTuple):
    """Result of an export.

    files : all that were written.
    clipped : share of the values that are brighter than their format holds.
    notes : sentences on what is not as in the light field.
    """

    files: list[Path]
    clipped: float = 0.0
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class ImportOptions:
    """Options of an import; see `importer.import_views`."""

    rows: int | None = None
    columns: int | None = None
    spacing: float | tuple[float, float] | None = None
    focus_distance: float | None = None
    flip: str = ""
    interleaved: bool = False
    optics: ViewOptics = field(default_factory=ViewOptics)
    allow_files: AllowFiles = ()

    def given(self) -> set[str]:
        """Return the names of the options that are given, those of `optics` as well."""
        default = ImportOptions()
        names = {each.name for each in fields(self) if getattr(self, each.name) != getattr(default, each.name)}
        optics = {name for name, value in self.optics._asdict().items() if value is not None}
        return (names - {"optics"}) | optics

    @property
    def has_metres(self) -> bool:
        """Return True if any option tells the geometry in metres."""
        return not METRES.isdisjoint(self.given())


METRES = frozenset({"spacing", "focus_distance", *ViewOptics._fields})
"""Names of the options of imports that tell the geometry in metres."""


@dataclass(frozen=True)
class ExportOptions:
    """Options of an export; what a format does not take must be None.

    Attributes
    ----------
    suffix : of the pictures of a folder, with the dot.
    bits : of the channels of .png files, 8 or 16.
    memory : bytes of pixels that are held at a time, or that estimating the depth for a quilt may take.
    device : name of a display that sets `columns`, `rows`, `size`, `aspect` and `view_cone`; see `quilt.DEVICES`.
    columns, rows : views of a quilt.
    size (px) : width and height of a quilt.
    aspect : of what the display shows, width over height.
    row : row of views that a quilt is made from.
    baseline (m) : from the first to the last view of a quilt.
    view_cone (degrees) : angle of that, seen from the plane of convergence.
    convergence (m) : distance of the plane that stands still in a quilt.
    depth : True to take views between others from where the depth of each point puts it.
    """

    suffix: str | None = None
    bits: int | None = None
    memory: int | None = None
    device: str | None = None
    columns: int | None = None
    rows: int | None = None
    size: tuple[int, int] | None = None
    aspect: float | None = None
    row: int | None = None
    baseline: float | None = None
    view_cone: float | None = None
    convergence: float | None = None
    depth: bool | None = None

    def given(self) -> set[str]:
        """Return the names of the options that are given."""
        return {each.name for each in fields(self) if getattr(self, each.name) is not None}


OPTION_NAMES = {"suffix": "format"}
"""Names of options on the command line, where they are not those of `ExportOptions`."""


@dataclass(frozen=True)
class LightFieldFormat:
    """A format of other programs for light fields.

    name : by which options choose it.
    summary : what is written, for the help and messages.
    is_input : returns True if a path that is to be imported is of this format; the first format by `order` that says so
        reads it.
    read : a light field, whose views are read as they are asked for where that can be.
    is_output : returns True if the name of an output asks for this format.
    check : raises an InputError, before anything is written, if a light field or the options are not for this format.
    write : writes a light field.
    takes, import_takes : names of the options of exports and of imports that it has.
    takes_posed : True if views may have poses of their own; otherwise `check` and `write` are given no others than
        views in one plane.
    folder : returns the folder that an output is written into; None if it is one file.
    order : place among the formats, ascending.
    """

    name: str
    summary: str
    is_input: Callable[[Path, ImportOptions], bool]
    read: Callable[[Path, ImportOptions], AnyField]
    is_output: Callable[[Path], bool]
    check: Callable[[Any, Path, ExportOptions], None]
    write: Callable[[Any, Path, ExportOptions, Update | None], Exported]
    takes: frozenset[str]
    import_takes: frozenset[str]
    order: int
    takes_posed: bool = False
    folder: Callable[[Path], Path | None] = lambda path: None

    def check_options(self, path: Path, options: ExportOptions | ImportOptions) -> None:
        """Raise an InputError for an option that the format does not have."""
        takes = self.takes if isinstance(options, ExportOptions) else self.import_takes
        for name in sorted(options.given() - takes):
            flag = OPTION_NAMES.get(name, name).replace("_", "-")
            raise InputError(f"{path}: --{flag} is of other layouts than {self.name}, {self.summary}")


def note_left_out(field: AnyField, kept: Iterable[str] = ()) -> tuple[str, ...]:
    """Make the note of an export on what its format does not hold: all but the radiance and the layers `kept`."""
    known = {"rays": field.rays, "microlenses": field.samples}
    names = [name for name in field.layers if name not in set(kept)]
    names += [name for name, value in known.items() if value is not None]
    return (f"left out, which the format cannot hold: {', '.join(names)}",) if names else ()
