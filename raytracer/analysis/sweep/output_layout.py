"""Layout of a sweep's folder: names of its files, and their writers."""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.analysis.sweep.animation import STEM, encode_animation
from raytracer.analysis.sweep.contact_sheet import SHEET, contact_sheet
from raytracer.analysis.sweep.manifest import CSV, JSON, RECORDS, write_manifest
from raytracer.analysis.sweep.page import PAGE, page
from raytracer.analysis.sweep.results import Images, PointResult, Sweep, SweepPoint
from raytracer.film.formats.registry import animation_suffixes, image_formats, picture_suffixes
from raytracer.util.atomic_write import check_file, write_bytes
from raytracer.util.errors import InputError


def normalize_formats(formats: Sequence[str]) -> tuple[str, ...]:
    """Normalize the formats of a point's images, one for display first.

    Raises
    ------
    InputError : one is not known.
    """
    names = list(dict.fromkeys(name.strip().lower().removeprefix(".") for name in formats))
    for name in names:
        if f".{name}" not in picture_suffixes():
            raise InputError(f"--format {name}: unknown suffix '.{name}'; known: {', '.join(picture_suffixes())}")
    # What browsers can show.
    for_display = [name for name in names if image_formats()[f".{name}"].media_type] or ["png"]
    return (*for_display, *(name for name in names if name not in for_display))


class OutputLayout(NamedTuple):
    """Folder and names of a sweep's files."""

    folder: Path
    formats: tuple[str, ...]
    animate: tuple[str, ...]
    fps: float

    def files(self, point: SweepPoint) -> tuple[str, ...]:
        """Return the names of a point's images."""
        return tuple(f"{point.name}.{suffix}" for suffix in self.formats)

    @property
    def other_files(self) -> tuple[str, ...]:
        """Names of the other files; of records, whose names are not known yet, any one."""
        return (JSON, CSV, PAGE, SHEET, *(f"{STEM}.{kind}" for kind in self.animate), f"{RECORDS}/{JSON}")

    def check(self) -> None:
        """Make sure, before anything is rendered, that all but the images can be written.

        Raises
        ------
        InputError : the folder is a file, or something else stands where a file is to go.
        """
        if self.folder.exists() and not self.folder.is_dir():
            raise InputError(f"{self.folder}: is a file, not a folder")
        for name in self.other_files:
            check_file(self.folder / name)

    def has_files(self, result: PointResult) -> bool:
        """Tell if all files of a point are there."""
        return all((self.folder / name).exists() for name in result.files)

    def writers(self, sweep: Sweep) -> dict[str, Callable[[], object]]:
        """Make functions that write the files of the sweep as a whole, by name; each may raise an OutputError."""
        tasks: dict[str, Callable[[], object]] = {JSON: partial(write_manifest, sweep, self.folder)}
        if any(result.status == "done" for result in sweep.results):
            encoders: dict[str, Callable[[Sweep, Images], bytes]] = {SHEET: contact_sheet, PAGE: page}
            for kind in self.animate:
                encoders[f"{STEM}.{kind}"] = partial(encode_animation, kind=kind, fps=self.fps)
            for name, encode in encoders.items():
                tasks[name] = partial(self._write, name, encode, sweep)
        return tasks

    def _write(self, name: str, encode: Callable[[Sweep, Images], bytes], sweep: Sweep) -> None:
        write_bytes(self.folder / name, encode(sweep, self.display_image))

    def display_image(self, result: PointResult) -> NDArray[np.uint8] | None:
        """Read a point's image, uint8 (height, width, 3), from its file for display; None if that is gone."""
        import PIL.Image

        if not result.files or not (self.folder / result.files[0]).exists():
            return None
        with PIL.Image.open(self.folder / result.files[0]) as file:
            return np.asarray(file.convert("RGB"))


def stale_images(sweep: Sweep) -> list[str]:
    """List images in the sweep's folder that are none of its points': an earlier sweep's, perhaps."""
    if sweep.folder is None or not sweep.folder.is_dir():
        return []
    own = {name for result in sweep.results for name in result.files}
    own |= {SHEET, *(STEM + suffix for suffix in animation_suffixes())}
    images = (path.name for path in sweep.folder.iterdir() if path.suffix.lower() in picture_suffixes())
    return sorted(name for name in images if name not in own)
