"""What is made of light fields: photographs focused afterwards, views, depth, pages to look around in.

import raytracer as rt

with rt.lightfield.open("x.lf") as field:
    rt.lightfield.refocus(field, 2.5).save("near.png")

Each function takes a `LightField` (`open` reads one, `of` finds it in a picture) and gives arrays, `Image`s or bytes;
the command line and users of Python call the same.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from raytracer.lightfield.bands import Captured, capture
    from raytracer.lightfield.decoding.calibration import Grid, find_grid, read_grid
    from raytracer.lightfield.decoding.decoder import Decoded, decode
    from raytracer.lightfield.decoding.optics import Optics
    from raytracer.lightfield.depth import Depth, depth_map
    from raytracer.lightfield.foreign import export_array, export_views, import_views
    from raytracer.lightfield.fourier import FourierRefocuser
    from raytracer.lightfield.fusion import all_in_focus
    from raytracer.lightfield.making import of
    from raytracer.lightfield.moving import look_around, path_places
    from raytracer.lightfield.openings import cell_weights
    from raytracer.lightfield.perspectives import montage, view_at
    from raytracer.lightfield.refocusing import focal_stack, refocus
    from raytracer.lightfield.slices import epipolar_slice
    from raytracer.lightfield.supersampling import supersampled
    from raytracer.lightfield.viewer import page, write_page
    from raytracer.plenoptic.field import LightField, Rays
    from raytracer.plenoptic.focusing import refocusable
    from raytracer.plenoptic.lf import Writer, open, write  # noqa: A004
    from raytracer.plenoptic.views import Plane, Pose, Views

_HOMES = {
    "Captured": "raytracer.lightfield.bands",
    "Decoded": "raytracer.lightfield.decoding.decoder",
    "Depth": "raytracer.lightfield.depth",
    "FourierRefocuser": "raytracer.lightfield.fourier",
    "Grid": "raytracer.lightfield.decoding.calibration",
    "LightField": "raytracer.plenoptic.field",
    "Optics": "raytracer.lightfield.decoding.optics",
    "Plane": "raytracer.plenoptic.views",
    "Pose": "raytracer.plenoptic.views",
    "Rays": "raytracer.plenoptic.field",
    "Views": "raytracer.plenoptic.views",
    "Writer": "raytracer.plenoptic.lf",
    "all_in_focus": "raytracer.lightfield.fusion",
    "capture": "raytracer.lightfield.bands",
    "cell_weights": "raytracer.lightfield.openings",
    "decode": "raytracer.lightfield.decoding.decoder",
    "depth_map": "raytracer.lightfield.depth",
    "epipolar_slice": "raytracer.lightfield.slices",
    "export_array": "raytracer.lightfield.foreign",
    "export_views": "raytracer.lightfield.foreign",
    "find_grid": "raytracer.lightfield.decoding.calibration",
    "focal_stack": "raytracer.lightfield.refocusing",
    "import_views": "raytracer.lightfield.foreign",
    "look_around": "raytracer.lightfield.moving",
    "montage": "raytracer.lightfield.perspectives",
    "of": "raytracer.lightfield.making",
    "open": "raytracer.plenoptic.lf",
    "page": "raytracer.lightfield.viewer",
    "path_places": "raytracer.lightfield.moving",
    "read_grid": "raytracer.lightfield.decoding.calibration",
    "refocus": "raytracer.lightfield.refocusing",
    "refocusable": "raytracer.plenoptic.focusing",
    "supersampled": "raytracer.lightfield.supersampling",
    "view_at": "raytracer.lightfield.perspectives",
    "write": "raytracer.plenoptic.lf",
    "write_page": "raytracer.lightfield.viewer",
}
"""Where the names are.  A module of this package has another name than what is in it: imported, it would hide that."""

__all__ = [
    "Captured",
    "Decoded",
    "Depth",
    "FourierRefocuser",
    "Grid",
    "LightField",
    "Optics",
    "Plane",
    "Pose",
    "Rays",
    "Views",
    "Writer",
    "all_in_focus",
    "capture",
    "cell_weights",
    "decode",
    "depth_map",
    "epipolar_slice",
    "export_array",
    "export_views",
    "find_grid",
    "focal_stack",
    "import_views",
    "look_around",
    "montage",
    "of",
    "open",
    "page",
    "path_places",
    "read_grid",
    "refocus",
    "refocusable",
    "supersampled",
    "view_at",
    "write",
    "write_page",
]


def __getattr__(name: str) -> Any:
    """Import what is asked for only then."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    found = getattr(importlib.import_module(_HOMES[name]), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted(__all__)
