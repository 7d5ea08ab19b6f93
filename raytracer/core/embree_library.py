"""Find Embree's library, which the `embreex` wheel ships in a place of its own on each system."""

import importlib.util
from pathlib import Path

_LAYOUTS = ("embreex.libs/libembree4*.so*", "embreex/.dylibs/libembree4*.dylib", "embreex.libs/embree4*.dll")


class EmbreeError(RuntimeError):
    """An error that Embree reported."""


def find_library(site_packages: Path | None = None) -> Path:
    """Find the Embree 4 shared library inside the installed `embreex` wheel, of Linux, macOS or Windows.

    Parameters
    ----------
    site_packages : the folder that holds the `embreex` package; found by import machinery if None.

    Raises
    ------
    EmbreeError : no library lies where any of the three wheels puts it.
    """
    if site_packages is None:
        spec = importlib.util.find_spec("embreex")
        if spec is None or spec.origin is None:
            raise EmbreeError("the package embreex, which ships Embree, is not installed")
        site_packages = Path(spec.origin).parent.parent
    for layout in _LAYOUTS:
        if libraries := sorted(site_packages.glob(layout)):
            return libraries[0]
    raise EmbreeError(f"the embreex package in {site_packages} holds no Embree 4 library")
