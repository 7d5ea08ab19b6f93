"""Image files: what a rendered image is written to, and what images are read from.

| suffix | holds | settings |
|---|---|---|
| .png | 8 bits, sRGB, by the tone curve | text chunks |
| .jpg .jpeg | 8 bits, sRGB, by the tone curve, quality 95, colour not subsampled | - |
| .exr | float32 (uint32 for numbers of things), linear; variance and layers | attributes, `rt.` before the name |
| .hdr | 8-bit mantissas with a common exponent, linear | header lines, named as in .exr |
| .npy | float64, linear | - |
| .lf | the views of a light field, float32, linear; layers and rays | attributes |

A file is written aside and renamed, so that what stood there before is whole whatever goes wrong.
"""

import contextlib
import dataclasses
import io
import os
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from raytracer import untrusted
from raytracer.errors import InputError, OutputError
from raytracer.film import decoding, rgbe, srgb
from raytracer.wholefiles import is_special, told, whole

if TYPE_CHECKING:
    from raytracer.film.image import Image
    from raytracer.plenoptic.field import LightField

Layers = Mapping[str, NDArray[np.floating[Any]]]

DISPLAY_SUFFIXES = (".png", ".jpg", ".jpeg")
"""Files that hold what a display shows; all others hold linear light."""

_JPEG_QUALITY = 95
_EXR_PREFIX = "rt."

# Bytes that are taken from a pipe at a time.
_PIECE = 1 << 20

# Red, green, blue and white of Rec. 709, as x and y each.
_CHROMATICITIES = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)


# ---- encoding ----


def _header_settings(image: "Image") -> dict[str, str]:
    """Everything that a header tells, as text: no format's own numbers hold a float64 or a 64-bit seed."""
    return {**{key: str(value) for key, value in image.settings.items()}, "samples": str(image.samples)}


def encode_png(image: "Image") -> bytes:
    """`image` as an 8-bit sRGB PNG file, with a text chunk for each of its settings."""
    import PIL.Image
    import PIL.PngImagePlugin

    info = PIL.PngImagePlugin.PngInfo()
    info.add(b"sRGB", b"\x00")
    for key, value in _header_settings(image).items():
        info.add_text(key, value)
    buffer = io.BytesIO()
    PIL.Image.fromarray(image.display()).save(buffer, "PNG", pnginfo=info)
    return buffer.getvalue()


def _encode_png(image: "Image", layers: Layers) -> bytes:
    return encode_png(image)


def _encode_jpeg(image: "Image", layers: Layers) -> bytes:
    import PIL.Image

    buffer = io.BytesIO()
    PIL.Image.fromarray(image.display()).save(buffer, "JPEG", quality=_JPEG_QUALITY, subsampling="4:4:4")
    return buffer.getvalue()


def _encode_exr(image: "Image", layers: Layers) -> bytes:
    import OpenEXR

    header: dict[str, Any] = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    header["chromaticities"] = _CHROMATICITIES
    header |= {_EXR_PREFIX + key: value for key, value in _header_settings(image).items()}

    arrays: dict[str, NDArray[Any]] = {"": image.radiance}
    if image.variance is not None:
        arrays["variance"] = image.variance
    arrays |= {**image.layers, **layers}

    # A float64 that float32 cannot hold becomes inf, as it should; numbers of things stay whole.
    channels: dict[str, NDArray[Any]] = {}
    for layer, array in arrays.items():
        planes = np.atleast_3d(array)
        names = image.channels.get(layer) or (("",) if array.ndim == 2 else tuple("RGB"))
        with np.errstate(over="ignore"):
            planes = planes if planes.dtype == np.uint32 else planes.astype(np.float32)
        for number, name in enumerate(names):
            full = ".".join(part for part in (layer, name) if part)
            channels[full] = np.ascontiguousarray(planes[..., number])
    buffer = io.BytesIO()
    OpenEXR.File(header, channels).write(buffer)
    return buffer.getvalue()


def _encode_hdr(image: "Image", layers: Layers) -> bytes:
    return rgbe.encode(image.radiance, _header_settings(image))


def _encode_npy(image: "Image", layers: Layers) -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, np.asarray(image.radiance, dtype=np.float64), allow_pickle=False)
    return buffer.getvalue()


_ENCODERS: dict[str, Callable[["Image", Layers], bytes]] = {
    ".png": _encode_png,
    ".jpg": _encode_jpeg,
    ".jpeg": _encode_jpeg,
    ".exr": _encode_exr,
    ".hdr": _encode_hdr,
    ".npy": _encode_npy,
}

_LIGHT_FIELD = ".lf"

SUFFIXES = tuple(_ENCODERS)
"""Of all files that are images."""

WRITTEN = (*SUFFIXES, _LIGHT_FIELD)
"""Of all files that pictures can be written to."""

NO_LIGHT_FIELD = (
    "the picture is of one view, or a part of one, and no light field: render the whole picture of a camera_array, "
    "light_slab or light_field, or of a thin_lens with the AOV rays"
)


# ---- writing ----


