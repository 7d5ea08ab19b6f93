"""What is far from the origin."""

from unittest.mock import patch

import numpy as np
from scipy.stats import norm

from raytracer.analysis.compare import z_test
from raytracer.core.geometry import OFFSET_ULPS
from raytracer.core.world_origin import Origin
from raytracer.scene.load import load
from raytracer.scene.pack.scene import pack
from tests.hard_cases.harness import ROUNDING, SCENES, hard_case
from tests.hard_cases.spheres import true_distance
from tests.moving import checked, document, moved, pictured
from tests.plugins.shapes.kernels import cast, unit

_ODDS = 1e-4
"""With which noise alone may be called an error."""

_RELATIVE = "Cozzi, Ring 2011, 3D Engine Design for Virtual Globes, sec. 5.2-5.4 (relative to centre); pbrt-v4 sec. 6.8"


def _unmoved(spec):
    """Pack a scene where it was written; its type is that of a scene that is moved."""
    stay = Origin((0.0, 0.0, 0.0), None)
    with patch("raytracer.scene.pack.world.shift_origin", lambda spec, layout, assets: (layout, stay)):
        return pack(spec)


def _first_hits(packed, written, origins, directions, *, exact):
    """Measure the errors (n,) of a packed scene's hits, for rays (n, 3) of the scene as written."""
    (table,) = packed.scene.primitives
    assert len(written) == len(table.radius)
    truth = np.array([true_distance(origins, directions, item.center, item.radius) for item in written])
    hits = cast((table,), origins + packed.shift, directions, exact=exact)
    reached = np.linalg.norm(hits.point - (origins + packed.shift), axis=1) if exact else hits.near
    own = truth[hits.primitive, np.arange(len(origins))]
    return np.abs(np.where(hits.table < 0, np.inf, reached) - own)


@hard_case(16, _RELATIVE, "far_from_origin", quick=96, thorough=4096)
def far_from_origin(samples):
    """A still life a million metres from the origin in each direction, against the same at the origin.

    Packed where it was written, its balls of 0.05 to 0.5 m are put on a grid of 0.0625 m, and spawned rays leave by
    0.48 m, over the balls.  Moved in float64 first, which rounds nothing, hits are good to eight roundings of the way
    plus twice the ground's radius, over the cosine, which is 0.2 where the ground is farthest; rays leave by four ulp
    of the ground's extent; and the picture's tiles differ by noise alone.
    """
    path = SCENES / "16_far_from_origin.yaml"
    # By the sampler that the pictures are taken with, or their kernel would be compiled for another one, too.
    spec = load(path, {"render.sampler": "independent"})
    both = _, ours = _unmoved(spec), pack(spec)
    at_origin = _unmoved(checked(moved(document(path), (-1e6, 1e6, -1e6)), SCENES, render={"sampler": "independent"}))

    # Rays from the camera, to each ball and to the ground.
    rng = np.random.default_rng(16)
    aims = [np.array(ball.center) + 0.5 * ball.radius * unit(rng.normal(size=(64, 3))) for ball in spec.objects[1:]]
    ground = np.array([1e6, -1e6, 1e6]) + rng.uniform(-2.0, 2.0, (64, 3)) * [1.0, 0.0, 1.0]
    aims = np.concatenate([*aims, ground])
    origins = np.broadcast_to(spec.camera.look_from, aims.shape)
    directions = unit(aims - origins)
    first, exact = (_first_hits(some, spec.objects, origins, directions, exact=some is ours) for some in both)
    yield "first hits off, of 8 things (m)", np.nanmax(first), exact, 8.0 * ROUNDING * (2.0 * 1000.0 + 10.0) / 0.2
    leave = (cast(some.scene.primitives, origins + some.shift, directions).offset.max() for some in both)
    yield "what rays leave the surface by (m)", *leave, OFFSET_ULPS * 2020.0

    here = pictured(at_origin, spp=samples, seed=1)
    z = []
    for some in both:
        there = pictured(some, spp=samples, seed=2)
        z.append(z_test(there.radiance, there.variance, here.radiance, here.variance).tile_z)
    yield "largest z of a tile, against the scene at the origin", *z, norm.isf(0.5 * _ODDS / z[0].size)
