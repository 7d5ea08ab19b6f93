"""Images as textures read them: values as stored, in every format, and what is refused."""

import io

import numpy as np
import OpenEXR
import PIL.Image
import pytest

from raytracer.film.formats import hdr
from raytracer.scene.assets.images import decode_image
from raytracer.util import srgb
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
