"""From a raw picture of a camera with microlenses to a light field.

The white picture, of something evenly bright, says where the microlenses are and how much light each pixel gets: the
raw picture is divided by it, each without the dark picture, so that 1 is as bright as the white was.  What its colour
was counts as white.
"""

import functools
import math
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytracer.errors import InputError
from raytracer.lightfield.decoding.calibration import Grid, find_grid
from raytracer.lightfield.decoding.optics import Optics
from raytracer.lightfield.openings import cell_weights
from raytracer.plenoptic.field import LIT, LightField, Samples
from raytracer.plenoptic.resampling import Resampler, Seen
from raytracer.plenoptic.views import Views

Singles = NDArray[np.float32]
Source = str | Path | NDArray[Any]
"""A file's name, or an array (height, width) or (height, width, 3) of linear light; uint8 and uint16 stand for 0..1."""

BAYER = ("rggb", "bggr", "grbg", "gbrg")
"""Colours of the filters on the first two pixels of the first two rows."""

_LEAST_LIGHT = 0.03
"""Of the brightest: what gets less is noise once it is divided by the light that it gets."""

_HOT, _DEAD = 1.6, 0.4
"""Of the brightest and the darkest of the eight neighbours: a pixel of which it sees more or less is defective."""

_UNBOUNDED = (".npy", ".exr", ".hdr")
"""Files without a largest value."""

_MANY_CLIPPED = 0.001
"""Part of a picture whose clipping is worth a word."""

_LARGEST_NUMBER = 65535.0

_LEAST_SCALE = 255
"""At which the numbers of the coarsest sensor end."""

_DARKEST = 1e-30
"""In place of the light of a picture that has none, lest it is divided by 0."""

_BAND = 256
"""Rows of pixels that are looked at together: few enough for the processor's caches."""

_SAMPLE = 1_000_000
"""Pixels of which a quantile is taken."""

_FILTERED = 1.1
"""Times by which one in four pixels is brighter than another on average, from which on that is by colour filters."""

_THREADS = 4
"""Views are made side by side: more threads wait for memory."""


@dataclass(frozen=True, eq=False)
class Decoded:
    """A raw picture that is ready to be turned into views, one by one.

    Attributes
    ----------
    grid : of the microlenses.
    views : geometry of the views.
    settings : for the light field's file.
    notes : sentences about what is not as one might expect.
    """

    grid: Grid
    views: Views
    settings: dict[str, str | float | int]
    notes: tuple[str, ...]
    resampler: Resampler
    light: Singles | NDArray[np.uint16]
    scale: float
    weight: Singles | None

    def view(self, row: int, column: int) -> NDArray[np.float64]:
        """What one view saw, float64 (height, width, 3); 0 where no light came to it."""
        return self._seen(row, column).values

    def light_field(self) -> LightField:
        """All views, in memory."""
        views = self.views
        radiance = np.empty((views.rows, views.columns, views.height, views.width, 3), dtype=np.float32)
        lit = np.empty(radiance.shape[:4], dtype=np.uint8)
        places = self._places
        values = None if places is None else np.empty((views.rows, views.columns, len(places), 3), dtype=np.float32)
        for row, column, seen in self._all():
            radiance[row, column], lit[row, column] = seen.values, seen.seen
            if values is not None:
                values[row, column] = seen.samples
        samples = None if places is None or values is None else Samples(places, values)
        return LightField(radiance, views, {LIT: lit} if self._tells_lit else {}, None, self.settings, samples)

    def write(self, path: str | Path, progress: Callable[[int, int], None] | None = None) -> None:
        """Write all views to an `.lf` file, each as it is made.

        Parameters
        ----------
        progress : is told how many views there are already, and of how many.

        Raises
        ------
        OutputError : the file cannot be written.
        """
        from raytracer.plenoptic.lf import Writer

        places = self._places
        with Writer(path, self.views, settings=self.settings, microlenses=places) as writer:
            for number, (row, column, seen) in enumerate(self._all(), 1):
                layers = {LIT: seen.seen.astype(np.uint8)} if self._tells_lit else {}
                writer.put_view(row, column, seen.values, layers, None if places is None else seen.samples)
                if progress is not None:
                    progress(number, self.views.rows * self.views.columns)

    @cached_property
    def _outside(self) -> NDArray[np.bool_]:
        """Mask of the views that lie outside the sub-images: bool (rows, columns)."""
        return np.asarray(cell_weights(self.views) == 0.0)

    @property
    def _tells_lit(self) -> bool:
        """Tell if it is known which pixels got light: by the white picture."""
        return self.weight is not None

    @property
    def _places(self) -> NDArray[np.float64] | None:
        """Places of the microlenses; None where pixels of views are not interpolated between them."""
        return None if self.resampler.is_direct else self.resampler.places

    def _seen(self, row: int, column: int) -> Seen:
        """One view, in three colours."""
        seen = self.resampler.weighted(self.light, row, column, self.weight, _LEAST_LIGHT)
        values, samples = self.scale * seen.values, self.scale * seen.samples
        if self._outside[row, column]:
            # There it is another microlens that looks, through the other side of the lens.
            seen, samples = seen._replace(seen=np.zeros_like(seen.seen)), np.full_like(samples, np.nan)
        if values.ndim == 2:
            values, samples = np.repeat(values[..., None], 3, axis=2), np.repeat(samples[..., None], 3, axis=1)
        return Seen(values, seen.seen, samples)

    def _all(self) -> Iterator[tuple[int, int, Seen]]:
        """Go through all views, a few at a time: row, column and what was seen."""
        places = list(np.ndindex(self.views.rows, self.views.columns))
        # What all need is made once, before they start.
        self.resampler.prepare()
        with ThreadPoolExecutor(_THREADS) as pool:
            for start in range(0, len(places), _THREADS):
                some = places[start : start + _THREADS]
                for (row, column), seen in zip(some, pool.map(lambda place: self._seen(*place), some), strict=True):
                    yield row, column, seen


