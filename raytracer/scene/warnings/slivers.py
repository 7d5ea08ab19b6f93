"""Warn of slivers: faces narrower than float32 resolves, as Embree subtracts the ray's origin from its vertices.

An edge then lies wrong by half an ulp of the distance, 3e-8 of it.  As measured with Embree 4.4, of the rays to a
triangle of width w from a distance of 1, those that meet it are 7 % too many at w = 1e-7, 30 % at 3e-8, twice as many
at 1e-8 and 14 to 19 times at 1e-9; 1 % or less from 3e-7 on.  What has a neighbour across its edges loses nothing:
that edge lies wrong by the same for both.
"""

import numpy as np
from numpy.typing import NDArray

from raytracer.core.geometry import OFFSET_ULPS
from raytracer.scene.warnings.base.kind import FLOAT32, SceneWarningKind
from raytracer.scene.warnings.base.primitive_points import edges, outline, squared, without_motion
from raytracer.scene.warnings.base.relative_sizes import UnseenLightFinder, relative_sizes
from raytracer.scene.warnings.base.survey import SceneSurvey
from raytracer.schema.warning_kind import Sentence, Warned

_MOST_SHARE = 0.01
"""Largest part of an object's area that may be too narrow."""


class Slivers(SceneWarningKind):
    """Objects of which slivers are more than a hundredth."""

    name = "slivers that float32 cannot tell"
    section = FLOAT32
    rank = 40
    narrow = Sentence(
        "{faces} as narrow as {width:.2g} m, and below {least:.2g} m, {step:.1e} of how far away the camera is, or of "
        "how far coordinates reach, float32 is too coarse for that: rays meet it too often, ten times so at a "
        "hundredth of that width; {remedy}",
        when="more than 1 % of an object's area is in faces with a free edge that are narrower than 4 * 2^-23 = "
        "4.8e-7 of the distance to the camera, or of their largest coordinate",
        remedy="make it wider, bring it nearer, or leave it out",
    )

    def find(self, survey: SceneSurvey) -> Warned:
        # The largest numbers in intersections: coordinates, or the distance to the camera, in the piece's own space.
        least = OFFSET_ULPS * survey.once(relative_sizes).scale(survey)
        unseen_lights = survey.once(UnseenLightFinder)
        # Rounding to float32 takes less than half of such a width.
        for piece in np.flatnonzero(survey.pieces.width < 2.0 * least).tolist():
            # Huge quads are cut into parts with neighbours.
            if survey.is_cut(piece) or unseen_lights.is_only_light_sampled(piece):
                continue
            count, share, width = _narrow(survey, piece, float(least[piece]))
            if share <= _MOST_SHARE:
                continue
            total = int(survey.pieces.stop[piece] - survey.pieces.start[piece])
            faces = f"{count:,} of its {total:,} faces are" if total > 1 else "is"
            text = self.narrow.fill(faces=faces, width=width, least=least[piece], step=OFFSET_ULPS)
            yield self.of_piece(survey, piece, text)


def _narrow(survey: SceneSurvey, piece: int, least: float) -> tuple[int, float, float]:
    """Count faces without neighbours narrower than `least` (m): number, part of the area, and the least width (m)."""
    table, start, stop = survey.rows_of(piece)
    table = without_motion(table)
    u, v, w = edges(outline(table, start, stop))
    area = np.sqrt(squared(np.cross(u, v)))
    longest = np.sqrt(np.maximum(np.maximum(squared(u), squared(v)), squared(w)))
    rows = np.flatnonzero((area < least * longest) & (area > 0.0))
    if len(rows) and hasattr(table, "faces"):
        rows = rows[_has_open_edge(np.asarray(table.faces[start:stop], np.int64), rows)]
    share = float(area[rows].sum() / area.sum()) if len(rows) else 0.0
    return len(rows), share, float((area[rows] / longest[rows]).min(initial=np.inf))


def _has_open_edge(faces: NDArray[np.int64], chosen: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Find the chosen triangles with an edge that no other triangle of `faces` (n, 3) has (m,)."""
    sides = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1), axis=-1)
    keys = sides[..., 0] * (int(faces.max()) + 1) + sides[..., 1]
    own = keys[chosen]
    near = keys[np.isin(faces, faces[chosen]).sum(axis=1) >= 2]
    edge, count = np.unique(near, return_counts=True)
    return np.asarray((count[np.searchsorted(edge, own)] == 1).any(axis=1))
