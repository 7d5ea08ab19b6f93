"""What apertures and the rims before them make of light: out of focus, and towards the corners."""

import math

import numpy as np
import pytest
from pydantic import ValidationError

from raytracer.plugins.apertures.base.vignetting import Vignetting
from raytracer.plugins.cameras.thin_lens import ThinLens
from tests.plugins.apertures.kernels import passed, sampled
from tests.plugins.apertures.test_apertures import COUNT, LETTER
from tests.plugins.cameras.kernels import weighted_rays
from tests.small_scenes import image

FOCUS, APERTURE = 10.0, 0.1


def bokeh(shape, distance, *, blur, size, base=None, pinhole=False):
    """A picture (size, size) of a light at a distance, blurred to a disc `blur` pixels wide by a round aperture.

    The light is a sphere a pixel in radius; each pixel holds the fraction of its rays that meet it.  A pinhole has its
    film where the lens has its plane of focus.
    """
    # Camera truths: C = A |z - F| / z on the plane of focus, and A (z + f) / z on the film of a pinhole.
    pixel = APERTURE * abs(distance + FOCUS if pinhole else distance - FOCUS) / distance / blur
    vfov = math.degrees(2.0 * math.atan(0.5 * size * pixel / FOCUS))
    lens = f"type: pinhole, focal_length: {1e3 * FOCUS}, diameter" if pinhole else "type: thin_lens, aperture"
    picture = image(
        f"""
camera: {{look_from: [0, 0, 0], look_at: [0, 0, {-FOCUS}], vfov: {vfov}, {lens}: {1e3 * APERTURE},
         aperture_shape: {shape}}}
objects:
  - {{type: sphere, center: [0, 0, {-distance}], radius: {pixel * distance / FOCUS},
     material: {{type: emitter, radiance: 1}}}}
""",
        width=size,
        height=size,
        max_depth=1,
        spp=2048,
        sampler="sobol",
        filled=False,
        base=base,
    )
    return np.asarray(picture.radiance[..., 0], np.float64)


LIGHT = math.pi
"""Sum of the pixels of `bokeh`: the light's own image is a disc a pixel in radius."""


@pytest.mark.parametrize("pinhole", [False, True])
def test_a_light_shows_the_mask_upright_beyond_the_focus_and_turned_round_by_a_pinhole(pinhole, tmp_path):
    # Pixels of the mask that are 6 pixels of the picture: the mask has 5 rows of 3 and is in the middle.
    np.save(tmp_path / "letter.npy", LETTER)
    side = math.sqrt(math.pi / LETTER.sum())
    weight = bokeh("{type: image, file: letter.npy}", 20.0, blur=12.0 / side, size=40, base=tmp_path, pinhole=pinhole)
    weight = weight[::-1, ::-1] if pinhole else weight
    assert weight.sum() == pytest.approx(LIGHT, rel=0.02)
    # Without the border of a pixel that the light's own size blurs.
    blocks = weight[5:35, 11:29].reshape(5, 6, 3, 6)[:, 1:5, :, 1:5].mean(axis=(1, 3)) * 36.0 / LIGHT
    assert (blocks[LETTER == 0.0] == 0.0).all()
    np.testing.assert_allclose(blocks, LETTER / LETTER.sum(), rtol=0.0, atol=0.012)


@pytest.mark.parametrize(
    "shape",
    [
        {"type": "round", "anamorphic": 1.3},
        {"type": "polygon", "blades": 6},
        {"type": "polygon", "blades": 5, "curvature": 0.5, "rotation": 20},
    ],
)
def test_exposure_does_not_depend_on_the_shape(shape):
    # Irradiance in a field of radiance 1: in the middle, with m = f / (s - f), pi / (4 N^2 (1 + m)^2), and at the side.
    # For shapes of one area it differs by the inclination of rays only: of the second order in the lens's radius over
    # the distance of the plane of focus, times how much their moments of inertia differ.
    lens = {"look_at": (0, 0, -10), "focal_length": 50, "f_number": 4, "shutter": 1, "iso": 100}
    for x in (15.0, 1.0):
        plain, shaped = (
            weighted_rays(ThinLens.model_validate({**lens, **more}).pack(30, 20), np.full(1 << 16, x), 10.0)[2].mean()
            for more in ({}, {"aperture_shape": shape})
        )
        assert shaped == pytest.approx(plain, rel=1e-3)
        if x == 15.0:
            assert plain == pytest.approx(math.pi / (4.0 * 4.0**2 * (1.0 + 0.05 / 9.95) ** 2), rel=1e-4)


