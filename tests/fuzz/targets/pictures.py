"""Images as textures read them and as they are compared; grids of densities; placements of instances."""

import io

import numpy as np
import OpenEXR
import PIL.Image

from raytracer.film import load, load_layers
from raytracer.film.formats import hdr
from raytracer.film.formats.base.image_format import MAX_PIXELS
from raytracer.film.formats.registry import display_suffixes, image_suffixes
from raytracer.film.image_file import load_encoded
from raytracer.scene.assets import read_grid, read_placements
from raytracer.scene.assets.images import decode_image
from raytracer.util.errors import InputError
from tests.fuzz.harness import target
from tests.fuzz.targets._parts import npy, with_header, with_sums

# ---- Pictures.  The first byte chooses the suffix, whether checksums or lengths are put right, and what is asked for.

SUFFIXES = (".png", ".jpg", ".bmp", ".tga", ".tif", ".webp", ".exr", ".hdr", ".npy")
_REPAIRED, _OTHERWISE = 0x80, 0x40

_PIXELS = np.arange(5 * 9 * 4, dtype=np.uint8).reshape(5, 9, 4)
_VALUES = np.linspace(0, 2, 2 * 9 * 3).reshape(2, 9, 3)


def _pillow_files():
    """Small files of every mode that each format has."""
    for suffix, name, modes, options in (
        (".png", "PNG", "1 L LA P RGB RGBA I;16", {}),
        (".jpg", "JPEG", "L RGB CMYK", {}),
        (".jpg", "JPEG", "RGB", {"progressive": True}),
        (".bmp", "BMP", "1 L P RGB", {}),
        (".tga", "TGA", "L RGB RGBA", {"compression": "tga_rle"}),
        (".tif", "TIFF", "1 L P RGBA F I;16", {}),
        (".tif", "TIFF", "RGB", {"compression": "tiff_lzw"}),
        (".tif", "TIFF", "RGB", {"compression": "tiff_deflate"}),
        (".webp", "WEBP", "RGB RGBA", {"lossless": True}),
        (".webp", "WEBP", "RGB", {}),
    ):
        for mode in modes.split():
            file = io.BytesIO()
            if mode == "I;16":
                image = PIL.Image.fromarray(np.arange(45, dtype=np.uint16).reshape(5, 9) * 1000)
            else:
                image = PIL.Image.fromarray(_PIXELS).convert("L" if mode == "F" else mode).convert(mode)
            image.save(file, name, **options)
            yield suffix, file.getvalue()


def _exr_files():
    values = np.linspace(0, 1, 4 * 6 * 3, dtype=np.float32).reshape(4, 6, 3)
    planes = {name: np.ascontiguousarray(values[..., number]) for number, name in enumerate("RGB")}
    half = {name: plane.astype(np.float16) for name, plane in planes.items()}
    kinds = [
        ({"compression": getattr(OpenEXR, f"{name}_COMPRESSION"), "type": OpenEXR.scanlineimage}, half)
        for name in ("NO", "RLE", "ZIP", "PIZ", "PXR24", "B44A", "DWAA")
    ]
    tiled = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.tiledimage, "tiles": OpenEXR.TileDescription()}
    for header, parts in (*kinds, (tiled, {"Y": planes["R"], "depth.Z": planes["G"].astype(np.uint32)})):
        file = io.BytesIO()
        OpenEXR.File(header, parts).write(file)
        yield file.getvalue()


def _repaired(choice, data, suffix):
    if choice & _REPAIRED and suffix == ".png":
        return with_sums(data)
    return with_header(*data.partition(b"\x00")[::2]) if choice & _REPAIRED and suffix == ".npy" else data


def _files(suffixes, *arrays):
    """Files of formats, each after the place of its suffix among these."""
    for suffix, files in (
        (".exr", _exr_files()),
        (".hdr", (hdr.encode(_VALUES, {"EXPOSURE": "2"}), hdr.encode(_VALUES[:, :3], {}))),
        (".npy", map(npy, (_VALUES, *arrays))),
    ):
        yield from (bytes([suffixes.index(suffix)]) + data for data in files)
    for suffix, data in _pillow_files():
        if suffix in suffixes:
            yield bytes([suffixes.index(suffix) | _REPAIRED]) + data
    for dtype in ("<u2", "<f2"):
        header = f"{{'descr': '{dtype}', 'fortran_order': True, 'shape': (1, 2, 3), }}\0".encode()
        yield bytes([suffixes.index(".npy") | _REPAIRED]) + header + bytes(range(12))


def _images():
    yield from _files(SUFFIXES, _PIXELS, _VALUES[..., 0].astype(np.float32))


