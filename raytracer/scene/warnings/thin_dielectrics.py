"""Warn of transmissive boxes thinner than the ray offset, behind which rays from their surfaces begin."""

import numpy as np

from raytracer.core.geometry import OFFSET_ULPS
from raytracer.scene.warnings.base.kind import FLOAT32, SceneWarningKind
from raytracer.scene.warnings.base.primitive_points import coordinate_extents, is_flat, normals, outline
from raytracer.scene.warnings.base.relative_sizes import MOST_FACES, MOST_REACH
from raytracer.scene.warnings.base.survey import SceneSurvey
from raytracer.schema.warning_kind import Sentence, Warned


class ThinDielectrics(SceneWarningKind):
    """Boxes in which rays do not know what they are in."""

    name = "clear things thinner than the offset of rays"
    section = FLOAT32
    rank = 50
    thin = Sentence(
        "is {thickness:.2g} m thick, light goes into it, and rays leave its faces {offset:.2g} m off them because its "
        "coordinates reach so far: they begin behind it, and so do not know what they are in; {remedy}",
        when="a box of glass, of a cutout or around a medium is thinner than twice the offset of the rays that "
        "enter it",
        remedy="make it thicker or smaller, or use a quad of a `thin_dielectric`",
    )

    def find(self, survey: SceneSurvey) -> Warned:
        pieces = survey.pieces
        # The sides of thin boxes are narrow.
        for piece in np.flatnonzero(pieces.width < 4.0 * OFFSET_ULPS * MOST_REACH * pieces.reach).tolist():
            look, (table, start, stop) = survey.material_of(piece), survey.rows_of(piece)
            if look is None or not look.admits_light() or stop - start > MOST_FACES:
                continue
            # A single face has no inside; round objects are as thick as they are wide.
            if not survey.is_solid(piece) or survey.spec_of(piece).faces is None or not is_flat(table):
                continue
            faces = outline(table, start, stop)
            thickness = float(np.ptp(faces.reshape(-1, 3) @ normals(faces).T, axis=0).min())
            offset = OFFSET_ULPS * float(coordinate_extents(table, start, stop).max())
            if thickness < 2.0 * offset:
                yield self.of_piece(survey, piece, self.thin.fill(thickness=thickness, offset=offset))