def decode(
    raw: Source,
    white: Source | None = None,
    *,
    dark: Source | None = None,
    grid: Grid | None = None,
    bayer: str | None = None,
    views: int | None = None,
    srgb: bool = False,
    optics: Optics | None = None,
) -> Decoded:
    """Find the microlenses of a raw picture, and make it ready to be turned into views.

    Parameters
    ----------
    white : picture of something evenly bright with the same camera at the same settings; without it the grid is
        looked for in the raw picture itself, and nothing is devignetted.
    dark : picture without light, which is taken off both others.
    grid : of the microlenses, if it is known.
    bayer : one of `BAYER`, where pixels have colour filters.
    views : in a row and in a column; default: the largest odd number that fits under a microlens.
    srgb : whether 8- and 16-bit files hold display values; a camera's raw picture does not.
    optics : of the camera; without it there are no metres.

    Raises
    ------
    InputError : files are missing or broken, sizes differ, no grid is found, or numbers make no sense.
    """
    names = {"raw": _name(raw, "raw"), "white": _name(white, "white"), "dark": _name(dark, "dark")}
    notes: list[str] = []
    picture = _read(raw, names["raw"], srgb)
    height, width = picture.shape[:2]
    if bayer is not None:
        bayer = _bayer(bayer, picture, names["raw"])
    background = None if dark is None else _fitting(_read(dark, names["dark"], srgb), picture, names, "dark")
    picture = _without(picture, background)

    weight: Singles | None = None
    if white is None:
        grid = grid or find_grid(_flat(picture, bayer), names["raw"])
        notes.append("no white picture: sub-images keep their darker edges")
    else:
        bright = _fitting(_read(white, names["white"], srgb), picture, names, "white")
        if _has_scale(white):
            _tell_clipped(bright, names["white"], notes)
        bright = _without(bright, background)
        if not (bright > 0.0).any():
            than = f": nowhere brighter than {names['dark']}" if background is not None else ""
            raise InputError(f"{names['white']}: is black{than}")
        flat = _flat(bright, bayer)
        mosaic = bayer is not None or _filtered(bright)
        if mosaic and bayer is None:
            notes.append("every other pixel is brighter: if they have colour filters, --bayer says in which order")
        grid = grid or find_grid(flat, names["white"])
        weight = _weight(flat)
        defective = _defects(flat, mosaic, dead=True) | _defects(picture, mosaic)
        if number := int(np.count_nonzero(defective & (weight > _LEAST_LIGHT))):
            notes.append(f"{number} defective pixels are left out")
        weight[defective] = 0.0
        picture = _divided(picture, bright, weight)
    if (grid.width, grid.height) != (width, height):
        raise InputError(
            f"{names['raw']}: has {width} x {height} pixels, and the grid is of pictures of {grid.width} x "
            f"{grid.height}"
        )
    light, scale = (picture, 1.0) if bayer is None else _demosaiced(picture, bayer)
    return _made(light, scale, weight, grid, optics or Optics(), views, names["raw"], notes)


