"""Image: a picture file laid over a surface by its parameters u and v.

In a scene:

    globe: {type: image, file: earth.png, wrap: [repeat, clamp]}
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator, Field
from pydantic.json_schema import JsonSchemaValue

from raytracer.core.compiler.dispatch import generic, kernel
from raytracer.core.fresnel import REC709_LUMINANCE
from raytracer.core.vec import Vec3
from raytracer.plugins.textures.base.interface import (
    Assets,
    TextureSpec,
    ValueRange,
    luminance,
    texture,
    texture_gradient,
)
from raytracer.schema.fields import Angle, Check, Color, Quantity, check_item, list_schema
from raytracer.util.errors import format_value

_NUMBERS = {"r": 0, "g": 1, "b": 2}

_WRAPS = ("repeat", "clamp", "mirror")
_REPEAT, _CLAMP, _MIRROR = range(3)

# Columns of the tables.
_FACTOR, _PLACEMENT, _FIRST, _SIZE, _CHANNELS, _WRAP, _NEAREST = 0, 3, 9, 10, 12, 13, 15


@dataclass(frozen=True)
class _Pair(Check):
    """Annotation of a field of two numbers, for u and v, each checked by `component`."""

    component: Quantity
    single: bool = False
    """One number stands for two equal ones."""

    def __call__(self, value: Any) -> tuple[float, float]:
        if isinstance(value, list | tuple):
            if len(value) != 2:
                raise ValueError(f"must be two numbers, for u and v, got {format_value(value)}")
            return check_item(value[0], self.component, (0,)), check_item(value[1], self.component, (1,))
        if self.single and isinstance(value, int | float | str) and not isinstance(value, bool):
            number = self.component(value)
            return number, number
        raise ValueError(f"must be two numbers, for u and v, got {format_value(value)}")

    def json_schema(self) -> JsonSchemaValue:
        return list_schema(self.component, 2, single=self.single)


Wrap: TypeAlias = Literal["repeat", "clamp", "mirror"]


def _both(value: Any) -> Any:
    return (value, value) if isinstance(value, str) else value


class ImageTexture(TextureSpec):
    """A picture over the surface: its lower left corner is at u = v = 0, its upper right corner at u = v = 1.

    Row 0 of the file, the top of the picture, is at v = 1, as in OBJ files.  The picture is looked up at offset +
    R(rotation) (scale * (u, v)), with R anticlockwise.  Texels are points in the middle of their squares, between which
    `bilinear` interpolates in linear light.
    """

    loads: ClassVar[Mapping[str, str]] = {"file": "image"}

    type: Literal["image"] = "image"
    file: str = Field(
        description="picture (.png .jpg .bmp .tga .tif .webp .exr .hdr .npy), relative to the scene", min_length=1
    )
    encoding: Literal["auto", "srgb", "linear"] = Field(
        default="auto",
        description="what the file's numbers are; `auto`: sRGB if they are integers and stand for colours, else linear",
    )
    filter: Literal["bilinear", "nearest"] = Field(default="bilinear", description="what lies between texels")
    wrap: Annotated[tuple[Wrap, Wrap], BeforeValidator(_both, json_schema_input_type=Wrap | tuple[Wrap, Wrap])] = Field(
        default=("repeat", "repeat"), description="what lies outside of 0..1; a name, or one for u and one for v"
    )
    channel: Literal["rgb", "r", "g", "b", "a", "luminance"] = Field(
        default="rgb", description="the colour, or one channel of the file, or its luminance, as grey"
    )
    factor: Color = Field(default=(1.0, 1.0, 1.0), description="what the decoded values are multiplied by")
    scale: Annotated[tuple[float, float], _Pair(Quantity(nonzero=True), single=True)] = Field(
        default=(1.0, 1.0), description="how often the picture fits into u and v of 0..1; one number or two"
    )
    offset: Annotated[tuple[float, float], _Pair(Quantity())] = Field(
        default=(0.0, 0.0), description="where in the picture u = v = 0 lies"
    )
    rotation: Angle = Field(default=0.0, description="by how much u and v are turned, anticlockwise")

    def as_data(self) -> Self:
        return self.model_copy(update={"encoding": "linear"}) if self.encoding == "auto" else self

    def _is_srgb(self, assets: Assets) -> bool:
        return self.encoding == "srgb" or (self.encoding == "auto" and assets["file"].integer)

    def _is_bytes(self, assets: Assets) -> bool:
        # Luminance is that of linear light, which bytes cannot hold.
        return bool(assets["file"].texels.dtype == np.uint8) and self.channel != "luminance"

    def _curve(self, assets: Assets) -> NDArray[np.float64]:
        """Return the linear value of each byte."""
        curve: NDArray[np.float64] = assets["file"].curve(self._is_srgb(assets) and self.channel != "a")
        return curve

    def group(self, assets: Assets) -> str:
        return f"{self.type} of {'bytes' if self._is_bytes(assets) else 'floats'}"

    @staticmethod
    def pack(specs: Sequence["ImageTexture"], assets: Sequence[Assets]) -> "ByteImages | FloatImages":
        as_bytes = specs[0]._is_bytes(assets[0])
        stored = [spec.stored_texels(files, as_bytes=as_bytes) for spec, files in zip(specs, assets, strict=True)]
        starts = np.cumsum([0, *(texels.size for texels in stored)])
        columns = []
        for spec, start, texels in zip(specs, starts[:-1], stored, strict=True):
            height, width, channels = texels.shape
            wraps = (_WRAPS.index(name) for name in spec.wrap)
            layout = (start, width, height, channels, *wraps, spec.filter == "nearest")
            columns.append((*spec.factor, *spec.uv_transform(), *layout))
        rows = np.array(columns, np.float64)
        flat = np.concatenate([texels.ravel() for texels in stored])
        if not as_bytes:
            return FloatImages(flat, rows)
        curves = np.array([spec._curve(files) for spec, files in zip(specs, assets, strict=True)])
        return ByteImages(flat, curves, rows)

    def stored_texels(self, assets: Assets, *, as_bytes: bool) -> NDArray[Any]:
        """Return the texels to be packed: (height, width, 1 or 3), uint8 not yet decoded or float32 in linear light."""
        image = assets["file"]
        texels = image.texels if as_bytes else image.linear(self._is_srgb(assets))
        colors = texels[..., : texels.shape[2] - (texels.shape[2] in (2, 4))]
        if self.channel == "a":
            return np.asarray(texels[..., -1:])
        if self.channel == "rgb" or colors.shape[2] == 1:
            return np.asarray(colors)
        if self.channel == "luminance":
            return np.asarray((colors @ np.array(REC709_LUMINANCE, np.float32))[..., None])
        return np.asarray(colors[..., _NUMBERS[self.channel], None])

    def check(self, assets: Assets) -> None:
        if self.channel == "a" and assets["file"].texels.shape[2] not in (2, 4):
            raise ValueError(f"{format_value(self.file)} has no channel a (transparency)")

    def uv_transform(self) -> tuple[float, ...]:
        """Return the affine map of (u, v) to the picture, row by row."""
        turn = math.fmod(self.rotation, 360.0)
        cosine, sine = math.cos(math.radians(turn)), math.sin(math.radians(turn))
        if turn % 90.0 == 0.0:
            cosine, sine = round(cosine), round(sine)
        (scale_u, scale_v), (offset_u, offset_v) = self.scale, self.offset
        return cosine * scale_u, -sine * scale_v, offset_u, sine * scale_u, cosine * scale_v, offset_v

    def mean(self, assets: Assets) -> Vec3:
        texels = self.stored_texels(assets, as_bytes=False)
        r, g, b = np.broadcast_to(texels.mean(axis=(0, 1), dtype=np.float64), 3) * self.factor
        return float(r), float(g), float(b)

    def range(self, assets: Assets) -> ValueRange:
        texels = self.stored_texels(assets, as_bytes=self._is_bytes(assets))
        ends = np.stack([texels.min(axis=(0, 1)), texels.max(axis=(0, 1))])
        values = (self._curve(assets)[ends] if ends.dtype == np.uint8 else ends) * np.array(self.factor)
        return ValueRange(float(values.min()), float(values.max()))


class ByteImages(NamedTuple):
    """Packed images of bytes.

    texels (m,) uint8 : of all images one after another.
    curve (n, 256) float64 : linear value of each byte.
    rows (n, 16) float64 : factor, the six numbers of the map from (u, v), the place of the first texel, columns, rows,
        channels (1 or 3), the two wraps, and 1 for the nearest texel.
    """

    texels: NDArray[np.uint8]
    curve: NDArray[np.float64]
    rows: NDArray[np.float64]


class FloatImages(NamedTuple):
    """Packed images of floats, as ByteImages, with texels (m,) float32 in linear light."""

    texels: NDArray[np.float32]
    rows: NDArray[np.float64]


@generic
def _decode_texel(table, index, at):
    """Read the number at a place in a table's texels, in linear light."""


