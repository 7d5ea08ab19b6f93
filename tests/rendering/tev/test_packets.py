"""Packets against tev's documented format, byte for byte."""

import numpy as np

from raytracer.rendering.tev.packets import create_image, update_image
from tests.rendering.tev.receiver import Receiver


def test_an_image_is_created_by_these_bytes():
    # Length, operation, grab focus, name, width, height, number of channels, and their names.
    expected = "1e000000 04 01 612e65787200 80020000 68010000 03000000 5200 4700 4200"
    assert create_image("a.exr", 640, 360).hex() == expected.replace(" ", "")


def test_a_rectangle_is_updated_by_these_bytes():
    pixels = np.array([[[1.0, 2.0, -0.5], [0.0, np.inf, 1e-3]]], np.float32)
    expected = (
        "6a000000 06 00 6100 03000000 5200 4700 4200 "
        "10000000 20000000 02000000 01000000 "
        # Interleaved: offsets 0, 1, 2, and strides of 3, in floats.
        "0000000000000000 0100000000000000 0200000000000000 "
        "0300000000000000 0300000000000000 0300000000000000 "
        "0000803f 00000040 000000bf 00000000 0000807f 6f12833a"
    )
    assert update_image("a", 16, 32, pixels).hex() == expected.replace(" ", "")


def test_names_are_utf_8_and_end_where_they_end():
    assert "B\u00e4lle.png".encode() + b"\0" in create_image("B\u00e4l\0le.png", 1, 1)


def test_the_receiver_puts_rectangles_where_they_belong():
    with Receiver() as viewer:
        viewer.take(create_image("a", 4, 3))
        pixels = np.arange(12, dtype=np.float32).reshape(2, 2, 3)
        viewer.take(update_image("a", 2, 1, pixels))
    expected = np.zeros((3, 4, 3))
    expected[1:3, 2:4] = pixels
    assert np.array_equal(viewer.images["a"], expected)
    assert viewer.operations == [4, 6]
    assert viewer.focused == ["a"]
