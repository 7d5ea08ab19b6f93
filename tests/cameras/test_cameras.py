"""Cameras: what every kind promises, and each against the formulas of its optics."""

import math
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from raytracer.cameras.pinhole import Pinhole
from raytracer.cameras.thin_lens import Lens, ThinLens
from raytracer.kinds import CAMERAS
from raytracer.spec import Spec
from tests.cameras.kernels import camera_rays
from tests.rendering import image

EXAMPLES: dict[str, list[dict[str, Any]]] = {
    "pinhole": [{"look_from": [1, 2, 3], "look_at": [0, 0, 0], "vfov": 35}],
    "thin_lens": [
        {"look_from": [1, 2, 3], "look_at": [0, 0, 0], "vfov": 35, "defocus_angle": 2},
        {"look_from": [1, 2, 3], "look_at": [0, 0, 0], "vfov": 35, "focus_distance": math.inf, "aperture": 50},
        {"look_from": [1, 2, 3], "look_at": [0, 0, 0], "vfov": 35, "focus_distance": 2, "aperture": 0},
    ],
}

CASES = [
    pytest.param({"type": kind, **parameters}, id=f"{kind} {number}")
    for kind, examples in EXAMPLES.items()
    for number, parameters in enumerate(examples)
]


def camera(**keys: Any) -> Any:
    return CAMERAS.specs()[keys.get("type", "pinhole")].model_validate(keys)


# ---- Every kind


def test_every_kind_has_an_example() -> None:
    assert set(EXAMPLES) == set(CAMERAS.specs())


@pytest.mark.parametrize("keys", CASES)
def test_rays_are_unit_vectors_and_numbers(keys: dict[str, Any]) -> None:
    rng = np.random.default_rng(1)
    packed = camera(**keys).pack(40, 30)
    origins, directions = camera_rays(packed, rng.uniform(0, 40, 2000), rng.uniform(0, 30, 2000))
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0, rtol=0.0, atol=1e-15)
    assert np.isfinite(origins).all()


@pytest.mark.parametrize("keys", CASES)
def test_film_is_upright_and_its_middle_is_what_the_camera_looks_at(keys: dict[str, Any]) -> None:
    spec = camera(**keys)
    _, directions = camera_rays(spec.pack(40, 30), np.full(4000, 20.0), 15.0)
    view = np.subtract(spec.look_at, spec.look_from)
    view /= np.linalg.norm(view)
    # A lens turns single rays by up to its radius over the focus distance: on average, not at all.
    middle = directions.mean(axis=0)
    np.testing.assert_allclose(middle / np.linalg.norm(middle), view, atol=1e-3)
    right = np.cross(view, spec.up)
    top, side = (camera_rays(spec.pack(40, 30), x, y)[1][0] for x, y in ((20.0, 0.0), (40.0, 15.0)))
    assert top @ np.asarray(spec.up) > view @ np.asarray(spec.up)
    assert side @ right > 0.1


# ---- Pinhole


@pytest.mark.parametrize("vfov", [20.0, 90.0, 179.9])
@pytest.mark.parametrize(("width", "height"), [(40, 30), (30, 40), (1, 1)])
def test_edges_of_the_film_are_the_field_of_view(vfov: float, width: int, height: int) -> None:
    # Half the field of view up to the top edge; square pixels to the sides.  Hard case 27: tan(89.95 deg) = 1145.9.
    half = math.tan(math.radians(vfov / 2.0))
    packed = camera(vfov=vfov).pack(width, height)
    for x, y in ((0.0, 0.0), (width, 0.0), (0.5 * width, height), (0.25 * width, 0.75 * height)):
        _, directions = camera_rays(packed, x, y)
        expected = np.array([(2.0 * x - width) / height * half, (1.0 - 2.0 * y / height) * half, -1.0])
        np.testing.assert_allclose(directions[0], expected / np.linalg.norm(expected), rtol=0.0, atol=1e-15)
    if vfov == 179.9:
        assert half == pytest.approx(1145.9, abs=0.1)


