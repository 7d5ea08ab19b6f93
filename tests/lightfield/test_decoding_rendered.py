"""Raw pictures that the camera `light_field` rendered: decoded, they are what a camera array renders."""

import math

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

import raytracer as rt
from raytracer.lightfield.decoding.decoder import decode
from raytracer.lightfield.decoding.microlens_grid import Optics
from raytracer.lightfield.super_resolution import upsample_cubic
from tests.lightfield.lenslet_pictures import dusty, texture

pytestmark = pytest.mark.slow

PIXEL_PITCH = 15.0
FOCAL_LENGTH = 20.0
FOCUS = 1.0

SCENE = """\
camera: {{type: {camera}, look_from: [0, 0, 0], look_at: [0, 0, -1], focus_distance: 1.0, {keys}}}
film: {{width: {width}, height: {height}}}
render: {{spp: {spp}, max_depth: 1}}
textures: {{pattern: {{type: image, file: {pattern}.npy, encoding: linear}}}}
materials: {{glowing: {{type: emitter, radiance: pattern}}}}
objects: [{{type: quad, corner: [-0.1, -0.1, -0.35], edges: [[0.2, 0, 0], [0, 0.2, 0]], material: glowing}}]
"""


def _rendered(folder, camera, keys, width, height, spp, pattern="pattern", scene=SCENE):
    path = folder / "scene.yaml"
    values = {"camera": camera, "keys": keys, "width": width, "height": height, "spp": spp, "pattern": pattern}
    path.write_text(scene.format(**values))
    return rt.render(rt.load(path), threads=2)


@pytest.mark.parametrize("layout", ["square", "hexagonal"])
def test_decoded_views_are_those_of_a_camera_array(tmp_path, layout):
    x, y = np.meshgrid(np.arange(512.0), np.arange(512.0))
    np.save(tmp_path / "pattern.npy", texture(x, y, 120.0).astype(np.float32))
    np.save(tmp_path / "white.npy", np.ones((4, 4, 3), np.float32))
    keys = (
        "sensor: {width: 9 mm, height: 7.2 mm}, focal_length: 20 mm, f_number: 4, "
        f"microlenses: {{pitch: 213 um, layout: {layout}, rotation: 0.7}}"
    )
    raw, white = (_rendered(tmp_path, "light_field", keys, 600, 480, 32, name) for name in ("pattern", "white"))
    known = raw.layout

    # What real sensors add: vignetting towards the corners, dust, a side in half-light, noise of 20 000 photons.
    rng = np.random.default_rng(1)
    down, right = np.mgrid[:480, :600]
    shade = 1.0 - 0.5 * (np.hypot(right - 300, down - 240) / np.hypot(300, 240)) ** 2
    shade *= dusty(shade.shape, 8) * np.clip((right + 5) / 40, 0.0, 1.0)
    pictures = [rng.poisson(2e4 * image.radiance * shade[..., None]) / 2e4 for image in (raw, white)]

    # Similar triangles give the distance of microlenses and sensor: sub-images are by 1 + behind / image wider.
    image = FOCAL_LENGTH * FOCUS / (FOCUS - 1e-3 * FOCAL_LENGTH)
    behind = (PIXEL_PITCH * known.lattice.pitch / 213.0 - 1.0) * image
    optics = Optics(PIXEL_PITCH, FOCAL_LENGTH, microlens_distance=1e3 * behind, focus_distance=FOCUS)
    decoded = decode(*pictures, optics=optics, views=11)

    found, true = decoded.grid.lattice, known.lattice
    assert decoded.grid.layout == layout
    assert found.pitch == pytest.approx(true.pitch, abs=0.02)
    assert found.rotation == pytest.approx(true.rotation, abs=0.02)
    middle = found.near((300.0, 240.0)).origin
    assert np.hypot(*np.subtract(true.near(middle).origin, middle)) < 0.05

    views = decoded.views
    # An array looks along its axis: its views are cut from what is as much larger as these are off the middle.
    edges = np.array([views.plane.left, views.plane.top])
    size = np.array([views.width, views.height]) * views.plane.pixel
    aside = edges * [2.0, -2.0] + size
    assert np.abs(aside).max() < 2.0 * views.plane.pixel
    spacing = float(views.position[5, 6, 0])
    half = views.plane.pixel * (0.5 * views.height + 2.0)
    keys = f"vfov: {math.degrees(2.0 * math.atan(half))}, rows: 11, columns: 11, spacing: {spacing}"
    array = _rendered(tmp_path, "camera_array", keys, views.width + 4, views.height + 4, 16)
    direct = array.layout.light_field(array).radiance

    from scipy.ndimage import shift

    moved = (-(edges[1] - (half - 2.0 * views.plane.pixel)), edges[0] + 0.5 * size[0])
    for row, column in ((5, 5), (5, 9), (2, 4), (8, 8)):
        pixels = [amount / views.plane.pixel for amount in moved]
        expected = shift(direct[row, column], (-pixels[0], -pixels[1], 0.0), order=3, mode="nearest")[2:-2, 2:-2]
        opposite = shift(direct[10 - row, 10 - column], (-pixels[0], -pixels[1], 0.0), order=3, mode="nearest")
        seen = decoded.view(row, column)
        scale = np.sqrt((expected[1:-1, 3:-1] ** 2).mean())
        error = np.sqrt(((seen - expected)[1:-1, 3:-1] ** 2).mean()) / scale
        assert error < 0.02
        if (row, column) != (5, 5):
            assert np.sqrt(((seen - opposite[2:-2, 2:-2])[1:-1, 3:-1] ** 2).mean()) / scale > 1.5 * error


