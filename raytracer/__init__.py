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

if TYPE_CHECKING:
    from raytracer import lightfield
    from raytracer.analysis.compare import compare
    from raytracer.analysis.cost.notebook import cost
    from raytracer.analysis.explain import explain
    from raytracer.analysis.probe import probe
    from raytracer.analysis.sweep.run import sweep
    from raytracer.film.image import Image
    from raytracer.rendering.cluster.connection import Cluster
    from raytracer.rendering.render import render_image as render
    from raytracer.scene.cache import RenderCache as Cache
    from raytracer.scene.cache import RenderCache as Stock
    from raytracer.scene.load import load
    from raytracer.scene.python_api import (
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
    from raytracer.scene.spec import SceneSpec as Scene
    from raytracer.util.errors import InputError, OutputError, SceneWarning

    __version__: str

__all__ = [
    "AutoExposure",
    "Cache",
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
    "cost",
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
    "Cache": ("raytracer.scene.cache", "RenderCache"),
    "Cluster": ("raytracer.rendering.cluster.connection", "Cluster"),
    "Image": ("raytracer.film.image", "Image"),
    "InputError": ("raytracer.util.errors", "InputError"),
    "OutputError": ("raytracer.util.errors", "OutputError"),
    "Scene": ("raytracer.scene.spec", "SceneSpec"),
    "SceneWarning": ("raytracer.util.errors", "SceneWarning"),
    # The old name of Cache, for scripts that have it.
    "Stock": ("raytracer.scene.cache", "RenderCache"),
    "compare": ("raytracer.analysis.compare", "compare"),
    "cost": ("raytracer.analysis.cost.notebook", "cost"),
    "explain": ("raytracer.analysis.explain", "explain"),
    "lightfield": ("raytracer.lightfield", None),
    "load": ("raytracer.scene.load", "load"),
    "probe": ("raytracer.analysis.probe", "probe"),
    "render": ("raytracer.rendering.render", "render_image"),
    "sweep": ("raytracer.analysis.sweep.run", "sweep"),
}
"""Modules of the names, None for a module itself; the others are words of scene files, `raytracer.scene.python_api`."""

# Without this lock, two threads that import parts of a package from two ends at once get a deadlock error from Python.
_importing = threading.RLock()


def __getattr__(name: str) -> Any:
    """Import a name when it is first used: the compiler takes a third of a second."""
    if name == "__version__":
        return globals().setdefault(name, _installed_version())
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module, member = _HOMES.get(name, ("raytracer.scene.python_api", name))
    with _importing:
        home = importlib.import_module(module)
        found = getattr(home, member) if member else home
    globals()[name] = found
    return found


def _installed_version() -> str:
    """Return the version of the installed package, which the build has made of the last tag; finding it takes 50 ms."""
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("raytracer")
    except PackageNotFoundError:
        # Sources that are on the path, and not installed.
        return "0+unknown"


def __dir__() -> list[str]:
    return sorted(__all__)
