"""Sizes of objects relative to their distances, on which the precision of float32 hits depends."""

from typing import NamedTuple

import numpy as np

from raytracer.scene.warnings.base.primitive_points import Points
from raytracer.scene.warnings.base.survey import SceneSurvey

MAX_DISTANCE_IN_RADII = 1e5
"""Largest distance of an object in its radii: at 1e6, Embree misses 15 % of the rays at 0.99 of a sphere's radius."""


class RelativeSizes(NamedTuple):
    """Largest coordinates and camera distances of pieces, or of their worst instances, relative to their radii.

    reach, distance : (n,), in radii.
    extent (m) : its own radius in the scene.
    flat : factor by which its instance makes it thinner in one direction than in another.
    """

    reach: Points
    distance: Points
    extent: Points
    flat: Points

    def scale(self, survey: SceneSurvey) -> Points:
        """Find the largest numbers (n,) at play where rays meet each piece, in its own space (m)."""
        return np.asarray(np.maximum(self.reach, self.distance) * survey.pieces.half)


def relative_sizes(survey: SceneSurvey) -> RelativeSizes:
    """Compare the coordinates and camera distances of all pieces with their radii."""
    pieces, camera = survey.pieces, survey.camera
    half = np.maximum(pieces.half, np.finfo(float).tiny)
    away = np.maximum(0.0, np.linalg.norm(pieces.middle - camera, axis=1) - half)
    result = RelativeSizes(pieces.reach / half, away / half, pieces.half.copy(), np.ones(len(half)))
    instances = survey.packed.scene.instances
    for group in np.unique(pieces.group[pieces.group >= 0]).tolist():
        assert instances is not None
        shown, of = np.flatnonzero(instances.group == group), np.flatnonzero(pieces.group == group)
        if not len(shown):
            continue
        pose, scale = survey.poses[shown], survey.scales[shown]
        low, high = pieces.low[of].min(axis=0), pieces.high[of].max(axis=0)
        middle = pose[:, :3, :3] @ (low + 0.5 * (high - low)) + pose[:, :3, 3]
        radius = scale * 0.5 * float(np.linalg.norm(high - low))
        # Rays are intersected in the group's space, where flattening by a factor moves the camera away by that factor.
        own = np.linalg.solve(pose[:, :3, :3], (camera - middle)[:, :, None])[:, :, 0]
        away = np.maximum(0.0, np.linalg.norm(own, axis=1) - radius / scale)
        # The nearest copy is seen best; the one farthest out has the worst coordinates.
        nearest = int(np.argmin(away))
        result.distance[of] = away[nearest] / half[of]
        result.flat[of] = np.linalg.cond(pose[nearest, :3, :3])
        out = (np.abs(middle).max(axis=1) / scale).max() / half[of]
        result.reach[of] = np.maximum(result.reach[of], out)
        result.extent[of] = pieces.half[of] * scale.max()
    return result
