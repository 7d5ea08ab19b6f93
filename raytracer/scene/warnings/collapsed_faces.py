"""Warn of faces that have no area once their corners are rounded to float32."""

import numpy as np

from raytracer.scene.warnings.base.kind import FLOAT32, SceneWarningKind
from raytracer.scene.warnings.base.survey import SceneSurvey
from raytracer.schema.warning_kind import Sentence, Warned


class CollapsedFaces(SceneWarningKind):
    """Faces that no ray can hit where they are."""

    name = "faces that float32 cannot hold"
    section = FLOAT32
    rank = 20
    collapsed = Sentence(
        "{faces} no area once its coordinates are rounded to float32, in which rays are cast, so no ray can hit "
        "{them}: {remedy}",
        when="faces are so small, for their distance from the origin, that their corners coincide or fall on a line",
        remedy="make the object larger, or place it nearer to {origin}",
    )

    def find(self, survey: SceneSurvey) -> Warned:
        pieces = survey.pieces
        for piece in np.flatnonzero(pieces.empty).tolist():
            count, total = int(pieces.empty[piece]), int(pieces.stop[piece] - pieces.start[piece])
            faces, them = (f"{count:,} of its {total:,} faces have", "them") if total > 1 else ("it has", "it")
            text = self.collapsed.fill(faces=faces, them=them, origin=survey.origin_text())
            yield self.of_piece(survey, piece, text)
