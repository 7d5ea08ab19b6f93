"""The formats of light fields that there are: modules of this package that declare `FORMATS`, found by looking."""

import importlib
import pkgutil
from functools import cache

from raytracer.lightfield import formats
from raytracer.lightfield.formats.base.light_field_format import LightFieldFormat


@cache
def light_field_formats() -> dict[str, LightFieldFormat]:
    """Find all formats by name, in their order; two with the same name are a TypeError."""
    declared: list[LightFieldFormat] = []
    for info in pkgutil.iter_modules(formats.__path__):
        # This module is one of them, and is being imported.
        if info.name != "registry" and not info.ispkg:
            module = importlib.import_module(f"{formats.__name__}.{info.name}")
            declared += getattr(module, "FORMATS", ())
    by_name: dict[str, LightFieldFormat] = {}
    for each in sorted(declared, key=lambda each: each.order):
        if each.name in by_name:
            raise TypeError(f"two formats of light fields are called {each.name!r}")
        by_name[each.name] = each
    return by_name
