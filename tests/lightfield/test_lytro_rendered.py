"""A table rendered by a camera like Lytro's: packed into its containers and decoded, it is the light field again."""

from pathlib import Path

import numpy as np
import pytest

import raytracer as rt
from raytracer.film.light_field.resampling import Resampler
from raytracer.lightfield.decoding.lytro.decode import decode_photo
from tests.lightfield import lytro_files
from tests.lightfield.lytro_files import F01, ILLUM

pytestmark = pytest.mark.slow

SCENE = Path(__file__).parents[2] / "scenes/lightfield/lytro.yaml"
SIZE = (640, 480)
SMALL = {
    "camera.sensor": {"width": "0.896 mm", "height": "0.672 mm"},
    "film.width": SIZE[0],
    "film.height": SIZE[1],
    "render.spp": 64,
    "camera.look_from": [0.0, 0.04, 0.2],
}
WHITE = {
    "environment": {"type": "constant", "radiance": 0.8},
    "objects": [{"type": "sphere", "center": [0, 0, 9], "radius": 1, "material": "table"}],
}


def _render(extra=()):
    return rt.render(rt.load(SCENE, overrides={**SMALL, **dict(extra)}), threads=2)


@pytest.fixture(scope="module")
def pictures():
    return _render(), _render(WHITE)


@pytest.mark.parametrize("camera", [F01, ILLUM], ids=["F01", "Illum"])
def test_decoded_it_is_the_light_field_that_was_rendered(tmp_path, pictures, camera):
    pytest.importorskip("cv2")
    raw, white = pictures
    layout = raw.layout
    described = rt.load(SCENE, overrides=SMALL).camera.describe(*SIZE)
    behind = 1e-3 * described["sensor_behind_microlenses_mm"]
    f, n = 6.45e-3, 2.0
    image = f * 0.2022 / (0.2022 - f)
    lens = {"focalLength": f, "fNumber": n, "infinityLambda": (image - f) / n / 14e-6, "exitPupilOffset": {"z": image}}
    values = lytro_files.metadata(*SIZE, camera, colors=True, **lens)
    values["devices"]["mla"] = {"lensPitch": 14e-6, "sensorOffset": {"z": behind}}
    codes = lytro_files.mosaic(0.4 * raw.radiance, camera, colors=True)
    # The white picture is of another colour than white.
    bright = lytro_files.mosaic(white.radiance * np.array([0.7, 1.0, 0.6]), camera)
    (tmp_path / "a.lfp").write_bytes(lytro_files.photo(codes, values))
    (tmp_path / "data.C.0").write_bytes(lytro_files.package(lytro_files.white_files([(bright, values)])))
    decoded = decode_photo(tmp_path / "a.lfp", tmp_path / "data.C.0", views=10)

    lattice, true = decoded.grid.lattice, layout.lattice
    assert lattice.pitch == pytest.approx(true.pitch, abs=0.001)
    assert lattice.rotation == pytest.approx(true.rotation, abs=0.001)
    origin = lattice.near((320.0, 240.0)).origin
    assert np.hypot(*np.subtract(true.near(origin).origin, origin)) < 0.01
    views, known = decoded.views, layout.views
    assert views.focus_distance == pytest.approx(0.2022, rel=1e-6)
    assert views.plane.pixel == pytest.approx(known.plane.pixel, rel=1e-4)
    assert views.position == pytest.approx(known.position, rel=1e-4)

    # What each view saw under each microlens, before anything was interpolated between them.
    direct, field = layout.light_field(raw), decoded.light_field()
    own, theirs = decoded.resampler, Resampler(true, *SIZE)
    places = [one.places * one.pixel + np.asarray(one.first) for one in (own, theirs)]
    away = ((places[0][:, None] - places[1][None]) ** 2).sum(axis=-1)
    nearest = away.argmin(axis=1)
    assert np.sqrt(away.min(axis=1)).max() < 0.05
    for row, column in ((4, 4), (5, 5), (2, 4), (4, 7), (7, 7)):
        error, scale = _relative_rms(field.samples.value[row, column], direct.samples.value[row, column][nearest])
        # 3.4 % in the middle, 4.2 % at the lens's rim: what demosaicing changes at the edges of checks, and noise.
        assert error < 0.05
        # 0.4 of what was rendered was the sensor's scale.
        assert scale == pytest.approx(1.0 / 0.4, rel=0.005)
    # The view through the other side of the lens is another one.
    other, _ = _relative_rms(field.samples.value[7, 7], direct.samples.value[2, 2][nearest])
    assert other > 2.0 * error


def _relative_rms(seen, expected):
    """Of light against that which is expected, after one factor of brightness, and this factor."""
    good = np.isfinite(seen).all(axis=-1) & np.isfinite(expected).all(axis=-1)
    seen, expected = seen[good], expected[good]
    scale = (seen * expected).sum() / (seen * seen).sum()
    return float(np.sqrt(((scale * seen - expected) ** 2).mean() / (expected**2).mean())), float(scale)
