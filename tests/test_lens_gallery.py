"""The scenes that show what real lenses do: every setting of their pictures, and what rays say on their page."""

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from raytracer.optics.lens_system.first_order import cardinal_points
from raytracer.optics.lens_system.lens_setup import stop_radius_for
from raytracer.optics.lens_system.ray_tracing import trace_rays
from raytracer.plugins.cameras.lens import RealLens
from raytracer.rendering.render import render
from raytracer.scene.assets.lenses import read_lens
from raytracer.scene.load import load
from tests.test_lecture import _script, make_gallery

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "scenes" / "optics"
NAMES = sorted(path.stem for path in FOLDER.glob("*.yaml"))
PAGE = (ROOT / "docs" / "lenses-gallery.md").read_text(encoding="utf-8")


def test_the_gallery_shows_every_scene_and_the_page_every_sheet() -> None:
    assert sorted(make_gallery.OPTICS) == NAMES
    assert sorted(re.findall(r"gallery/optics_(\w+)\.jpg", PAGE)) == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_every_setting_is_a_scene_of_its_own(name: str) -> None:
    variants = make_gallery.OPTICS[name].variants
    specs = [load(FOLDER / f"{name}.yaml", dict(variant.keys)) for variant in variants]
    assert len({repr(spec.camera) for spec in specs}) == len(variants) > 1
    assert len({variant.caption for variant in variants}) == len(variants)


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_every_setting_gives_a_picture(name: str) -> None:
    for variant in make_gallery.OPTICS[name].variants:
        rendered = render(make_gallery.smaller(FOLDER / f"{name}.yaml", variant.keys, 48, 48), spp=16)
        assert rendered.stats.nan_samples == 0
        values = rendered.image.radiance
        assert np.isfinite(values).all()
        assert (values >= 0.0).all()
        assert values.max() > 0.2, variant.caption


def test_the_street_is_what_its_script_makes() -> None:
    street = _script(ROOT / "scenes" / "generate" / "street.py")
    for name in street.OPTICS:
        assert (FOLDER / f"{name}.yaml").read_text(encoding="utf-8") == street.street(name)


# ---- Numbers of the page


def spot(name: str, f_number: float, point: tuple[float, float], film: float | None = None) -> Any:
    """Trace light of a point (height, distance, mm) to a film (n, 2); by default that of the first order."""
    lens = read_lens(ROOT / "scenes" / "lenses" / f"{name}.yaml")
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


def test_the_singlet_blurs_by_the_cube_of_its_opening() -> None:
    from scipy.optimize import minimize_scalar

    radii = []
    for f_number in (4.0, 8.0):
        square = minimize_scalar(
            lambda film, n=f_number: (spot("plano-convex-100mm", n, (0.0, 2000.0), film) ** 2).sum(axis=1).mean(),
            bounds=(100.0, 112.0),
            method="bounded",
        ).fun
        radii.append(math.sqrt(square))
    assert radii == pytest.approx([0.1545, 0.0185], rel=3e-3)
    assert "0.1545 mm by rays" in PAGE
    assert "0.0185 mm by rays" in PAGE


def test_comets_are_as_long_as_rays_say() -> None:
    lengths = [np.ptp(spot("hyperbolic-100mm", n, (840.0, 10000.0))[:, 1]) for n in (2.5, 5.0)]
    assert lengths == pytest.approx([1.82, 0.50], abs=0.01)
    assert re.search(r"rays say 1\.82 mm.*rays say\s+0\.50 mm", PAGE, re.DOTALL)


def test_the_fisheye_draws_angles_and_the_wide_angle_lens_their_tangents() -> None:
    def angle(keys: dict[str, Any], x: float) -> float:
        camera = load(FOLDER / "fisheye.yaml", keys).camera
        assert isinstance(camera, RealLens)
        _, way = camera.film_to_ray(x, 0.5, 480, 320)
        return math.atan2(way[0], way[2])

    wide = make_gallery.OPTICS["fisheye"].variants[1].keys
    assert math.degrees(angle(wide, 1.0)) == pytest.approx(39.4, abs=0.05)
    assert 22.0 * math.tan(angle(wide, 1.0)) == pytest.approx(18.07, abs=0.01)
    # 10 mm and 12 mm off the middle of 25 mm.
    for place in (10.0, 12.0):
        assert 10.0 * angle({}, 0.5 + place / 25.0) == pytest.approx(place, rel=5e-3)
