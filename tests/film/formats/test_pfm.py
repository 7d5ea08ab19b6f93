"""Portable float maps: the bytes that the format's description gives, and what is none."""

import numpy as np
import pytest

from raytracer.film.formats import pfm


@pytest.mark.parametrize("shape", [(3, 4), (3, 4, 3), (1, 1)])
def test_what_is_encoded_is_decoded(shape):
    values = np.random.default_rng(0).normal(size=shape)
    values.flat[0] = np.inf
    assert np.array_equal(pfm.decode(pfm.encode(values)), values.astype(np.float32))


def test_rows_go_from_the_bottom_to_the_top_in_either_order_of_bytes():
    top, bottom = [1.0, 2.0], [3.0, 4.0]
    for order, scale in (("<f4", b"-1.0"), (">f4", b"1.0")):
        data = b"Pf\n2 2\n" + scale + b"\n" + np.array([bottom, top], order).tobytes()
        assert pfm.decode(data).tolist() == [top, bottom]
    assert pfm.encode(np.array([top, bottom])) == b"Pf\n2 2\n-1.0\n" + np.array([bottom, top], "<f4").tobytes()


@pytest.mark.parametrize(
    ("data", "sentence"),
    [
        (b"P6\n2 2\n255\n", "is no .pfm file"),
        (b"Pf\n2 2\n-1.0\n" + bytes(15), "is truncated"),
        # As many as are claimed are not made room for.
        (b"PF\n999999999 999999999\n-1.0\n", "is truncated"),
        (b"Pf\n0 2\n-1.0\n", "without a size"),
        (b"Pf\n2 2\n0.0\n" + bytes(16), "without a size or a scale"),
        (b"Pf\n2 2\n1e999\n" + bytes(16), "without a size or a scale"),
    ],
)
def test_what_is_no_map_is_a_value_error(data, sentence):
    with pytest.raises(ValueError, match=sentence):
        pfm.decode(data)


def test_other_shapes_are_not_encoded():
    with pytest.raises(ValueError, match="not"):
        pfm.encode(np.zeros((2, 2, 4)))
