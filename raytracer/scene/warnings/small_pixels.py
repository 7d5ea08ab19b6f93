"""Warn of cameras whose pixels are smaller than float32 tells directions."""

from raytracer.core.geometry import OFFSET_ULPS
from raytracer.plugins.cameras.base.interface import camera_defocus
from raytracer.plugins.cameras.base.moving import MovingCamera
from raytracer.scene.warnings.base.kind import FLOAT32, SceneWarningKind
from raytracer.scene.warnings.base.survey import SceneSurvey
from raytracer.schema.warning_kind import Sentence, Warned


class SmallPixels(SceneWarningKind):
    """Pixels that see edges beside their place."""

    name = "pixels too small for float32"
    section = FLOAT32
    rank = 130
    small = Sentence(
        "a pixel is {width:.2g} wide at a distance of 1, and edges are only met to {step:.1e} of how far away they "
        "are: {remedy}",
        when="the field of view is so narrow that a pixel is smaller than the precision of directions in float32, "
        "so edges are displaced by a quarter of a pixel or more",
        remedy="bring the camera nearer and let it see more",
    )

    def find(self, survey: SceneSurvey) -> Warned:
        camera = survey.packed.scene.camera
        defocus = camera_defocus(camera.camera if isinstance(camera, MovingCamera) else camera)
        if defocus is not None and defocus.pixel < OFFSET_ULPS:
            text = self.small.fill(width=defocus.pixel, step=OFFSET_ULPS)
            yield self.of_keys(survey, ("camera",), text)
