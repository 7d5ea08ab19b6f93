"""A room and a plain wall, of the type that most small scenes share, and the comparison of two renders of it."""

import numpy as np

from tests.small_scenes import scene

# The left half is a wall under an even sky, without any noise.  The right one looks into a room, where a lamp behind a
# screen lights walls that light each other.
HALVES = """
camera: {type: pinhole, look_from: [0, 0, 4], look_at: [0, 0, 0], vfov: 40}
environment: {type: constant, radiance: 0.1}
objects:
  - {type: quad, corner: [-3, -3, 0], edges: [[3, 0, 0], [0, 6, 0]], material: {type: lambertian, albedo: 0.8}}
  - {type: quad, corner: [0, -3, -1.5], edges: [[4, 0, 0], [0, 6, 0]], material: {type: lambertian, albedo: 0.8}}
  - {type: quad, corner: [0, -3, -1.5], edges: [[0, 6, 0], [0, 0, 1.5]], material: {type: lambertian, albedo: 0.8}}
  - {type: quad, corner: [1.2, 0.1, -0.4], edges: [[1, 0, 0], [0, 1, 0]], material: {type: lambertian, albedo: 0.5}}
  - {type: sphere, center: [1.7, 0.6, -0.7], radius: 0.1, material: {type: emitter, radiance: 80}}
  - {type: sphere, name: ball, center: [0.8, -0.4, -0.7], radius: 0.3, material: {type: lambertian, albedo: 0.8}}
"""

WIDTH, HEIGHT, SPP = 44, 36, 37
"""A size that tiles of 16 cut into unequal ones, and samples that are no whole packets."""


def halves(text=HALVES, **settings):
    return scene(text, lit=True, **{"width": WIDTH, "height": HEIGHT, "spp": SPP, "max_depth": 4, **settings})


def assert_same_samples(a, b):
    """Check that radiance and variance are bit-identical, and as many rays were traced."""
    np.testing.assert_array_equal(a.image.radiance, b.image.radiance)
    np.testing.assert_array_equal(a.image.variance, b.image.variance)
    assert a.stats.rays == b.stats.rays


def assert_same(a, b):
    """Check that all else that pictures and their files hold is the same too, and so are their statistics."""
    assert_same_samples(a, b)
    assert a.image.layers.keys() == b.image.layers.keys()
    for name, layer in a.image.layers.items():
        np.testing.assert_array_equal(layer, b.image.layers[name])
    assert a.image.settings == b.image.settings
    assert a.complete == b.complete
    for name in ("samples", "pilot_samples", "error"):
        assert getattr(a.stats, name) == getattr(b.stats, name), name
