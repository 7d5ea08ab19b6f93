"""Warn of lights that emit nothing, or light nothing."""

import numpy as np

from raytracer.core.geometry import OFFSET_ULPS
from raytracer.core.primitives.spheres import Spheres
from raytracer.scene.warnings.base.kind import LIGHTS_AND_CAMERAS, SceneWarningKind
from raytracer.scene.warnings.base.primitive_points import Points, is_flat, normals, outline, without_motion
from raytracer.scene.warnings.base.survey import SceneSurvey
from raytracer.schema.warning_kind import Sentence, Warned

# Most faces of an emitter that are examined one by one.
_MOST_FACES = 64


class UselessLights(SceneWarningKind):
    """Lights without power, lights that point at nothing, and scenes without light."""

    name = "lights that light nothing"
    section = LIGHTS_AND_CAMERAS
    rank = 120
    powerless = Sentence(
        "gives no light: its {power} is 0", when="a light has no power", remedy="give it some, or take it out"
    )
    black = Sentence(
        "is made of an emitter that gives no light: its radiance is 0",
        when="the radiance of an emitter is 0",
        remedy="give it some, or take it out",
    )
    averted = Sentence(
        "gives light to the side of its normal only, and the camera and all other objects are on the other side: "
        "{remedy}",
        when="a one-sided emitter faces away from everything",
        remedy="turn it round, or make it `two_sided`",
        advice="swapping its edges reverses the normal",
    )
    hollow = Sentence(
        "has a negative radius, so it gives light to its inside only, where nothing is: {remedy}",
        when="a sphere is turned inside out",
        remedy="make the radius positive, or the emitter `two_sided`",
    )
    dark = Sentence(
        "nothing gives light, so the picture will be black: {remedy}",
        when="there is no environment, no light and no emitter",
        remedy="add an `environment`, one of the `lights`, or an emitter",
    )

    def find(self, survey: SceneSurvey) -> Warned:
        yield from self._find_powerless(survey)
        yield from self._find_averted(survey)
        if _is_dark(survey):
            yield self.of_keys(survey, ("objects",), self.dark.fill())

    def _find_powerless(self, survey: SceneSurvey) -> Warned:
        for number, light in enumerate(survey.spec.lights):
            if not light.shines():
                yield self.of_keys(survey, ("lights", number), self.powerless.fill(power=light.power))
        # An object in several groups is reported once.
        _, first = np.unique(survey.pieces.item, return_index=True)
        for piece in np.sort(first).tolist():
            look = survey.material_of(piece)
            if look is not None and "radiance" in type(look).model_fields and not look.is_emissive():
                yield self.of_piece(survey, piece, self.black.fill())

    def _find_averted(self, survey: SceneSurvey) -> Warned:
        """Find emitters with nothing in front of them."""
        pieces = survey.pieces
        # Fog shows light that hits nothing else.
        if survey.packed.scene.media is not None:
            return
        for piece in np.flatnonzero(pieces.group < 0).tolist():
            look = survey.material_of(piece)
            if look is None or look.children() or not look.is_emissive() or getattr(look, "two_sided", True):
                continue
            table, start, stop = survey.rows_of(piece)
            if is_flat(table):
                if stop - start <= _MOST_FACES and not _shines_on_something(survey, piece, outline(table, start, stop)):
                    yield self.of_piece(survey, piece, self.averted.fill())
            elif _is_hollow(survey, piece, without_motion(table), start):
                yield self.of_piece(survey, piece, self.hollow.fill())


def _others(survey: SceneSurvey, piece: int) -> Points:
    """List the corners (n, 3) of the boxes round all other objects, and the camera."""
    low, high = survey.boxes
    there = np.asarray(np.isfinite(low).all(axis=1))
    there[piece] = False
    ends = np.stack([low[there], high[there]])
    corners = [ends[which, :, np.arange(3)].T for which in np.ndindex(2, 2, 2)]
    return np.concatenate([survey.camera[None], *corners])


def _shines_on_something(survey: SceneSurvey, piece: int, faces: Points) -> bool:
    others = _others(survey, piece)
    offset = OFFSET_ULPS * float(survey.pieces.reach[piece])
    return any(((others - face[0]) @ normal > offset).any() for face, normal in zip(faces, normals(faces), strict=True))


def _is_hollow(survey: SceneSurvey, piece: int, table: Spheres, row: int) -> bool:
    """Return True if a sphere shines inwards, and neither another object's box nor the camera reaches into it."""
    if table.radius[row] > 0.0:
        return False
    center, radius = table.center[row], abs(float(table.radius[row]))
    low, high = survey.boxes
    away = np.linalg.norm(np.clip(center, low, high) - center, axis=1)
    away[piece] = np.inf
    return bool(min(float(away.min()), float(np.linalg.norm(survey.camera - center))) >= radius)


def _is_dark(survey: SceneSurvey) -> bool:
    return not (
        any(light.shines() for light in survey.spec.lights)
        or survey.packed.scene.environment is not None
        or any(look.is_emissive() for look in survey.packed.resolved_materials.values())
    )
