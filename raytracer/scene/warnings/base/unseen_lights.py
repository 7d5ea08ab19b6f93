"""Find lights that only next-event estimation reaches: the accuracy of float32 hits does not matter for them."""

import math

import numpy as np

from raytracer.plugins.cameras.base.interface import project
from raytracer.plugins.lights.base.interface import Lights
from raytracer.scene.warnings.base.primitive_points import Points, without_motion
from raytracer.scene.warnings.base.survey import SceneSurvey

_MOST_COPIES = 256
"""Most instances of a light that are examined; one with more counts as seen."""

_TIMES = (0.0, 0.5, 1.0)
"""Fractions of the exposure at which a camera that moves is asked what it sees."""


class UnseenLightFinder:
    """Finder of lights that only next-event estimation reaches: neither camera rays nor mirrors show them.

    Other rays that hit them weigh next to nothing in MIS: next-event estimation samples a light that is small in the
    sky with a far higher density than any rough surface scatters with.

    References: Veach 1997, thesis, eq. 9.8 (the balance heuristic).
    """

    def __init__(self, survey: SceneSurvey) -> None:
        self._survey = survey
        lights = survey.packed.scene.lights
        self._is_all = isinstance(lights, Lights) and not any(
            look.has_delta_bsdf() for look in survey.packed.resolved_materials.values()
        )

    def is_only_light_sampled(self, piece: int) -> bool:
        """Tell if a piece is a light that next-event estimation samples, and that is seen in no other way."""
        survey = self._survey
        if not self._is_all:
            return False
        look, table = survey.material_of(piece), survey.tables[survey.pieces.table[piece]]
        if look is None or not look.is_emissive() or look.has_non_delta_bsdf() or without_motion(table) is not table:
            return False
        places = _places(survey, piece)
        return len(places) <= _MOST_COPIES and not any(self._is_seen(place) for place in places)

    def _is_seen(self, place: Points) -> bool:
        """Tell if the camera may see what is at a place (3,): it stands before it, and not far beside the picture."""
        film = self._survey.spec.film
        for time in _TIMES:
            x, y, depth = project(self._survey.packed.scene.camera, tuple(map(float, place)), time)
            if math.isnan(x + y):
                if depth > 0.0:
                    return True
            elif abs(x / film.width - 0.5) < 1.0 and abs(y / film.height - 0.5) < 1.0:
                # What is out of focus shows half a picture beside its place, at most.
                return True
        return False


def _places(survey: SceneSurvey, piece: int) -> Points:
    """List the middles (n, 3) of a piece in the packed scene."""
    middle = survey.pieces.middle[piece]
    if survey.pieces.group[piece] < 0:
        return np.asarray(middle[None])
    pose = survey.poses[survey.placed(piece)]
    return np.asarray(pose[:, :3, :3] @ middle + pose[:, :3, 3])
