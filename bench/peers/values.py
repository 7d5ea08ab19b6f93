"""Values of our scene files as Mitsuba takes them: lengths, angles, colours and transforms."""

from __future__ import annotations

import math
import re
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

Spec = dict[str, Any]
Matrix = NDArray[np.float64]

METRES = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "km": 1e3}
MILLIMETRE = METRES["mm"]


class UnsupportedError(Exception):
    """The scene asks for something that this exporter has no exact Mitsuba equal for."""


def refuse_others(spec: Spec, known: str, what: str) -> None:
    """Raise unless every key of `spec` is one of the space-separated `known` keys."""
    others = sorted(set(spec) - set(known.split()))
    if others:
        raise UnsupportedError(f"{what}: no Mitsuba equal for {', '.join(others)}")


def length(value: float | str, plain: float = 1.0) -> float:
    """Read a length in metres; `plain` is the unit of one without a unit (optics are in millimetres)."""
    match = re.fullmatch(r"\s*(\S+?)\s*(km|cm|mm|m)\s*", value) if isinstance(value, str) else None
    return float(match[1]) * METRES[match[2]] if match else float(value) * plain


def degrees(value: float | str) -> float:
    """Read an angle in degrees, with or without the unit."""
    return float(value.removesuffix("deg")) if isinstance(value, str) else float(value)


def rgb(value: float | list[float]) -> Spec:
    """Write a colour as Mitsuba's `rgb`."""
    return {"type": "rgb", "value": [float(v) for v in np.broadcast_to(np.asarray(value, float), 3)]}


def rotation(axis: list[float], angle: float) -> Matrix:
    """Return the right-handed rotation by `angle` degrees about `axis` (Rodrigues)."""
    x, y, z = np.asarray(axis, float) / np.linalg.norm(axis)
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    matrix = np.eye(4)
    matrix[:3, :3] += math.sin(math.radians(angle)) * k + (1 - math.cos(math.radians(angle))) * k @ k
    return matrix


def transform_matrix(transform: list[Spec] | Spec | None) -> Matrix:
    """Return the product of a `transform`'s steps, the first of which is applied first."""
    if isinstance(transform, dict):
        return np.asarray(transform["matrix"], float).reshape(4, 4)
    matrix = np.eye(4)
    for step in transform or []:
        ((kind, value),) = step.items()
        if kind == "translate":
            one = np.eye(4)
            one[:3, 3] = [length(v) for v in value]
        elif kind == "scale":
            one = np.diag([*np.broadcast_to(np.asarray(value, float), 3), 1.0])
        elif kind == "rotate":
            one = rotation(value["axis"], degrees(value["angle"]))
        elif kind == "matrix":
            one = np.asarray(value, float).reshape(4, 4)
        else:
            raise UnsupportedError(f"transform: no Mitsuba equal for {kind}")
        matrix = one @ matrix
    return matrix


def frame(first: Matrix, second: Matrix, third: Matrix, origin: Matrix) -> Any:
    """Return the Mitsuba transform whose columns are three axes and an origin."""
    matrix = np.eye(4)
    matrix[:3] = np.stack([first, second, third, origin], axis=1)
    return mi.ScalarTransform4f(matrix)
