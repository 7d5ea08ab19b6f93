"""Warnings about implausible lenses: stops that are hidden or block light, and wrong focal lengths."""

import dataclasses
import math
import re

import pytest

from raytracer.optics.glass import AIR, constant_index_glass
from raytracer.optics.lens_system.first_order import cardinal_points
from raytracer.optics.lens_system.lens import Element, Focus, Lens
from raytracer.optics.lens_system.warnings import LENS_WARNINGS, MountedLens, lens_warnings
from raytracer.scene.assets.lenses import read_lens
from tests.optics.lens_system.test_shipped_lenses import SHIPPED


def singlet(stop):
    """Flat glass of index 1.5 and a radius of 50 mm, so that f = 100 mm, of diameter 25; 10 mm behind it a stop."""
    glass = (Element(0.0, 5.0, constant_index_glass(1.5), 12.5, "flat"), Element(-0.02, 10.0, AIR, 12.5))
    return Lens("singlet", (*glass, Element(0.0, 0.0, AIR, 0.5 * stop, "stop", is_stop=True)), f_number=4.0)


def test_shipped_lenses_have_none():
    assert {name: found for name, path in SHIPPED.items() if (found := lens_warnings(read_lens(path)))} == {}


def test_a_stop_that_a_rim_hides_is_told():
    # By Snell's law, light 12.5 mm from the axis is this wide 10 mm behind the vertex that it leaves by.
    bent = math.asin(1.5 * 0.25) - math.asin(0.25)
    width = 25.0 - 2.0 * (10.0 + 50.0 - math.sqrt(50.0**2 - 12.5**2)) * math.tan(bent)
    (doubt,) = lens_warnings(singlet(50.0))
    assert doubt.startswith("its stop, surface 3, is hidden: the rim of surface 1 leaves light of the axis ")
    share, f_number = map(float, re.findall(r"(\d+) %.* f/([\d.]+)$", doubt)[0])
    assert share == pytest.approx(100.0 * width / 50.0, abs=0.5)
    assert f_number == 4.0
    # A third of a stop is a factor of 1.12 of the diameter.
    assert lens_warnings(singlet(1.12 * width)) == []
    assert len(lens_warnings(singlet(1.13 * width))) == 1


def test_a_stop_that_blocks_light_is_told():
    assert lens_warnings(singlet(21.0)) == []
    (doubt,) = lens_warnings(singlet(2.25))
    assert doubt == "its stop, surface 3, blocks light: it opens to f/40, and f/4 is published"
    assert lens_warnings(dataclasses.replace(singlet(2.25), f_number=None)) == []


def test_a_focal_length_that_is_not_the_published_one_is_told():
    lens = dataclasses.replace(singlet(21.0), focal_length=110.0)
    assert lens_warnings(lens) == []
    assert lens_warnings(dataclasses.replace(lens, focal_length=200.0)) == [
        "its focal length is 100 mm, and 200 mm are published"
    ]


def test_what_is_published_is_of_the_lens_at_infinity():
    # Two singlets of 100 mm, 60 mm apart, and 80 mm where the front one has moved to what is near: f = 71 and 83 mm.
    front = singlet(21.0).elements[:2]
    rear = (Element(0.0, 5.0, constant_index_glass(1.5), 12.5, "flat"), Element(-0.02, 2.0, AIR, 12.5))
    spaced = (front[0], front[1]._replace(thickness=60.0), *rear, singlet(5.0).elements[2])
    pair = Lens("pair", spaced, focus=Focus("group", 1, 2))
    pair = dataclasses.replace(pair, focal_length=cardinal_points(pair.packed()).focal_length)
    assert list(LENS_WARNINGS.find(MountedLens(pair, 20.0))) == lens_warnings(pair) == []
    assert any("are published" in doubt for doubt in lens_warnings(pair.focused(20.0)))
