"""Read lenses from files: prescriptions in YAML, and the formats of other programs."""

from pathlib import Path

from pydantic import ValidationError

from raytracer.optics.lens_system.importers import SUFFIXES, import_lens
from raytracer.optics.lens_system.lens import Lens
from raytracer.optics.lens_system.prescription import LensSpec
from raytracer.schema.validation_errors import first_error
from raytracer.schema.yaml_parser import parse, read
from raytracer.util.errors import SceneError


def read_prescription(path: Path) -> LensSpec:
    """Read the prescription of a lens file.

    Raises
    ------
    SceneError : it cannot be read, or is wrong; the error names file, line and key.
    """
    file = str(path)
    if path.suffix.lower() in SUFFIXES:
        return import_lens(path).spec
    root = parse(read(file, "lens"), file)
    if root is None or (root.entries is None and root.value is None and root.items is None):
        raise SceneError("is empty; a lens needs at least name and surfaces", file=file)
    try:
        return LensSpec.model_validate(root.plain())
    except ValidationError as error:
        raise first_error(error, root, file) from None


def read_lens(path: Path) -> Lens:
    """Read the lens of a file.

    Raises
    ------
    SceneError : it cannot be read, or is wrong; the error names file, line and key.
    """
    return import_lens(path).lens() if path.suffix.lower() in SUFFIXES else read_prescription(path).lens()
