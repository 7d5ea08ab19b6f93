"""The textures that a scene's materials ask for: their files read, their values checked, their tables packed."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from raytracer.errors import InputError, shown
from raytracer.materials.interface import MaterialSpec
from raytracer.scene.materials import resolved
from raytracer.scene.objects import Assets as Files
from raytracer.scene.spec import SceneSpec
from raytracer.textures.interface import Assets, Book, Range, TextureSpec, Use, textures_of

_Keys = tuple[str | int, ...]


class _Place(NamedTuple):
    """Where a material asks for a texture, and where the texture itself stands."""

    asked: _Keys
    stands: _Keys


def _inline(material: MaterialSpec, keys: _Keys) -> Iterator[tuple[MaterialSpec, _Keys]]:
    """A material and those that it holds inline, each with where it stands."""
    yield material, keys
    for below, child in material.children().items():
        if isinstance(child, MaterialSpec):
            yield from _inline(child, (*keys, *below))


def _places(
    spec: SceneSpec, used: Sequence[MaterialSpec], stand: Mapping[MaterialSpec, _Keys]
) -> Iterator[tuple[Use, _Place]]:
    """Each texture that a material asks for, once for each time."""
    roots = list(stand.items())
    for path, item in spec.all_objects():
        if isinstance(item.material, MaterialSpec):
            roots.append((item.material, (*path, "material")))
    roots += [(material, ("materials", name)) for name, material in spec.materials.items()]
    keys: dict[MaterialSpec, _Keys] = {}
    for material, path in roots:
        keys |= _inline(material, path)
        keys[resolved(material, spec.materials)] = path
    for material in dict.fromkeys(used):
        for use in textures_of(material):
            asked = (*keys[material], use.key) if material in keys else ("materials",)
            yield use, _Place(asked, ("textures", use.value) if isinstance(use.value, str) else asked)


def _read(spec: SceneSpec, texture: TextureSpec, keys: _Keys, files: Files) -> Assets:
    """What a texture's files held.

    Raises
    ------
    SceneError : a file cannot be read, or lacks what the texture asks for.
    """
    found: dict[str, Any] = {}
    for key, kind in texture.loads.items():
        try:
            found[key] = files.read(kind, getattr(texture, key))
        except InputError as error:
            raise spec.error(str(error), *keys, key) from None
    try:
        texture.check(found)
    except ValueError as error:
        raise spec.error(str(error), *keys) from None
    return found


def _check_range(spec: SceneSpec, use: Use, values: Range, keys: _Keys) -> None:
    """Refuse a texture that takes values that the parameter cannot have."""
    bounds = use.field.bounds
    if bounds.low <= values.low and values.high <= bounds.high:
        return
    name = f"texture {shown(use.value)}" if isinstance(use.value, str) else "texture"
    side, bound, value = (
        ("at least", bounds.low, values.low) if values.low < bounds.low else ("at most", bounds.high, values.high)
    )
    raise spec.error(f"must be {side} {bound:g}, and the {name} takes the value {value:.6g}", *keys)


def pack_textures(
    spec: SceneSpec, used: Sequence[MaterialSpec], stand: Mapping[MaterialSpec, _Keys], files: Files
) -> Book:
    """What materials are packed with, holding the textures that the `used` ones ask for.

    stand : where materials stand that are not in the scene itself but in files of its objects.

    Raises
    ------
    SceneError : a texture's file cannot be read, or its values do not suit what they stand for.
    """
    assets: dict[TextureSpec, Assets] = {}
    uses: list[Use] = []
    for use, place in _places(spec, used, stand):
        texture = spec.textures[use.value] if isinstance(use.value, str) else use.value
        uses.append(use)
        for variant in (texture, texture.as_data()):
            if variant not in assets:
                assets[variant] = _read(spec, variant, place.stands, files)
        _check_range(spec, use, (texture.as_data() if use.field.data else texture).range(assets[texture]), place.asked)
    return Book(spec.textures, uses, assets)
