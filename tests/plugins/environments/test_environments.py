"""Environments: what every kind promises, and the values that each is made of."""

import numpy as np
import pytest

from raytracer.film.formats.base.image_format import StoredImage
from raytracer.schema.registry import ENVIRONMENTS
from tests.plugins.environments.kernels import seen
from tests.plugins.shapes.kernels import uniform_directions

EXAMPLES = {
    "constant": [{"radiance": 1.0}, {"radiance": [0.1, 0.2, 3.0]}],
    "gradient": [{}, {"horizon": [1, 0, 2], "zenith": [0, 5, 0]}],
    "image": [{"file": "map.npy"}, {"file": "map.npy", "scale": [1, 2, 0], "rotation": 77}],
    "sky": [{}, {"sun_direction": [1, 0, -1], "turbidity": 10, "ground_albedo": 0.3, "sun": True}],
}

MAP = StoredImage(np.random.default_rng(5).random((7, 9, 3), np.float32) ** 6, False)

DIRECTIONS = uniform_directions(200, 1)


def spec_of(kind, keys):
    return ENVIRONMENTS.specs()[kind].model_validate({"type": kind, **keys})


def packed(kind, keys):
    return spec_of(kind, keys).pack({"file": MAP} if kind == "image" else {})


CASES = [pytest.param(kind, keys, id=f"{kind} {keys}") for kind, examples in EXAMPLES.items() for keys in examples]


def test_every_kind_has_an_example():
    assert set(EXAMPLES) == set(ENVIRONMENTS.specs())


@pytest.mark.parametrize(("kind", "keys"), CASES)
def test_radiance_is_finite_and_not_negative(kind, keys):
    radiance = seen(packed(kind, keys), DIRECTIONS)
    assert np.isfinite(radiance).all()
    assert (radiance >= 0.0).all()


def test_no_environment_is_black():
    assert not seen(None, DIRECTIONS).any()


def test_a_black_environment_is_none():
    # So that nothing of it is compiled.
    assert packed("constant", {"radiance": 0}) is None
    assert packed("gradient", {"horizon": 0, "zenith": 0}) is None
    assert packed("gradient", {"horizon": 0, "zenith": 1}) is not None


def test_constant_is_the_same_everywhere():
    np.testing.assert_array_equal(
        seen(packed("constant", {"radiance": [1, 2, 3]}), DIRECTIONS), np.tile([1.0, 2.0, 3.0], (200, 1))
    )


def test_gradient_is_that_of_one_weekend():
    # Section 4.2: (1 - a) white + a (0.5, 0.7, 1.0), a = (y + 1) / 2; so (0.75, 0.85, 1) straight ahead.
    sky = packed("gradient", {})
    np.testing.assert_allclose(seen(sky, [0, 1, 0])[0], [0.5, 0.7, 1.0], rtol=1e-15)
    np.testing.assert_allclose(seen(sky, [0, -1, 0])[0], [1.0, 1.0, 1.0], rtol=1e-15)
    np.testing.assert_allclose(seen(sky, [0, 0, -1])[0], [0.75, 0.85, 1.0], rtol=1e-15)
    a = 0.5 * (DIRECTIONS[:, 1:2] + 1.0)
    np.testing.assert_allclose(seen(sky, DIRECTIONS), (1.0 - a) + a * [0.5, 0.7, 1.0], rtol=1e-14)


def test_gradient_is_never_negative():
    # Unit vectors may be longer by rounding.
    dark = packed("gradient", {"horizon": 0.0, "zenith": [0.0, 5.0, 1.0]})
    assert not seen(dark, [0.0, -1.0 - 2.0**-52, 0.0]).any()
    np.testing.assert_array_equal(seen(dark, [0.0, 1.0 + 2.0**-52, 0.0])[0], [0.0, 5.0, 1.0])