def test_points_appear_in_their_pixels() -> None:
    # A known point of space, projected by hand to film coordinates; an emitter there, no larger than 0.01 pixels,
    # lights that pixel and no other.
    eye, target = np.array([3.0, 2.0, 5.0]), np.array([0.5, -0.3, 0.2])
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, [0.0, 1.0, 0.0])
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    half = math.tan(math.radians(20.0))
    for point in ([0.6, 0.1, 0.3], [-0.4, -1.0, 0.9], [1.0, 0.5, -1.0]):
        to = np.array(point) - eye
        x = 8.0 + 8.0 * (to @ right) / (to @ forward) / half
        y = 8.0 - 8.0 * (to @ up) / (to @ forward) / half
        _, directions = camera_rays(
            camera(look_from=eye.tolist(), look_at=target.tolist(), vfov=40.0).pack(16, 16), x, y
        )
        np.testing.assert_allclose(directions[0], to / np.linalg.norm(to), rtol=0.0, atol=1e-14)
        picture = image(
            f"""
camera: {{type: pinhole, look_from: {eye.tolist()}, look_at: {target.tolist()}, vfov: 40}}
objects:
  - {{type: sphere, center: {point}, radius: 0.02, material: {{type: emitter, radiance: 1}}}}
""",
            max_depth=1,
            spp=4096,
        )
        weight = picture.radiance[..., 0]
        rows, columns = np.mgrid[0:16, 0:16] + 0.5
        assert weight[int(y), int(x)] > 0.0
        # The centroid of a sphere of 0.08 pixels is known to its radius; pixels hold it to within theirs.
        assert abs((weight * columns).sum() / weight.sum() - x) < 0.6
        assert abs((weight * rows).sum() / weight.sum() - y) < 0.6


def test_frame_is_orthonormal_however_close_up_is_to_the_view() -> None:
    # Hard case 28: parallel is an error; 1e-6 rad off, the frame is orthonormal to 1e-12.
    for angle in (1.0, 1e-3, 1e-6, 1e-9):
        spec = camera(look_from=[0, 0, 0], look_at=[0, 0, -2], up=[0, math.sin(angle), -math.cos(angle)])
        frame = np.array(spec.frame()[1:])
        np.testing.assert_allclose(frame @ frame.T, np.eye(3), rtol=0.0, atol=1e-12)
        # Right is that of the exact cross product, along +x for this up.
        np.testing.assert_allclose(frame[0], [1.0, 0.0, 0.0], rtol=0.0, atol=1e-12)
    for up in ([0, 0, 1], [0, 0, -3]):
        with pytest.raises(ValidationError, match="parallel"):
            camera(look_from=[0, 0, 0], look_at=[0, 0, -2], up=up)
    with pytest.raises(ValidationError, match="same point"):
        camera(look_from=[1, 2, 3], look_at=[1, 2, 3])


@pytest.mark.parametrize("vfov", [0.0, 180.0, -10.0, 200.0])
def test_impossible_fields_of_view_are_refused(vfov: float) -> None:
    with pytest.raises(ValidationError):
        camera(vfov=vfov)


# ---- Thin lens


def lens_spec(**keys: Any) -> ThinLens:
    return ThinLens.model_validate({"look_from": [0, 0, 0], "look_at": [0, 0, -10], "vfov": 20, **keys})


def test_defocus_angle_is_the_cone_from_focus_to_lens() -> None:
    # Camera truths: F = 10, delta = 0.6 deg: A = 2 F tan(delta / 2) = 0.104720 m.
    assert lens_spec(defocus_angle=0.6).diameter() == pytest.approx(0.104720, abs=1e-6)
    assert lens_spec(aperture=104.72).diameter() == pytest.approx(0.10472)


