"""From the container of a photograph to a light field: levels, white picture, colours and optics from its metadata."""

import dataclasses
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from raytracer.film.formats.registry import linear_suffixes
from raytracer.lightfield.calibrating.camera import CameraModel
from raytracer.lightfield.decoding.decoder import Decoded, decode
from raytracer.lightfield.decoding.lytro.container import is_container
from raytracer.lightfield.decoding.lytro.metadata import PhotoMetadata
from raytracer.lightfield.decoding.lytro.optics import optics_from_metadata
from raytracer.lightfield.decoding.lytro.photo import Photo, PhotoFile, codes_to_light, open_photo
from raytracer.lightfield.decoding.lytro.white_pictures import (
    choose_white_picture,
    find_white_pictures,
    holds_white_pictures,
)
from raytracer.lightfield.decoding.microlens_grid import Grid, Optics
from raytracer.lightfield.decoding.raw_image import (
    LARGEST_CODE,
    MANY_CLIPPED,
    RawPicture,
    bright_quantile,
    check_fits,
    read_raw,
    read_stored,
)
from raytracer.util.errors import InputError

Colors = Literal["camera", "white"]
"""Source of colours: the camera's own gains and matrix, or the white picture, whose colour then counts as white."""

_PITCH_TOLERANCE = 0.02
"""Difference of the pitch from that of the metadata, as a share, from which on a note is made."""


class _White(NamedTuple):
    """A white picture's light, and notes for the user."""

    source: RawPicture
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
        other picture of it: the sensor's codes, black level and all, if its numbers are integers, and else light.  By
        default the one that the container brings along, if it does.
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
    bright = None
    if flat is not None:
        names = {"raw": picture.name, "white": flat.source.name}
        check_fits(flat.source.values, picture.values, names, "white")
        bright = _scale_white(flat.source, metadata, colors)
    decoded = decode(
        picture,
        bright,
        grid=grid,
        bayer=metadata.bayer,
        views=views,
        optics=optics if isinstance(optics, CameraModel) else optics_from_metadata(metadata, optics or Optics()),
    )
    known = (*(() if flat is None else flat.notes), *_clipping(picture))
    notes = (*known, *decoded.notes, *_notes(metadata, decoded.grid))
    settings = {**decoded.settings, **({"camera": metadata.camera} if metadata.camera else {})}
    matrix = None
    if colors == "camera" and metadata.bayer is not None:
        matrix = np.eye(3) if metadata.matrix is None else metadata.matrix
        matrix = matrix * np.array(metadata.gains or (1.0, 1.0, 1.0))
    return dataclasses.replace(decoded, notes=notes, settings=settings, matrix=matrix)


def _read_white(photo: PhotoFile, white: str | Path | None) -> _White | None:
    """Read the white picture for a photograph; None if there is none."""
    told: tuple[str, ...] = ()
    if white is None:
        if not photo.has_white:
            return None
        source = _as_source(photo.read_white())
    elif holds_white_pictures(white):
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
        told = (", ".join((f"white picture: {chosen.name}", *steps)),)
        source = _as_source(chosen.read())
    elif is_container(white):
        source = _as_source(open_photo(white).read())
    else:
        return _read_other_white(white, photo.metadata)
    return _White(source, (*told, *_clipping(source)))


def _read_other_white(path: str | Path, metadata: PhotoMetadata) -> _White:
    """Read a white picture that is in no file of a camera's, as `rt lightfield extract` writes them, or another.

    Integers are codes of the sensor, with the black level in them, which fill 16 bits or are as they were (.npy); other
    numbers are light, which has no end.
    """
    image = read_stored(path)
    values = read_raw(image.linear(False), str(path), False)
    if not image.integer:
        return _White(RawPicture(values, str(path)), ())
    # Codes are whole numbers again, so that the largest is known to be clipped.
    codes = np.rint(values * np.float32(LARGEST_CODE))
    if Path(path).suffix.lower() in linear_suffixes() and image.texels.dtype == np.float32:
        most = int(LARGEST_CODE) >> metadata.spare_bits
        if not codes.max() <= most:
            raise InputError(f"{path}: holds codes of up to {codes.max():g}, and the camera's end at {most}")
    else:
        codes /= np.float32(1 << metadata.spare_bits)
    source = RawPicture(codes_to_light(codes, metadata), str(path))
    return _White(source, tuple(_clipping(source)))


def _clipping(source: RawPicture) -> list[str]:
    """Return a note if many pixels of a picture are at the end of the scale."""
    share = np.count_nonzero(source.values >= 1.0) / source.values.size
    return [f"{source.name}: {share:.1%} of it is clipped"] if share > MANY_CLIPPED else []


def _as_source(photo: Photo) -> RawPicture:
    return RawPicture(photo.light(), photo.name)


def _scale_white(source: RawPicture, metadata: PhotoMetadata, colors: Colors) -> RawPicture:
    """Scale a white picture so that its brightest light is 1, for "camera" in each colour of the filters.

    Dividing by it then takes away the vignetting only, and leaves the colours to the camera's gains.
    """
    light = source.values
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
