"""Pictures of small cameras, and what is measured on them.

A *spot* is a disc that shines, faces the camera, and lies across its axis.  Of it, seen through a thin lens without
exposure, a picture is exactly the spot's image, spread by the circle of confusion, and averaged over each pixel: the
convolution of three shapes, whose second moments add up.  So the circle's diameter C follows from the spread of what
is measured, without any threshold: a disc of the diameter C has the moment <x^2> = C^2 / 16 along each axis, a pixel,
1 / 12.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.rendering.render import render
from tests.small_scenes import scene

Array = NDArray[np.float64]

LOOK = "look_from: [0, 0, 0], look_at: [0, 0, -1]"
"""A camera at the origin that looks along -z, so that depths are distances along -z."""


def shot(camera, rest, *, crop=None, **settings):
    """A scene as this camera sees it, with camera rays only, rendered with Sobol's numbers by two threads.

    camera : keys besides where it stands, which is `LOOK`.
    """
    text = f"camera: {{{LOOK}, {camera}}}\n{rest}"
    spec = scene(text, **{"max_depth": 1, "sampler": "sobol", "filled": False, **settings})
    result = render(spec, crop=crop, threads=2, seed=1)
    assert result.stats.nan_samples == 0
    return result


def pixels(camera, rest, **settings):
    """The green of such a picture, (height, width); what shines here is white."""
    return np.asarray(shot(camera, rest, **settings).image.radiance[..., 1])


def spot(x, y, depth, radius, more=""):
    """A disc of radiance 1 that faces the camera at a depth along its axis, as the objects of a scene (m)."""
    return (
        f"objects:\n  - {{type: disc, center: [{x!r}, {y!r}, {-depth!r}], normal: [0, 0, 1], radius: {radius!r}, "
        f"material: {{type: emitter, radiance: 1}}{more}}}\n"
    )


class Moments(NamedTuple):
    """Of a picture: its sum, its middle (x, y) and its variances along x and y, in pixels from the top left corner."""

    total: float
    x: float
    y: float
    variance_x: float
    variance_y: float


def moments(picture):
    """Moments of a picture (height, width), each pixel's content taken to be in its middle."""
    rows, columns = np.mgrid[0 : picture.shape[0], 0 : picture.shape[1]] + 0.5
    total = picture.sum()
    x, y = (picture * columns).sum() / total, (picture * rows).sum() / total
    return Moments(
        float(total),
        float(x),
        float(y),
        float((picture * (columns - x) ** 2).sum() / total),
        float((picture * (rows - y) ** 2).sum() / total),
    )


def blur_px(picture, radius):
    """Diameter (px) of the circle of confusion in the picture of a spot, whose own image has this radius (px)."""
    found = moments(picture)
    # What is cut off at the edge of the film would be missing in the moments.
    edge = np.concatenate([picture[0], picture[-1], picture[:, 0], picture[:, -1]])
    assert not edge.any(), "the spot does not fit on the film"
    spread = found.variance_x + found.variance_y - radius * radius / 2.0 - 1.0 / 6.0
    return math.sqrt(8.0 * max(0.0, spread))
