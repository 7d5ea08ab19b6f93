"""The standard error of a depth: against true errors in bins, and where nothing can be known.

`test_predicted_and_true_errors` and `test_better_than_the_structure_tensor` print their tables (pytest -s).
"""

import functools
import math

import numpy as np
import pytest

from raytracer.lightfield.depth import depth_map as module
from raytracer.lightfield.depth.depth_map import Depth, depth_map
from raytracer.lightfield.depth.measures import BAD, measure_depth, measure_inverse
from tests.lightfield.analytic import Surface, light_field, views, waves
from tests.lightfield.benchmark import SCENES, SPACING, scene, structure_tensor


def reliability(error, exact, bins):
    """Sort pixels by their predicted error into bins of as many: (predicted RMS, true RMS) of each."""
    order = np.argsort(error, axis=None)
    parts = np.array_split(order, bins)
    return [tuple(float(np.sqrt((values.ravel()[part] ** 2).mean())) for values in (error, exact)) for part in parts]


def test_the_error_follows_noise_and_texture():
    """A wall whose contrast falls from left to right: the error grows as it says, and doubles with the noise."""

    def fading(x, y):
        x, y = np.broadcast_arrays(x, y)
        return 0.5 + np.clip(0.6 - x, 0.2, 1.0)[..., None] * (waves(1, 0.06)(x, y) - 0.5)

    geometry = views(7, 7, spacing=0.03, width=80, height=60)
    predicted = []
    for noise in (0.05, 0.1):
        field = light_field(geometry, [Surface(2.2, fading, tilt=(0.3, 0.2))], noise=noise, supersampling=1)
        found = depth_map(field, near=1.5, far=3.5, threads=2)
        true = found.inverse - 1.0 / field.layers["depth"][3, 3]
        # Others may be better than they say: of them there is doubt, not knowledge.
        sure = found.confidence >= 0.5
        assert sure.mean() > 0.6
        for said, was in reliability(found.error[sure], true[sure], 6):
            assert 0.5 < was / said < 2.0
        predicted.append(found)
    little, much = predicted
    both = (little.confidence >= 0.5) & (much.confidence >= 0.5)
    assert np.median((much.error / little.error)[both]) == pytest.approx(2.0, rel=0.25)


def test_errors_in_metres_and_pixels():
    found = Depth(np.array([[0.5, 0.0]]), np.ones((1, 2)), 0, 0, error=np.array([[0.01, 0.01]]))
    # d(1/w) = dw / w^2
    assert found.distance_error.tolist() == [[0.04, math.inf]]
    geometry = views(3, 3, spacing=0.02)
    assert found.disparity_error(geometry) == pytest.approx(0.01 * 0.02 / geometry.plane.pixel)
    assert Depth(np.ones((1, 1)), np.ones((1, 1)), 0, 0).distance_error is None


def grey(values):
    """Turn a function of right and up into a texture."""
    return lambda x, y: np.repeat(values(*np.broadcast_arrays(x, y))[..., None], 3, axis=-1)


def checkerboard(side):
    return grey(lambda x, y: np.where((np.floor(x / side) + np.floor(y / side)) % 2.0 > 0.0, 0.8, 0.2))


HARD = {
    "no texture": grey(lambda x, y: np.full(x.shape, 0.5)),
    "a gradient": grey(lambda x, y: 0.5 + 0.2 * x + 0.1 * y),
    "wide waves": grey(lambda x, y: 0.5 + 0.3 * np.sin(5.0 * x) * np.cos(4.0 * y)),
    "checkerboard": checkerboard(0.03),
    "stripes": grey(lambda x, y: 0.5 + 0.3 * np.sin(2.0 * math.pi * x / 0.05)),
}


