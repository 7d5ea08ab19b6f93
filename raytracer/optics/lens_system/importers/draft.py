"""A lens as read from another program's file, before it is checked, with the lines that its surfaces stand on."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, Literal, NamedTuple, NoReturn

from pydantic import ValidationError

from raytracer.optics.lens_system.lens import FileInterpretation
from raytracer.optics.lens_system.prescription import LensSpec
from raytracer.schema.validation_errors import error_sentence
from raytracer.util.errors import SceneError

Glasses = Mapping[str, Any]
"""Glasses by name that the catalogue does not have, each a value as `material` takes it."""


class Choices(NamedTuple):
    """Settings of an import that the user gives.

    glasses : glasses by name.
    thickness : its convention in a table, "after" or "before" each surface; None to find it by the numbers.
    """

    glasses: Glasses = MappingProxyType({})
    thickness: Literal["after", "before"] | None = None


NO_CHOICES = Choices()
"""No settings: everything is found from the file."""


@dataclass
class Draft:
    """The unchecked lens of a file.

    file : its name.
    values : keys of the lens except `surfaces`, as in a lens file.
    surfaces : the line of each surface, and its keys.
    reading : how the file was interpreted, if it is ambiguous.
    """

    file: str
    values: dict[str, Any] = field(default_factory=dict)
    surfaces: list[tuple[int, dict[str, Any]]] = field(default_factory=list)
    reading: FileInterpretation | None = None

    def refuse(self, message: str, line: int | None = None) -> NoReturn:
        """Raise an error about the file, on a line of it."""
        raise SceneError(message, file=self.file, line=line)

    def spec(self) -> LensSpec:
        """Check the lens.

        Raises
        ------
        SceneError : it is not valid; the error names the line of the surface.
        """
        values = {**self.values, "surfaces": [surface for _, surface in self.surfaces]}
        try:
            return LensSpec.model_validate(values)
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
        path = [step for step in first["loc"] if isinstance(step, str | int)]
        line, key = None, str(path[0]) if path else ""
        if len(path) > 1 and path[0] == "surfaces" and isinstance(path[1], int):
            line, surface = self.surfaces[path[1]]
            # Behind the surface pydantic names its type, which a key may be called like.
            below = path[3:] if path[2:3] == [surface.get("type")] else path[2:]
            key = ".".join(map(str, below))
        raise SceneError(error_sentence(first), file=self.file, line=line, key=key)


def rounded(value: float) -> float:
    """Round a number to 12 digits: a product has more than its factors were written with."""
    return float(f"{value:.12g}")


def shape(curvature: float, conic: float = 0.0, coefficients: Sequence[float] = ()) -> dict[str, Any]:
    """Make the keys of the shape of a surface of glass, from its curvature (1/mm), conic constant and coefficients."""
    radius = {} if curvature == 0.0 else {"radius": rounded(1.0 / curvature)}
    used = max((power for power, value in enumerate(coefficients, start=1) if value != 0.0), default=0)
    if used:
        return {"type": "asphere", **radius, "conic": conic, "coefficients": list(coefficients[:used])}
    if not radius:
        return {"type": "flat"}
    return {"type": "conic", **radius, "conic": conic} if conic != 0.0 else {"type": "spherical", **radius}
