"""rt: an offline ray tracer for people who think in cameras.

import raytracer as rt

scene = rt.load("scene.yaml", {"camera.vfov": 40})
image = rt.render(scene, spp=64)
image.save("picture.png")
"""

import importlib
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

__all__ = ["SceneWarning", "explain", "load", "render"]

if TYPE_CHECKING:
    from raytracer.errors import SceneWarning
    from raytracer.explanation import explain
    from raytracer.rendering import render_image as render
    from raytracer.scene.load import load

_HOMES = {
    "SceneWarning": ("raytracer.errors", "SceneWarning"),
    "explain": ("raytracer.explanation", "explain"),
    "load": ("raytracer.scene.load", "load"),
    "render": ("raytracer.rendering", "render_image"),
}


def __getattr__(name: str) -> Any:
    """Import what is asked for only then: the compiler takes a third of a second."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module, function = _HOMES[name]
    return getattr(importlib.import_module(module), function)
