"""Decoder: from a raw picture of a camera with microlenses to a light field.

The white picture, of something evenly bright, gives the grid of the microlenses and the light of each pixel: the raw
picture is divided by it, both without the dark picture, so that 1 is as bright as the white was.  Its colour counts as
white.
"""

import math
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.film.light_field.field import LIT_LAYER, LightField, Samples
from raytracer.film.light_field.resampling import ResampledView, Resampler
from raytracer.film.light_field.views import Views
from raytracer.lightfield.calibrating.camera import CameraModel
from raytracer.lightfield.decoding.calibration import find_grid
from raytracer.lightfield.decoding.memory_needs import require_decoding, require_light_field, require_views
from raytracer.lightfield.decoding.microlens_grid import Grid, Optics
from raytracer.lightfield.decoding.raw_image import (
    LEAST_LIGHT,
    Floats32,
    Source,
    check_bayer,
    check_fits,
    demosaic,
    divide_by_white,
    find_defects,
    flatten_channels,
    has_color_filters,
    has_largest_value,
    light_weight,
    note_clipping,
    read_raw,
    source_name,
    subtract_dark,
)
from raytracer.lightfield.synthetic_aperture import cell_weights
from raytracer.util.errors import InputError

_WHOLLY_SEEN = 0.999
"""Share of the light of a rectified pixel that comes from lit ones, from which on it is one."""

_PIXEL_BYTES, _SAMPLE_BYTES = 13, 12
"""Bytes of a pixel of a view in memory, its light and if it is lit, and of the light under one microlens in a view."""

_THREADS = 4
"""Threads that make views: more wait for memory."""


@dataclass(frozen=True, eq=False)
class Decoded:
    """Raw picture that is ready to be resampled into views, one by one.

    Attributes
    ----------
    grid : of the microlenses.
    views : geometry of the views.
    settings : for the light field's file.
    notes : sentences for the user, about what is unusual.
    resampler : of the picture into views.
    light : picture without dark and vignetting, in units of `scale`.
    scale : light of one unit of `light`.
    weight : light that each pixel gets, 0..1; None without a white picture.
    matrix : 3 x 3, from the sensor's colours to linear sRGB; None if they are that.
    camera : whose distortion is taken from the views; None if there is none.
    """

    grid: Grid
    views: Views
    settings: dict[str, str | float | int]
    notes: tuple[str, ...]
    resampler: Resampler
    light: Floats32 | NDArray[np.uint16]
    scale: float
    weight: Floats32 | None
    matrix: NDArray[np.float64] | None = None
    camera: CameraModel | None = None

    def view(self, row: int, column: int) -> NDArray[np.float64]:
        """Make one view, float64 (height, width, 3); 0 where no light came to it."""
        return self._seen(row, column).values

    def light_field(self) -> LightField:
        """Make all views, in memory; an InputError says that they take more of it than is given."""
        views, places = self.views, self._places
        pixels = views.width * views.height
        stored = _PIXEL_BYTES * pixels + (0 if places is None else _SAMPLE_BYTES * len(places))
        weight = 0 if self.weight is None else self.weight.nbytes
        name = str(self.settings["decoded"])
        require_light_field(name, self.light.nbytes + weight + views.rows * views.columns * stored)
        radiance = np.empty((views.rows, views.columns, views.height, views.width, 3), dtype=np.float32)
        lit = np.empty(radiance.shape[:4], dtype=np.uint8)
        values = None if places is None else np.empty((views.rows, views.columns, len(places), 3), dtype=np.float32)
        for place, seen in self._all():
            radiance[place], lit[place] = seen.values, seen.seen
            if values is not None:
                values[place] = seen.samples
        samples = None if places is None or values is None else Samples(places, values)
        # Which pixels got light is known by the white picture.
        layers = {} if self.weight is None else {LIT_LAYER: lit}
        return LightField(radiance, views, layers, None, self.settings, samples)

    def write(self, path: str | Path, progress: Callable[[int, int], None] | None = None) -> None:
        """Write all views to an `.lf` file, each as it is made.

        Parameters
        ----------
        progress : called with the number of views that are written, and of all.

        Raises
        ------
        OutputError : the file cannot be written.
        """
        from raytracer.film.light_field.lf import Writer

        places = self._places
        with Writer(path, self.views, settings=self.settings, microlenses=places) as writer:
            for number, (place, seen) in enumerate(self._all(), 1):
                layers = {} if self.weight is None else {LIT_LAYER: seen.seen.astype(np.uint8)}
                writer.put_view(*place, seen.values, layers, None if places is None else seen.samples)
                if progress is not None:
                    progress(number, self.views.rows * self.views.columns)

    @cached_property
    def _outside(self) -> NDArray[np.bool_]:
        """Mask of the views that lie outside the sub-images: bool (rows, columns)."""
        return np.asarray(cell_weights(self.views) == 0.0)

    @property
    def _places(self) -> NDArray[np.float64] | None:
        """Places of the microlenses; None where views are not interpolated between them, or rectified after that."""
        return None if self.resampler.is_direct or self.camera is not None else self.resampler.places

    def _seen(self, row: int, column: int) -> ResampledView:
        """Resample one view, in three colours."""
        seen = self.resampler.weighted(self.light, row, column, self.weight, LEAST_LIGHT)
        values, samples = self.scale * seen.values, self.scale * seen.samples
        if self._outside[row, column]:
            # These pixels are under another microlens, and see through the other side of the lens.
            seen, samples = seen._replace(seen=np.zeros_like(seen.seen)), np.full_like(samples, np.nan)
        if self.camera is not None:
            values = self.camera.rectify(values)
            whole = self.camera.rectify(seen.seen.astype(np.float64), order=1)
            seen = seen._replace(seen=whole > _WHOLLY_SEEN)
            values[~seen.seen] = 0.0
        if values.ndim == 2:
            values, samples = np.repeat(values[..., None], 3, axis=2), np.repeat(samples[..., None], 3, axis=1)
        if self.matrix is not None:
            values, samples = values @ self.matrix.T, samples @ self.matrix.T
        return ResampledView(values, seen.seen, samples)

    def _all(self) -> Iterator[tuple[tuple[int, int], ResampledView]]:
        """Yield all views, resampled a few at a time: (row, column) and view."""
        places = list(np.ndindex(self.views.rows, self.views.columns))
        # What views share is computed before the threads start, and not by each of them.
        _ = self._places, self._outside
        with ThreadPoolExecutor(_THREADS) as pool:
            for start in range(0, len(places), _THREADS):
                some = places[start : start + _THREADS]
                yield from zip(some, pool.map(lambda place: self._seen(*place), some), strict=True)