def _suffix(path: Path, known: Sequence[str] = WRITTEN) -> str:
    """The format's suffix; a device without one takes PNG.

    Raises
    ------
    InputError : the suffix is not known.
    """
    suffix = path.suffix.lower()
    if suffix in known:
        return suffix
    if not suffix and is_special(path):
        return ".png"
    found = f"unknown suffix {path.suffix!r}" if suffix else "no suffix"
    raise InputError(f"{path}: {found} for an image; known: {', '.join(known)}")


def check_writable(path: str | Path) -> None:
    """Make sure, before an image is rendered, that it can be written to `path`; leave nothing behind.

    Raises
    ------
    InputError : the suffix is not known, `path` is a folder or protected, or its folder cannot be made or written.
    """
    check_file(path)
    _suffix(Path(path))


def check_file(path: str | Path) -> None:
    """As `check_writable`, for a file of any kind."""
    path = Path(path)
    try:
        if path.is_dir():
            raise InputError(f"{path}: is a folder, not a file")
        if path.exists() and not os.access(path, os.W_OK):
            raise InputError(f"{path}: may not be overwritten: it is protected against writing")
        if is_special(path):
            return

        # Folders that are missing are made when the image is written, in the nearest that is there.
        folder = path.resolve().parent
        while not folder.exists():
            folder = folder.parent
        if not folder.is_dir():
            raise InputError(f"{path}: cannot be written: {folder} is not a folder")
        if not os.access(folder, os.W_OK | os.X_OK):
            raise InputError(f"{path}: cannot be written: no permission to write in the folder {folder}")
    except (OSError, ValueError, RuntimeError) as error:
        # A name that is too long, holds a zero byte, or is a loop of links.
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{path!s:.200}: cannot be written: {reason}") from error


def write_bytes(path: str | Path, data: bytes) -> None:
    """Write a file so that it is either the old one or the new one, each whole; folders are made as needed.

    Devices and pipes are written to as they are; a link keeps pointing where it does.

    Raises
    ------
    OutputError : the file cannot be written (full disk, quota, permission); nothing is left behind.
    """
    path = Path(path)
    with told(path):
        if is_special(path):
            path.write_bytes(data)
            return
    with whole(path) as aside, told(path):
        aside.write_bytes(data)


def light_field(image: "Image") -> "LightField":
    """The light field that a picture holds, without a copy of its pixels.

    Raises
    ------
    InputError : it holds none.
    """
    found = None if image.layout is None else image.layout.light_field(image)
    if found is None or (found.views.rows * found.views.columns == 1 and found.rays is None):
        raise InputError(NO_LIGHT_FIELD)
    return found


def save(image: "Image", path: str | Path, layers: Layers | None = None) -> None:
    """Write `image` to `path` in the format that its suffix names.

    Parameters
    ----------
    layers : arrays besides the image's own layers, for .exr, of shape (height, width) for a
        channel of that name, or (height, width, 3) for the channels R, G and B of a layer of that name.

    Raises
    ------
    InputError : the suffix is not known, or a light field asked for of a picture that is none.
    OutputError : the format cannot hold the image, or the file cannot be written.
    """
    path = Path(path)
    suffix = _suffix(path)
    if suffix == _LIGHT_FIELD:
        _save_light_field(image, path)
        return
    try:
        data = _ENCODERS[suffix](image, layers or {})
    except (ValueError, OSError, RuntimeError) as error:
        height, width, _ = image.radiance.shape
        raise OutputError(f"{path}: an image of {width} x {height} pixels cannot be written as {suffix}") from error
    write_bytes(path, data)


def _save_light_field(image: "Image", path: Path) -> None:
    from raytracer.plenoptic import lf

    try:
        found = light_field(image)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    samples = {"samples": image.samples}
    lf.write(path, dataclasses.replace(found, settings={**found.settings, **samples}))


# ---- reading ----


def _decode_pillow(data: bytes, *, is_linear: bool = True) -> NDArray[np.float64]:
    """Values of an image file in sRGB, decoded to linear ones or as they are, in 0..1."""
    with decoding.pillow(data, ("PNG", "JPEG")) as file:
        is_deep = file.mode.startswith("I")
        stored = np.asarray(file if is_deep else file.convert("RGB"))

    # A power for each of all values that there may be is quicker than one for each pixel.
    largest = 65535 if is_deep else 255
    shades = np.arange(largest + 1) / largest
    values = np.take(srgb.decode(shades) if is_linear else shades, stored)
    return np.repeat(values[..., None], 3, axis=2) if is_deep else values


