"""Radiance pictures: the encoding of a pixel, the run-length packets, and broken files."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from raytracer.film.formats import hdr


def pixel(*rgb):
    return hdr.to_rgbe(np.array(rgb, dtype=np.float64).reshape(1, 1, 3)).ravel().tolist()


def test_the_value_of_a_pixel_is_its_mantissas_times_its_power_of_two():
    # (r, g, b, e) is (r, g, b) 2^(e - 136): 128 2^(129 - 136) = 1.
    assert pixel(1, 0.5, 0.25) == [128, 64, 32, 129]
    assert pixel(0, 0, 0) == [0, 0, 0, 0]


def test_a_mantissa_that_rounds_up_to_256_takes_the_next_exponent():
    assert pixel(255.4 / 256, 0, 0) == [255, 0, 0, 128]
    assert pixel(255.6 / 256, 0, 0) == [128, 0, 0, 129]


def test_what_cannot_be_held_is_made_the_nearest_that_can():
    assert pixel(-1, np.nan, 1) == [0, 0, 128, 129]
    assert pixel(np.inf, 1, 1) == pixel(1e300, 1, 1) == [255, 0, 0, 255]
    assert pixel(1e-45, 0, 0) == [0, 0, 0, 0]


def test_the_error_is_at_most_half_a_step_of_the_largest_component():
    linear = np.exp(np.random.default_rng(3).uniform(-30, 30, (50, 60, 3)))
    error = np.abs(hdr.from_rgbe(hdr.to_rgbe(linear)) - linear)
    assert (error <= linear.max(axis=2, keepdims=True) / 128 / 2).all()


def test_every_pixel_that_a_file_can_hold_is_encoded_as_it_was():
    rng = np.random.default_rng(4)
    pixels = rng.integers(0, 256, (40, 50, 4), dtype=np.uint8)
    pixels[..., 0] |= 128
    pixels[..., 3] |= 1
    np.testing.assert_array_equal(hdr.to_rgbe(hdr.from_rgbe(pixels)), pixels)


def roundtrip(linear):
    expected = hdr.from_rgbe(hdr.to_rgbe(linear))
    np.testing.assert_array_equal(hdr.decode(hdr.encode(linear, {})), expected)


@given(
    arrays.arrays(
        np.float64,
        st.tuples(st.integers(1, 4), st.integers(1, 300), st.just(3)),
        elements=st.sampled_from([0.0, 1.0, 2.5]),
    )
)
def test_run_length_packets_hold_any_scanlines(linear):
    roundtrip(linear)


@pytest.mark.parametrize("width", [1, 7, 8, 126, 127, 128, 129, 254, 255, 256, 257, 600, 32767, 32768])
@pytest.mark.parametrize("kind", ["equal", "different", "runs of three", "runs of four"])
def test_packets_end_where_their_length_bytes_do(width, kind):
    x = np.arange(width)
    values = {"equal": x * 0, "different": x % 251, "runs of three": x // 3 % 251, "runs of four": x // 4 % 251}[kind]
    roundtrip(np.broadcast_to((values + 1.0)[None, :, None] * [1.0, 0.5, 0.3], (2, width, 3)))


def test_a_run_is_two_bytes():
    # Four components of 127 equal bytes: a packet of two bytes each, after the four that begin the scanline.
    data = hdr.encode(np.ones((1, 127, 3)), {})
    assert data.endswith(b"-Y 1 +X 127\n" + bytes([2, 2, 0, 127]) + bytes([255, 128] * 3 + [255, 129]))


def test_an_image_of_many_blocks_of_scanlines():
    roundtrip(np.random.default_rng(5).random((700, 512, 3)))


def test_the_header_names_settings_and_no_line_of_theirs_ends_it():
    data = hdr.encode(np.ones((1, 9, 3)), {"scene": "two\n\nlines", "spp": "64"})
    assert b"\nrt.spp=64\n" in data
    assert hdr.decode(data).shape == (1, 9, 3)


def test_exposure_lines_are_divided_out():
    data = hdr.encode(np.ones((1, 9, 3)), {}).replace(b"\nFORMAT", b"\nEXPOSURE=4\nEXPOSURE= 0.5\nFORMAT")
    np.testing.assert_array_equal(hdr.decode(data), 0.5)


@pytest.mark.parametrize("keep", [0, 5, 40, 140, 170, -1])
@pytest.mark.parametrize("width", [5, 40])
def test_a_file_that_ends_early_is_refused(keep, width):
    data = hdr.encode(np.random.default_rng(6).random((4, width, 3)), {})
    with pytest.raises((ValueError, IndexError)):
        hdr.decode(data[:keep])


@pytest.mark.parametrize("packet", [[0, 1, 2], [137, 1], [129 + 9, 1]])
def test_a_packet_without_bytes_or_beyond_the_scanline_is_refused(packet):
    data = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 8\n" + bytes([2, 2, 0, 8, *packet] + [128 + 8, 1] * 4)
    with pytest.raises((ValueError, IndexError)):
        hdr.decode(data[: data.index(b"\x02\x02") + 4] + bytes(packet * 20))


@pytest.mark.parametrize(
    ("side", "reason"), [(10**9, "at most 268,435,456 are read"), (16_000, "which no picture is"), (900, "ends early")]
)
def test_a_size_that_the_file_cannot_hold_takes_no_memory(side, reason):
    with pytest.raises(ValueError, match=reason):
        hdr.decode(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y %d +X %d\n" % (side, side) + bytes(100))
