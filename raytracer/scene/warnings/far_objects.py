"""Warn of objects too far away for their size, from the origin or from the camera."""

import numpy as np

from raytracer.scene.warnings.base.kind import FLOAT32, SceneWarningKind
from raytracer.scene.warnings.base.relative_sizes import MAX_DISTANCE_IN_RADII, UnseenLightFinder, relative_sizes
from raytracer.scene.warnings.base.survey import SceneSurvey
from raytracer.schema.warning_kind import Sentence, Warned

# Flattening from which on a message mentions it.
_FLAT = 10.0


class FarObjects(SceneWarningKind):
    """Objects that rays begin to miss at their rims."""

    name = "objects too far away for their size"
    section = FLOAT32
    rank = 30
    far = Sentence(
        "is {times:.2g} of its radii ({radius:.3g} m) away from {place}, and beyond {limit:.0e} float32 is too coarse "
        "to hit it well: {remedy}",
        when="an object is more than 10^5 times its radius away from the camera, or from the middle of the scene: "
        "rays begin to miss its rim, at 10^6 15 % of those at 0.99 of the radius",
        remedy="make it larger, bring it nearer, or leave it out",
        advice="seen through most lenses it is a fraction of a pixel",
    )

    def find(self, survey: SceneSurvey) -> Warned:
        seen, unseen_lights = survey.once(relative_sizes), survey.once(UnseenLightFinder)
        for piece in np.flatnonzero(
            (seen.reach > MAX_DISTANCE_IN_RADII) | (seen.distance > MAX_DISTANCE_IN_RADII)
        ).tolist():
            if unseen_lights.is_only_light_sampled(piece):
                continue
            place, times = survey.origin_text(), float(seen.reach[piece])
            if seen.distance[piece] > MAX_DISTANCE_IN_RADII:
                place, times = "the camera", float(seen.distance[piece])
                if seen.flat[piece] > _FLAT:
                    place += f", as seen where its transform has not made it {seen.flat[piece]:.2g} times thinner"
            radius = float(seen.extent[piece])
            text = self.far.fill(times=times, radius=radius, place=place, limit=MAX_DISTANCE_IN_RADII)
            yield self.of_piece(survey, piece, text)
