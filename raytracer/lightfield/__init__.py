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
    from raytracer.film.light_field.layout import extract_light_field as of
    from raytracer.film.light_field.lf import Writer, open, open_posed, write  # noqa: A004
    from raytracer.film.light_field.posed_field import PosedLightField
    from raytracer.film.light_field.posed_views import PosedViews
    from raytracer.film.light_field.views import Plane, Pose, Views
    from raytracer.lightfield.calibrating.bundle_adjustment import Calibration
    from raytracer.lightfield.calibrating.calibrate import calibrate
    from raytracer.lightfield.calibrating.camera import CameraModel, read_camera
    from raytracer.lightfield.capturing.capture import Captured, capture
    from raytracer.lightfield.decoding.calibration import find_grid
    from raytracer.lightfield.decoding.decoder import Decoded, decode
    from raytracer.lightfield.decoding.focused import DecodedFocused, FocusedOptics, decode_focused
    from raytracer.lightfield.decoding.lytro.decode import decode_photo
    from raytracer.lightfield.decoding.microlens_grid import Grid, Optics, read_grid
    from raytracer.lightfield.depth.depth_map import Depth, depth_map
    from raytracer.lightfield.epipolar import epipolar_slice
    from raytracer.lightfield.formats.exporter import export, export_array, export_views
    from raytracer.lightfield.formats.importer import import_views
    from raytracer.lightfield.refocusing.fourier import FourierRefocuser
    from raytracer.lightfield.refocusing.refocus import focal_stack, refocus
    from raytracer.lightfield.super_resolution import all_in_focus, supersampled
    from raytracer.lightfield.synthetic_aperture import cell_weights
    from raytracer.lightfield.viewer.page import page, write_page
    from raytracer.lightfield.views.camera_paths import look_around, path_places
    from raytracer.lightfield.views.contact_sheet import montage
    from raytracer.lightfield.views.free_camera import FreeCamera, free_camera, orbit, path_through
    from raytracer.lightfield.views.synthesis import view_at
    from raytracer.lightfield.views.unstructured import FreeView, view_from, views_along

_MODULES = {
    "raytracer.film.light_field.field": ("LightField", "Rays"),
    "raytracer.film.light_field.focusing": ("refocusable",),
    "raytracer.film.light_field.lf": ("Writer", "open", "open_posed", "write"),
    "raytracer.film.light_field.posed_field": ("PosedLightField",),
    "raytracer.film.light_field.posed_views": ("PosedViews",),
    "raytracer.film.light_field.views": ("Plane", "Pose", "Views"),
    "raytracer.lightfield.calibrating.bundle_adjustment": ("Calibration",),
    "raytracer.lightfield.calibrating.calibrate": ("calibrate",),
    "raytracer.lightfield.calibrating.camera": ("CameraModel", "read_camera"),
    "raytracer.lightfield.capturing.capture": ("Captured", "capture"),
    "raytracer.lightfield.decoding.calibration": ("find_grid",),
    "raytracer.lightfield.decoding.decoder": ("Decoded", "decode"),
    "raytracer.lightfield.decoding.focused": ("DecodedFocused", "FocusedOptics", "decode_focused"),
    "raytracer.lightfield.decoding.lytro.decode": ("decode_photo",),
    "raytracer.lightfield.decoding.microlens_grid": ("Grid", "Optics", "read_grid"),
    "raytracer.lightfield.depth.depth_map": ("Depth", "depth_map"),
    "raytracer.lightfield.epipolar": ("epipolar_slice",),
    "raytracer.lightfield.formats.exporter": ("export", "export_array", "export_views"),
    "raytracer.lightfield.formats.importer": ("import_views",),
    "raytracer.lightfield.refocusing.fourier": ("FourierRefocuser",),
    "raytracer.lightfield.refocusing.refocus": ("focal_stack", "refocus"),
    "raytracer.lightfield.super_resolution": ("all_in_focus", "supersampled"),
    "raytracer.lightfield.synthetic_aperture": ("cell_weights",),
    "raytracer.lightfield.viewer.page": ("page", "write_page"),
    "raytracer.lightfield.views.camera_paths": ("look_around", "path_places"),
    "raytracer.lightfield.views.contact_sheet": ("montage",),
    "raytracer.lightfield.views.free_camera": ("FreeCamera", "free_camera", "orbit", "path_through"),
    "raytracer.lightfield.views.synthesis": ("view_at",),
    "raytracer.lightfield.views.unstructured": ("FreeView", "view_from", "views_along"),
}
"""Public names by module.  No module of this package is called as a public name: imported, it would hide that."""

_HOMES = {name: (module, name) for module, names in _MODULES.items() for name in names}
_HOMES["of"] = ("raytracer.film.light_field.layout", "extract_light_field")

__all__ = [
    "Calibration",
    "CameraModel",
    "Captured",
    "Decoded",
    "DecodedFocused",
    "Depth",
    "FocusedOptics",
    "FourierRefocuser",
    "FreeCamera",
    "FreeView",
    "Grid",
    "LightField",
    "Optics",
    "Plane",
    "Pose",
    "PosedLightField",
    "PosedViews",
    "Rays",
    "Views",
    "Writer",
    "all_in_focus",
    "calibrate",
    "capture",
    "cell_weights",
    "decode",
    "decode_focused",
    "decode_photo",
    "depth_map",
    "epipolar_slice",
    "export",
    "export_array",
    "export_views",
    "find_grid",
    "focal_stack",
    "free_camera",
    "import_views",
    "look_around",
    "montage",
    "of",
    "open",
    "open_posed",
    "orbit",
    "page",
    "path_places",
    "path_through",
    "read_camera",
    "read_grid",
    "refocus",
    "refocusable",
    "supersampled",
    "view_at",
    "view_from",
    "views_along",
    "write",
    "write_page",
]


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module, own_name = _HOMES[name]
    value = getattr(importlib.import_module(module), own_name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
