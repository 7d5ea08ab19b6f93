"""Warn of objects on grounds so large that rays leave these above the objects."""

from raytracer.core.geometry import OFFSET_ULPS
from raytracer.scene.warnings.base.kind import FLOAT32, SceneWarningKind
from raytracer.scene.warnings.base.relative_sizes import sunk_objects
from raytracer.scene.warnings.base.survey import SceneSurvey
from raytracer.schema.warning_kind import Sentence, Warned


class SunkObjects(SceneWarningKind):
    """Objects that cast no shadow on what they lie on."""

    name = "objects that drown in what they lie on"
    section = FLOAT32
    rank = 60
    sunk = Sentence(
        "is {size:.3g} m large and lies on {ground}, which rays leave {offset:.2g} m off its surface because its "
        "coordinates reach {reach:.3g} m there: nothing that is lower casts a shadow on it; {remedy}",
        when="the radius of an object is less than 10^-5 of the largest coordinate of what it lies on, so that "
        "light leaks under it",
        remedy="make that one smaller, or split it",
        advice="a ground no larger than what is visible, or several objects instead",
    )

    def find(self, survey: SceneSurvey) -> Warned:
        for sunk in survey.once(sunk_objects):
            size, offset = 2.0 * sunk.radius, OFFSET_ULPS * sunk.reach
            text = self.sunk.fill(size=size, ground=survey.name_of(sunk.ground), offset=offset, reach=sunk.reach)
            yield self.of_piece(survey, sunk.piece, text)