@_decode_texel.register(ByteImages)
def _decode_texel_byte_images(table, index, at):
    return table.curve[index, table.texels[at]]


@_decode_texel.register(FloatImages)
def _decode_texel_float_images(table, index, at):
    return np.float64(table.texels[at])


@kernel
def wrap_index(cell: int, count: int, wrap: int) -> int:
    """Wrap a column or row, which may be outside of 0 .. count - 1."""
    if wrap == _CLAMP:
        return max(0, min(count - 1, cell))
    if wrap == _REPEAT:
        return cell % count
    cell %= 2 * count
    return cell if cell < count else 2 * count - 1 - cell


@kernel
def _texel(table, index, first, channels):
    """Read the colour at a place in a table's texels."""
    r = _decode_texel(table, index, first)
    if channels == 1:
        return (r, r, r)
    return (r, _decode_texel(table, index, first + 1), _decode_texel(table, index, first + 2))


@kernel
def _uv_to_texel(rows, index, u, v):
    """Transform (u, v) to the picture, in columns from the left and rows from the top."""
    s = rows[index, _PLACEMENT] * u + rows[index, _PLACEMENT + 1] * v + rows[index, _PLACEMENT + 2]
    t = rows[index, _PLACEMENT + 3] * u + rows[index, _PLACEMENT + 4] * v + rows[index, _PLACEMENT + 5]
    return s * rows[index, _SIZE], (1.0 - t) * rows[index, _SIZE + 1]


