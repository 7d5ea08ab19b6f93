"""Interface of textures: the spec's methods, the generic functions for kernels, and the parameters that textures set.

A kind's file holds its YAML spec, its packed table (one row a texture) and its case of `texture`.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, NamedTuple, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter
from pydantic.json_schema import JsonSchemaValue

from raytracer.core.compiler.dispatch import generic, kernel, switch
from raytracer.core.fresnel import REC709_LUMINANCE
from raytracer.core.geometry import row3
from raytracer.core.vec import Vec3, dot
from raytracer.schema.fields import Check, Quantity, Triple, Vector
from raytracer.schema.registry import TEXTURES
from raytracer.schema.spec import Spec
from raytracer.schema.units import parse_quantity
from raytracer.util.errors import format_value

Assets: TypeAlias = Mapping[str, Any]
"""Contents of a texture's files, by the key that names the file."""


class ValueRange(NamedTuple):
    """Lowest and highest value of a texture, in any channel."""

    low: float
    high: float


class TextureSpec(Spec):
    """Base of the textures."""

    type: str

    @staticmethod
    def pack(specs: Any, assets: Any) -> Any:
        """Pack the textures of one group, one row a spec; `assets` holds, by spec, the contents of its files."""
        raise NotImplementedError

    def group(self, assets: Assets) -> str:
        """Return the name of the group of textures that share a table; begins with the type."""
        return self.type

    def check(self, assets: Assets) -> None:
        """Refuse files that lack what the texture asks of them.

        Raises
        ------
        ValueError : they do; a sentence that says what.
        """

    def as_data(self) -> Self:
        """Return the texture for use as numbers, heights or normals and not as colours."""
        return self

    def mean(self, assets: Assets) -> Vec3:
        """Return the mean colour, by which lights are chosen; not zero unless the texture is black all over."""
        raise NotImplementedError

    def range(self, assets: Assets) -> ValueRange:
        """Return the range of its values."""
        raise NotImplementedError


# ---- Fields


def is_name(value: Any) -> bool:
    """Tell if a field's value is a name and not a number: it does not begin as a number or `#rrggbb` does."""
    return isinstance(value, str) and value.strip()[:1] not in tuple("#+-.0123456789") and not _is_quantity(value)


def _is_quantity(text: str) -> bool:
    try:
        parse_quantity(text, "number")
    except ValueError:
        return False
    return True


@cache
def _adapter() -> TypeAdapter[TextureSpec]:
    return TypeAdapter(TEXTURES.union())


@dataclass(frozen=True)
class Texturable(Check):
    """Annotation of a field that a texture may set: a plain value, a texture's name, or a texture itself.

    plain : the check of a plain value; None for a field that is a texture or None.
    data : True where the texture's values are no colours.
    """

    plain: Triple | Quantity | None
    data: bool

    def __call__(self, value: Any) -> Any:
        if isinstance(value, TextureSpec) or is_name(value):
            return value
        if isinstance(value, Mapping):
            return _adapter().validate_python(value)
        if self.plain is None:
            if value is None:
                return None
            raise ValueError(f"must be a texture's name or a texture {{type: ...}}, got {format_value(value)}")
        return self.plain(value)

    @property
    def bounds(self) -> ValueRange:
        """Range that a texture's values must keep to."""
        if self.plain is None:
            return ValueRange(-np.inf, np.inf)
        component = self.plain.component if isinstance(self.plain, Triple) else self.plain
        return ValueRange(component.low, component.high)

    def json_schema(self) -> JsonSchemaValue:
        """Return the schema of plain values, names and textures: `x-texture` stands for the definition of textures."""
        texture: list[JsonSchemaValue] = [{"type": "string"}, {"x-texture": True}]
        if self.plain is None:
            return {"anyOf": [*texture, {"type": "null"}]}
        plain = self.plain.json_schema()
        unit = plain.pop("x-unit", None)
        choices = [choice for choice in plain.pop("anyOf", [plain]) if choice.get("type") != "string"]
        return {"anyOf": [*choices, *texture], **({"x-unit": unit} if unit else {})}


