"""Small pictures that are kept, with their noise and with what they were rendered from.

A reference is an .npz file of three arrays: `mean` and `variance`, float32 (height, width, 3), and `settings`, a JSON
text.  No part of it is pickled, so that reading one that somebody else has made does no harm.
"""

import io
import json
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from raytracer.errors import InputError
from raytracer.film.output import write_bytes
from raytracer.untrusted import array, contents

SUFFIX = ".npz"

WIDEST = 128
"""The most pixels that a reference may be wide: it is kept with the sources."""

_LARGEST_FILE = 1 << 26
"""Bytes of a reference, and of each of its arrays: far more than pictures of that width have."""

_ABSENT = "no such file"

_INT32_MAX, _UINT32_MAX = 2**31 - 1, 2**32 - 1


class Recipe(NamedTuple):
    """What a reference was rendered from.

    scene : path of the scene file from the folder of the reference, with `/`; None for a scene that is built in code.
    overrides : values by dotted path that stand in place of the scene's, those for its size and sampler among them.
    spp, seed : samples a pixel, and the seed of all random numbers.
    version : of rt.
    inputs : digests by name of what was read: see `inputs.digests`.
    dropped : samples that were left out since they were not finite.
    gains : (3,), what the light of each channel was multiplied by where that was measured on the picture itself
        (`exposure: auto`, `white_balance: auto`); None where it was not.
    """

    scene: str | None
    overrides: dict[str, Any]
    spp: int
    seed: int
    version: str
    inputs: dict[str, str]
    dropped: int = 0
    gains: tuple[float, float, float] | None = None


class Reference(NamedTuple):
    """A small image kept to compare with: mean and variance, float64 (height, width, 3), and where they are from."""

    mean: NDArray[np.float64]
    variance: NDArray[np.float64]
    recipe: Recipe


def save_reference(path: str | Path, mean: ArrayLike, variance: ArrayLike, recipe: Recipe) -> None:
    """Write a reference as compressed float32 .npz; the same values give the same bytes.

    Raises
    ------
    ValueError : the shapes differ, or the image is wider than `WIDEST`.
    OutputError : the file cannot be written.
    """
    single = np.asarray(mean, dtype=np.float32)
    if single.ndim != 3 or single.shape[2] != 3 or single.shape != np.shape(variance):
        raise ValueError(f"mean and variance of one shape (height, width, 3), got {single.shape}, {np.shape(variance)}")
    if single.shape[1] > WIDEST:
        raise ValueError(f"a reference is at most {WIDEST} pixels wide, got {single.shape[1]}")
    buffer = io.BytesIO()
    text = np.array(json.dumps(recipe._asdict(), sort_keys=True))
    np.savez_compressed(buffer, mean=single, variance=np.asarray(variance, dtype=np.float32), settings=text)
    write_bytes(path, buffer.getvalue())


def load_reference(path: str | Path) -> Reference:
    """Read what `save_reference` wrote; the arrays are float64 with the precision of float32.

    Raises
    ------
    InputError : the file is missing or broken.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(contents(Path(path), _LARGEST_FILE))) as file:
            # A signalling nan becomes a quiet one, of which is told below.
            with np.errstate(invalid="ignore"):
                mean, variance = (array(_member(file, name)).astype(np.float64) for name in ("mean", "variance"))
            recipe = _recipe(json.loads(_text(_member(file, "settings"))))
        if mean.ndim != 3 or mean.shape[2] != 3 or mean.shape != variance.shape or mean.size == 0:
            raise ValueError("not an image and its variance")
        if not np.all(np.isfinite(variance) & (variance >= 0.0)):
            raise ValueError("a variance that is none")
    except FileNotFoundError as error:
        raise InputError(f"{path}: {_ABSENT}") from error
    except Exception as error:
        # What has been changed in any way can raise nearly anything.
        raise InputError(f"{path}: broken, or not a reference image of `rt reference`") from error
    return Reference(mean, variance, recipe)


def _member(file: zipfile.ZipFile, name: str) -> bytes:
    """A file of the archive, of which no more is unpacked than a reference has.

    Raises
    ------
    ValueError : it has more.
    """
    with file.open(f"{name}.npy") as member:
        data = member.read(_LARGEST_FILE + 1)
    if len(data) > _LARGEST_FILE:
        raise ValueError(f"{name} has more than {_LARGEST_FILE} bytes")
    return data


def _text(data: bytes) -> str:
    """The text in the bytes of a .npy file."""
    file = io.BytesIO(data)
    np.lib.format.read_magic(file)
    shape, _, dtype = np.lib.format.read_array_header_1_0(file)
    if shape != () or dtype.kind != "U":
        raise ValueError("settings that are no text")
    return str(np.frombuffer(data, dtype, 1, file.tell())[0])


def _recipe(found: Mapping[str, Any]) -> Recipe:
    """The recipe of a JSON text, each value of the type that it has to be.

    Raises
    ------
    ValueError, TypeError, KeyError : one is not.
    """
    scene, gains = found["scene"], found["gains"]
    if not (scene is None or isinstance(scene, str)):
        raise TypeError("a scene is named by a text")
    return Recipe(
        scene=scene,
        overrides=dict(found["overrides"]),
        spp=_whole(found["spp"], 1, _INT32_MAX),
        seed=_whole(found["seed"], 0, _UINT32_MAX),
        version=str(found["version"]),
        inputs={str(name): str(digest) for name, digest in found["inputs"].items()},
        dropped=int(found["dropped"]),
        gains=None if gains is None else (float(gains[0]), float(gains[1]), float(gains[2])),
    )


def _whole(value: Any, least: int, most: int) -> int:
    number = int(value)
    if not least <= number <= most:
        raise ValueError(f"{number} is not in {least}..{most}")
    return number
