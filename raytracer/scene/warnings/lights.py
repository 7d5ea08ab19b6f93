"""Lights that give none, or to nothing."""

from collections.abc import Iterator

import numpy as np

from raytracer.geometry import OFFSET_ULPS
from raytracer.primitives.spheres import Spheres
from raytracer.scene.concerns.interface import Concern, concern
from raytracer.scene.concerns.outlines import Points, is_flat, normals, outline, resting
from raytracer.scene.concerns.survey import Survey

_KIND = "lights that light nothing"

_POWERS = ("intensity", "irradiance", "energy")

# Faces of an emitter that are looked at one by one.
_MOST_FACES = 64


def lamps(survey: Survey) -> Iterator[Concern]:
    """Concerns about lights."""
    yield from _without_power(survey)
    yield from _turned_away(survey)
    yield from _dark(survey)


def _without_power(survey: Survey) -> Iterator[Concern]:
    spec = survey.spec
    for number, light in enumerate(spec.lights):
        for key in (name for name in _POWERS if not any(getattr(light, name, (1.0,)))):
            yield concern(spec, _KIND, ("lights", number), f"gives no light: its {key} is 0")
    # An object in several groups is one.
    _, first = np.unique(survey.pieces.item, return_index=True)
    for piece in np.sort(first).tolist():
        look = survey.look_of(piece)
        if look is not None and "radiance" in type(look).model_fields and not look.emits():
            yield survey.concern(_KIND, piece, "is made of an emitter that gives no light: its radiance is 0")


def _turned_away(survey: Survey) -> Iterator[Concern]:
    """Emitters before whose fronts there is nothing."""
    pieces = survey.pieces
    # Fog shows light that meets nothing else.
    if survey.packed.scene.media is not None:
        return
    for piece in np.flatnonzero(pieces.group < 0).tolist():
        look = survey.look_of(piece)
        if look is None or look.children() or not look.emits() or getattr(look, "two_sided", True):
            continue
        table = survey.tables[pieces.table[piece]]
        start, stop = int(pieces.start[piece]), int(pieces.stop[piece])
        if is_flat(table):
            if stop - start <= _MOST_FACES and not _shines_on_something(survey, piece, outline(table, start, stop)):
                yield survey.concern(
                    _KIND,
                    piece,
                    "gives light to the side of its normal only, and the camera and all other objects are on the "
                    "other side: turn it round, or make it `two_sided`",
                )
        elif _is_hollow(survey, piece, resting(table), start):
            yield survey.concern(
                _KIND,
                piece,
                "has a negative radius, so it gives light to its inside only, where nothing is: make the radius "
                "positive, or the emitter `two_sided`",
            )


def _others(survey: Survey, piece: int) -> Points:
    """The corners (n, 3) of the boxes round all other objects, and the camera."""
    low, high = survey.boxes
    there = np.asarray(np.isfinite(low).all(axis=1))
    there[piece] = False
    ends = np.stack([low[there], high[there]])
    corners = [ends[which, :, np.arange(3)].T for which in np.ndindex(2, 2, 2)]
    return np.concatenate([survey.camera[None], *corners])


def _shines_on_something(survey: Survey, piece: int, faces: Points) -> bool:
    others = _others(survey, piece)
    offset = OFFSET_ULPS * float(survey.pieces.reach[piece])
    return any(((others - face[0]) @ normal > offset).any() for face, normal in zip(faces, normals(faces), strict=True))


def _is_hollow(survey: Survey, piece: int, table: Spheres, row: int) -> bool:
    """Whether a sphere shines inwards, and no box of another object, nor the camera, reaches into it."""
    if table.radius[row] > 0.0:
        return False
    center, radius = table.center[row], abs(float(table.radius[row]))
    low, high = survey.boxes
    away = np.linalg.norm(np.clip(center, low, high) - center, axis=1)
    away[piece] = np.inf
    return bool(min(float(away.min()), float(np.linalg.norm(survey.camera - center))) >= radius)


def _dark(survey: Survey) -> Iterator[Concern]:
    spec = survey.spec
    shines = any(any(any(getattr(light, name, ())) for name in _POWERS) for light in spec.lights)
    if (
        shines
        or survey.packed.scene.environment is not None
        or any(look.emits() for look in survey.packed.looks.values())
    ):
        return
    yield concern(
        spec,
        _KIND,
        ("objects",),
        "nothing gives light, so the picture will be black: add an `environment`, one of the `lights`, or an emitter",
    )
