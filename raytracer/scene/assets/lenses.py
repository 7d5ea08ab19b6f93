"""Lenses from files: prescriptions in YAML, and what other programs write."""

from pathlib import Path

from pydantic import ValidationError

from raytracer.document import first_error, parse, read
from raytracer.errors import SceneError
from raytracer.lenses.importing import SUFFIXES, imported
from raytracer.lenses.lens import Lens
from raytracer.lenses.prescription import LensSpec


def read_prescription(path: Path) -> LensSpec:
    """What a lens file says.

    Raises
    ------
    SceneError : it cannot be read, or what it says is wrong; it names file, line and key.
    """
    file = str(path)
    if path.suffix.lower() in SUFFIXES:
        return imported(path).spec
    root = parse(read(file, "lens"), file)
    if root is None or (root.entries is None and root.value is None and root.items is None):
        raise SceneError("is empty; a lens needs at least name and surfaces", file=file)
    try:
        return LensSpec.model_validate(root.plain())
    except ValidationError as error:
        raise first_error(error, root, file) from None


def read_lens(path: Path) -> Lens:
    """The lens of a file.

    Raises
    ------
    SceneError : it cannot be read, or what it says is wrong; it names file, line and key.
    """
    return imported(path).lens() if path.suffix.lower() in SUFFIXES else read_prescription(path).lens()
