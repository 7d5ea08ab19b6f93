"""The quick look at a scene: the same picture, smaller and with fewer samples."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from raytracer.scene.spec import SceneSpec

EDGE = 480
"""Most pixels of a preview, across or down."""

SPP = 16
"""Most samples per pixel of a preview."""


def preview_scene(spec: "SceneSpec") -> "SceneSpec":
    """Shrink the picture of a scene to at most EDGE pixels a side, of the same aspect ratio."""
    factor = min(1.0, EDGE / max(spec.picture()))
    size = {edge: max(1, round(factor * getattr(spec.film, edge))) for edge in ("width", "height")}
    return spec.model_copy(update={"film": spec.film.model_copy(update=size)})
