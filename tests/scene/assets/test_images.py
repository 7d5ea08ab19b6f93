"""Images as textures read them: values as stored, in every format, and what is refused."""

import io
import struct
import zlib

import numpy as np
import OpenEXR
import PIL.Image
import pytest

from raytracer.film import image_file
from raytracer.film.formats import hdr
from raytracer.scene.assets.images import decode_image
from raytracer.util import srgb
from raytracer.util.safe_open import BrokenFileError
from tests.fuzz.targets._parts import npy

BYTES = np.random.default_rng(1).integers(0, 256, (3, 5, 4), dtype=np.uint8)


def encoded(texels):
    buffer = io.BytesIO()
    PIL.Image.fromarray(texels).save(buffer, "PNG")
    return buffer.getvalue()


def decoded(array):
    return decode_image(npy(array), ".npy")


def test_integers_come_as_they_are_stored():
    for channels in (1, 2, 3, 4):
        texels = BYTES[..., 0] if channels == 1 else BYTES[..., :channels]
        image = decode_image(encoded(texels), ".png")
        assert (image.integer, image.texels.dtype) == (True, np.uint8)
        np.testing.assert_array_equal(image.texels, texels.reshape(3, 5, channels))
    deep = np.array([[0, 1, 32768, 65535]], np.uint16)
    image = decode_image(encoded(deep), ".png")
    assert image.integer
    np.testing.assert_allclose(image.texels[..., 0], deep / 65535, rtol=1e-7)
    # A palette is looked up.
    picture, buffer = PIL.Image.fromarray(np.array([[0, 1], [1, 0]], np.uint8)), io.BytesIO()
    picture.putpalette([10, 20, 30, 200, 210, 220])
    picture.save(buffer, "PNG")
    image = decode_image(buffer.getvalue(), ".PNG")
    np.testing.assert_array_equal(image.texels[0], [[10, 20, 30], [200, 210, 220]])


@pytest.mark.parametrize(
    ("names", "dtype"),
    [("RGB", np.float32), ("RGBA", np.float32), ("Y", np.float32), ("Z", np.float32), ("Y", np.float16)],
)
def test_exr_channels_in_their_order(names, dtype):
    values = np.random.default_rng(2).random((4, 6, len(names))).astype(dtype)
    buffer = io.BytesIO()
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {name: np.ascontiguousarray(values[..., i]) for i, name in enumerate(names)}).write(buffer)
    image = decode_image(buffer.getvalue(), ".exr")
    assert (image.integer, image.texels.dtype) == (False, np.float32)
    np.testing.assert_array_equal(image.texels, values)


def test_hdr_and_npy():
    values = np.random.default_rng(3).random((4, 9, 3))
    image = decode_image(hdr.encode(values, {}), ".hdr")
    np.testing.assert_allclose(image.texels, values, atol=values.max() / 256)
    for array, channels in ((values, 3), (values[..., 0], 1), (values[..., :2], 2)):
        assert not decoded(array).integer
        np.testing.assert_array_equal(decoded(array).texels, array.reshape(4, 9, channels).astype(np.float32))
    for dtype, expected in ((np.uint8, 255), (np.uint16, np.float32(255 / 65535))):
        image = decoded(np.array([[0, 255]], dtype))
        assert image.integer
        assert image.texels[0, 1, 0] == expected


def test_colours_are_decoded_from_srgb_and_transparency_is_not():
    image = decode_image(encoded(BYTES), ".png")
    linear = image.linear(True)
    np.testing.assert_allclose(linear[..., :3], srgb.decode(BYTES[..., :3] / 255), atol=1e-7)
    np.testing.assert_allclose(linear[..., 3], BYTES[..., 3] / 255, atol=1e-7)
    np.testing.assert_allclose(image.linear(False), BYTES / 255, atol=1e-7)


DEEP = np.random.default_rng(4).integers(0, 65536, (9, 7, 4), dtype=np.uint16)


def deep_png(values, key=None):
    """Write a PNG file of 16 bits by its specification (W3C 2003, sec. 5 and 11), each row by the next filter."""
    height, width, channels = values.shape
    rows, step = values.astype(">u2").reshape(height, -1).view(np.uint8).astype(int), 2 * channels
    lines = b""
    for number, row in enumerate(rows):
        above = rows[number - 1] if number else np.zeros_like(row)
        left, corner = (np.concatenate([np.zeros(step, int), each[:-step]]) for each in (row, above))
        away = [np.abs(left + above - corner - each) for each in (left, above, corner)]
        paeth = np.where((away[0] <= away[1]) & (away[0] <= away[2]), left, np.where(away[1] <= away[2], above, corner))
        kind = number % 5
        guess = (np.zeros_like(row), left, above, (left + above) // 2, paeth)[kind]
        lines += bytes([kind]) + ((row - guess) % 256).astype(np.uint8).tobytes()
    chunks = [(b"IHDR", struct.pack(">IIBBBBB", width, height, 16, (0, 4, 2, 6)[channels - 1], 0, 0, 0))]
    chunks += [] if key is None else [(b"tRNS", np.array(key, ">u2").tobytes())]
    chunks += [(b"IDAT", zlib.compress(lines)), (b"IEND", b"")]
    packed = (
        struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body)) for kind, body in chunks
    )
    return b"\x89PNG\r\n\x1a\n" + b"".join(packed)


