"""Pixels that no light came to: they take part in nothing, and nobody is sure of them."""

import dataclasses
import json
import math

import h5py
import numpy as np
import PIL.Image
import pytest

from raytracer.film.light_field import lf
from raytracer.film.light_field.field import LIT_LAYER, LightField
from raytracer.lightfield.coverage import lit_views, within_lens
from raytracer.lightfield.decoding.decoder import decode
from raytracer.lightfield.depth.depth_map import Depth, depth_map
from raytracer.lightfield.refocusing.fourier import FourierRefocuser
from raytracer.lightfield.refocusing.refocus import refocus
from raytracer.lightfield.super_resolution import all_in_focus, supersampled, upsample_cubic
from raytracer.lightfield.views.synthesis import view_at
from raytracer.util.errors import InputError
from tests.lightfield.analytic import Surface, away, light_field, views, waves
from tests.lightfield.lenslet_pictures import Camera, lattice
from tests.lightfield.test_looking_commands import run


def darkened(whole, lit):
    """As a camera that vignettes: 0 where no light came."""
    radiance = np.where(lit[..., None], whole.radiance, 0.0)
    return LightField(radiance, whole.views, {**whole.layers, LIT_LAYER: lit.astype(np.uint8)}, settings=whole.settings)


@pytest.fixture(scope="module")
def bright():
    """A wall that leans away, all of it seen by 7 x 7 views."""
    geometry = views(7, 7, spacing=0.03, width=60, height=48)
    return light_field(geometry, [Surface(2.2, waves(1, 0.06), tilt=(0.3, 0.2))], noise=0.01, supersampling=1)


@pytest.fixture(scope="module")
def lit(bright):
    """A corner that no view has, one that half of them lack, and a view without any light."""
    lit = np.ones(bright.radiance.shape[:4], dtype=bool)
    lit[:, :, :12, :16] = False
    lit[:, :4, -14:, -20:] = False
    lit[0, 0] = False
    return lit


@pytest.fixture(scope="module")
def dark(bright, lit):
    return darkened(bright, lit)


def test_depth_is_not_sure_without_light(bright, dark, lit):
    found, whole = depth_map(dark, threads=2), depth_map(bright, threads=2)
    seen = lit[3, 3]
    assert (found.confidence[~seen] == 0.0).all()
    assert np.array_equal(np.isnan(found.distance), ~seen)
    exact = bright.layers["depth"][3, 3]
    error = {
        name: np.abs(depth.distance - exact)[seen & (depth.confidence >= 0.5)]
        for name, depth in (("dark", found), ("whole", whole))
    }
    assert len(error["dark"]) > 0.9 * len(error["whole"])
    assert np.sqrt((error["dark"] ** 2).mean()) < 1.2 * np.sqrt((error["whole"] ** 2).mean())


@pytest.mark.parametrize("method", ["focus", "slopes"])
def test_depth_that_one_other_view_tells_is_not_sure(bright, method):
    lit = np.ones(bright.radiance.shape[:4], dtype=bool)
    lit[..., :, :30] = False
    lit[3, 3:5] = True
    found = depth_map(darkened(bright, lit), method=method, threads=1, near=1.5, far=4.0)
    assert (found.confidence[:, :30] == 0.0).all()
    assert (found.confidence[:, 40:-4] >= 0.5).mean() > 0.5