OptionalTexture: TypeAlias = Annotated[str | TextureSpec | None, Texturable(None, data=True)]
TexturedRadiance: TypeAlias = Annotated[
    Vector | str | TextureSpec, Texturable(Triple(Quantity(low=0.0), "a radiance", single=True, color=True), data=False)
]
TexturedAlbedo: TypeAlias = Annotated[
    Vector | str | TextureSpec,
    Texturable(Triple(Quantity(low=0.0, high=1.0), "an albedo", single=True, color=True), data=False),
]
TexturedFraction: TypeAlias = Annotated[float | str | TextureSpec, Texturable(Quantity(low=0.0, high=1.0), data=True)]


class TextureUse(NamedTuple):
    """Texture that a spec asks for: the key, the field's annotation, and the name or texture."""

    key: str
    field: Texturable
    value: str | TextureSpec


def textures_of(spec: Spec) -> Iterator[TextureUse]:
    """List the textures that a spec's fields ask for."""
    for key, field in _texturable(type(spec)):
        value = getattr(spec, key)
        if isinstance(value, str | TextureSpec):
            yield TextureUse(key, field, value)


@cache
def _texturable(cls: type[Spec]) -> tuple[tuple[str, Texturable], ...]:
    """List the fields of a class that take textures."""
    every = ((key, field) for key, info in cls.model_fields.items() for field in info.metadata)
    return tuple((key, field) for key, field in every if isinstance(field, Texturable))


def is_zero(value: Any) -> bool:
    """Tell if a colour or number is zero wherever it is looked up; a texture is taken not to be."""
    return not isinstance(value, str | TextureSpec) and not np.any(value)


# ---- Kernels


@generic
def texture(table, index, site):
    """Look up the colour of texture `index` at a geometry.Site, in linear light."""


@generic
def texture_gradient(table, index, site, tangent, bitangent):
    """Return the derivatives of the luminance of texture `index` by u and v; `tangent` is dp/du, `bitangent` dp/dv.

    The derivatives are in the space of site.point.
    """


_texture_any = switch(texture)
_texture_gradient_any = switch(texture_gradient)


