"""Apertures: their form, their area, that they are filled evenly, and what they let through as stops of real lenses."""

import math

import numpy as np
import pytest
from pydantic import ValidationError

from raytracer.core.sampling import warp
from raytracer.film.formats.base.image_format import StoredImage
from raytracer.optics.lens_system.surfaces import aperture_extent
from raytracer.plugins.apertures.base.interface import ApertureSpec
from raytracer.schema.registry import APERTURES
from tests.plugins.apertures.kernels import covered, sampled
from tests.statistics import chi2_counts, chi2_test
from tests.vectorised import rows, vectorised

EXAMPLES = {
    "image": [{"file": "x"}, {"file": "x", "anamorphic": 0.7}],
    "polygon": [
        {"blades": 3},
        {"blades": 4, "rotation": 30},
        {"blades": 5, "curvature": 0.5},
        {"blades": 7, "rotation": -1000.5, "curvature": 0.95},
        {"blades": 6, "rotation": 20, "curvature": 0.3, "anamorphic": 1.8},
    ],
    "round": [{"anamorphic": 2}, {"anamorphic": 0.25}],
}

CASES = [
    pytest.param({"type": kind, **keys}, id=f"{kind} {number}")
    for kind, examples in EXAMPLES.items()
    for number, keys in enumerate(examples)
]

POLYGONS = [pytest.param(keys, id=f"polygon {number}") for number, keys in enumerate(EXAMPLES["polygon"])]

COUNT = 1 << 18

# An L: every pixel a whole number of tenths, some black, none of its mirror images or turns the same.
LETTER = np.array([[10, 0, 0], [7, 0, 0], [10, 0, 0], [10, 3, 5], [2, 0, 0]]) / 10.0


def picture(values, *, integer=False):
    """An image as it is read from a file, (height, width) or with channels."""
    array = np.asarray(values, np.uint8 if integer else np.float32)
    return StoredImage(array[..., None] if array.ndim == 2 else array, integer)


def spec_of(**keys):
    spec = APERTURES.specs()[keys["type"]].model_validate(keys)
    assert isinstance(spec, ApertureSpec)
    return spec


def packed(values=LETTER, *, integer=False, **keys):
    return spec_of(**keys).pack({"file": picture(values, integer=integer)})


def uniform(count=COUNT, seed=1):
    return np.random.default_rng(seed).random((count, 2))


def outline(aperture, steps=20_000):
    """Points (4 steps, 2) along the edge of an aperture, to which the edge of the square of numbers is taken."""
    ramp, zero, one = np.arange(steps) / steps, np.zeros(steps), np.full(steps, np.nextafter(1.0, 0.0))
    sides = [(one, ramp), (1.0 - ramp, one), (zero, 1.0 - ramp), (ramp, zero)]
    return sampled(aperture, np.concatenate([np.stack(side, axis=1) for side in sides]))


def area(points):
    """Return the area of a polygon with these corners, anticlockwise, by the shoelace formula."""
    (x, y), (next_x, next_y) = points.T, np.roll(points, -1, axis=0).T
    return 0.5 * float((x * next_y - y * next_x).sum())


# ---- Every kind


def test_every_kind_has_an_example():
    assert set(EXAMPLES) == set(APERTURES.specs())


@pytest.mark.parametrize("keys", CASES)
def test_the_ends_of_the_numbers_are_points_of_the_aperture(keys):
    # Three triangles' corners, the farthest points of all, are 1.56 away; an L of five pixels and one of three less.
    ends = [0.0, 2.0**-33, 0.5, 1.0 - 2.0**-33, np.nextafter(1.0, 0.0)]
    points = sampled(packed(**keys), [(u1, u2) for u1 in ends for u2 in ends])
    assert np.isfinite(points).all()
    stretch = math.sqrt(max(keys.get("anamorphic", 1.0), 1.0 / keys.get("anamorphic", 1.0)))
    assert np.hypot(*points.T).max() < 2.5 * stretch


@pytest.mark.parametrize("keys", [{"type": "round"}, {"type": "polygon", "blades": 5, "curvature": 1, "rotation": 3}])
def test_what_is_round_is_the_plain_disc(keys):
    assert packed(**keys) is None
    numbers = uniform(100)
    np.testing.assert_array_equal(sampled(None, numbers), vectorised(warp.sample_disc)(*map(rows, numbers.T)))


