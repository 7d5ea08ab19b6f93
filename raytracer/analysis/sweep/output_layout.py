"""Where a sweep's files go, and which they are."""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.errors import InputError
from raytracer.film.output import SUFFIXES, check_file
from raytracer.sweeping.animation import KINDS, STEM, Kind, write_animation
from raytracer.sweeping.manifest import CSV, JSON, RECORDS, write_manifest
from raytracer.sweeping.page import PAGE, write_page
from raytracer.sweeping.points import Point, Sweep, Taken
from raytracer.sweeping.sheet import SHEET, write_sheet

DISPLAY_FORMATS = ("png", "jpg", "jpeg")
"""Suffixes of images that a page can show."""


def formats_of(formats: Sequence[str]) -> tuple[str, ...]:
    """The formats of a point's images, one for display first.

    Raises
    ------
    InputError : one is not known.
    """
    names = list(dict.fromkeys(name.strip().lower().removeprefix(".") for name in formats))
    for name in names:
        if f".{name}" not in SUFFIXES:
            raise InputError(f"--format {name}: unknown suffix '.{name}'; known: {', '.join(SUFFIXES)}")
    shown = [name for name in names if name in DISPLAY_FORMATS] or ["png"]
    return (*shown, *(name for name in names if name not in shown))


class Home(NamedTuple):
    """Where a sweep's files go, and which."""

    folder: Path
    formats: tuple[str, ...]
    animate: tuple[Kind, ...]
    fps: float

    def files(self, point: Point) -> tuple[str, ...]:
        """Names of a point's images."""
        return tuple(f"{point.name}.{suffix}" for suffix in self.formats)

    @property
    def others(self) -> tuple[str, ...]:
        """Names of the other files; of records, which are not known yet, any one."""
        return (JSON, CSV, PAGE, SHEET, *(f"{STEM}.{kind}" for kind in self.animate), f"{RECORDS}/{JSON}")

    def check(self) -> None:
        """Make sure, before anything is rendered, that all but the images can be written.

        Raises
        ------
        InputError : the folder is a file, or something else stands where a file is to go.
        """
        if self.folder.exists() and not self.folder.is_dir():
            raise InputError(f"{self.folder}: is a file, not a folder")
        for name in self.others:
            check_file(self.folder / name)

    def holds(self, taken: Taken) -> bool:
        """Whether all files of a point are there."""
        return all((self.folder / name).exists() for name in taken.files)

    def publishing(self, sweep: Sweep) -> dict[str, Callable[[], object]]:
        """What writes the files that show a sweep as a whole, by their names; each may raise an OutputError."""
        tasks: dict[str, Callable[[], object]] = {JSON: partial(write_manifest, sweep, self.folder)}
        if any(taken.status == "done" for taken in sweep.taken):
            tasks |= {SHEET: partial(write_sheet, sweep, self.shown), PAGE: partial(write_page, sweep, self.shown)}
            for kind in self.animate:
                tasks[f"{STEM}.{kind}"] = partial(write_animation, sweep, self.shown, kind, fps=self.fps)
        return tasks

    def shown(self, taken: Taken) -> NDArray[np.uint8] | None:
        """A point's picture, uint8 (height, width, 3), as its file for display holds it; None if that has gone."""
        import PIL.Image

        if not taken.files or not (self.folder / taken.files[0]).exists():
            return None
        with PIL.Image.open(self.folder / taken.files[0]) as file:
            return np.asarray(file.convert("RGB"))


def strangers(sweep: Sweep) -> list[str]:
    """Names of images in the sweep's folder that are none of its points': an earlier sweep's, perhaps."""
    if sweep.folder is None or not sweep.folder.is_dir():
        return []
    own = {name for taken in sweep.taken for name in taken.files} | {SHEET} | {f"{STEM}.{kind}" for kind in KINDS}
    images = (path.name for path in sweep.folder.iterdir() if path.suffix.lower() in (".png", ".jpg", ".jpeg", ".exr"))
    return sorted(name for name in images if name not in own)