@pytest.mark.parametrize("focus", [0.5, 10.0, 1e4])
def test_rays_of_a_film_point_meet_in_the_plane_of_focus(focus: float) -> None:
    spec = lens_spec(focus_distance=focus, aperture=100)
    x, y = 31.0, 7.0
    origins, directions = camera_rays(spec.pack(40, 30), np.full(1000, x), y)
    # All on the disc of the lens, over all of it, perpendicular to the axis.
    radius = np.hypot(origins[:, 0], origins[:, 1])
    assert (origins[:, 2] == 0.0).all()
    assert (radius <= 0.05 * (1.0 + 1e-12)).all()
    assert (radius < 0.025).mean() == pytest.approx(0.25, abs=0.05)
    # At z = -focus, all where the pinhole's ray of that film point is.
    meeting = origins + directions * (-focus / directions[:, 2:])
    _, straight = camera_rays(Pinhole(look_from=(0, 0, 0), look_at=(0, 0, -10), vfov=20).pack(40, 30), x, y)
    expected = straight[0] * (-focus / straight[0, 2])
    np.testing.assert_allclose(meeting, np.tile(expected, (1000, 1)), rtol=0.0, atol=1e-14 * focus + 1e-15)


def test_focus_at_infinity_sends_parallel_rays() -> None:
    # Hard case 24: o + inf * d is not a number.
    packed = lens_spec(focus_distance=math.inf, aperture=100).pack(40, 30)
    assert packed.lens == Lens(0.05, 0.0)
    origins, directions = camera_rays(packed, np.full(500, 5.0), 5.0)
    assert np.isfinite(directions).all()
    assert (directions == directions[0]).all()
    assert np.unique(origins, axis=0).shape == (500, 3)
    with pytest.raises(ValidationError, match="aperture"):
        lens_spec(focus_distance=math.inf, defocus_angle=1.0)


@pytest.mark.parametrize("keys", [{}, {"aperture": 0}, {"defocus_angle": 0}, {"aperture": 0, "focus_distance": 3}])
def test_no_aperture_is_the_pinhole_bit_for_bit(keys: dict[str, Any]) -> None:
    # Hard case 23: normalize(focus * d) would differ from normalize(d) in half of all rays.
    packed = lens_spec(**keys).pack(40, 30)
    pinhole = Pinhole(look_from=(0, 0, 0), look_at=(0, 0, -10), vfov=20).pack(40, 30)
    assert packed == pinhole
    assert packed.lens is None
    text = "camera: {{type: {}, look_from: [0, 0, 4], look_at: [0, 0, 0], vfov: 40{}}}\n"
    rest = """
environment: {type: constant, radiance: 1}
objects:
  - {type: sphere, center: [0, 0, 0], radius: 1, material: {type: metal, fuzz: 0.5}}
"""
    more = "".join(f", {key}: {value}" for key, value in keys.items())
    np.testing.assert_array_equal(
        image(text.format("thin_lens", more) + rest, spp=8).radiance,
        image(text.format("pinhole", "") + rest, spp=8).radiance,
    )


def test_a_tiny_aperture_is_the_pinhole_within_a_hundredth_of_a_pixel() -> None:
    # Hard case 26: the blur A |z - F| / z / F of a lens of 0.05 mm, at half the focus distance: 5e-6, 3e-4 pixels.
    spec = lens_spec(focus_distance=10, aperture=0.05)
    origins, directions = camera_rays(spec.pack(40, 30), np.full(1000, 8.0), 8.0)
    _, straight = camera_rays(lens_spec().pack(40, 30), 8.0, 8.0)
    at = origins + directions * (-5.0 / directions[:, 2:])
    expected = straight[0] * (-5.0 / straight[0, 2])
    pixel = 2.0 * math.tan(math.radians(10.0)) / 30.0 * 5.0
    assert np.linalg.norm(at - expected, axis=1).max() < 0.01 * pixel


