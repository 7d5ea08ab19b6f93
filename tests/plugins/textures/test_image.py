"""Image textures: where texels lie, what is between and beyond them, and what their numbers mean."""

import numpy as np
import pytest

from raytracer.util import srgb
from tests.plugins.textures.kernels import looked_up, picture, slopes, spec_of, table_of

RAMP = np.array([[0.1, 0.4, 0.3], [0.8, 0.2, 0.9]])
"""Two rows of three texels."""


def result(texels, uv, *, integer=False, **parameters):
    """The first channel at parameters (n, 2)."""
    spec = spec_of("image", file="x", **parameters)
    return looked_up(table_of(spec, files=picture(texels, integer=integer)), uv=uv)[:, 0]


def test_row_0_is_at_the_top_and_texels_lie_in_the_middle_of_their_squares():
    uv = [((column + 0.5) / 3, 1 - (row + 0.5) / 2) for row in range(2) for column in range(3)]
    for filtering in ("bilinear", "nearest"):
        np.testing.assert_allclose(result(RAMP, uv, filter=filtering), RAMP.ravel(), atol=1e-7)


def test_halfway_between_texels_is_their_mean():
    mean = [(RAMP[0, 0] + RAMP[0, 1]) / 2, (RAMP[0, 1] + RAMP[1, 1]) / 2, RAMP[:, :2].mean()]
    np.testing.assert_allclose(result(RAMP, [(1 / 3, 0.75), (0.5, 0.5), (1 / 3, 0.5)]), mean, atol=1e-7)


def test_nearest_has_steps_in_the_middle_between_texels():
    just = 1e-9
    uv = [(1 / 3 - just, 0.75), (1 / 3 + just, 0.75), (0.5, 0.5 + just), (0.5, 0.5 - just)]
    np.testing.assert_allclose(result(RAMP, uv, filter="nearest"), [0.1, 0.4, 0.4, 0.2], atol=1e-7)


@pytest.mark.parametrize(
    ("wrap", "columns"),
    [
        ("repeat", [0, 1, 2, 0, 1, 2, 0, 1, 2]),
        ("clamp", [0, 0, 0, 0, 1, 2, 2, 2, 2]),
        ("mirror", [2, 1, 0, 0, 1, 2, 2, 1, 0]),
    ],
)
@pytest.mark.parametrize("filtering", ["bilinear", "nearest"])
def test_what_lies_beyond_the_picture(wrap, columns, filtering):
    uv = [((column + 0.5) / 3, 0.75) for column in range(-3, 6)]
    np.testing.assert_allclose(result(RAMP, uv, wrap=wrap, filter=filtering), RAMP[0][columns], atol=1e-7)


def test_wraps_may_differ_along_u_and_v():
    assert result(RAMP, [(1 + 0.5 / 3, 1.25)], wrap=["repeat", "clamp"])[0] == pytest.approx(RAMP[0, 0])
    assert result(RAMP, [(1 + 0.5 / 3, 1.25)], wrap=["clamp", "repeat"])[0] == pytest.approx(RAMP[1, 2])


def test_between_the_last_and_the_first_texel_repeated_pictures_have_no_seam():
    assert result(RAMP, [(0.0, 0.75)])[0] == pytest.approx((0.3 + 0.1) / 2)
    assert result(RAMP, [(0.0, 0.75)], wrap="clamp")[0] == pytest.approx(0.1)


def test_bytes_are_srgb_where_they_are_colours_and_linear_where_they_are_data():
    grey = np.array([[0, 10, 128, 255]])
    uv = [((column + 0.5) / 4, 0.5) for column in range(4)]
    np.testing.assert_allclose(result(grey, uv, integer=True), srgb.decode(grey[0] / 255), atol=1e-12)
    np.testing.assert_allclose(result(grey, uv, integer=True, encoding="linear"), grey[0] / 255, atol=1e-12)
    data = spec_of("image", file="x").as_data()
    np.testing.assert_allclose(looked_up(table_of(data, files=picture(grey)), uv=uv)[:, 0], grey[0] / 255, atol=1e-12)
    # An encoding that was asked for stays.
    assert spec_of("image", file="x", encoding="srgb").as_data().encoding == "srgb"


def test_floats_are_linear_unless_it_is_said_that_they_are_not():
    assert result([[0.5]], [(0.5, 0.5)])[0] == 0.5
    assert result([[0.5]], [(0.5, 0.5)], encoding="srgb")[0] == pytest.approx(srgb.decode(0.5), rel=1e-6)