@kernel
def texture_at(textures, reference, site):
    """Call `texture` of the one that a parameter refers to by row * kinds + kind."""
    kinds = len(textures)
    return _texture_any(textures, reference % kinds, reference // kinds, site)


@kernel
def texture_gradient_at(textures, reference, site, tangent, bitangent):
    """Call `texture_gradient` of a texture, by its reference."""
    kinds = len(textures)
    return _texture_gradient_any(textures, reference % kinds, reference // kinds, site, tangent, bitangent)


class Colors(NamedTuple):
    """Colours of the rows of a table: values (n, 3) float64."""

    values: NDArray[np.float64]


class TexturedColors(NamedTuple):
    """Colours or textures of the rows of a table: reference (n,) int32, -1 for the plain value."""

    values: NDArray[np.float64]
    reference: NDArray[np.int32]


class Numbers(NamedTuple):
    """Numbers of the rows of a table: values (n,) float64."""

    values: NDArray[np.float64]


class TexturedNumbers(NamedTuple):
    """Numbers or textures of the rows of a table: reference (n,) int32, -1 for the plain value."""

    values: NDArray[np.float64]
    reference: NDArray[np.int32]


ColorParameter: TypeAlias = Colors | TexturedColors
NumberParameter: TypeAlias = Numbers | TexturedNumbers


@generic
def color(parameter, index, textures, site):
    """Look up a material's colour at a site."""


@color.register(Colors)
def color_colors(parameter, index, textures, site):
    return row3(parameter.values, index)


@color.register(TexturedColors)
def color_textured_colors(parameter, index, textures, site):
    reference = parameter.reference[index]
    return row3(parameter.values, index) if reference < 0 else texture_at(textures, reference, site)


@generic
def number(parameter, index, textures, site):
    """Look up a material's number at a site; of a texture it is the luminance."""


@number.register(Numbers)
def number_numbers(parameter, index, textures, site):
    return parameter.values[index]


@number.register(TexturedNumbers)
def number_textured_numbers(parameter, index, textures, site):
    reference = parameter.reference[index]
    return parameter.values[index] if reference < 0 else luminance(texture_at(textures, reference, site))


@kernel
def luminance(rgb: Vec3) -> float:
    """Return the relative luminance of a colour with the primaries of Rec. 709.

    References: ITU-R BT.709-6, table 3.
    """
    return dot(REC709_LUMINANCE, rgb)


class ParameterPacker:
    """Packer of the parameters of materials, from plain values and textures.

    named : textures by name.
    used : the textures that materials ask for, as `textures_of` lists them.
    assets : contents of the files of each.
    """

    def __init__(
        self,
        named: Mapping[str, TextureSpec] | None = None,
        used: Iterable[TextureUse] = (),
        assets: Mapping[TextureSpec, Assets] | None = None,
    ) -> None:
        self._named = named or {}
        self._assets = assets or {}
        groups: dict[str, dict[TextureSpec, int]] = {}
        for use in used:
            texture = self.texture(use.value, data=use.field.data)
            rows = groups.setdefault(texture.group(self._files(texture)), {})
            rows.setdefault(texture, len(rows))
        order = sorted(groups)
        self._references = {
            texture: row * len(order) + kind for kind, name in enumerate(order) for texture, row in groups[name].items()
        }
        self.tables: tuple[Any, ...] | None = None
        """One table a group of textures; None where nothing is textured."""
        if order:
            self.tables = tuple(
                next(iter(rows)).pack(list(rows), [self._files(texture) for texture in rows])
                for rows in (groups[name] for name in order)
            )

    def _files(self, spec: TextureSpec) -> Assets:
        return self._assets.get(spec, {})

    def texture(self, value: str | TextureSpec, *, data: bool) -> TextureSpec:
        """Return the texture of this name, or itself, as colours or as data."""
        texture = self._named[value] if isinstance(value, str) else value
        return texture.as_data() if data else texture

    def reference(self, value: Any, *, data: bool = True) -> int:
        """Return the number by which kernels know a texture, given or named; -1 for None and for a plain value."""
        if not isinstance(value, str | TextureSpec):
            return -1
        return self._references[self.texture(value, data=data)]

    def colors(self, values: Sequence[Any]) -> ColorParameter:
        """Pack the parameter of a table whose rows have these colours."""
        plain = [(0.0, 0.0, 0.0) if isinstance(value, str | TextureSpec) else value for value in values]
        rows = np.array(plain, np.float64).reshape(-1, 3)
        references = self._rows(values, data=False)
        return Colors(rows) if references is None else TexturedColors(rows, references)

    def numbers(self, values: Sequence[Any]) -> NumberParameter:
        """Pack the parameter of a table whose rows have these numbers."""
        plain = [0.0 if isinstance(value, str | TextureSpec) else value for value in values]
        rows = np.array(plain, np.float64)
        references = self._rows(values, data=True)
        return Numbers(rows) if references is None else TexturedNumbers(rows, references)

    def _rows(self, values: Sequence[Any], *, data: bool) -> NDArray[np.int32] | None:
        references = np.array([self.reference(value, data=data) for value in values], np.int32)
        return references if np.any(references >= 0) else None

    def mean(self, value: Any, *, data: bool = False) -> Vec3:
        """Return the mean of a colour, or of a number three times over; `data`: a texture stands for numbers."""
        if isinstance(value, str | TextureSpec):
            texture = self.texture(value, data=data)
            return texture.mean(self._files(texture))
        r, g, b = np.broadcast_to(np.asarray(value, np.float64), 3).tolist()
        return r, g, b
