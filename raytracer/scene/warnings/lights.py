"""Warn of lights that emit nothing, or light nothing."""

from collections.abc import Iterator

import numpy as np

from raytracer.core.geometry import OFFSET_ULPS
from raytracer.core.primitives.spheres import Spheres
from raytracer.scene.warnings.primitive_points import Points, is_flat, normals, outline, without_motion
from raytracer.scene.warnings.record import WarningRecord, warning_at
from raytracer.scene.warnings.survey import SceneSurvey

_KIND = "lights that light nothing"

_POWERS = ("intensity", "irradiance", "energy")

# Most faces of an emitter that are examined one by one.
_MOST_FACES = 64


def light_warnings(survey: SceneSurvey) -> Iterator[WarningRecord]:
    """Find lights without power, lights that point at nothing, and scenes without light."""
    yield from _without_power(survey)
    yield from _turned_away(survey)
    yield from _dark(survey)


def _without_power(survey: SceneSurvey) -> Iterator[WarningRecord]:
    spec = survey.spec
    for number, light in enumerate(spec.lights):
        for key in (name for name in _POWERS if not any(getattr(light, name, (1.0,)))):
            yield warning_at(spec, _KIND, ("lights", number), f"gives no light: its {key} is 0")
    # An object in several groups is reported once.
    _, first = np.unique(survey.pieces.item, return_index=True)
    for piece in np.sort(first).tolist():
        look = survey.material_of(piece)
        if look is not None and "radiance" in type(look).model_fields and not look.is_emissive():
            yield survey.warning(_KIND, piece, "is made of an emitter that gives no light: its radiance is 0")


def _turned_away(survey: SceneSurvey) -> Iterator[WarningRecord]:
    """Find emitters with nothing in front of them."""
    pieces = survey.pieces
    # Fog shows light that hits nothing else.
    if survey.packed.scene.media is not None:
        return
    for piece in np.flatnonzero(pieces.group < 0).tolist():
        look = survey.material_of(piece)
        if look is None or look.children() or not look.is_emissive() or getattr(look, "two_sided", True):
            continue
        table = survey.tables[pieces.table[piece]]
        start, stop = int(pieces.start[piece]), int(pieces.stop[piece])
        if is_flat(table):
            if stop - start <= _MOST_FACES and not _shines_on_something(survey, piece, outline(table, start, stop)):
                yield survey.warning(
                    _KIND,
                    piece,
                    "gives light to the side of its normal only, and the camera and all other objects are on the "
                    "other side: turn it round, or make it `two_sided`",
                )
        elif _is_hollow(survey, piece, without_motion(table), start):
            yield survey.warning(
                _KIND,
                piece,
                "has a negative radius, so it gives light to its inside only, where nothing is: make the radius "
                "positive, or the emitter `two_sided`",
            )


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


def _dark(survey: SceneSurvey) -> Iterator[WarningRecord]:
    spec = survey.spec
    shines = any(any(any(getattr(light, name, ())) for name in _POWERS) for light in spec.lights)
    if (
        shines
        or survey.packed.scene.environment is not None
        or any(look.is_emissive() for look in survey.packed.resolved_materials.values())
    ):
        return
    yield warning_at(
        spec,
        _KIND,
        ("objects",),
        "nothing gives light, so the picture will be black: add an `environment`, one of the `lights`, or an emitter",
    )