def test_srgb_is_decoded_before_texels_are_blended():
    assert result([[0, 255]], [(0.5, 0.5)], integer=True)[0] == pytest.approx(0.5, abs=1e-12)


def test_channels():
    files = picture([[(51, 102, 204, 128)]])
    linear = srgb.decode(np.array((51, 102, 204)) / 255)
    expected = {
        "rgb": linear,
        "r": linear[[0, 0, 0]],
        "g": linear[[1, 1, 1]],
        "b": linear[[2, 2, 2]],
        # Transparency is never sRGB.
        "a": np.full(3, 128 / 255),
        "luminance": np.full(3, linear @ (0.2126, 0.7152, 0.0722)),
    }
    for channel, color in expected.items():
        spec = spec_of("image", file="x", channel=channel)
        np.testing.assert_allclose(looked_up(table_of(spec, files=files), uv=[(0.5, 0.5)])[0], color, atol=1e-6)


def test_a_file_without_transparency_has_no_channel_a():
    with pytest.raises(ValueError, match="no channel a"):
        spec_of("image", file="x", channel="a").check(picture([[(1, 2, 3)]]))


def test_the_factor_multiplies_what_was_decoded():
    spec = spec_of("image", file="x", factor=[0.5, 1.0, 2.0])
    files = picture([[(255, 255, 255)]])
    np.testing.assert_allclose(looked_up(table_of(spec, files=files), uv=[(0.2, 0.2)])[0], [0.5, 1.0, 2.0])
    assert spec.range(files) == (0.5, 2.0)
    assert spec.mean(files) == pytest.approx((0.5, 1.0, 2.0))


def test_placement_scales_then_turns_anticlockwise_then_shifts():
    # By hand: (0.1, 0.2) scaled by (2, 3) is (0.2, 0.6), turned by 90 degrees (-0.6, 0.2), shifted (0.1, 0.45).
    texels = np.random.default_rng(2).random((8, 8))
    moved = result(texels, [(0.1, 0.2)], scale=[2, 3], rotation=90, offset=[0.7, 0.25])
    np.testing.assert_allclose(moved, result(texels, [(0.1, 0.45)]), atol=1e-6)
    # And by 30 degrees, against the matrix.
    turn = np.radians(30)
    matrix = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    uv = np.random.default_rng(3).random((50, 2))
    expected = result(texels, (2 * uv) @ matrix.T + (0.1, -0.2))
    np.testing.assert_allclose(result(texels, uv, scale=2, rotation=30, offset=[0.1, -0.2]), expected, atol=1e-6)


def test_pictures_of_several_sizes_and_channels_share_a_table():
    specs = [spec_of("image", file=str(number)) for number in range(3)]
    files = [picture(np.full(shape, value)) for shape, value in (((2, 3), 10), ((5, 1, 3), 20), ((1, 1, 4), 30))]
    assert len({spec.group(assets) for spec, assets in zip(specs, files, strict=True)}) == 1
    # Bytes stay bytes in memory.
    assert table_of(specs[0], files=files[1]).texels.nbytes == 5 * 1 * 3
    table = type(specs[0]).pack(specs, files)
    assert len(table.texels) == 6 + 15 + 3
    for index, value in enumerate((10, 20, 30)):
        np.testing.assert_allclose(
            looked_up(table, uv=[(0.3, 0.9)], index=index), np.full((1, 3), srgb.decode(value / 255)), atol=1e-12
        )


@pytest.mark.parametrize("turn", [0, 90, 37])
def test_slopes_of_a_ramp_are_its_steepness_wherever_it_is_turned(turn):
    # Heights of 0.1 + 0.02 column + 0.01 row from below; between texels bilinear values are exact for a plane.
    columns, rows = np.meshgrid(np.arange(16), np.arange(16)[::-1])
    texels = 0.1 + 0.02 * columns + 0.01 * rows
    spec = spec_of("image", file="x", rotation=turn, scale=0.25, offset=[0.5, 0.5], wrap="clamp")
    table = table_of(spec, files=picture(texels, integer=False))
    uv = np.random.default_rng(4).uniform(-0.5, 0.5, (50, 2))
    h = 1e-3
    expected = np.stack(
        [
            (looked_up(table, uv=uv + step)[:, 0] - looked_up(table, uv=uv - step)[:, 0]) / (2 * h)
            for step in h * np.eye(2)
        ],
        axis=1,
    )
    np.testing.assert_allclose(slopes(table, uv=uv), expected, rtol=2e-4)