_WORDS = "IHDR~PLTE~IDAT~tRNS~iCCP~acTL~fdAT~dataWindow\0box2i~channels\0chlist~EXPOSURE="


@target("image", seeds=_images, max_length=2048, words=_WORDS)
def load_image(data, folder):
    """An image as textures read it."""
    choice, data = data[0] if data else 0, data[1:]
    suffix = SUFFIXES[(choice & ~_REPAIRED) % len(SUFFIXES)]
    try:
        image = decode_image(_repaired(choice, data, suffix), suffix)
    except ValueError as error:
        raise InputError(str(error)) from error
    height, width, channels = image.texels.shape
    assert 0 < height * width <= MAX_PIXELS
    assert channels in (1, 2, 3, 4)
    assert image.texels.dtype in (np.uint8, np.float32)
    assert image.texels.dtype == np.uint8 or np.isfinite(image.texels).all()


def _compared():
    yield from _files(image_suffixes())
    exr = image_suffixes().index(".exr") | _OTHERWISE
    yield from (bytes([exr]) + data for data in _exr_files())


@target("picture", seeds=_compared, max_length=2048, words=_WORDS)
def load_picture(data, folder):
    """A picture as it is compared."""
    choice, data = data[0] if data else 0, data[1:]
    suffix = image_suffixes()[(choice & 0x3F) % len(image_suffixes())]
    path = folder / f"a{suffix}"
    path.write_bytes(_repaired(choice, data, suffix))
    if choice & _OTHERWISE and suffix == ".exr":
        layers, settings = load_layers(path)
        assert all(layer.dtype == np.float64 and layer.ndim in (2, 3) for layer in layers.values())
        assert all(isinstance(value, str) for value in settings.values())
        return
    found = load_encoded(path) if choice & _OTHERWISE and suffix in display_suffixes() else load(path)
    height, width, channels = found.shape
    assert (found.dtype, channels) == (np.float64, 3)
    assert 0 < height * width <= MAX_PIXELS


# ---- Arrays.  The first byte says whether the header's length is put right, or that they are another format.


def _densities():
    values = np.arange(24.0).reshape(2, 3, 4)
    for array in (values, values.astype(np.float32), values.astype(np.uint8), values > 3, values.astype(">i2")):
        yield b"\x00" + npy(array)
    yield b"\x00" + npy(values, "F")
    for dtype in ("<f2", "<f8"):
        yield f"\x01{{'descr': '{dtype}', 'fortran_order': False, 'shape': (1, 2, 3), }}\x00".encode() + bytes(48)


_WORDS = "'descr'~'fortran_order'~'shape'~'<f8'~'|O'~'>f2'~'|b1'~True~999999999999~(~["


@target("grid", seeds=_densities, max_length=1024, words=_WORDS)
def load_grid(data, folder):
    kind, data = data[:1], data[1:]
    if kind in (b"\x01", b"\x02"):
        data = with_header(*data.partition(b"\x00")[::2], version=kind[0])
    (folder / "a.npy").write_bytes(data)
    grid = read_grid(folder / "a.npy")
    assert (grid.dtype, grid.ndim) == (np.float32, 3)
    assert 0.0 <= grid.min() <= grid.max() < np.inf


_POSES = np.tile(np.eye(4), (2, 1, 1))
_SHORT = b"{'descr': '<f4', 'fortran_order': False, 'shape': (1, 3, 4), }\x00" + np.eye(3, 4, dtype="<f4").tobytes()
_PLACEMENTS = [
    *(b"\x00" + npy(poses) for poses in (_POSES, _POSES[:, :3].astype(np.float32))),
    b"\x01" + _SHORT,
    b"\x02x,y,z\n1,2,3\n4,5,6\n",
    b"\x02x,y,z,scale,angle,axis_x,axis_y,axis_z\n1,2,3,2,90,1,1,0\n",
    b"\x02\xef\xbb\xbfx, y ,z,scale_x,scale_z\r\n1,2,3,4,5\r\n",
]
_WORDS = "x,y,z~scale~scale_x~angle~axis_x~,~\"~\n~1e308~nan~inf~-0~\ufeff~'descr'~'<f8'~'|O'"


@target("placements", seeds=_PLACEMENTS, max_length=1024, words=_WORDS)
def load_placements(data, folder):
    kind, data = data[0] % 3 if data else 0, data[1:]
    path = folder / ("a.csv" if kind == 2 else "a.npy")
    path.write_bytes(with_header(*data.partition(b"\x00")[::2]) if kind == 1 else data)
    poses = read_placements(path)
    assert (poses.dtype, poses.shape) == (np.float64, (max(1, len(poses)), 4, 4))
    assert np.isfinite(poses).all()