@pytest.mark.parametrize("keys", CASES)
def test_anamorphic_is_the_ratio_of_height_to_width(keys):
    # To the shape without it each axis is in proportion, one by as much more as the other is by less.
    ratio = keys.get("anamorphic", 1.0)
    numbers = uniform(1000)
    plain, stretched = (sampled(packed(**{**keys, "anamorphic": value}), numbers) for value in (1.0, ratio))
    np.testing.assert_allclose(stretched, plain * [1.0 / math.sqrt(ratio), math.sqrt(ratio)], rtol=1e-15)


@pytest.mark.parametrize(
    "keys",
    [
        *({"type": "polygon", key: value} for key, value in (("blades", 2), ("blades", 5.5), ("curvature", 1.01))),
        *({"type": "round", "anamorphic": value} for value in (0, math.inf)),
        {"type": "polygon", "curvature": -0.1},
        {"type": "image", "file": ""},
    ],
)
def test_impossible_apertures_are_refused(keys):
    with pytest.raises(ValidationError):
        spec_of(**keys)


# ---- Round


def test_stretched_round_is_an_ellipse_of_the_same_area():
    # Semi-axes 1/2 and 2: x^2 / a^2 + y^2 / b^2 is even over 0..1.
    points = sampled(packed(type="round", anamorphic=4), uniform())
    squares = (2.0 * points[:, 0]) ** 2 + (0.5 * points[:, 1]) ** 2
    counts, _ = np.histogram(squares, bins=64, range=(0.0, 1.0))
    assert counts.sum() == COUNT
    chi2_counts(counts, np.full(64, COUNT / 64))
    assert area(outline(packed(type="round", anamorphic=4))) == pytest.approx(math.pi, rel=1e-8)


# ---- Polygon


def corner_radius(blades, curvature):
    """Return the radius of the polygon of area pi: n triangles, and n segments of circles of the radius R / curvature.

    References: https://mathworld.wolfram.com/CircularSegment.html
    """
    unit = 0.5 * math.sin(2.0 * math.pi / blades)
    if curvature > 0.0:
        angle = 2.0 * math.asin(curvature * math.sin(math.pi / blades))
        unit += 0.5 * (angle - math.sin(angle)) / curvature**2
    return math.sqrt(math.pi / (blades * unit))


def directions(keys):
    """Angles (n,) of the corners from the x axis, in -pi..pi."""
    blades = keys["blades"]
    angles = math.pi / 2.0 + math.radians(keys.get("rotation", 0.0)) + 2.0 * math.pi * np.arange(blades) / blades
    return np.sort(np.mod(angles + math.pi, 2.0 * math.pi) - math.pi)


def is_inside(keys, points):
    """Tell if points (n, 2) are in the polygon: for every edge within its circle, or on its side of the line."""
    blades, curvature = keys["blades"], keys.get("curvature", 0.0)
    radius = corner_radius(blades, curvature)
    height = math.sqrt(keys.get("anamorphic", 1.0))
    x, y = points[:, 0] * height, points[:, 1] / height
    inside = np.ones(len(points), bool)
    for angle in directions(keys) + math.pi / blades:
        along, across = x * math.cos(angle) + y * math.sin(angle), y * math.cos(angle) - x * math.sin(angle)
        near = radius * math.cos(math.pi / blades)
        if curvature == 0.0:
            inside &= along <= near
        else:
            half = radius * math.sin(math.pi / blades)
            back = math.sqrt((radius / curvature) ** 2 - half**2) - near
            inside &= (along + back) ** 2 + across**2 <= (radius / curvature) ** 2
    return inside


@pytest.mark.parametrize("keys", POLYGONS)
def test_polygon_is_filled_evenly_and_no_more(keys):
    points = sampled(packed(type="polygon", **keys), uniform())
    assert is_inside(keys, points * (1.0 - 1e-12)).all()
    bounds = [(-2.0, 2.0), (-2.0, 2.0)]
    chi2_test(points, lambda at: is_inside(keys, at) / math.pi, bounds, [24, 24], order=48, tests=5)


@pytest.mark.parametrize("keys", POLYGONS)
def test_polygon_has_the_area_of_the_disc(keys):
    assert area(outline(packed(type="polygon", **keys))) == pytest.approx(math.pi, rel=1e-7)


@pytest.mark.parametrize("keys", POLYGONS[:4])
def test_corners_are_where_the_rotation_puts_them(keys):
    points = outline(packed(type="polygon", **keys), 50_000)
    radius = np.hypot(*points.T)
    result = np.arctan2(points[:, 1], points[:, 0])
    assert radius.max() == pytest.approx(corner_radius(keys["blades"], keys.get("curvature", 0.0)), rel=1e-8)
    # One local maximum of the radius a corner, there.
    around = np.argsort(result)
    peaks = around[(radius[around] > np.roll(radius[around], 1)) & (radius[around] >= np.roll(radius[around], -1))]
    np.testing.assert_allclose(result[peaks], directions(keys), rtol=0.0, atol=1e-4)


