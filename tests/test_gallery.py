"""Scenes of the camera lecture and of real lenses: the settings of their pictures, and what their pages say."""

import math
import re
import shlex

import numpy as np
import pytest
import typer
from PIL import Image
from scipy.optimize import minimize_scalar
from scipy.signal import fftconvolve

from raytracer.analysis.explain import explain
from raytracer.cli.base.app import application
from raytracer.optics.lens_system.first_order import cardinal_points
from raytracer.optics.lens_system.lens_setup import stop_radius_for
from raytracer.optics.lens_system.ray_tracing import trace_rays
from raytracer.rendering.render import render
from raytracer.scene.assets.lenses import read_lens
from raytracer.scene.load import load
from raytracer.scene.overrides import parse_overrides
from raytracer.scene.pack.scene import pack
from raytracer.scene.warnings import find_warnings
from tests.repository import ROOT, SCENES, need_files_of, script

make_gallery, street = script("docs/make_gallery.py"), script("scenes/generate/street.py")
coded_mask, lensless = script("scenes/generate/coded_mask.py"), script("docs/examples/lensless.py")
make_diagrams = script("docs/make_diagrams.py")

LECTURE = "".join(path.read_text(encoding="utf-8") for path in sorted((ROOT / "docs" / "lecture").glob("[0-9]*.md")))
OPTICS = (ROOT / "docs" / "lenses-gallery.md").read_text(encoding="utf-8")
SHEETS = {
    f"{folder}/{name}": (SCENES / folder / f"{sheet.scene or name}.yaml", sheet)
    for folder, sheets in make_gallery.SHEETS.items()
    for name, sheet in sheets.items()
}
EVERY_SHEET = pytest.mark.parametrize("name", SHEETS)


@pytest.mark.parametrize(("folder", "page"), [("lecture", LECTURE), ("optics", OPTICS)], ids=["lecture", "optics"])
def test_the_gallery_shows_every_scene_and_the_page_every_sheet(folder, page):
    scenes = {path.stem for path in (SCENES / folder).glob("*.yaml")}
    made = {name.removeprefix(f"{folder}_") for name in make_gallery.MADE if name.startswith(folder)}
    sheets = make_gallery.SHEETS[folder]
    assert {sheet.scene or name for name, sheet in sheets.items()} | (made & scenes) == scenes
    assert sorted(re.findall(rf"gallery/{folder}_(\w+)\.jpg", page)) == sorted({*sheets, *made})


@pytest.mark.parametrize("path", sorted((SCENES / "showcase").glob("*.yaml")), ids=lambda path: path.stem)
def test_a_showcase_is_on_the_page_and_says_what_to_look_at_and_what_to_change(path):
    page = (ROOT / "docs" / "scenes-gallery.md").read_text(encoding="utf-8")
    comment = path.read_text(encoding="utf-8").partition("camera:")[0]
    assert all(line.startswith("# ") for line in comment.splitlines())
    assert "# Look at: " in comment
    assert "# Change: " in comment
    assert f"](gallery/{path.stem}.jpg)\n\n`scenes/showcase/{path.name}`: " in page
    assert (make_gallery.GALLERY / f"{path.stem}.jpg").stat().st_size <= make_gallery.MOST_BYTES
    need_files_of(path.stem)
    spec = load(path)
    # Exposed by numbers, and as large as the gallery shows it.
    assert spec.camera.iso
    assert max(spec.film.width, spec.film.height) <= make_gallery.LONGEST_EDGE
    assert [item.text for item in find_warnings(pack(spec))] == []


def test_pages_show_every_diagram_that_is_drawn():
    drawn = sorted(make_diagrams.DIAGRAMS)
    assert sorted(path.stem for path in (ROOT / "docs" / "lecture" / "diagrams").glob("*.svg")) == drawn
    assert sorted(re.findall(r"diagrams/(\w+)\.svg", LECTURE)) == drawn


@EVERY_SHEET
def test_a_scene_says_what_to_look_at_and_what_to_change_and_has_settings_of_its_own(name):
    path, sheet = SHEETS[name]
    comment = path.read_text(encoding="utf-8").partition("camera:")[0]
    assert all(line.startswith("# ") for line in comment.splitlines())
    assert "# Look at: " in comment
    assert "# Change: " in comment
    specs = [load(path, dict(variant.keys)) for variant in sheet.variants]
    assert len({repr((spec.camera, spec.lights)) for spec in specs}) == len(specs) > 1
    assert len({variant.caption for variant in sheet.variants}) == len(specs)


# Sheets whose pictures differ in brightness, by this factor each.
EXPOSED_ON_PURPOSE = {"lecture/bracketing": 2.0, "lecture/building_up": 4.0}

# Sheets whose pictures are black in part: tests/test_lecture_figures.py says in which.
BLACK_IN_PART = {"lecture/slit"}