def test_pictures_are_means_of_what_is_lit(bright, dark, lit):
    seen = lit[3, 3][6:-6, 6:-6]

    def error(picture, exact):
        return away(picture[6:-6, 6:-6][seen], exact[6:-6, 6:-6][seen])

    # Where a third of the views have no light, brightness would be off by as much.
    sharp = [refocus(field, 2.2).radiance for field in (bright, dark)]
    assert error(sharp[1], sharp[0]) < 0.03
    leaning = [refocus(field, 2.2, tilt=20.0).radiance for field in (bright, dark)]
    assert error(leaning[1], leaning[0]) < 0.03
    slices = [FourierRefocuser(field, [1 / 2.2]).picture(1 / 2.2) for field in (bright, dark)]
    assert error(slices[1], slices[0]) < 0.1
    depth = Depth(1.0 / bright.layers["depth"][3, 3], np.ones((48, 60)), 3, 3)
    whole, found = (all_in_focus(field, depth) for field in (bright, dark))
    assert error(found, whole) < 0.03
    place = 0.4 * 0.03, 0.3 * 0.03
    between = [view_at(field, *place, depth=depth) for field in (bright, dark)]
    assert error(between[1], between[0]) < 0.03
    # Nothing is known of what no view has seen.
    assert (found[:6, :8] == 0.0).all()
    assert (sharp[1][:6, :8] == 0.0).all()


def test_commands_leave_out_views_without_light(dark, tmp_path, capsys):
    file = tmp_path / "dark.lf"
    lf.write(file, dark)
    assert run("info", file, "--json") == 0
    assert json.loads(capsys.readouterr().out)["lit_views"] == 48
    assert run("info", file) == 0
    assert "7 x 7, each 60 x 48 pixels; 48 of them got light" in capsys.readouterr().out
    assert run("views", file, "--all", "-o", tmp_path / "all") == 0
    assert capsys.readouterr().err.endswith("wrote 48 views to " + str(tmp_path / "all") + "; 1 others got no light\n")
    assert not (tmp_path / "all" / "view_0_0.png").exists()
    assert run("views", file, "-o", tmp_path / "m.png", "-q") == 0
    with PIL.Image.open(tmp_path / "m.png") as montage:
        assert montage.getpixel((30, 24)) == (128, 128, 128)
        assert montage.getpixel((62 + 30, 24)) != (128, 128, 128)
    for command in (("views", file, "--view", "0,0"), ("depth", file, "--view", "0,0")):
        assert run(*command, "-o", tmp_path / "v.npy", "-q") == 2
        assert "dark.lf: no light came to view 0,0: it lies outside the lens" in capsys.readouterr().err
    assert run("depth", file, "-o", tmp_path / "d.npy", "-o", tmp_path / "d.png", "-o", tmp_path / "d.exr", "-q") == 0
    assert np.isnan(np.load(tmp_path / "d.npy")[:12, :16]).all()
    with PIL.Image.open(tmp_path / "d.png") as drawn:
        assert drawn.getpixel((4, 4)) == (128, 128, 128)


def test_views_outside_the_lens_are_left_out():
    geometry = dataclasses.replace(views(5, 5, spacing=0.01), aperture=0.04)
    assert within_lens(geometry).sum() == 13
    assert not within_lens(geometry)[0, 0]
    field = LightField(np.ones((5, 5, 72, 96, 3)), geometry)
    # Those in the corners are sqrt(2) 20 mm away, with cells that reach 5 mm to the middle both ways: beyond 20 mm.
    assert lit_views(field).sum() == 21
    with pytest.raises(InputError, match="no light came to view 0,0"):
        depth_map(field, row=0, column=0)


PITCH = 12.3
SLOPE = 2.7
"""Pixels by which what a microlens sees moves, for each by which one looks beside its middle."""


def ripples(side):
    """Waves (x, y) -> (..., 3), 0.2 to 0.8, down to 1.4 pixels of a view long; as means over squares with this side."""
    random = np.random.default_rng(4)
    length = PITCH * 1.4 * 4.0 ** random.random(30)
    angle, phase = random.uniform(0.0, 2.0 * math.pi, 30), random.uniform(0.0, 2.0 * math.pi, (30, 3))
    fx, fy = np.cos(angle) / length, np.sin(angle) / length
    strength = (0.05 * np.sinc(fx * side) * np.sinc(fy * side))[:, None] * np.exp(1j * phase)

    def scene(x, y):
        angle = 2.0 * math.pi * (x[..., None] * fx + y[..., None] * fy)
        return 0.5 + np.sin(angle) @ strength.real + np.cos(angle) @ strength.imag

    return scene