def decode(
    raw: Source,
    white: Source | None = None,
    *,
    dark: Source | None = None,
    grid: Grid | None = None,
    bayer: str | None = None,
    views: int | None = None,
    srgb: bool = False,
    optics: Optics | CameraModel | None = None,
) -> Decoded:
    """Find the microlenses of a raw picture, and make it ready to be resampled into views.

    Parameters
    ----------
    white : picture of something evenly bright with the same camera at the same settings; without it the grid is
        looked for in the raw picture itself, and nothing is devignetted.
    dark : picture without light, which is subtracted from both others.
    grid : of the microlenses, if it is known.
    bayer : one of `BAYER`, where pixels have colour filters.
    views : number in a row and in a column; default: the largest odd number that fits under a microlens.
    srgb : True if 8- and 16-bit files hold display values; a camera's raw picture does not.
    optics : of the camera, or its calibration; without either there are no metres.

    Raises
    ------
    InputError : files are missing or broken, sizes differ, no grid is found, numbers make no sense, or it takes more
        memory than is given.
    """
    prepared = prepare_raw(raw, white, dark=dark, grid=grid, bayer=bayer, srgb=srgb)
    return _make_decoded(prepared, optics or Optics(), views)


class PreparedRaw(NamedTuple):
    """Raw picture without dark and vignetting, and the grid of its microlenses.

    light : picture, (height, width) or (height, width, channels), in units of `scale`.
    scale : light of one unit of `light`.
    weight : light that each pixel gets, 0..1; None without a white picture.
    name : of the raw picture.
    notes : sentences for the user, about what is unusual.
    """

    light: Floats32 | NDArray[np.uint16]
    scale: float
    weight: Floats32 | None
    grid: Grid
    name: str
    notes: list[str]