# ---- Rims


def overlap(r, s, distance):
    """Area that two circles have in common.

    References: https://mathworld.wolfram.com/Circle-CircleIntersection.html, eq. 14.
    """
    if distance <= abs(r - s):
        return math.pi * min(r, s) ** 2
    if distance >= r + s:
        return 0.0
    first = r * r * math.acos((distance**2 + r * r - s * s) / (2.0 * distance * r))
    second = s * s * math.acos((distance**2 + s * s - r * r) / (2.0 * distance * s))
    kite = (-distance + r + s) * (distance + r - s) * (distance - r + s) * (distance + r + s)
    return first + second - 0.5 * math.sqrt(kite)


@pytest.mark.parametrize("slope", [0.0, 0.1, 0.3, 0.5, 0.8, 0.901])
@pytest.mark.parametrize("side", [0.0, 2.0])
def test_cats_eye_has_the_area_of_two_overlapping_circles(slope, side):
    # A lens of 40 mm, a rim of 50 mm 50 mm in front of it: rays of the slope t meet it shifted by 50 mm t.
    rim = Vignetting(diameter=50.0, distance=50.0).pack()
    points = 0.02 * sampled(None, np.random.default_rng(2).random((COUNT, 2)))
    weights = passed(rim, points, slope * math.cos(side), slope * math.sin(side))
    expected = overlap(0.02, 0.025, 0.05 * slope) / (math.pi * 0.02**2)
    error = math.sqrt(expected * (1.0 - expected) / COUNT)
    assert weights.mean() == pytest.approx(expected, abs=4.0 * error)
    assert set(np.unique(weights)) <= {0.0, 1.0}
    # What is cut is on the side that the rays come from.
    cut = points[weights == 0.0]
    if 0.0 < len(cut) < COUNT:
        assert (cut @ [math.cos(side), math.sin(side)]).mean() > 0.0


def test_a_rim_smaller_than_the_lens_cuts_the_middle_too():
    points = sampled(None, np.random.default_rng(3).random((COUNT, 2)))
    weights = passed(Vignetting(diameter=1000.0, distance=1.0).pack(), points, 0.0, 0.0)
    np.testing.assert_array_equal(weights, np.hypot(*points.T) <= 0.5)


@pytest.mark.parametrize("keys", [{"diameter": 50}, {"diameter": 0, "distance": 5}, {"diameter": 5, "distance": 0}])
def test_impossible_rims_are_refused(keys):
    with pytest.raises(ValidationError):
        Vignetting.model_validate(keys)


def test_the_picture_darkens_to_its_corners_as_the_circles_part():
    # Focus at infinity in a field of radiance 1: a place's light is the part of the aperture that its rays pass the rim
    # from.  They are shifted there by the distance times the tangent of their angle.
    keys = {"vfov": 60, "focus_distance": math.inf, "aperture": 40, "vignetting": {"diameter": 50, "distance": 60}}
    packed = ThinLens.model_validate({"look_at": (0, 0, -10), **keys}).pack(25, 25)
    expected = []
    for x, y in ((12.5, 12.5), (6.0, 12.5), (1.0, 12.5), (4.0, 20.0), (0.5, 0.5)):
        tangent = math.hypot(x - 12.5, y - 12.5) * 2.0 * math.tan(math.radians(30.0)) / 25.0
        expected.append(overlap(20.0, 25.0, 60.0 * tangent) / overlap(20.0, 25.0, 0.0))
        weights = weighted_rays(packed, np.full(1 << 16, x), y)[2]
        deviation = math.sqrt(expected[-1] * (1.0 - expected[-1]) / (1 << 16))
        assert weights.mean() == pytest.approx(expected[-1], abs=4.5 * deviation + 1e-12)
    assert (expected[0], expected[-1]) == (1.0, 0.0)
    assert 0.1 < expected[2] < 0.5