def deep_tiff(values, order="<", compression=1, planes=1):
    """Write a TIFF file of 16 bits in one strip (TIFF 6.0, Adobe 1992)."""
    height, width, channels = values.shape
    body = values.astype(f"{order}u2").tobytes()
    body = zlib.compress(body) if compression == 8 else body
    entries = [
        (256, 4, width),
        (257, 4, height),
        (258, 3, None),
        (259, 3, compression),
        (262, 3, 2 if channels > 2 else 1),
    ]
    entries += [(273, 4, 200), (277, 3, channels), (278, 4, height), (279, 4, len(body)), (284, 3, planes)]
    entries += [(338, 3, 2)] if channels == 4 else []
    bits = struct.pack(f"{order}{channels}H", *[16] * channels)
    packed = b""
    for tag, kind, value in entries:
        count = channels if value is None else 1
        field = (
            struct.pack(f"{order}I", 180)
            if value is None
            else struct.pack(f"{order}{'I' if kind == 4 else 'H'}", value)
        )
        packed += struct.pack(f"{order}HHI", tag, kind, count) + field.ljust(4, b"\0")
    head = (b"II*\0" if order == "<" else b"MM\0*") + struct.pack(f"{order}I", 8)
    head += struct.pack(f"{order}H", len(entries)) + packed + bytes(4)
    return head.ljust(180, b"\0") + bits.ljust(20, b"\0") + body


@pytest.mark.parametrize("channels", [1, 2, 3, 4])
def test_png_files_keep_sixteen_bits(channels):
    values = DEEP[..., :channels]
    image = decode_image(deep_png(values), ".png")
    assert image.integer
    np.testing.assert_array_equal(np.rint(image.texels * 65535.0), values)


@pytest.mark.parametrize("channels", [3, 4])
@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("compression", [1, 8])
def test_tiff_files_keep_sixteen_bits(channels, order, compression):
    values = DEEP[..., :channels]
    image = decode_image(deep_tiff(values, order, compression), ".tif")
    assert image.integer
    np.testing.assert_array_equal(np.rint(image.texels * 65535.0), values)


def test_a_colour_that_stands_for_transparency_is_found_by_all_its_bits():
    values = DEEP[..., :3].copy()
    values[2, 3], values[2, 4] = (1000, 2000, 3000), (1000, 2000, 3001)
    alpha = decode_image(deep_png(values, key=(1000, 2000, 3000)), ".png").texels[..., 3]
    assert (alpha[2, 3], alpha[2, 4], alpha.sum()) == (0.0, 1.0, alpha.size - 1)


def test_pictures_are_read_with_the_same_bits_as_textures(tmp_path):
    values = DEEP[..., :3]
    (tmp_path / "a.png").write_bytes(deep_png(values))
    (tmp_path / "a.tif").write_bytes(deep_tiff(values))
    for name in ("a.png", "a.tif"):
        np.testing.assert_array_equal(np.rint(image_file.load_encoded(tmp_path / name) * 65535.0), values)
        np.testing.assert_allclose(image_file.load(tmp_path / name), srgb.decode(values / 65535.0), rtol=1e-12)


def test_sixteen_bits_that_would_become_eight_are_refused():
    with pytest.raises(BrokenFileError, match="one after the other"):
        decode_image(deep_tiff(DEEP[..., :3], planes=2), ".tif")
    whole = deep_tiff(DEEP[..., :3])
    with pytest.raises(BrokenFileError):
        decode_image(whole[:-100], ".tif")
    with pytest.raises(BrokenFileError):
        decode_image(deep_png(DEEP[..., :3])[:-60], ".png")
    # A header that claims more than its bytes hold.
    huge = bytearray(deep_png(DEEP[..., :3]))
    huge[16:24] = struct.pack(">II", 60000, 60000)
    huge[29:33] = struct.pack(">I", zlib.crc32(bytes(huge[12:29])))
    with pytest.raises(BrokenFileError, match="60000 x 60000 pixels"):
        decode_image(bytes(huge), ".png")
