"""Raw pictures in Lytro's containers: codes and metadata, and their light."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytracer.lightfield.decoding.lytro.container import Container
from raytracer.lightfield.decoding.lytro.metadata import PhotoMetadata, read_metadata
from raytracer.lightfield.decoding.lytro.packing import unpack_pixels
from raytracer.lightfield.decoding.raw_image import Floats32
from raytracer.util.errors import InputError
from raytracer.util.safe_open import BrokenFileError, name_read_errors


@dataclass(frozen=True, eq=False)
class Photo:
    """A raw picture.

    name : of the file, for messages.
    metadata : of the picture.
    codes : uint16 (height, width), as the sensor gave them.
    """

    name: str
    metadata: PhotoMetadata
    codes: NDArray[np.uint16]

    def light(self) -> Floats32:
        """Compute the light, (height, width): 0 at the black level of each filter, and at most 1, at the white."""
        return codes_to_light(self.codes, self.metadata)


@dataclass(frozen=True, eq=False)
class PhotoFile:
    """Photograph in an open container: its metadata, and pixels that are not read yet.

    path : of the file.
    frame : object of the contents that names the sections of the picture.
    metadata : of the picture.
    all_metadata : the JSON object that they are from.
    """

    path: Path
    frame: Mapping[str, Any]
    metadata: PhotoMetadata
    all_metadata: Mapping[str, Any]

    @property
    def has_white(self) -> bool:
        """True if the container has a white picture as well, as some of the Illum's have."""
        return isinstance(self.frame.get("modulationDataRef"), str)

    def read(self) -> Photo:
        """Read the raw picture."""
        return self._read("imageRef", str(self.path))

    def read_white(self) -> Photo:
        """Read the white picture that belongs to it."""
        return self._read("modulationDataRef", f"{self.path}, white picture")

    def _read(self, key: str, name: str) -> Photo:
        reference = self.frame.get(key)
        if not isinstance(reference, str):
            raise InputError(f"{self.path}: holds no raw picture, but what was made of one (no {key})")
        with Container(self.path) as container:
            data = container.read(reference)
        with name_read_errors(self.path):
            return make_photo(name, self.metadata, data)


def codes_to_light(codes: NDArray[np.uint16] | Floats32, metadata: PhotoMetadata) -> Floats32:
    """Compute the light of codes (height, width), by the levels of the filters; see `Photo.light`."""
    black, white = metadata.filter_levels(metadata.black), metadata.filter_levels(metadata.white)
    light = codes.astype(np.float32)
    for row, column in np.ndindex(2, 2):
        part = light[row::2, column::2]
        part -= black[row, column]
        part /= white[row, column] - black[row, column]
    return np.minimum(light, np.float32(1.0), out=light)


def make_photo(name: str, metadata: PhotoMetadata, data: bytes) -> Photo:
    """Unpack a raw picture; a BrokenFileError says that there are too few bytes, or that the packing is not known."""
    codes = unpack_pixels(data, metadata.width, metadata.height, metadata.bits, metadata.endianness)
    return Photo(name, metadata, np.right_shift(codes, metadata.shift, dtype=np.uint16))


def open_photo(path: str | Path) -> PhotoFile:
    """Read what a container says of its photograph, but no pixels.

    Raises
    ------
    InputError : the file is no container, damaged, or holds no photograph.
    """
    with Container(path) as container:
        frame = find_frame(container.contents)
        if frame is None:
            raise InputError(
                f"{path}: holds no photograph, but {'files of a camera' if 'files' in container.contents else 'others'}"
            )
        values, private = (_read_part(container, frame, name) for name in ("metadata", "privateMetadata"))
    with name_read_errors(Path(path)):
        return PhotoFile(Path(path), frame, read_metadata(values, private), values)


def find_frame(contents: Mapping[str, Any]) -> Mapping[str, Any] | None:
    """Find the frame of a photograph in the contents of a container, or in a white picture's metadata."""
    for keys in (("picture", "frameArray"), ("frames",), ("master", "picture", "frameArray")):
        value: Any = contents
        for key in keys:
            value = value.get(key) if isinstance(value, Mapping) else None
        if isinstance(value, list) and value and isinstance(value[0], Mapping):
            frame = value[0].get("frame")
            if isinstance(frame, Mapping):
                return frame
    return None


def _read_part(container: Container, frame: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    """Read metadata of a frame, which are part of it, or in a section that it names; empty if there are none."""
    inside, reference = frame.get(name), frame.get(f"{name}Ref")
    if isinstance(inside, Mapping):
        return inside
    if not isinstance(reference, str) or reference not in container.sections:
        return {}
    return container.read_json(reference)


def read_white_metadata(values: Mapping[str, Any]) -> PhotoMetadata:
    """Read the metadata of a camera's own white picture; a BrokenFileError says that they are of none."""
    frame = find_frame(values)
    inside = (frame or values).get("metadata") if frame is not None else values
    private = (frame or {}).get("privateMetadata")
    if not isinstance(inside, Mapping):
        raise BrokenFileError("holds no metadata of a picture")
    return read_metadata(inside, private if isinstance(private, Mapping) else None)
