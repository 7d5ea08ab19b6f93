"""Cameras that stand where there is nothing to be seen."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from raytracer.cameras.interface import defocus_of
from raytracer.cameras.moving import MovingCamera
from raytracer.geometry import OFFSET_ULPS
from raytracer.primitives.spheres import Spheres
from raytracer.scene.concerns.interface import Concern, concern
from raytracer.scene.concerns.outlines import Points, normals, outline, reaches, resting
from raytracer.scene.concerns.survey import Survey

_KIND = "cameras without a view"

# Faces of an object that are looked at one by one.
_MOST_FACES = 10_000

_MOST_REACH = 5.0
"""How many times the largest coordinate the offset of a quad may count: its corner once, either edge twice."""


def viewpoint(survey: Survey) -> Iterator[Concern]:
    """Concerns about where the camera is."""
    yield from _pixels(survey)
    pieces = survey.pieces
    for piece in np.flatnonzero(
        (pieces.group < 0) & (pieces.stop - pieces.start <= _MOST_FACES) & _near(survey)
    ).tolist():
        table = survey.tables[pieces.table[piece]]
        start, stop = int(pieces.start[piece]), int(pieces.stop[piece])
        offset = _offset_there(survey, table, start, stop)
        if offset is not None:
            yield concern(
                survey.spec,
                _KIND,
                ("camera", "look_from"),
                f"lies on the surface of {survey.name_of(piece)}, to within {offset:.2g} m, so which side it sees is "
                "left to rounding: move it by more than that",
            )
        elif _is_in_the_dark(survey, piece):
            yield concern(
                survey.spec,
                _KIND,
                ("camera", "look_from"),
                f"is inside {survey.name_of(piece)}, which is opaque and holds no light, so the picture will be black",
            )


def _pixels(survey: Survey) -> Iterator[Concern]:
    """Find a camera whose pixels are smaller than float32 tells directions: edges are seen beside their place."""
    camera = survey.packed.scene.camera
    defocus = defocus_of(camera.camera if isinstance(camera, MovingCamera) else camera)
    if defocus is not None and defocus.pixel < OFFSET_ULPS:
        yield concern(
            survey.spec,
            "pixels too small for float32",
            ("camera",),
            f"a pixel is {defocus.pixel:.2g} wide at a distance of 1, and edges are only met to {OFFSET_ULPS:.1e} of "
            "how far away they are: bring the camera nearer and let it see more",
        )


def _near(survey: Survey) -> NDArray[np.bool_]:
    """Which pieces have the camera in their box, or on it (n,)."""
    pieces, camera = survey.pieces, survey.camera
    slack = _MOST_REACH * OFFSET_ULPS * pieces.reach[:, None]
    return np.asarray(((camera >= pieces.low - slack) & (camera <= pieces.high + slack)).all(axis=1))


def _offset_there(survey: Survey, table: object, start: int, stop: int) -> float | None:
    """The offset of rays that leave the surface that the camera is on, to within that (m); None if it is on none."""
    base = resting(table)
    offset = OFFSET_ULPS * reaches(table, start, stop)
    if isinstance(base, Spheres):
        height = abs(_away(base, start, survey.camera) - abs(float(base.radius[start])))
        return float(offset[0]) if height <= offset[0] else None
    faces = outline(table, start, stop)
    normal = normals(faces)
    to = survey.camera - faces
    height = np.abs(np.einsum("nki,ni->nk", to, normal)).max(axis=1)
    # Inside of a convex face, the point is to the left of all of its edges.
    edges = np.roll(faces, -1, axis=1) - faces
    left = np.einsum("nki,ni->nk", np.cross(edges, to), normal)
    on = (height <= offset) & (left >= 0.0).all(axis=1)
    return float(offset[on].max()) if on.any() else None


def _away(table: Spheres, row: int, point: Points) -> float:
    return float(np.linalg.norm(point - table.center[row]))


def _is_in_the_dark(survey: Survey, piece: int) -> bool:
    """Whether the camera is inside of a closed opaque object into which no light comes."""
    look = survey.look_of(piece)
    if look is None or look.passes() or look.transmits() or look.emits():
        return False
    low, high = survey.boxes
    middles = low + 0.5 * (high - low)
    emitting = np.array([(found := survey.look_of(other)) is None or found.emits() for other in range(len(low))])
    places = [light.position for light in survey.spec.lights if hasattr(light, "position")]
    # A flash without a place of its own is at the camera.
    lit = [survey.camera if place is None else np.subtract(place, survey.shift) for place in places]
    points = np.concatenate([survey.camera[None], middles[emitting], np.reshape(lit, (-1, 3))])
    inside = survey.contains(piece, points)
    return bool(inside[0]) and not inside[1:].any()