DETAIL = """\
camera: {{type: {camera}, look_from: [0, 0, 0], look_at: [0, 0, -1], {keys}}}
film: {{width: {width}, height: {height}}}
render: {{spp: {spp}, max_depth: 1}}
textures: {{pattern: {{type: image, file: {pattern}.npy, encoding: linear}}}}
materials: {{glowing: {{type: emitter, radiance: pattern}}}}
objects:
  - {{type: quad, corner: [-0.5, -0.5, -3.2], edges: [[1, 0, 0], [0, 1, 0]], material: glowing}}
  - {{type: quad, corner: [-0.45, -0.28, -1.5], edges: [[0.45, 0, -1], [0, 0.5, 0]], material: glowing}}
  - {{type: quad, corner: [0.03, -0.07, -1.4], edges: [[0.2, 0, 0], [0, 0.2, 0]], material: glowing}}
"""

FINER = 3
"""Pixels of what is rendered for the truth to one of the truth, so that it can be cut where the views' edges are."""


def _truth(folder, views, factor):
    """Render what a pinhole in the middle of the lens sees, in `factor` times as many pixels as a view."""
    fine = views.plane.pixel / (factor * FINER)
    edges = np.array([-views.plane.left, views.plane.top])
    size = np.array([views.width, views.height])
    half = np.ceil(np.maximum(edges, size * views.plane.pixel - edges) / fine).astype(int) + 1
    vfov = 2.0 * math.degrees(math.atan(half[1] * fine))
    whole = _rendered(folder, "pinhole", f"vfov: {vfov!r}", *(2 * half), 16, scene=DETAIL).radiance
    left, top = np.rint(half - edges / fine).astype(int)
    width, height = factor * FINER * size
    part = whole[top : top + height, left : left + width]
    return part.reshape(height // FINER, FINER, width // FINER, FINER, 3).mean(axis=(1, 3))


@pytest.mark.parametrize(
    ("microlenses", "least"),
    [("{pixels: 9}", 0.65), ("{pitch: 140 um, layout: hexagonal, rotation: 0.3, offset: [13 um, 7 um]}", 0.75)],
    ids=["square", "hexagonal"],
)
def test_finer_than_a_view_of_a_raw_picture(tmp_path, microlenses, least):
    """Letters, as it were: against what a pinhole sees, with four times the pixels along each side."""
    random = np.random.default_rng(0)
    grains = random.standard_normal((1024, 1024, 3))
    pattern = sum(s * gaussian_filter(grains, (s, s, 0), mode="wrap") for s in (1.5, 3.0, 6.0, 12.0))
    np.save(tmp_path / "pattern.npy", np.clip(0.5 + 0.2 * pattern / pattern.std(), 0.0, 1.0).astype(np.float32))
    np.save(tmp_path / "white.npy", np.ones((4, 4, 3), np.float32))
    lens = "focus_distance: 2, sensor: {width: 6 mm, height: 4.8 mm}, focal_length: 50 mm, f_number: 2"
    keys = f"{lens}, microlenses: {microlenses}"
    size = (540, 432) if "pixels" in microlenses else (600, 480)
    raw = _rendered(tmp_path, "light_field", keys, *size, 32, scene=DETAIL)
    white = _rendered(tmp_path, "light_field", keys, *size, 64, "white", scene=DETAIL)
    optics = Optics(6000.0 / size[0], 50.0, 2.0, focus_distance=2.0)
    decoded = decode(raw.radiance, white.radiance, optics=optics).light_field()
    for field in (decoded, raw.layout.light_field(raw)):
        depth = rt.lightfield.depth_map(field, threads=2)
        exact = _truth(tmp_path, field.views, 4)
        errors = [
            float(np.sqrt((((picture - exact)[8:-8, 8:-8]) ** 2).mean()))
            for picture in (
                rt.lightfield.supersampled(field, 4, depth),
                upsample_cubic(field.view(depth.row, depth.column), 4),
            )
        ]
        assert errors[0] < least * errors[1]
