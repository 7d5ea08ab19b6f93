"""What figures and numbers of the lecture say is what the program computes."""

import numpy as np
import pytest
from PIL import Image

from docs.diagrams import shutter
from docs.gallery_sheets import LECTURE
from raytracer.core.shutter.table import line_exposure
from raytracer.scene.load import load
from tests.repository import ROOT, SCENES

PAGES = {path.stem[:2]: path.read_text(encoding="utf-8") for path in (ROOT / "docs" / "lecture").glob("[01]*.md")}
GALLERY = ROOT / "docs" / "gallery"


def shown(name: str) -> np.ndarray:
    """A picture of the gallery, 0 to 255."""
    with Image.open(GALLERY / f"{name}.jpg") as picture:
        return np.asarray(picture, float)


# ---- The slit of a focal plane shutter


@pytest.mark.parametrize("seconds", shutter.TIMES.values())
def test_the_slit_uncovers_the_lines_that_are_exposed(seconds: float) -> None:
    packed = shutter.focal_plane(seconds)
    whole = packed.close - packed.open
    for time in np.linspace(0.01, 0.99, 12) * whole:
        begin, end = shutter.uncovered(seconds, time)
        for place in np.linspace(0.03, 0.97, 23):
            opens, width = (part * whole for part in line_exposure(packed.scan, 0.0, place * packed.scan.lines))
            assert (begin < place < end) == (opens < time < opens + width)
    # The width that the page derives, at a moment when the slit is whole.
    begin, end = shutter.uncovered(seconds, 0.5 * whole)
    assert end - begin == pytest.approx(min(1.0, seconds / shutter.TRAVEL))


def test_a_flash_shows_the_slit_where_it_is() -> None:
    wanted = [(0.0, 0.25), (0.25, 0.5), (0.5, 0.75), (0.75, 1.0), (0.375, 0.5), (0.0, 1.0)]
    picture, sheet = shown("lecture_slit"), LECTURE["slit"]
    for number, (variant, band) in enumerate(zip(sheet.variants, wanted, strict=True)):
        spec = load(SCENES / "lecture" / "frozen_drop.yaml", dict(variant.keys))
        timing = spec.camera.shutter.timing(0.0)
        begin, end = (moment for moment in spec.lights[0].pulse(timing))
        seconds = timing.seconds()
        assert shutter.uncovered(seconds, begin) == pytest.approx(band)
        assert end - begin < 0.02 * shutter.TRAVEL
        # The panel of the sheet is black elsewhere.
        left, top = 406 * (number % 3), 297 * (number // 3)
        lit = picture[top + 2 : top + 265, left + 5 : left + 395].mean(axis=(1, 2)) > 30.0
        assert lit.mean() == pytest.approx(band[1] - band[0], abs=0.03)
        assert np.flatnonzero(lit).mean() / len(lit) == pytest.approx(np.mean(band), abs=0.02)