def _decode_exr(
    data: bytes, wanted: Collection[str] | None = None
) -> tuple[dict[str, NDArray[np.float64]], dict[str, str]]:
    def is_wanted(name: str) -> bool:
        return wanted is None or (name.rpartition(".")[0] or "radiance") in wanted or name in wanted

    header, planes = decoding.exr(data, is_wanted)
    channels = {name: np.asarray(plane, dtype=np.float64) for name, plane in planes.items()}
    prefix = _EXR_PREFIX
    settings = {key[len(prefix) :]: str(value) for key, value in header.items() if key.startswith(prefix)}

    # Put the channels of a layer together again.
    layers: dict[str, NDArray[np.float64]] = {}
    for stem in dict.fromkeys(name[: name.rfind(".") + 1] for name in channels):
        own = [name for name in channels if name[: name.rfind(".") + 1] == stem]
        for components in ("RGB", "XYZ", "XY"):
            names = [stem + c for c in components]
            # The image's own channels are not taken for a vector in the plane.
            if all(n in own for n in names) and (stem or components != "XY"):
                layers[stem.removesuffix(".") or "radiance"] = np.stack([channels.pop(n) for n in names], axis=-1)
                break
        else:
            if stem and len(own) == 1:
                layers[stem.removesuffix(".")] = channels.pop(own[0])
    return {**layers, **channels}, settings


def _decode_exr_radiance(data: bytes) -> NDArray[np.float64]:
    layers, _ = _decode_exr(data, {"radiance"})
    if "radiance" not in layers and "Y" not in layers:
        raise decoding.BrokenImageError("has neither channels R, G and B nor Y")
    return layers["radiance"] if "radiance" in layers else np.repeat(layers["Y"][..., None], 3, axis=2)


def _decode_npy(data: bytes) -> NDArray[np.float64]:
    array = untrusted.array(data)
    if array.ndim != 3 or array.shape[2] != 3 or array.dtype.kind not in "fiu":
        raise decoding.BrokenImageError("is no array of numbers of the shape (height, width, 3)")
    decoding.check_size(array.shape[1], array.shape[0], len(data))
    return np.asarray(array, dtype=np.float64)


_DECODERS: dict[str, Callable[[bytes], NDArray[np.float64]]] = {
    ".png": _decode_pillow,
    ".jpg": _decode_pillow,
    ".jpeg": _decode_pillow,
    ".exr": _decode_exr_radiance,
    ".hdr": rgbe.decode,
    ".npy": _decode_npy,
}


@contextlib.contextmanager
def _reading(path: Path) -> Iterator[None]:
    """Turn whatever reading `path` raises into one sentence: broken files raise anything from SyntaxError on."""
    try:
        yield
    except InputError:
        raise
    except (decoding.BrokenImageError, untrusted.BrokenArrayError) as error:
        raise InputError(f"{path}: {error}") from error
    except MemoryError as error:
        raise InputError(f"{path}: does not fit into memory") from error
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such file") from error
    except OSError as error:
        # The system's errors have a number and the decoders' have none.
        reason = f"cannot be read: {error.strerror}" if error.errno else f"broken, or no {path.suffix} image"
        raise InputError(f"{path}: {reason}") from error
    except Exception as error:
        raise InputError(f"{path}: broken, or no {path.suffix} image") from error


def _contents(path: Path) -> bytes:
    """The bytes of a file, or what comes through a pipe that was named as such, without a suffix."""
    if path.suffix or not is_special(path):
        return untrusted.contents(path)
    data = bytearray()
    with path.open("rb") as pipe:
        while piece := pipe.read(_PIECE):
            data += piece
            if len(data) > untrusted.MAX_BYTES:
                raise decoding.BrokenImageError(f"has more than the {untrusted.MAX_BYTES:,} bytes that are read")
    return bytes(data)


def load(path: str | Path) -> NDArray[np.float64]:
    """Linear values of an image file: float64 (height, width, 3), row 0 at the top.

    .png and .jpg are decoded from sRGB, their transparency and profiles left out; a grey image has equal channels.

    Raises
    ------
    InputError : the file is missing, unreadable or broken, or of an unknown suffix.
    """
    path = Path(path)
    decode = _DECODERS[_suffix(path, SUFFIXES)]
    with _reading(path):
        return decode(_contents(path))


def load_encoded(path: str | Path) -> NDArray[np.float64]:
    """Values of a .png or .jpg file as it holds them, sRGB-encoded: float64 (height, width, 3) in 0..1.

    Raises
    ------
    InputError : as `load`; or the file is of a linear format.
    """
    path = Path(path)
    if path.suffix.lower() not in DISPLAY_SUFFIXES:
        raise InputError(f"{path}: only {', '.join(DISPLAY_SUFFIXES)} files hold display values")
    with _reading(path):
        return _decode_pillow(untrusted.contents(path), is_linear=False)


def load_layers(
    path: str | Path, wanted: Collection[str] | None = None
) -> tuple[dict[str, NDArray[np.float64]], dict[str, str]]:
    """Layers and settings of an .exr file that `save` wrote, or another program.

    The layers are float64, (height, width, 3) where a layer has the channels R, G and B or X, Y and Z, (height, width,
    2) where it has X and Y, and (height, width) for every other channel, by the layer's name if it is the only one; the
    image itself is called `radiance`.  The settings are text.  Of all layers only those `wanted` are brought, if any
    are named.

    Raises
    ------
    InputError : the file is missing, unreadable or broken, or not an .exr file.
    """
    path = Path(path)
    if path.suffix.lower() != ".exr":
        raise InputError(f"{path}: only .exr files have layers")
    with _reading(path):
        return _decode_exr(untrusted.contents(path), wanted)