def _made(
    picture: Singles | NDArray[np.uint16],
    scale: float,
    weight: Singles | None,
    grid: Grid,
    optics: Optics,
    count: int | None,
    name: str,
    notes: list[str],
) -> Decoded:
    height, width = picture.shape[:2]
    most = math.floor(grid.lattice.pitch)
    number = (most if most % 2 else most - 1) if count is None else count
    if not 1 <= number <= most:
        raise InputError(f"--views {number}: must be from 1 to {most}, the whole pixels under a microlens")
    try:
        resampler = Resampler(grid.lattice, width, height, count=number)
    except ValueError as error:
        raise InputError(f"{name}: {error}") from None
    try:
        views = optics.views(grid, resampler)
    except ValueError as error:
        raise InputError(f"--focus-distance {optics.focus_distance:g}: {error}") from None
    settings: dict[str, str | float | int] = {
        "decoded": name,
        "microlenses": grid.layout,
        "microlens_pitch_pixels": grid.lattice.pitch,
        "microlens_rotation_degrees": grid.lattice.rotation,
    }
    if optics.missing:
        settings["units"] = "views"
        notes.append(f"distances are in pixels from view to view; metres would need {optics.missing}")
    return Decoded(grid, views, settings, tuple(notes), resampler, picture, scale, weight)


# ---- pictures


def _name(source: Source | None, otherwise: str) -> str:
    return str(source) if isinstance(source, str | Path) else otherwise


def _read(source: Source, name: str, srgb: bool) -> Singles:
    """A picture (height, width) or (height, width, 3) in linear light; what is grey in three channels has one."""
    from raytracer.assets.images import read_image

    if isinstance(source, str | Path):
        image = read_image(source)
        stored = image.texels.dtype == np.float32 and not (srgb and image.integer)
        values = np.asarray(image.texels, np.float32) if stored else image.linear(srgb and image.integer)
    else:
        array = np.asarray(source)
        if array.dtype.kind not in "fu" or array.ndim not in (2, 3) or array.size == 0:
            raise InputError(f"{name}: a picture has the shape (height, width) or (height, width, 3)")
        largest = np.iinfo(array.dtype).max if array.dtype.kind == "u" else 1.0
        values = np.asarray(array, np.float32) / np.float32(largest)
        values = values[..., None] if values.ndim == 2 else values
        if not np.isfinite(values.sum(dtype=np.float64)):
            raise InputError(f"{name}: holds values that are not finite")
    channels = values.shape[2]
    if channels > 4:
        raise InputError(f"{name}: a picture has 1 or 3 channels, got {channels}")
    if channels < 3:
        return np.ascontiguousarray(values[..., 0])
    values = np.ascontiguousarray(values[..., :3])
    is_grey = np.array_equal(values[..., 0], values[..., 1]) and np.array_equal(values[..., 0], values[..., 2])
    return np.ascontiguousarray(values[..., 0]) if is_grey else values


def _fitting(picture: Singles, raw: Singles, names: dict[str, str], kind: str) -> Singles:
    """A picture that goes with the raw one: as large, and with as many channels.

    Raises
    ------
    InputError : it does not.
    """
    if picture.shape[:2] != raw.shape[:2]:
        (height, width), (tall, wide) = picture.shape[:2], raw.shape[:2]
        turned = ", turned by 90 degrees" if (height, width) == (wide, tall) else ""
        raise InputError(
            f"{names[kind]}: has {width} x {height} pixels, and {names['raw']} has {wide} x {tall}{turned}: "
            f"the {kind} picture must be of the same camera, as it comes from it"
        )
    if picture.ndim == 3 and raw.ndim == 2:
        raise InputError(f"{names[kind]}: has three colours, and {names['raw']} has one channel")
    return picture


def _has_scale(source: Source) -> bool:
    """Whether there is a largest value."""
    if isinstance(source, str | Path):
        return Path(source).suffix.lower() not in _UNBOUNDED
    return np.asarray(source).dtype.kind == "u"


def _without(picture: Singles, background: Singles | None) -> Singles:
    if background is None:
        return picture
    return picture - (background[..., None] if picture.ndim > background.ndim else background)


def _bayer(bayer: str, raw: Singles, name: str) -> str:
    from raytracer.film.sensor import require_demosaic

    if bayer.lower() not in BAYER:
        raise InputError(f"--bayer {bayer}: must be one of {', '.join(BAYER)}")
    if raw.ndim == 3:
        raise InputError(f"{name}: has three colours already, and --bayer is for one channel behind colour filters")
    require_demosaic()
    return bayer.lower()


def _flat(picture: Singles, bayer: str | None) -> Singles:
    """One channel (height, width): of colours their mean, of a mosaic all as bright as the others."""
    if picture.ndim == 3:
        return np.asarray(picture.mean(axis=2), np.float32)
    if bayer is None:
        return picture
    flat = np.empty_like(picture)
    for row in (0, 1):
        for column in (0, 1):
            part = picture[row::2, column::2]
            mean = float(part.mean(dtype=np.float64))
            flat[row::2, column::2] = part / mean if mean > 0.0 else part
    return flat


