"""Warn of scenes whose largest object is too large for the smallest."""

import numpy as np

from raytracer.scene.warnings.base.kind import FLOAT32, SceneWarningKind
from raytracer.scene.warnings.base.relative_sizes import UnseenLightFinder, relative_sizes, sunk_objects
from raytracer.scene.warnings.base.survey import SceneSurvey
from raytracer.schema.warning_kind import Sentence, Warned

MAX_SIZE_RATIO = 1e6
"""Largest ratio of the sizes of two objects: float32 has 2^24 = 1.7e7 steps."""


class SizeRatio(SceneWarningKind):
    """Sizes that float32 cannot hold side by side; objects that sink into their ground say so themselves."""

    name = "sizes that are too far apart"
    section = FLOAT32
    rank = 70
    apart = Sentence(
        "is {small:.3g} m large, and {largest} {large:.3g} m, {ratio:.2g} times as much: beyond {limit:.0e} float32 "
        "cannot hold both, and rays from far away miss what is small; {remedy}",
        when="the largest object is more than 10^6 times as large as the smallest",
        remedy="make skies of an `environment` or a `sun`, and grounds no larger than is seen",
    )

    def find(self, survey: SceneSurvey) -> Warned:
        if survey.once(sunk_objects):
            return
        extent = survey.once(relative_sizes).extent
        # Subdivided objects do not count as large.
        whole = np.array([0.0 if survey.is_cut(piece) else size for piece, size in enumerate(extent.tolist())])
        small, large = int(np.argmin(extent)), int(np.argmax(whole))
        if whole[large] > MAX_SIZE_RATIO * extent[small]:
            # Lights are examined only if the ratio is too large.
            unseen_lights = survey.once(UnseenLightFinder)
            aimed = np.array([unseen_lights.is_only_light_sampled(piece) for piece in range(len(extent))])
            small, large = int(np.argmin(np.where(aimed, np.inf, extent))), int(np.argmax(np.where(aimed, 0.0, whole)))
        ratio = float(whole[large] / max(extent[small], np.finfo(float).tiny))
        if ratio > MAX_SIZE_RATIO:
            sizes = {"small": 2.0 * extent[small], "large": 2.0 * extent[large], "ratio": ratio}
            text = self.apart.fill(**sizes, largest=survey.name_of(large), limit=MAX_SIZE_RATIO)
            yield self.of_piece(survey, small, text)
