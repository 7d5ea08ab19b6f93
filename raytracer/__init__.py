"""rt: an offline ray tracer for people who think in cameras.

import raytracer as rt

scene = rt.load("scene.yaml", {"camera.vfov": 40})
image = rt.render(scene, spp=64)
image.save("picture.png")

A scene can also be built in code, with the words of scene files: `rt.Scene(camera=rt.camera.pinhole(...), ...)`.
"""

import importlib
import threading
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from raytracer import lightfield
    from raytracer.cluster import Cluster
    from raytracer.comparison import compare
    from raytracer.errors import InputError, OutputError, SceneWarning
    from raytracer.explanation import explain
    from raytracer.film.image import Image
    from raytracer.probing import probe
    from raytracer.rendering import render_image as render
    from raytracer.scene.load import load
    from raytracer.scene.spec import SceneSpec as Scene
    from raytracer.stock import Stock
    from raytracer.sweeping.run import sweep
    from raytracer.vocabulary import (
        AutoExposure,
        Film,
        Frame,
        Keyframe,
        Microlenses,
        Motion,
        Render,
        Sensor,
        Shake,
        Shutter,
        Spin,
        ToneCurve,
        Vignetting,
        aperture,
        camera,
        environment,
        filter,  # noqa: A004
        light,
        material,
        medium,
        object,  # noqa: A004
        texture,
    )

__all__ = [
    "AutoExposure",
    "Cluster",
    "Film",
    "Frame",
    "Image",
    "InputError",
    "Keyframe",
    "Microlenses",
    "Motion",
    "OutputError",
    "Render",
    "Scene",
    "SceneWarning",
    "Sensor",
    "Shake",
    "Shutter",
    "Spin",
    "Stock",
    "ToneCurve",
    "Vignetting",
    "aperture",
    "camera",
    "compare",
    "environment",
    "explain",
    "filter",
    "light",
    "lightfield",
    "load",
    "material",
    "medium",
    "object",
    "probe",
    "render",
    "sweep",
    "texture",
]

_HOMES: dict[str, tuple[str, str | None]] = {
    "Cluster": ("raytracer.cluster", "Cluster"),
    "Image": ("raytracer.film.image", "Image"),
    "InputError": ("raytracer.errors", "InputError"),
    "OutputError": ("raytracer.errors", "OutputError"),
    "Scene": ("raytracer.scene.spec", "SceneSpec"),
    "SceneWarning": ("raytracer.errors", "SceneWarning"),
    "Stock": ("raytracer.stock", "Stock"),
    "compare": ("raytracer.comparison", "compare"),
    "explain": ("raytracer.explanation", "explain"),
    "lightfield": ("raytracer.lightfield", None),
    "load": ("raytracer.scene.load", "load"),
    "probe": ("raytracer.probing", "probe"),
    "render": ("raytracer.rendering", "render_image"),
    "sweep": ("raytracer.sweeping.run", "sweep"),
}
"""Where the names are, None for a module itself; the others are words of scene files, `raytracer.vocabulary`."""

# Two threads that import parts of a package from two ends at once are told of a deadlock by Python's own locks.
_importing = threading.RLock()


def __getattr__(name: str) -> Any:
    """Import what is asked for only then: the compiler takes a third of a second."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module, member = _HOMES.get(name, ("raytracer.vocabulary", name))
    with _importing:
        home = importlib.import_module(module)
        found = getattr(home, member) if member else home
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted(__all__)
