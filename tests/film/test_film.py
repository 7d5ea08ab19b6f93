"""The film's statistics against those of NumPy, and what it develops to."""

import numpy as np
import pytest

from raytracer.film import Film, Image, develop


def exposed(samples):
    """A film that holds `samples` (n, height, width, 3)."""
    film = Film.empty(samples.shape[2], samples.shape[1])
    film.mean[:] = samples.mean(axis=0)
    film.m2[:] = ((samples - samples.mean(axis=0)) ** 2).sum(axis=0)
    film.count[:] = len(samples)
    return film


def test_variance_of_mean_is_the_sample_variance_over_n():
    samples = np.random.default_rng(1).random((7, 2, 3, 3))
    np.testing.assert_allclose(exposed(samples).variance_of_mean(), samples.var(axis=0, ddof=1) / 7, rtol=1e-12)


def test_a_pixel_with_fewer_than_two_samples_has_an_unknown_variance():
    film = exposed(np.ones((3, 1, 3, 3)))
    film.count[0] = [0, 1, 2]
    np.testing.assert_array_equal(film.variance_of_mean()[0, :, 0], [np.inf, np.inf, 0])


def test_develop_copies_the_film():
    film = exposed(np.full((4, 2, 3, 3), 0.5))
    image = develop(film, {"spp": 4})
    film.mean[:] = 9
    assert (image.radiance == 0.5).all()
    assert (image.variance == 0).all()
    assert (image.samples, image.settings) == (4, {"spp": 4})


def test_develop_knows_no_variance_of_single_samples():
    assert develop(exposed(np.ones((1, 2, 2, 3))), {}).variance is None


def test_an_image_shows_itself_in_a_notebook():
    assert Image(np.ones((2, 3, 3)))._repr_png_().startswith(b"\x89PNG\r\n\x1a\n")


@pytest.mark.parametrize("shape", [(3, 4), (3, 4, 4), (0, 4, 3), (3,)])
def test_an_image_has_three_channels(shape):
    with pytest.raises(ValueError, match=r"\(height, width, 3\)"):
        Image(np.zeros(shape))


def test_an_image_and_its_variance_have_one_shape():
    with pytest.raises(ValueError, match="variance"):
        Image(np.zeros((2, 2, 3)), np.zeros((2, 3, 3)))
