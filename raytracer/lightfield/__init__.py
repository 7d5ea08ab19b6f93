"""Light fields: refocusing, views, depth, decoding of raw pictures, formats of other programs, and a viewer.

import raytracer as rt

with rt.lightfield.open("x.lf") as field:
    rt.lightfield.refocus(field, 2.5).save("near.png")

Each function takes a `LightField` (`open` reads one, `of` gets it from a rendered picture) and returns arrays, `Image`s
or bytes; the command line calls the same functions.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from raytracer.film.light_field.field import LightField, Rays
    from raytracer.film.light_field.focusing import refocusable
    from raytracer.film.light_field.lf import Writer, open, write  # noqa: A004
    from raytracer.film.light_field.views import Plane, Pose, Views
    from raytracer.lightfield.capturing.capture import Captured, capture
    from raytracer.lightfield.decoding.calibration import find_grid
    from raytracer.lightfield.decoding.decoder import Decoded, decode
    from raytracer.lightfield.decoding.microlens_grid import Grid, read_grid
    from raytracer.lightfield.decoding.optics import Optics
    from raytracer.lightfield.depth.depth_map import Depth, depth_map
    from raytracer.lightfield.epipolar import epipolar_slice
    from raytracer.lightfield.formats.exporter import export_array, export_views
    from raytracer.lightfield.formats.importer import import_views
    from raytracer.lightfield.from_image import of
    from raytracer.lightfield.refocusing.all_in_focus import all_in_focus
    from raytracer.lightfield.refocusing.fourier import FourierRefocuser
    from raytracer.lightfield.refocusing.refocus import focal_stack, refocus
    from raytracer.lightfield.super_resolution import supersampled
    from raytracer.lightfield.synthetic_aperture import cell_weights
    from raytracer.lightfield.viewer.page import page, write_page
    from raytracer.lightfield.views.camera_paths import look_around, path_places
    from raytracer.lightfield.views.contact_sheet import montage
    from raytracer.lightfield.views.synthesis import view_at

_HOMES = {
    "Captured": "raytracer.lightfield.capturing.capture",
    "Decoded": "raytracer.lightfield.decoding.decoder",
    "Depth": "raytracer.lightfield.depth.depth_map",
    "FourierRefocuser": "raytracer.lightfield.refocusing.fourier",
    "Grid": "raytracer.lightfield.decoding.microlens_grid",
    "LightField": "raytracer.film.light_field.field",
    "Optics": "raytracer.lightfield.decoding.optics",
    "Plane": "raytracer.film.light_field.views",
    "Pose": "raytracer.film.light_field.views",
    "Rays": "raytracer.film.light_field.field",
    "Views": "raytracer.film.light_field.views",
    "Writer": "raytracer.film.light_field.lf",
    "all_in_focus": "raytracer.lightfield.refocusing.all_in_focus",
    "capture": "raytracer.lightfield.capturing.capture",
    "cell_weights": "raytracer.lightfield.synthetic_aperture",
    "decode": "raytracer.lightfield.decoding.decoder",
    "depth_map": "raytracer.lightfield.depth.depth_map",
    "epipolar_slice": "raytracer.lightfield.epipolar",
    "export_array": "raytracer.lightfield.formats.exporter",
    "export_views": "raytracer.lightfield.formats.exporter",
    "find_grid": "raytracer.lightfield.decoding.calibration",
    "focal_stack": "raytracer.lightfield.refocusing.refocus",
    "import_views": "raytracer.lightfield.formats.importer",
    "look_around": "raytracer.lightfield.views.camera_paths",
    "montage": "raytracer.lightfield.views.contact_sheet",
    "of": "raytracer.lightfield.from_image",
    "open": "raytracer.film.light_field.lf",
    "page": "raytracer.lightfield.viewer.page",
    "path_places": "raytracer.lightfield.views.camera_paths",
    "read_grid": "raytracer.lightfield.decoding.microlens_grid",
    "refocus": "raytracer.lightfield.refocusing.refocus",
    "refocusable": "raytracer.film.light_field.focusing",
    "supersampled": "raytracer.lightfield.super_resolution",
    "view_at": "raytracer.lightfield.views.synthesis",
    "write": "raytracer.film.light_field.lf",
    "write_page": "raytracer.lightfield.viewer.page",
}
"""Module of each public name.  No module of this package is called as a public name: imported, it would hide that."""

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
    """Import a public name when it is first used."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(_HOMES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