@pytest.mark.slow
@EVERY_SHEET
def test_every_setting_gives_a_picture_and_those_of_the_lecture_are_exposed_well(name):
    path, sheet = SHEETS[name]
    means = []
    for variant in sheet.variants:
        rendered = render(make_gallery.smaller(path, variant.keys, 48, 48), spp=16)
        values = rendered.image.radiance
        means.append(values.mean())
        assert rendered.stats.nan_samples == 0
        assert np.isfinite(values).all()
        if name.startswith("optics"):
            # Single wavelengths lie outside of the colours of displays: pixels may be a little below 0, but not all.
            assert (values.mean(axis=(0, 1)) > 0.0).all()
            assert values.max() > 0.2, variant.caption
        if name.startswith("optics") or name in EXPOSED_ON_PURPOSE or name in BLACK_IN_PART:
            continue
        # Light is neither lost nor mostly beyond what the sensor can tell apart: 10/78 is what a meter wants; night and
        # bright roads are up to two stops from it.
        assert rendered.setting.iso is not None
        assert 0.04 < np.minimum(values, 1.0).mean() < 0.4, variant.caption
        assert np.mean(values.max(axis=2) > 1.0) < 0.2, variant.caption
        assert np.median(values) > 0.01, variant.caption
    if name in EXPOSED_ON_PURPOSE:
        np.testing.assert_allclose(np.divide(means[1:], means[:-1]), EXPOSED_ON_PURPOSE[name], rtol=0.1)


def test_files_that_scripts_made_are_what_the_scripts_make():
    for folder, names in (("lecture", street.HEADS), ("optics", street.OPTICS)):
        for name in names:
            assert (SCENES / folder / f"{name}.yaml").read_text(encoding="utf-8") == street.street(name)
    night = SCENES / "showcase" / "night_street.yaml"
    assert night.read_text(encoding="utf-8") == script("scenes/generate/night_street.py").scene()
    assert (SCENES / "diamond.ply").read_bytes() == script("scenes/generate/diamond.py").ply()
    assert (SCENES / "showcase" / "step_cut.ply").read_bytes() == script("scenes/generate/step_cut.py").ply()
    assert (SCENES / "lecture" / "splash.ply").read_bytes() == script("scenes/generate/splash.py").ply()
    with Image.open(SCENES / "lecture" / "coded_mask.png") as picture:
        assert (np.asarray(picture) == coded_mask.coded_mask()).all()
    puff = np.load(SCENES / "kinds" / "media" / "puff.npy")
    assert np.array_equal(puff, script("scenes/generate/puff.py").densities())


def test_the_veil_spreads_the_light_of_the_sun_and_takes_none_away(monkeypatch):
    sky = script("scenes/generate/sky.py")
    monkeypatch.setattr(sky, "HEIGHT", 256)
    ways = sky.directions()
    toward = np.array([0.0, math.sin(0.5), -math.cos(0.5)])
    angle = np.arccos(np.clip(ways @ toward, -1.0, 1.0))
    # Rows of equal angles: a texel is the smaller the nearer to a pole.
    solid_angle = np.sqrt(1.0 - ways[..., 1] ** 2) * (math.pi / 256) ** 2
    assert solid_angle.sum() == pytest.approx(4.0 * math.pi, rel=1e-4)
    # Rayleigh's distribution, with the standard deviation of 3.5 degrees.
    for veil, within in ((0.0, 1.0), (1.0, 1.0 - math.exp(-0.5 * (0.06 / math.radians(3.5)) ** 2))):
        light = sky.sun_lobes(toward, ways, veil) * solid_angle
        assert light.sum() == pytest.approx(1.0, rel=1e-6)
        assert np.tensordot(light, ways, axes=2) == pytest.approx(toward, abs=5e-3)
        assert light[angle < 0.06].sum() == pytest.approx(within, abs=0.03)


def test_a_mask_repeated_is_correlated_with_itself_in_one_place_only():
    # Gottesman and Fenimore 1989: with what is closed counted as -1, and the first square as open, the periodic
    # correlation with the mask is a single peak.
    mask = coded_mask.coded_mask().astype(float)
    key = 2.0 * mask - 1.0
    key[0, 0] = 1.0
    correlation = np.fft.irfft2(np.fft.rfft2(mask) * np.fft.rfft2(key).conj(), mask.shape)
    assert correlation[0, 0] == pytest.approx(mask.sum())
    np.testing.assert_allclose(correlation.ravel()[1:], 0.0, atol=1e-9)


def test_what_a_mask_mixed_is_told_apart():
    file = SCENES / "lecture" / "lensless.yaml"
    shadow = lensless.scene_shadow(load(file, {"film.width": 160, "film.height": 120}), file.parent)
    # 31 squares of 0.5 mm, larger by 1.04, on pixels of 0.375 mm.
    across = np.flatnonzero(shadow.sum(axis=0))
    assert across[-1] - across[0] + 1 == pytest.approx(1.04 * 31 * 0.5 / 0.375 + 1.0, abs=1.5)
    seen = np.zeros((120, 160, 3))
    seen[50:70, 60:90, 0], seen[40:60, 80:100, 1] = 1.0, 0.5
    mixed = fftconvolve(seen, shadow[..., None], axes=(0, 1))[60:180, 80:240]
    assert np.corrcoef(mixed.ravel(), seen.ravel())[0, 1] < 0.7
    assert np.corrcoef(lensless.reconstruct(mixed, shadow).ravel(), seen.ravel())[0, 1] > 0.97


