"""Render the targets of docs/depth_of_field.yaml for the page of depth of field, into docs/gallery: `make gallery`."""

import math
import sys
from pathlib import Path

import numpy as np
from PIL import Image

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

from docs.make_pages import STRIP_APERTURES, STRIP_FOCUSES, STRIPS  # noqa: E402
from raytracer.rendering.render import render  # noqa: E402
from raytracer.scene.load import load  # noqa: E402

QUALITY = 70
"""Of the WebP file, so that it has less than 300 KB."""


def main() -> None:
    """Render a strip for each aperture and focus, one below the other."""
    strips = []
    for aperture in STRIP_APERTURES:
        for focus in STRIP_FOCUSES:
            keys = {"camera.aperture": aperture, "camera.focus_distance": 1.0 / focus if focus else math.inf}
            strips.append(render(load(ROOT / "docs" / "depth_of_field.yaml", keys)).image.display())
    Image.fromarray(np.concatenate(strips)).save(STRIPS, quality=QUALITY, method=6)


if __name__ == "__main__":
    main()