@pytest.mark.parametrize("spacing", [0.02, pytest.param(0.06, marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    "name",
    [
        "no texture",
        "checkerboard",
        *(pytest.param(name, marks=pytest.mark.slow) for name in ("a gradient", "wide waves", "stripes")),
    ],
)
def test_smooth_and_repeating_surfaces_are_refused_or_right(name, spacing):
    """Half of the picture is hard, half has texture: the RMS error is below 2 % of the range where it is sure.

    Neighbouring views differ by 0.7 or 2 pixels over the range of the scene, and the textures repeat after 4.1 and 3.4
    pixels.
    """
    geometry = views(9, 9, spacing=spacing, width=96, height=72, vfov=20.0, focus_distance=2.4)
    surfaces = [Surface(3.0, HARD[name], tilt=(0.1, 0.1)), Surface(2.0, waves(2, 0.04), bounds=(0.0, -5.0, 5.0, 5.0))]
    field = light_field(geometry, surfaces, noise=0.01, supersampling=2)
    exact = field.layers["depth"][4, 4]
    found = depth_map(field, threads=2)
    sure = found.confidence >= 0.5
    assert np.sqrt(((found.distance - exact)[sure] ** 2).mean()) < 0.02 * np.ptp(exact)
    assert sure[exact < 2.5].mean() > 0.8
    if name in {"no texture", "a gradient"}:
        assert sure[exact > 2.5].mean() < 0.01


def test_confidence_is_a_half_at_a_hundredth_of_the_range():
    error = np.array([[0.0, 0.01, 0.03]])
    np.testing.assert_allclose(module.confidence_of(error, 1.0), [[1.0, 0.5, 0.1]])


def test_measures_of_a_known_difference():
    """A plane, off by 0.02 and 0.05 px in two halves, and by an angle."""
    geometry = views(3, 3, spacing=0.02, width=60, height=60)
    scale = 0.02 / geometry.plane.pixel
    truth = np.full((60, 60), 2.0)
    inverse = np.full((60, 60), 0.5 + 0.02 / scale)
    inverse[:, 30:] = 0.5 - 0.05 / scale
    found = measure_inverse(geometry, (1, 1), inverse, truth)
    assert found.mse_x100 == pytest.approx(100.0 * 0.5 * (0.02**2 + 0.05**2))
    assert found.bad == pytest.approx((0.0, 0.5, 1.0))
    assert found.planes_degrees == pytest.approx(0.0, abs=1e-6)
    assert math.isnan(found.curved_degrees)

    # z = 2 + tan(10 degrees) X leans by 10 degrees, wherever its view stands.
    leaning = light_field(
        geometry, [Surface(2.0, waves(0, 0.1), tilt=(math.tan(math.radians(10.0)), 0.0))], supersampling=1
    )
    for view in ((1, 1), (0, 2)):
        found = measure_inverse(geometry, view, np.full((60, 60), 0.5), leaning.layers["depth"][view])
        assert found.planes_degrees == pytest.approx(10.0, abs=1e-3)
    with pytest.raises(ValueError, match="no pixel has both"):
        measure_inverse(geometry, (1, 1), inverse, np.full((60, 60), np.inf))
    with pytest.raises(ValueError, match="of the depth's size"):
        measure_inverse(geometry, (1, 1), inverse, truth[:, :9])


def test_nothing_of_a_ball_is_a_plane():
    from tests.lightfield.benchmark import Sphere

    geometry = views(1, 1, width=64, height=64)
    ball = light_field(geometry, [Sphere((0.0, 0.0, 3.0), 1.5, waves(0, 0.1))], supersampling=1).layers["depth"][0, 0]
    two = views(3, 3, spacing=0.02, width=64, height=64)
    found = measure_inverse(two, (1, 1), 1.0 / ball, ball)
    assert math.isnan(found.planes_degrees)
    assert found.curved_degrees == pytest.approx(0.0, abs=1e-6)


@functools.cache
def estimated(name):
    field = scene(name)
    return field, depth_map(field, threads=2)


@pytest.mark.slow
def test_predicted_and_true_errors():
    """All pixels of the five scenes, occlusions too, in twelve bins of the predicted error, from 0.0005 px on."""
    said, was = [], []
    for name in SCENES:
        field, found = estimated(name)
        said.append(found.disparity_error(field.views).ravel())
        was.append(((found.inverse - 1.0 / field.layers["depth"][4, 4]) * SPACING / field.views.plane.pixel).ravel())
    for predicted, true in reliability(np.concatenate(said), np.concatenate(was), 12):
        print(f"| {predicted:.5f} | {true:.5f} | {true / predicted:.2f} |")
        assert 0.5 < true / predicted < 2.0


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_better_than_the_structure_tensor(name):
    """In every measure, but for one: at the edges of the slats its mean of both sides has a smaller squared error."""
    field, found = estimated(name)
    geometry, exact = field.views, field.layers["depth"][4, 4]
    ours = measure_depth(geometry, found, exact)
    slopes = geometry.inverse_focus + structure_tensor(field) * geometry.plane.pixel / SPACING
    theirs = measure_inverse(geometry, (4, 4), slopes, exact)
    for who, found_measures in (("rt", ours), ("structure tensor", theirs)):
        bad = " | ".join(f"{100.0 * share:.2f}" for share in found_measures.bad)
        angles = f"{found_measures.planes_degrees:.2f} | {found_measures.curved_degrees:.2f}"
        print(f"| {name} | {who} | {found_measures.mse_x100:.3f} | {bad} | {angles} |")
    assert len(BAD) == 3
    assert all(one < other for one, other in zip(ours.bad, theirs.bad, strict=True))
    assert ours.planes_degrees < theirs.planes_degrees
    assert math.isnan(ours.curved_degrees) or ours.curved_degrees < theirs.curved_degrees
    assert ours.mse_x100 < (1.2 if name == "backgammon" else 1.0) * theirs.mse_x100
    sure = found.confidence >= 0.5
    assert np.sqrt(((found.distance - exact)[sure] ** 2).mean()) < 0.02 * np.ptp(exact)
