"""Files of references: small pictures with their variance and their recipe.

A reference is an .npz file of three arrays: `mean` and `variance`, float32 (height, width, 3), and `settings`, a JSON
string.  No part of it is pickled, so that it is safe to read references of others.
"""

import io
import json
import zipfile
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field, TypeAdapter

from raytracer.util.atomic_write import write_bytes
from raytracer.util.errors import InputError
from raytracer.util.safe_open import parse_npy, read_regular

SUFFIX = ".npz"

MAX_WIDTH = 128
"""Greatest width of a reference (px): it is kept with the sources."""

_LARGEST_FILE = 1 << 26
"""Most bytes of a reference, and of each of its arrays: far more than pictures of that width have."""


class Recipe(NamedTuple):
    """Recipe of a reference: what it was rendered from.

    scene : path of the scene file from the folder of the reference, with `/`; None for a scene that is built in code.
    overrides : values by dotted path that stand in place of the scene's, those for its size and sampler among them.
    spp, seed : samples per pixel, and the seed of all random numbers.
    version : of rt.
    inputs : digests of the inputs by name: see `render_reference.digests`.
    dropped : samples that were left out since they were not finite.
    gains : (3,), factors of the channels that were measured on the picture itself (`exposure: auto`,
        `white_balance: auto`); None without such.
    """

    scene: str | None
    overrides: dict[str, Any]
    spp: Annotated[int, Field(ge=1, le=2**31 - 1)]
    seed: Annotated[int, Field(ge=0, le=2**32 - 1)]
    version: str
    inputs: dict[str, str]
    dropped: int = 0
    gains: tuple[float, float, float] | None = None


class Reference(NamedTuple):
    """A small image to compare with.

    mean, variance : float64 (height, width, 3).
    """

    mean: NDArray[np.float64]
    variance: NDArray[np.float64]
    recipe: Recipe


def save_reference(path: str | Path, mean: ArrayLike, variance: ArrayLike, recipe: Recipe) -> None:
    """Write a reference as compressed float32 .npz; the same values give the same bytes.

    Raises
    ------
    ValueError : the shapes differ, or the image is wider than `MAX_WIDTH`.
    OutputError : the file cannot be written.
    """
    single = np.asarray(mean, dtype=np.float32)
    if single.ndim != 3 or single.shape[2] != 3 or single.shape != np.shape(variance):
        raise ValueError(f"mean and variance of one shape (height, width, 3), got {single.shape}, {np.shape(variance)}")
    if single.shape[1] > MAX_WIDTH:
        raise ValueError(f"a reference is at most {MAX_WIDTH} pixels wide, got {single.shape[1]}")
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
        with zipfile.ZipFile(io.BytesIO(read_regular(Path(path), _LARGEST_FILE))) as file:
            # A signalling nan becomes a quiet one, of which is told below.
            with np.errstate(invalid="ignore"):
                mean, variance = (parse_npy(_member(file, name)).astype(np.float64) for name in ("mean", "variance"))
            settings = json.loads(_text(_member(file, "settings")))
            recipe = TypeAdapter(Recipe).validate_python({name: settings[name] for name in Recipe._fields})
        if mean.ndim != 3 or mean.shape[2] != 3 or mean.shape != variance.shape or mean.size == 0:
            raise ValueError("not an image and its variance")
        if not np.all(np.isfinite(variance) & (variance >= 0.0)):
            raise ValueError("a variance that is negative or not finite")
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such file") from error
    except Exception as error:
        # A broken file can raise nearly anything.
        raise InputError(f"{path}: broken, or not a reference image of `rt reference`") from error
    return Reference(mean, variance, recipe)


def _member(file: zipfile.ZipFile, name: str) -> bytes:
    """Read a file of the archive, and no more of it than a reference has.

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
    """Decode the string in the bytes of a .npy file."""
    file = io.BytesIO(data)
    np.lib.format.read_magic(file)
    shape, _, dtype = np.lib.format.read_array_header_1_0(file)
    if shape != () or dtype.kind != "U":
        raise ValueError("settings that are not a string")
    return str(np.frombuffer(data, dtype, 1, file.tell())[0])
