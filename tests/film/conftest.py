"""Fixtures of the film: a picture to write."""

import numpy as np
import pytest

from raytracer.film import Image

SETTINGS = {"scene": "Köln, 東京", "spp": 64, "seed": 2**63, "f_number": 0.1}


@pytest.fixture
def image() -> Image:
    rng = np.random.default_rng(7)
    return Image(rng.random((6, 9, 3)) * 1.2, rng.random((6, 9, 3)), 64, SETTINGS)