@pytest.mark.parametrize(("distance", "pixels"), [(5.0, 20.044), (20.0, 10.022)])
def test_circle_of_confusion_of_a_point(distance: float, pixels: float) -> None:
    # Camera truths: C = A |z - F| / z on the plane of focus; F = 10, delta = 0.6, vfov 20, 675 rows.  A point of light
    # blurs to an even disc, whose variance along each axis is (C / 4)^2: measured on the image, 51 of the 675 rows.
    size = 0.002 * distance / 5.0
    vfov = math.degrees(2.0 * math.atan(math.tan(math.radians(10.0)) * 51.0 / 675.0))
    picture = image(
        f"""
camera: {{type: thin_lens, look_from: [0, 0, 0], look_at: [0, 0, -10], vfov: {vfov}, defocus_angle: 0.6}}
objects:
  - {{type: sphere, center: [0, 0, {-distance}], radius: {size}, material: {{type: emitter, radiance: 1}}}}
""",
        width=51,
        height=51,
        max_depth=1,
        spp=4096,
    )
    weight = picture.radiance[..., 0]
    rows, columns = np.mgrid[0:51, 0:51] - 25.0
    total = weight.sum()
    # A pixel's own width adds 1/12, and the sphere's own image its radius^2 / 4.
    pixel = 2.0 * math.tan(math.radians(10.0)) / 675.0 * distance
    own = 1.0 / 12.0 + (size / pixel) ** 2 / 4.0
    for axis in (rows, columns):
        middle = (weight * axis).sum() / total
        measured = 4.0 * math.sqrt((weight * (axis - middle) ** 2).sum() / total - own)
        assert abs(middle) < 0.1
        assert measured == pytest.approx(pixels, rel=0.02)
    # And nothing beyond it, but for the sphere's own radius and half the diagonal of a pixel.
    beyond = np.hypot(rows, columns) > 0.5 * pixels + size / pixel + math.sqrt(0.5)
    assert weight[beyond].sum() == 0.0


def test_a_point_in_focus_stays_in_its_pixel() -> None:
    picture = image(
        """
camera: {type: thin_lens, look_from: [0, 0, 0], look_at: [0, 0, -10], vfov: 4, focus_distance: 10, defocus_angle: 2}
objects:
  - {type: sphere, center: [0, 0, -10], radius: 0.005, material: {type: emitter, radiance: 1}}
""",
        width=15,
        height=15,
        max_depth=1,
        spp=512,
    )
    lit = picture.radiance[..., 0] > 0.0
    assert lit[7, 7]
    assert lit.sum() == 1


def test_a_lens_does_not_change_what_is_uniform() -> None:
    # A uniform environment stays 1 through any lens: rays carry equal weight.
    picture = image(
        """
camera: {type: thin_lens, look_from: [0, 0, 4], look_at: [0, 0, 0], vfov: 40, aperture: 500}
environment: {type: constant, radiance: 1}
objects:
  - {type: sphere, center: [0, 0, 0], radius: 1, material: {type: metal, albedo: 1}}
""",
        spp=8,
    )
    np.testing.assert_allclose(picture.radiance, 1.0, rtol=1e-14)


def test_only_one_aperture_may_be_given() -> None:
    with pytest.raises(ValidationError, match="give one of them"):
        lens_spec(defocus_angle=1, aperture=10)


def test_cameras_describe_themselves() -> None:
    # 90 degrees high and 4:3: atan(4/3) * 2 = 106.26 across, atan(5/3) * 2 = 118.07 over the diagonal.
    numbers = camera(vfov=90.0).describe(40, 30)
    assert numbers["hfov_deg"] == pytest.approx(106.2602, abs=1e-4)
    assert numbers["dfov_deg"] == pytest.approx(118.0725, abs=1e-4)
    assert numbers["pixel_at_1m_mm"] == pytest.approx(1e3 * 2.0 / 30.0)
    numbers = lens_spec(defocus_angle=0.6).describe(1200, 675)
    assert numbers["aperture_diameter_mm"] == pytest.approx(104.720, abs=1e-3)
    # Camera truths: twice the blur at 20 m, which is twice the focus distance, is half that at infinity.
    assert numbers["blur_at_infinity_px"] == pytest.approx(20.044, abs=1e-3)
    assert isinstance(camera(), Spec)