@kernel
def _filtered_texel(table, index, x, y):
    """Interpolate the colour at column x and row y of the picture, texels' middles being at halves."""
    rows = table.rows
    first, channels = int(rows[index, _FIRST]), int(rows[index, _CHANNELS])
    width, height = int(rows[index, _SIZE]), int(rows[index, _SIZE + 1])
    wrap_x, wrap_y = rows[index, _WRAP], rows[index, _WRAP + 1]

    # The nearest texel is the only one of the four with a weight.
    nearest = rows[index, _NEAREST] != 0.0
    x, y = (math.floor(x), math.floor(y)) if nearest else (x - 0.5, y - 0.5)
    left, top = math.floor(x), math.floor(y)
    part_x, part_y = x - left, y - top
    r, g, b = 0.0, 0.0, 0.0
    for corner in range(4):
        right, below = corner & 1, corner >> 1
        weight = (part_x if right else 1.0 - part_x) * (part_y if below else 1.0 - part_y)
        column, row = wrap_index(left + right, width, wrap_x), wrap_index(top + below, height, wrap_y)
        texel = _texel(table, index, first + (row * width + column) * channels, channels)
        r, g, b = r + weight * texel[0], g + weight * texel[1], b + weight * texel[2]
    return (rows[index, _FACTOR] * r, rows[index, _FACTOR + 1] * g, rows[index, _FACTOR + 2] * b)


@texture.register(ByteImages)
@texture.register(FloatImages)
def texture_byte_images(table, index, site):
    x, y = _uv_to_texel(table.rows, index, site.u, site.v)
    return _filtered_texel(table, index, x, y)


@texture_gradient.register(ByteImages)
@texture_gradient.register(FloatImages)
def texture_gradient_byte_images(table, index, site, tangent, bitangent):
    """Take differences over one texel, half to each side: continuous, where the derivative of bilinear values jumps."""
    rows = table.rows
    x, y = _uv_to_texel(rows, index, site.u, site.v)
    across = down = 0.0
    for side in range(2):
        sign = 2.0 * side - 1.0
        across += sign * luminance(_filtered_texel(table, index, x + 0.5 * sign, y))
        down += sign * luminance(_filtered_texel(table, index, x, y + 0.5 * sign))

    # By the chain rule, through the placement of the picture.
    by_s, by_t = across * rows[index, _SIZE], -down * rows[index, _SIZE + 1]
    along_u = rows[index, _PLACEMENT] * by_s + rows[index, _PLACEMENT + 3] * by_t
    return along_u, rows[index, _PLACEMENT + 1] * by_s + rows[index, _PLACEMENT + 4] * by_t
