"""A quick look at a scene: the same picture, smaller."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from raytracer.scene.spec import SceneSpec

EDGE = 480
"""Pixels that a preview has at most, across or down."""

SPP = 16
"""Samples a pixel that it has at most."""


def smaller(spec: "SceneSpec") -> "SceneSpec":
    """The scene with a picture of at most EDGE pixels a side, of the same shape."""
    factor = min(1.0, EDGE / max(spec.picture()))
    size = {edge: max(1, round(factor * getattr(spec.film, edge))) for edge in ("width", "height")}
    return spec.model_copy(update={"film": spec.film.model_copy(update=size)})
