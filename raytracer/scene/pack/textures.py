"""Pack the textures that a scene's materials use: read their files, check their values, pack their tables."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from raytracer.plugins.materials.base.interface import MaterialSpec
from raytracer.plugins.textures.base.interface import (
    Assets,
    ParameterPacker,
    TextureSpec,
    TextureUse,
    ValueRange,
    textures_of,
)
from raytracer.scene.pack.materials import resolve_material
from raytracer.scene.scene_assets import SceneAssets
from raytracer.scene.spec import SceneSpec
from raytracer.schema.yaml_nodes import KeyPath
from raytracer.util.errors import InputError, format_value


class _TexturePaths(NamedTuple):
    """Paths of a texture: that of the key that uses it, and its own."""

    use_path: KeyPath
    texture_path: KeyPath


def _inline(material: MaterialSpec, keys: KeyPath) -> Iterator[tuple[MaterialSpec, KeyPath]]:
    """Walk through a material and those that it holds inline, each with its path."""
    yield material, keys
    for below, child in material.children().items():
        if isinstance(child, MaterialSpec):
            yield from _inline(child, (*keys, *below))


def _texture_uses(
    spec: SceneSpec, used: Sequence[MaterialSpec], file_paths: Mapping[MaterialSpec, KeyPath]
) -> Iterator[tuple[TextureUse, _TexturePaths]]:
    """Walk through the uses of textures by materials, with their paths."""
    roots = list(file_paths.items())
    for path, item in spec.all_objects():
        if isinstance(item.material, MaterialSpec):
            roots.append((item.material, (*path, "material")))
    roots += [(material, ("materials", name)) for name, material in spec.materials.items()]
    keys: dict[MaterialSpec, KeyPath] = {}
    for material, path in roots:
        keys |= _inline(material, path)
        keys[resolve_material(material, spec.materials)] = path
    for material in dict.fromkeys(used):
        for use in textures_of(material):
            asked = (*keys[material], use.key) if material in keys else ("materials",)
            yield use, _TexturePaths(asked, ("textures", use.value) if isinstance(use.value, str) else asked)


def _read(spec: SceneSpec, texture: TextureSpec, keys: KeyPath, files: SceneAssets) -> Assets:
    """Read a texture's files.

    Raises
    ------
    SceneError : a file cannot be read, or does not suit the texture.
    """
    contents: dict[str, Any] = {}
    for key, kind in texture.loads.items():
        try:
            contents[key] = files.read(kind, getattr(texture, key))
        except InputError as error:
            raise spec.error(str(error), *keys, key) from None
    try:
        texture.check(contents)
    except ValueError as error:
        raise spec.error(str(error), *keys) from None
    return contents


def _check_range(spec: SceneSpec, use: TextureUse, values: ValueRange, keys: KeyPath) -> None:
    """Reject a texture with values that the parameter cannot have."""
    bounds = use.field.bounds
    if bounds.low <= values.low and values.high <= bounds.high:
        return
    name = f"texture {format_value(use.value)}" if isinstance(use.value, str) else "texture"
    side, bound, value = (
        ("at least", bounds.low, values.low) if values.low < bounds.low else ("at most", bounds.high, values.high)
    )
    raise spec.error(f"must be {side} {bound:g}, and the {name} takes the value {value:.6g}", *keys)


def pack_textures(
    spec: SceneSpec, used: Sequence[MaterialSpec], file_paths: Mapping[MaterialSpec, KeyPath], files: SceneAssets
) -> ParameterPacker:
    """Pack the textures that the materials `used` ask for, into the packer of material parameters.

    file_paths : paths of materials that are not in the scene itself but in files of its objects.

    Raises
    ------
    SceneError : a texture's file cannot be read, or its values do not suit the parameter.
    """
    assets: dict[TextureSpec, Assets] = {}
    uses: list[TextureUse] = []
    for use, place in _texture_uses(spec, used, file_paths):
        texture = spec.textures[use.value] if isinstance(use.value, str) else use.value
        uses.append(use)
        for variant in (texture, texture.as_data()):
            if variant not in assets:
                assets[variant] = _read(spec, variant, place.texture_path, files)
        _check_range(
            spec, use, (texture.as_data() if use.field.data else texture).range(assets[texture]), place.use_path
        )
    return ParameterPacker(spec.textures, uses, assets)
