"""A lens as another program's file has it, before it is checked, and the lines that its surfaces stand on."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, Literal, NamedTuple, NoReturn

from pydantic import ValidationError

from raytracer.errors import SceneError
from raytracer.lenses.lens import Reading
from raytracer.lenses.prescription import LensSpec
from raytracer.spec import sentence

Glasses = Mapping[str, Any]
"""What names of glasses mean, each a value such as `material` has it, where the catalogue does not know them."""


class Choices(NamedTuple):
    """Settings of an import that the user gives.

    glasses : what names of glasses mean.
    thickness : where it stands in a table, "after" or "before" each surface; None to tell it by the numbers.
    """

    glasses: Glasses = MappingProxyType({})
    thickness: Literal["after", "before"] | None = None


AS_IT_IS = Choices()
"""Nothing is said of a file."""


@dataclass
class Draft:
    """What a file says of a lens.

    values : its keys but `surfaces`, as in a lens file.
    surfaces : the keys of each surface, and the line that it stands on.
    reading : how it was read, where it leaves that open.
    """

    file: str
    values: dict[str, Any] = field(default_factory=dict)
    surfaces: list[tuple[int, dict[str, Any]]] = field(default_factory=list)
    reading: Reading | None = None

    def refuse(self, message: str, line: int | None = None) -> NoReturn:
        """Raise what is wrong with the file, on a line of it."""
        raise SceneError(message, file=self.file, line=line)

    def spec(self) -> LensSpec:
        """The lens, checked.

        Raises
        ------
        SceneError : it is no lens; the error names the line of the surface that is wrong.
        """
        values = {**self.values, "surfaces": [surface for _, surface in self.surfaces]}
        try:
            return LensSpec.model_validate(values)
        except ValidationError as error:
            raise self._told(error) from None

    def _told(self, error: ValidationError) -> SceneError:
        first = error.errors(include_url=False)[0]
        path = [step for step in first["loc"] if isinstance(step, str | int)]
        line, key = None, str(path[0]) if path else ""
        if len(path) > 1 and path[0] == "surfaces" and isinstance(path[1], int):
            line, surface = self.surfaces[path[1]]
            # Behind the surface pydantic names its type, which a key may be called like.
            below = path[3:] if path[2:3] == [surface.get("type")] else path[2:]
            key = ".".join(map(str, below))
        return SceneError(sentence(first), file=self.file, line=line, key=key)


def rounded(value: float) -> float:
    """A number as people would write it, where a product of one has more digits than it was made from."""
    return float(f"{value:.12g}")


def shape(curvature: float, conic: float = 0.0, coefficients: Sequence[float] = ()) -> dict[str, Any]:
    """The keys of a surface of glass that say what it is, from its curvature (1/mm) and what makes it no sphere."""
    radius = {} if curvature == 0.0 else {"radius": rounded(1.0 / curvature)}
    used = max((power for power, value in enumerate(coefficients, start=1) if value != 0.0), default=0)
    if used:
        return {"type": "asphere", **radius, "conic": conic, "coefficients": list(coefficients[:used])}
    if not radius:
        return {"type": "flat"}
    return {"type": "conic", **radius, "conic": conic} if conic != 0.0 else {"type": "spherical", **radius}