@pytest.fixture(scope="module")
def hexagons():
    """A picture from behind hexagons, each of which averages what is before it, as pixels of views do."""
    camera = Camera(lattice(PITCH, 0.6, (151.0, 122.4), hexagonal=True), 300, 240, vignetting=0.0)
    side = math.sqrt(camera.lattice.area)
    return decode(camera.picture(ripples(side), SLOPE), camera.picture())


def test_finer_than_any_view_behind_hexagons(hexagons, tmp_path):
    """Of views' pixels alone, which are interpolated between microlenses, what is fine comes out as something else."""
    hexagons.write(tmp_path / "a.lf")
    with lf.open(tmp_path / "a.lf") as field:
        geometry, resampler = field.views, hexagons.resampler
        row, column = geometry.nearest()
        inverse = np.full((geometry.height, geometry.width), SLOPE / resampler.pixel)
        depth = Depth(inverse, np.ones_like(inverse), row, column)
        x, y = (
            first + resampler.pixel * ((np.arange(4 * size) + 0.5) / 4 - 0.5)
            for first, size in zip(resampler.first, (geometry.width, geometry.height), strict=True)
        )
        exact = ripples(0.25 * resampler.pixel)(*np.meshgrid(x, y))
        found = supersampled(field, 4, depth)
        plain = supersampled(dataclasses.replace(field, samples=None), 4, depth)

        def error(picture):
            inner = (slice(16, -16), slice(16, -16))
            return away(picture[inner] - 0.5, exact[inner] - 0.5)

        single = error(upsample_cubic(field.view(row, column), 4))
        assert error(found) < 0.5 * single
        assert error(found) < 0.6 * error(plain)


def test_noise_is_not_multiplied():
    """However noisy views are, what all of them together tell is better than one of them."""
    surfaces = [Surface(2.2, waves(1, 0.06), tilt=(0.3, 0.2))]
    field = light_field(views(7, 7, spacing=0.023, width=48, height=36), surfaces, noise=0.2, supersampling=2)
    fine = light_field(views(1, 1, width=192, height=144), surfaces, supersampling=1).view(0, 0)
    depth = Depth(1.0 / field.layers["depth"][3, 3], np.ones((36, 48)), 3, 3)
    assert away(supersampled(field, 4, depth), fine) < 0.6 * away(upsample_cubic(field.view(3, 3), 4), fine)


def test_views_of_the_middle_of_a_lens():
    """Fewer than fit into the sub-images: the lens is wider than all of them together, and they are all lit."""
    geometry = dataclasses.replace(views(3, 3, spacing=0.01, width=12, height=9), aperture=0.2)
    field = LightField(np.ones((3, 3, 9, 12, 3)), geometry)
    assert lit_views(field).all()
    assert refocus(field, 1.5).radiance == pytest.approx(1.0)
    with pytest.raises(InputError, match="wider than all views together"):
        refocus(field, 1.5, aperture=0.1)


def test_samples_in_a_file(hexagons, tmp_path):
    field = hexagons.light_field()
    hexagons.write(tmp_path / "a.lf")
    lf.write(tmp_path / "b.lf", field)
    for name in ("a.lf", "b.lf"):
        with lf.open(tmp_path / name) as read:
            assert np.array_equal(read.samples.place, field.samples.place)
            assert np.array_equal(read.samples.value, field.samples.value, equal_nan=True)
            assert np.array_equal(read.layers[LIT_LAYER], field.layers[LIT_LAYER])
            assert np.array_equal(lit_views(read), lit_views(field))
    assert not lit_views(field)[0, 0]
    assert np.isnan(field.samples.value[0, 0]).all()
    assert run("info", tmp_path / "a.lf", "--check") == 0
    with h5py.File(tmp_path / "b.lf", "r+") as file:
        del file["microlenses/place"]
        file["microlenses/place"] = np.zeros((3, 2))
    with pytest.raises(InputError, match="microlenses must be of shapes"):
        lf.open(tmp_path / "b.lf")