@pytest.mark.parametrize("curvature", [0.0, 0.2, 0.8])
def test_edges_are_arcs_of_the_given_curvature(curvature):
    # Through three points of one edge goes one circle; 1 / its radius = 4 area / product of the sides.
    points = outline(packed(type="polygon", blades=5, curvature=curvature), 5000)
    angle = np.arctan2(points[:, 1], points[:, 0])
    edge = points[(angle > math.radians(20.0)) & (angle < math.radians(88.0))]
    edge = edge[np.argsort(edge[:, 0])]
    a, b, c = edge[0], edge[len(edge) // 2], edge[-1]
    sides = math.dist(a, b) * math.dist(b, c) * math.dist(c, a)
    assert 4.0 * abs(area(np.array([a, b, c]))) / sides == pytest.approx(
        curvature / corner_radius(5, curvature), abs=1e-9
    )


def test_edges_straighten_and_round_off_without_a_jump():
    # From a curvature that is the next thing to none to the straight polygon, and likewise to the disc, here turned by
    # what takes the first edge to the right.
    numbers = uniform(20_000)
    straight = sampled(packed(type="polygon", blades=5), numbers)
    for curvature in (1e-30, 1e-17, 1e-15, 1e-12, 1e-9):
        near = sampled(packed(type="polygon", blades=5, curvature=curvature), numbers)
        np.testing.assert_allclose(near, straight, rtol=0.0, atol=1e-15 + 2.0 * curvature)
    nearly = sampled(packed(type="polygon", blades=5, curvature=1.0 - 1e-12, rotation=-126.0), numbers)
    np.testing.assert_allclose(nearly, sampled(None, numbers), rtol=0.0, atol=1e-5)


def test_neighbouring_numbers_are_neighbouring_points():
    # What is well spread over the square stays so over the polygon: no seam but where the disc has its own, none.
    aperture = packed(type="polygon", blades=7, curvature=0.4, rotation=10)
    numbers = uniform(20_000) * (1.0 - 2.0**-20)
    for step in ([2.0**-20, 0.0], [0.0, 2.0**-20]):
        distance = np.hypot(*(sampled(aperture, numbers + step) - sampled(aperture, numbers)).T)
        assert distance.max() < 6.0 * 2.0**-20


# ---- Image


def pixels_of(points, side, shape):
    """Counts (height, width) of the points in each pixel of a picture in the middle."""
    height, width = shape
    edges = side * (np.arange(height + 1) - 0.5 * height), side * (np.arange(width + 1) - 0.5 * width)
    counts, _, _ = np.histogram2d(points[:, 1], points[:, 0], bins=edges)
    return np.asarray(counts[::-1], np.int64)


def test_mask_is_reproduced_upright():
    points = sampled(packed(type="image", file="x"), uniform())
    # Transmission 1 on a pixel counts as its area: their sum is pi.
    side = math.sqrt(math.pi / LETTER.sum())
    counts = pixels_of(points, side, (5, 3))
    assert counts.sum() == COUNT
    chi2_counts(counts, COUNT * LETTER / LETTER.sum(), tests=2)
    # Within a pixel it is even.
    first = points[(points[:, 0] < -0.5 * side) & (points[:, 1] > 1.5 * side)]
    inside = (first - [-1.5 * side, 1.5 * side]) / side
    counts, _, _ = np.histogram2d(*inside.T, bins=8, range=[(0.0, 1.0), (0.0, 1.0)])
    chi2_counts(counts, np.full((8, 8), len(first) / 64), tests=2)


def test_only_proportions_of_the_transmission_count():
    numbers = uniform(2000)
    expected = sampled(packed(type="image", file="x"), numbers)
    for factor in (0.125, 1024.0):
        np.testing.assert_allclose(sampled(packed(LETTER * factor, type="image", file="x"), numbers), expected)


@pytest.mark.parametrize(
    ("values", "keys", "expected"),
    [
        # Bytes count as they are, unless they are said to be sRGB: 188 is half of 255 in linear light.
        ([[51, 204]], {}, [0.2, 0.8]),
        ([[188, 255]], {"encoding": "srgb"}, [1.0 / 3.0, 2.0 / 3.0]),
        # Colours by their luminance (Rec. 709), and transparency as black.
        ([[[255, 0, 0], [0, 255, 0]]], {}, [0.2126 / 0.9278, 0.7152 / 0.9278]),
        ([[[255, 51], [255, 204]]], {}, [0.2, 0.8]),
        ([[[255, 255, 255, 0], [9, 9, 9, 255]]], {}, [0.0, 1.0]),
    ],
)
def test_what_pixels_let_through(values, keys, expected):
    points = sampled(packed(values, integer=True, type="image", file="x", **keys), uniform())
    share = (points[:, 0] < 0.0).mean()
    assert share == pytest.approx(expected[0], abs=4.0 * 0.5 / math.sqrt(COUNT) + 2e-3 * ("encoding" in keys))


@pytest.mark.parametrize(
    ("values", "words"), [([[0.0, 0.0]], "black all over"), ([[1.0, -0.5]], "negative"), ([[1.0, np.nan]], "finite")]
)
def test_pictures_that_are_no_masks_are_refused(values, words):
    with pytest.raises(ValueError, match=f"^x .*{words}"):
        packed(values, type="image", file="x")


# ---- As the stop of a real lens: what it lets through is where it draws its points

SHAPES = [*CASES, pytest.param({"type": "round"}, id="disc")]


def grid(half, count=900):
    """Points (count^2, 2), one in each of the squares that a square of this half width is cut into."""
    corners = np.indices((count, count)).reshape(2, -1).T
    return half * (2.0 * (corners + uniform(count * count, seed=4)) / count - 1.0)


@pytest.mark.parametrize("keys", SHAPES)
def test_as_much_light_gets_through_as_through_the_disc(keys):
    shape = packed(**keys)
    half = 1.01 * aperture_extent(shape)
    passed = covered(shape, grid(half))
    assert passed.min() == 0.0
    assert passed.max() <= 1.0
    assert 4.0 * half * half * passed.mean() == pytest.approx(math.pi, rel=5e-4)


@pytest.mark.parametrize("keys", SHAPES)
def test_what_is_drawn_is_let_through_and_within_reach(keys):
    shape = packed(**keys)
    points = sampled(shape, uniform(20_000))
    assert covered(shape, points * (1.0 - 1e-12)).min() > 0.0
    assert np.hypot(*points.T).max() <= aperture_extent(shape) * (1.0 + 1e-15)


@pytest.mark.parametrize("keys", SHAPES)
def test_out_of_reach_all_is_dark(keys):
    shape = packed(**keys)
    angle = np.linspace(0.0, 2.0 * math.pi, 1000)
    for factor in (1.0 + 1e-12, 3.0, 1e9, math.inf):
        with np.errstate(invalid="ignore"):
            circle = factor * aperture_extent(shape) * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        np.testing.assert_array_equal(covered(shape, circle), 0.0)
    np.testing.assert_array_equal(covered(shape, [[math.nan, 0.0], [0.0, math.nan]]), 0.0)


@pytest.mark.parametrize("keys", POLYGONS)
def test_polygon_lets_through_what_is_on_the_near_side_of_all_edges(keys):
    points = 4.0 * uniform(COUNT, seed=5) - 2.0
    np.testing.assert_array_equal(covered(packed(type="polygon", **keys), points) == 1.0, is_inside(keys, points))


@pytest.mark.parametrize("curvature", [1e-30, 1e-15, 1e-9])
def test_hardly_curved_edges_are_straight(curvature):
    points = 4.0 * uniform(seed=6) - 2.0
    straight, slight = (covered(packed(type="polygon", blades=5, curvature=bend), points) for bend in (0.0, curvature))
    np.testing.assert_array_equal(slight, straight)


@pytest.mark.parametrize("stretch", [1.0, 2.0])
def test_mask_lets_through_what_its_pixels_do(stretch):
    # The letter upright: five rows of three pixels, each as wide as makes their sum pi, its brightest all clear.
    side = math.sqrt(math.pi / LETTER.sum())
    rows, columns = np.indices(LETTER.shape)
    x, y = side * (columns - 1.0) / math.sqrt(stretch), side * (2.0 - rows) * math.sqrt(stretch)
    for shift in (-0.49, 0.0, 0.49):
        at = np.stack([x + shift * side / math.sqrt(stretch), y + shift * side * math.sqrt(stretch)], axis=-1)
        result = covered(packed(type="image", file="x", anamorphic=stretch), at.reshape(-1, 2))
        # The picture is float32.
        np.testing.assert_allclose(result.reshape(LETTER.shape), LETTER, rtol=0.0, atol=1e-7)