def _filtered(white: Singles) -> bool:
    """Whether a picture seems to be behind a mosaic of colour filters."""
    if white.ndim == 3:
        return False
    means = [float(white[i::2, j::2].mean(dtype=np.float64)) for i in (0, 1) for j in (0, 1)]
    return max(means) > _FILTERED * min(means)


def _tell_clipped(white: Singles, name: str, notes: list[str]) -> None:
    highest = float(white.max())
    share = np.count_nonzero(white == highest) / white.size
    # What is rendered without noise may be alike everywhere, and is not at the end of a scale.
    if share > _MANY_CLIPPED and _ends_a_scale(highest):
        notes.append(f"{name}: {share:.1%} of it is clipped: the raw picture is too dark there once it is devignetted")


def _ends_a_scale(value: float) -> bool:
    """Whether a sensor's numbers can end at a value: in binary it is all ones, wherever they are in 16 bits."""
    number = round(value * _LARGEST_NUMBER)
    if number < 1:
        return False
    ones = number // (number & -number)
    return ones >= _LEAST_SCALE and ones & (ones + 1) == 0


def _weight(flat: Singles) -> Singles:
    """How much light each pixel gets, of the brightest."""
    brightest = _bright(flat)
    if not brightest > 0.0:
        brightest = float(flat.max())
    weight = np.asarray(flat / np.float32(brightest), np.float32)
    return np.clip(weight, 0.0, 1.0, out=weight)


def _defects(picture: Singles, mosaic: bool, dead: bool = False) -> NDArray[np.bool_]:
    """Pixels (height, width) that see much more than all around them, or if `dead` much less, too.

    A defect is by itself: no lens makes one pixel so much brighter than the next, as long as those have one colour.
    """
    if picture.ndim == 3:
        return np.asarray(np.any([_defects(picture[..., i], False, dead) for i in range(picture.shape[2])], axis=0))
    apart = 2 if mosaic else 1
    height, width = picture.shape
    least = np.float32(_LEAST_LIGHT * max(0.0, _bright(picture)))
    bad = np.zeros(picture.shape, bool)
    # A band at a time, with the neighbours of its first and last row.
    for top in range(0, height, _BAND):
        part = picture[top : top + _BAND]
        around = np.pad(picture[max(0, top - apart) : top + _BAND + apart], ((0, 0), (apart, apart)), mode="edge")
        above, below = min(top, apart), max(0, min(apart, height - top - len(part)))
        around = np.pad(around, ((apart - above, apart - below), (0, 0)), mode="edge")
        places = [(i, j) for i in (0, apart, 2 * apart) for j in (0, apart, 2 * apart) if (i, j) != (apart, apart)]
        ring = [around[i : i + len(part), j : j + width] for i, j in places]
        highest = np.maximum(functools.reduce(np.maximum, ring), least)
        found = part > np.float32(_HOT) * highest
        if dead:
            found |= part < np.float32(_DEAD) * functools.reduce(np.minimum, ring)
        bad[top : top + _BAND] = found
    return bad


def _bright(picture: NDArray[Any]) -> float:
    """What hardly a pixel exceeds."""
    step = max(1, math.isqrt(picture.size // _SAMPLE))
    return float(np.quantile(picture[::step, ::step], 0.99))


def _divided(picture: Singles, bright: Singles, weight: Singles) -> Singles:
    """The picture in parts of the white one; 0 where that has no light."""
    ratio = np.zeros_like(picture)
    lit = weight >= np.float32(0.25 * _LEAST_LIGHT)
    if picture.ndim == 2:
        np.divide(picture, bright, out=ratio, where=lit & (bright > 0.0))
        return ratio
    for channel in range(picture.shape[2]):
        light = bright if bright.ndim == 2 else bright[..., channel]
        np.divide(picture[..., channel], light, out=ratio[..., channel], where=lit & (light > 0.0))
    return ratio


def _demosaiced(mosaic: Singles, bayer: str) -> tuple[NDArray[np.uint16], float]:
    """Three colours (height, width, 3) of a mosaic, and what one step of them is: what is missing follows the edges.

    References: https://docs.opencv.org/4.x/d8/d01/group__imgproc__color__conversions.html, "Edge-Aware Demosaicing".
    """
    import cv2

    # Noise where there is next to no light must not take up the range of whole numbers.
    most = 1.5 * max(_bright(mosaic), _DARKEST)
    numbers = np.clip(mosaic * np.float32(_LARGEST_NUMBER / most), 0.0, _LARGEST_NUMBER).astype(np.uint16)
    colors = cv2.demosaicing(numbers, getattr(cv2, f"COLOR_Bayer{bayer.upper()}2RGB_EA"))
    return np.asarray(colors), most / _LARGEST_NUMBER