@pytest.mark.slow
def test_a_picture_without_a_lens_is_that_of_a_hole():
    file, size = SCENES / "lecture" / "lensless.yaml", {"film.width": 160, "film.height": 120}
    hole = {"camera.aperture_shape": "round", "camera.diameter": 0.56}
    scene = load(file, size)
    recorded, seen = render(scene, spp=4096).image.radiance, render(load(file, size | hole), spp=64).image.radiance
    told_apart = lensless.reconstruct(recorded, lensless.scene_shadow(scene, file.parent))
    assert np.corrcoef(told_apart.ravel(), seen.ravel())[0, 1] > 0.92


def commands():
    """Commands of the lecture, without `rt`, and what the page says that they print."""
    for block in re.findall(r"^```\n(.*?)^```$", LECTURE, re.DOTALL | re.MULTILINE):
        for piece in re.split(r"^\$ rt ", block, flags=re.MULTILINE)[1:]:
            first, *output = piece.splitlines()
            yield pytest.param(shlex.split(first), output, id=first)


@pytest.mark.parametrize(("words", "output"), list(commands()))
def test_commands_of_the_page_work_and_print_what_it_says(words, output):
    verb, scene, *options = words
    parameters = typer.main.get_command(application()).commands[verb].params
    assert set(options[::2]) <= {name for parameter in parameters for name in parameter.opts}
    keys = [value for option, value in zip(options[::2], options[1::2], strict=True) if option == "-D"]
    spec = load(ROOT / scene, parse_overrides(keys))
    assert bool(output) == (verb == "explain")
    if output:
        printed = {" ".join(line.split()) for line in explain(spec).text().splitlines()}
        assert {" ".join(line.split()) for line in output} <= printed


# ---- Numbers of the page of real lenses


def spot(name, f_number, point, film=None):
    """Trace light of a point (height, distance, mm) to a film (n, 2); by default that of the first order."""
    lens = read_lens(SCENES / "lenses" / f"{name}.yaml")
    surfaces = lens.packed(stop_radius=stop_radius_for(lens, f_number))
    height, distance = point
    if film is None:
        found = cardinal_points(surfaces)
        film = found.rear_principal + 1.0 / (1.0 / found.focal_length - 1.0 / (distance + found.front_principal))
    line = np.linspace(-1.0, 1.0, 301) * 1.1 * surfaces.radius[0]
    across, above = (grid.ravel() for grid in np.meshgrid(line, line))
    ways = np.stack([across, above - height, np.full(len(across), distance)], axis=1)
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    weights, points, onward = trace_rays(surfaces, np.tile([0.0, height, -distance], (len(ways), 1)), ways)
    points, onward = points[weights > 0.0], onward[weights > 0.0]
    return (points + ((film - points[:, 2]) / onward[:, 2])[:, None] * onward)[:, :2]


def test_the_singlet_blurs_by_the_cube_of_its_opening():
    for f_number, radius in ((4.0, 0.1545), (8.0, 0.0185)):
        square = minimize_scalar(
            lambda film, n=f_number: (spot("plano-convex-100mm", n, (0.0, 2000.0), film) ** 2).sum(axis=1).mean(),
            bounds=(100.0, 112.0),
            method="bounded",
        ).fun
        assert math.sqrt(square) == pytest.approx(radius, rel=3e-3)
        assert f"{radius} mm by rays" in OPTICS


def test_comets_are_as_long_as_rays_say():
    lengths = [np.ptp(spot("hyperbolic-100mm", n, (840.0, 10000.0))[:, 1]) for n in (2.5, 5.0)]
    assert lengths == pytest.approx([1.82, 0.50], abs=0.01)
    assert re.search(r"rays say 1\.82 mm.*rays say\s+0\.50 mm", OPTICS, re.DOTALL)


def test_the_fisheye_draws_angles_and_the_wide_angle_lens_their_tangents():
    path, sheet = SHEETS["optics/fisheye"]

    def angle(keys, x):
        _, way = load(path, keys).camera.film_to_ray(x, 0.5, 480, 320)
        return math.atan2(way[0], way[2])

    wide = sheet.variants[1].keys
    assert math.degrees(angle(wide, 1.0)) == pytest.approx(39.4, abs=0.05)
    assert 22.0 * math.tan(angle(wide, 1.0)) == pytest.approx(18.07, abs=0.01)
    # 10 mm and 12 mm off the middle of 25 mm.
    for place in (10.0, 12.0):
        assert 10.0 * angle({}, 0.5 + place / 25.0) == pytest.approx(place, rel=5e-3)
