"""Lamps that only next-event estimation finds, for which it is no matter how well float32 hits them."""

import math

import numpy as np

from raytracer.cameras.interface import project
from raytracer.lights.interface import Lights
from raytracer.scene.concerns.outlines import Points, resting
from raytracer.scene.concerns.survey import Survey

_MOST_COPIES = 256
"""Places of a lamp that are looked at; one that is in more counts as seen."""

_TIMES = (0.0, 0.5, 1.0)
"""Fractions of the exposure at which a camera that moves is asked what it sees."""


class Aiming:
    """Finds the lamps of a scene that are only aimed at: neither the camera's rays show them, nor those from a mirror.

    What else meets them by chance counts for next to nothing: a lamp that is small in the sky is aimed at with a far
    higher density than any rough surface scatters with.

    References: Veach 1997, thesis, eq. 9.8 (the balance heuristic).
    """

    def __init__(self, survey: Survey) -> None:
        self._survey = survey
        lights = survey.packed.scene.lights
        self._is_all = isinstance(lights, Lights) and not any(look.mirrors() for look in survey.packed.looks.values())

    def is_only_aimed_at(self, piece: int) -> bool:
        """Tell if a piece is a lamp that is aimed at, and seen in no other way."""
        survey = self._survey
        if not self._is_all:
            return False
        look, table = survey.look_of(piece), survey.tables[survey.pieces.table[piece]]
        if look is None or not look.emits() or look.is_lit() or resting(table) is not table:
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


def _places(survey: Survey, piece: int) -> Points:
    """List the middles (n, 3) of a piece in the packed scene."""
    middle = survey.pieces.middle[piece]
    if survey.pieces.group[piece] < 0:
        return np.asarray(middle[None])
    pose = survey.poses[survey.placed(piece)]
    return np.asarray(pose[:, :3, :3] @ middle + pose[:, :3, 3])
