"""Warn of cameras at positions where they see nothing."""

import numpy as np

from raytracer.core.geometry import OFFSET_ULPS
from raytracer.core.primitives.spheres import Spheres
from raytracer.scene.warnings.base.kind import LIGHTS_AND_CAMERAS, SceneWarningKind
from raytracer.scene.warnings.base.primitive_points import coordinate_extents, normals, outline, without_motion
from raytracer.scene.warnings.base.relative_sizes import MOST_REACH
from raytracer.scene.warnings.base.survey import SceneSurvey
from raytracer.schema.warning_kind import Sentence, Warned

# Most faces of an object that are examined one by one.
_MOST_FACES = 10_000


class CameraPosition(SceneWarningKind):
    """Cameras on a surface, or inside of an opaque object."""

    name = "cameras without a view"
    section = LIGHTS_AND_CAMERAS
    rank = 140
    inside = Sentence(
        "is inside {object}, which is opaque and holds no light, so the picture will be black",
        when="the camera is inside an opaque sphere or box, and no light is",
        remedy="move it out",
        advice="a room needs a lamp inside",
    )
    on = Sentence(
        "lies on the surface of {object}, to within {offset:.2g} m, so which side it sees is left to rounding: "
        "{remedy}",
        when="the camera is on a surface, to within the offset of the rays that leave it",
        remedy="move it by more than that",
    )

    def find(self, survey: SceneSurvey) -> Warned:
        pieces, camera = survey.pieces, survey.camera
        slack = MOST_REACH * OFFSET_ULPS * pieces.reach[:, None]
        near = ((camera >= pieces.low - slack) & (camera <= pieces.high + slack)).all(axis=1)
        single = (pieces.group < 0) & (pieces.stop - pieces.start <= _MOST_FACES)
        for piece in np.flatnonzero(single & near).tolist():
            offset = _offset_there(survey, *survey.rows_of(piece))
            if offset is not None:
                text = self.on.fill(object=survey.name_of(piece), offset=offset)
            elif _is_inside_opaque(survey, piece):
                text = self.inside.fill(object=survey.name_of(piece))
            else:
                continue
            yield self.of_keys(survey, ("camera", "look_from"), text)


def _offset_there(survey: SceneSurvey, table: object, start: int, stop: int) -> float | None:
    """Compute the ray offset (m) of the surface that the camera lies on, to within that offset; None if on none."""
    base = without_motion(table)
    offset = OFFSET_ULPS * coordinate_extents(table, start, stop)
    if isinstance(base, Spheres):
        away = float(np.linalg.norm(survey.camera - base.center[start]))
        height = abs(away - abs(float(base.radius[start])))
        return float(offset[0]) if height <= offset[0] else None
    faces = outline(table, start, stop)
    normal = normals(faces)
    to = survey.camera - faces
    height = np.abs(np.einsum("nki,ni->nk", to, normal)).max(axis=1)
    # Inside of a convex face, the point is to the left of all of its edges.
    edges = np.roll(faces, -1, axis=1) - faces
    left = np.einsum("nki,ni->nk", np.cross(edges, to), normal)
    on = (height <= offset) & (left >= 0.0).all(axis=1)
    return float(offset[on].max()) if on.any() else None


def _is_inside_opaque(survey: SceneSurvey, piece: int) -> bool:
    """Return True if the camera is inside of a closed opaque object without a light in it."""
    look = survey.material_of(piece)
    if look is None or look.admits_light() or look.is_emissive():
        return False
    low, high = survey.boxes
    middles = low + 0.5 * (high - low)
    emitting = np.array(
        [(material := survey.material_of(other)) is None or material.is_emissive() for other in range(len(low))]
    )
    places = [light.position for light in survey.spec.lights if hasattr(light, "position")]
    # A flash without a position is at the camera.
    lit = [survey.camera if place is None else np.subtract(place, survey.shift) for place in places]
    points = np.concatenate([survey.camera[None], middles[emitting], np.reshape(lit, (-1, 3))])
    inside = survey.contains(piece, points)
    return bool(inside[0]) and not inside[1:].any()
