"""From the container of a photograph to a light field: levels, white picture, colours and optics from its metadata."""

import dataclasses
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from raytracer.lightfield.calibrating.camera import CameraModel
from raytracer.lightfield.decoding.decoder import Decoded, decode
from raytracer.lightfield.decoding.lytro.container import is_container
from raytracer.lightfield.decoding.lytro.metadata import PhotoMetadata
from raytracer.lightfield.decoding.lytro.optics import optics_from_metadata
from raytracer.lightfield.decoding.lytro.photo import Photo, PhotoFile, open_photo
from raytracer.lightfield.decoding.lytro.white_pictures import (
    choose_white_picture,
    find_white_pictures,
    holds_white_pictures,
)
from raytracer.lightfield.decoding.microlens_grid import Grid, Optics
from raytracer.lightfield.decoding.raw_image import Floats32, RawPicture, Source, bright_quantile
from raytracer.util.errors import InputError

Colors = Literal["camera", "white"]
"""Source of colours: the camera's own gains and matrix, or the white picture, whose colour then counts as white."""

_PITCH_TOLERANCE = 0.02
"""Difference of the pitch from that of the metadata, as a share, from which on a note is made."""


_MANY_CLIPPED = 0.001
"""Share of clipped pixels from which on a note is made."""


class _White(NamedTuple):
    """A white picture's light, and notes for the user."""

    source: Source
    notes: tuple[str, ...]


def decode_photo(
    path: str | Path,
    white: str | Path | None = None,
    *,
    grid: Grid | None = None,
    views: int | None = None,
    colors: Colors = "camera",
    optics: Optics | CameraModel | None = None,
) -> Decoded:
    """Make the photograph in a container of Lytro's ready to be resampled into views.

    1 is the sensor's largest code, in the middle of the brightest sub-images.

    Parameters
    ----------
    white : the camera's white pictures, of which the nearest in zoom and focus is taken: a folder, an archive
        (.tar), a package (data.C.0), one of them (.RAW); or a container with a photograph of something white, or any
        other picture of it.  By default the one that the container brings along, if it does.
    grid : of the microlenses, if it is known.
    views : number in a row and in a column; default: the largest odd number that fits under a microlens.
    colors : "camera" for the gains and the matrix of the metadata, "white" if the white picture's colour is white.
    optics : what is known better than by the metadata, or a calibration of the camera.

    Raises
    ------
    InputError : files are missing, damaged, or of another camera; or as `decode`.
    """
    photo = open_photo(path)
    metadata = photo.metadata
    picture = _as_source(photo.read())
    flat = _read_white(photo, white)
    bright = None if flat is None else _scale_white(flat.source, metadata, colors)
    decoded = decode(
        picture,
        bright,
        grid=grid,
        bayer=metadata.bayer,
        views=views,
        optics=optics if isinstance(optics, CameraModel) else optics_from_metadata(metadata, optics or Optics()),
    )
    clipped = [note for one in (picture, flat and flat.source) for note in _clipping(one)]
    notes = (*(() if flat is None else flat.notes), *clipped, *decoded.notes, *_notes(metadata, decoded.grid))
    settings = {**decoded.settings, **({"camera": metadata.camera} if metadata.camera else {})}
    matrix = None
    if colors == "camera" and metadata.bayer is not None:
        matrix = np.eye(3) if metadata.matrix is None else metadata.matrix
        matrix = matrix * np.array(metadata.gains or (1.0, 1.0, 1.0))
    return dataclasses.replace(decoded, notes=notes, settings=settings, matrix=matrix)


def _read_white(photo: PhotoFile, white: str | Path | None) -> _White | None:
    """Read the white picture for a photograph; None if there is none."""
    if white is None:
        return _White(_as_source(photo.read_white()), ()) if photo.has_white else None
    if holds_white_pictures(white):
        chosen = choose_white_picture(find_white_pictures(white), photo.metadata, white)
        lens, wanted = chosen.metadata.lens, photo.metadata.lens
        steps = [
            f"{name} step {there:g} for {here:g}"
            for name, there, here in (
                ("zoom", lens.zoom_step, wanted.zoom_step),
                ("focus", lens.focus_step, wanted.focus_step),
            )
            if there is not None and here is not None
        ]
        return _White(_as_source(chosen.read()), (", ".join((f"white picture: {chosen.name}", *steps)),))
    if is_container(white):
        return _White(_as_source(open_photo(white).read()), ())
    return _White(white, ())


def _clipping(source: Source | None) -> list[str]:
    """Return a note if many pixels of a picture are at the end of the scale."""
    if not isinstance(source, RawPicture):
        return []
    share = np.count_nonzero(source.values >= 1.0) / source.values.size
    return [f"{source.name}: {share:.1%} of it is clipped"] if share > _MANY_CLIPPED else []


def _as_source(photo: Photo) -> RawPicture:
    return RawPicture(photo.light(), photo.name)


def _scale_white(source: Source, metadata: PhotoMetadata, colors: Colors) -> Source:
    """Scale a white picture so that its brightest light is 1, for "camera" in each colour of the filters.

    Dividing by it then takes away the vignetting only, and leaves the colours to the camera's gains.
    """
    if not isinstance(source, RawPicture):
        return source
    light: Floats32 = source.values
    scaled = np.empty_like(light)
    filters = list(np.ndindex(2, 2)) if metadata.bayer is not None else [(0, 0)]
    step = 2 if metadata.bayer is not None else 1
    parts = [light[row::step, column::step] for row, column in filters]
    means = np.array([float(part.mean(dtype=np.float64)) for part in parts])
    if not (means > 0.0).all():
        raise InputError(f"{source.name}: is black")
    green = means[0] if metadata.bayer is None else means[[color == "g" for color in metadata.bayer]].mean()
    for (row, column), part, mean in zip(filters, parts, means, strict=True):
        scaled[row::step, column::step] = part * np.float32(green / mean if colors == "camera" else 1.0)
    scaled /= np.float32(bright_quantile(scaled))
    return RawPicture(scaled, source.name)


def _notes(metadata: PhotoMetadata, grid: Grid) -> list[str]:
    """Return what is unusual about a photograph."""
    notes = []
    below = metadata.microlenses
    if below.pitch is not None and below.pixel_pitch is not None:
        told = below.pitch / below.pixel_pitch
        if abs(grid.lattice.pitch - told) > _PITCH_TOLERANCE * told:
            notes.append(
                f"the microlenses are {grid.lattice.pitch:.4g} pixels apart, and {told:.4g} by the metadata: "
                "the white picture may be of another camera"
            )
    if metadata.orientation != 1:
        notes.append("the camera was turned: the views are as the sensor saw them")
    return notes
