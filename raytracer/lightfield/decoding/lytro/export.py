"""Write what a container holds to files that other programs read."""

import json
from pathlib import Path

import numpy as np

from raytracer.film.formats.npy import encode_array
from raytracer.lightfield.decoding.lytro.photo import Photo, PhotoFile
from raytracer.util.atomic_write import atomic_write, wrap_os_errors, write_bytes


def write_raw(path: str | Path, photo: Photo) -> None:
    """Write a raw picture: codes as they are (.npy, uint16), or times a power of two that fills 16 bits (.png).

    Raises
    ------
    OutputError : the file cannot be written.
    """
    import PIL.Image

    path = Path(path)
    if path.suffix.lower() == ".npy":
        write_bytes(path, encode_array(photo.codes))
        return
    with atomic_write(path) as aside, wrap_os_errors(path):
        PIL.Image.fromarray(np.left_shift(photo.codes, photo.metadata.spare_bits, dtype=np.uint16)).save(aside, "PNG")


def write_metadata(path: str | Path, photo: PhotoFile) -> None:
    """Write the metadata of a photograph as JSON; an OutputError says that the file cannot be written."""
    write_bytes(path, (json.dumps(photo.all_metadata, indent=1) + "\n").encode())
