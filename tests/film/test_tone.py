"""Tone curves: their anchors, their shape, and that only what is shown goes through them."""

import numpy as np
import PIL.Image
import pytest
from pydantic import ValidationError

from raytracer.film import Image, load
from raytracer.film.tone import Filmic, ToneCurveSpec
from raytracer.util import srgb

WHITES = [1.0, 2.0, 4.0, 16.0, 1e6]


def _hable(x):
    a, b, c, d, e, f = 0.15, 0.50, 0.10, 0.20, 0.02, 0.30
    return (x * (a * x + c * b) + d * e) / (x * (a * x + b) + d * f) - e / f


@pytest.mark.parametrize("white", WHITES)
def test_black_grey_and_white_are_where_they_belong(white):
    curve = Filmic(white)
    assert curve(0.0) == 0.0
    assert curve(white) == pytest.approx(1.0, rel=1e-12)
    # ISO 12232: what is exposed by 10 / S_SOS is shown as 118 of 255, 10 / S_SOS being 10 / 78 of saturation.
    assert curve(10.0 / 78.0) == pytest.approx(0.18, rel=1e-9)
    assert srgb.to_uint8(curve(10.0 / 78.0)) == 118


@pytest.mark.parametrize("white", WHITES)
def test_it_is_hables_curve(white):
    curve = Filmic(white)
    x = np.linspace(0.0, white, 101)
    scale = curve._scale
    np.testing.assert_allclose(curve(x), _hable(scale * x) / _hable(scale * white), rtol=1e-9, atol=1e-12)


def test_what_is_outside_is_clipped_and_nan_stays():
    curve = Filmic(4.0)
    np.testing.assert_allclose(curve([-1.0, 5.0, np.inf, -np.inf]), [0.0, 1.0, 1.0, 0.0], rtol=1e-12)
    assert np.isnan(curve(np.nan))


def test_white_is_where_the_sensor_saturates_if_there_is_one():
    assert ToneCurveSpec().curve(saturates=True) is None
    assert ToneCurveSpec(type="filmic").curve(saturates=True) == Filmic(1.0)
    assert ToneCurveSpec(type="filmic").curve(saturates=False) == Filmic(4.0)
    assert ToneCurveSpec(type="filmic", white=8.0).curve(saturates=True) == Filmic(8.0)


def test_a_linear_curve_has_no_white():
    with pytest.raises(ValidationError, match="only the tone curve filmic has a white"):
        ToneCurveSpec(white=2.0)


def test_only_what_is_shown_goes_through_it(tmp_path):
    values = np.geomspace(1e-3, 8.0, 60).reshape(4, 5, 3)
    image = Image(values, tone_curve=Filmic(4.0))
    for name in ("a.npy", "a.exr", "a.hdr", "a.png"):
        image.save(tmp_path / name)
    np.testing.assert_array_equal(load(tmp_path / "a.npy"), values)
    np.testing.assert_array_equal(load(tmp_path / "a.exr"), values.astype(np.float32))
    np.testing.assert_allclose(load(tmp_path / "a.hdr"), values, atol=8.0 / 256)
    with PIL.Image.open(tmp_path / "a.png") as file:
        np.testing.assert_array_equal(np.asarray(file), srgb.to_uint8(Filmic(4.0)(values)))
    # Highlights that clipping would make alike stay apart.
    assert np.unique(image.display()[-1]).size > np.unique(Image(values).display()[-1]).size
