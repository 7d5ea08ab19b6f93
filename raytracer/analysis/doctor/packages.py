"""Packages that rt needs, and those that its extras bring: versions, and what each extra is for."""

import importlib
import importlib.util
from importlib.metadata import PackageNotFoundError, version
from typing import NamedTuple

REQUIRED = {
    "embreex": "embreex",
    "filelock": "filelock",
    "h5py": "h5py",
    "Jinja2": "jinja2",
    "llvmlite": "llvmlite",
    "matplotlib": "matplotlib",
    "numba": "numba",
    "numpy": "numpy",
    "OpenEXR": "OpenEXR",
    "Pillow": "PIL",
    "psutil": "psutil",
    "pydantic": "pydantic",
    "PyYAML": "yaml",
    "rich": "rich",
    "scipy": "scipy",
    "tqdm": "tqdm",
    "typer": "typer",
}
"""Modules of the packages that rt needs, by their names on the package index; llvmlite comes with Numba."""


class Extra(NamedTuple):
    """An extra.

    modules : those that it brings.
    gives : what it is for.
    """

    modules: tuple[str, ...]
    gives: str


EXTRAS = {
    "bayer": Extra(("cv2",), "sensors with a Bayer mosaic, and raw pictures of light-field cameras"),
    "cluster": Extra(("distributed",), "rt render --cluster, on other machines"),
    "compare": Extra(("flip_evaluator", "skimage"), "SSIM and FLIP in rt compare"),
    "denoise": Extra(("pyoidn",), "rt render --denoise"),
    "view": Extra(("aiohttp",), "rt view, a live page of a scene"),
}
"""Extras for users, by name; the others are for who works on rt itself."""


def installed_version(package: str) -> str | None:
    """Return the version of a package that is installed; None if it is not."""
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def import_failure(package: str) -> str | None:
    """Import a package that rt needs, and return what went wrong in a sentence; None if nothing did."""
    try:
        importlib.import_module(REQUIRED[package])
    except Exception as error:  # noqa: BLE001
        # A damaged package raises whatever it likes.
        return f"{package} {installed_version(package) or 'is not installed'}: {type(error).__name__}: {error}"
    return None


def missing_modules(extra: str) -> list[str]:
    """List the modules of an extra that are not installed."""
    return [name for name in EXTRAS[extra].modules if importlib.util.find_spec(name) is None]