def prepare_raw(
    raw: Source,
    white: Source | None,
    *,
    dark: Source | None = None,
    grid: Grid | None = None,
    bayer: str | None = None,
    srgb: bool = False,
    has_glints: bool = False,
) -> PreparedRaw:
    """Take dark and vignetting off a raw picture, and find its microlenses; other parameters and errors are `decode`'s.

    has_glints : True if microlenses show the scene sharply: a bright pixel of `raw` then need not be defective.
    """
    names = {kind: source_name(source, kind) for kind, source in (("raw", raw), ("white", white), ("dark", dark))}
    notes: list[str] = []
    picture = read_raw(raw, names["raw"], srgb)
    height, width = picture.shape[:2]
    if bayer is not None:
        bayer = check_bayer(bayer, picture, names["raw"])
    require_decoding(
        names["raw"],
        picture.shape,
        has_dark=dark is not None,
        is_mosaic=bayer is not None,
        in_memory=not isinstance(raw, str | Path),
        finds_grid=grid is None,
    )
    background = None if dark is None else check_fits(read_raw(dark, names["dark"], srgb), picture, names, "dark")
    picture = subtract_dark(picture, background)

    weight: Floats32 | None = None
    if white is None:
        grid = grid or find_grid(flatten_channels(picture, bayer), names["raw"])
        notes.append("no white picture: sub-images keep their darker edges")
    else:
        bright = check_fits(read_raw(white, names["white"], srgb), picture, names, "white")
        if has_largest_value(white):
            note_clipping(bright, names["white"], notes)
        bright = subtract_dark(bright, background)
        if not (bright > 0.0).any():
            comparison = f": nowhere brighter than {names['dark']}" if background is not None else ""
            raise InputError(f"{names['white']}: is black{comparison}")
        flat = flatten_channels(bright, bayer)
        mosaic = bayer is not None or has_color_filters(bright)
        if mosaic and bayer is None:
            notes.append("every other pixel is brighter: if they have colour filters, --bayer says in which order")
        grid = grid or find_grid(flat, names["white"])
        weight = light_weight(flat)
        defective = find_defects(flat, mosaic, dead=True)
        if not has_glints:
            defective |= find_defects(picture, mosaic)
        if number := int(np.count_nonzero(defective & (weight > LEAST_LIGHT))):
            notes.append(f"{number} defective pixels are left out")
        weight[defective] = 0.0
        picture = divide_by_white(picture, bright, weight)
    if (grid.width, grid.height) != (width, height):
        raise InputError(
            f"{names['raw']}: has {width} x {height} pixels, and the grid is of pictures of {grid.width} x "
            f"{grid.height}"
        )
    light, scale = (picture, 1.0) if bayer is None else demosaic(picture, bayer)
    return PreparedRaw(light, scale, weight, grid, names["raw"], notes)


def _make_decoded(prepared: PreparedRaw, optics: Optics | CameraModel, count: int | None) -> Decoded:
    """Set up the resampler and the geometry of the views."""
    picture, scale, weight, grid, name, notes = prepared
    height, width = picture.shape[:2]
    most = math.floor(grid.lattice.pitch)
    number = (most if most % 2 else most - 1) if count is None else count
    if not 1 <= number <= most:
        raise InputError(f"--views {number}: must be from 1 to {most}, the whole pixels under a microlens")
    try:
        resampler = Resampler(grid.lattice, width, height, count=number)
    except ValueError as error:
        raise InputError(f"{name}: {error}") from None
    kept = picture.nbytes + (0 if weight is None else weight.nbytes)
    require_views(name, kept, number, resampler.width, resampler.height)
    camera = optics if isinstance(optics, CameraModel) else None
    nominal = Optics() if isinstance(optics, CameraModel) else optics
    try:
        views = nominal.views(grid, resampler)
    except ValueError as error:
        raise InputError(f"{name}: {error}") from None
    if camera is not None:
        camera.check_views(views, "--calibration")
        views = camera.views(grid.diameter)
    settings = grid_settings(grid, name)
    if camera is None and nominal.missing:
        settings["units"] = "views"
        notes.append(f"distances are in pixels from view to view; metres would need {nominal.missing}")
    rectified = camera if camera is not None and camera.is_distorted else None
    return Decoded(grid, views, settings, tuple(notes), resampler, picture, scale, weight, camera=rectified)


def grid_settings(grid: Grid, name: str) -> dict[str, str | float | int]:
    """Return what the file of a decoded light field says of the raw picture `name` and its grid."""
    return {
        "decoded": name,
        "microlenses": grid.layout,
        "microlens_pitch_pixels": grid.lattice.pitch,
        "microlens_rotation_degrees": grid.lattice.rotation,
    }
