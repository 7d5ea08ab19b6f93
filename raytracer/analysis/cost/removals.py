"""Removals of effects from checked scenes, packed scenes and materials, for the variants of `variants.py`.

A shutter without its ramps is open for as long as with them, so that the picture keeps its brightness.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytracer.core.fresnel import REC709_LUMINANCE
from raytracer.core.geometry import Site
from raytracer.core.shutter.spec import ShutterSpec
from raytracer.kernel.packed_scene import Scene
from raytracer.optics.glass import Glass, constant_index_glass
from raytracer.plugins.cameras.base.moving import camera_at_time
from raytracer.plugins.lights.background import Background
from raytracer.plugins.materials.base.interface import MaterialSpec, SelectorSpec, reflectance, row
from raytracer.plugins.materials.lambertian import Lambertian
from raytracer.plugins.media.base.interface import NO_MEDIUM
from raytracer.plugins.textures.base.interface import ParameterPacker, Texturable, TextureSpec, textures_of
from raytracer.scene.pack.world import MaterialVariant
from raytracer.scene.spec import SceneSpec
from raytracer.schema.fields import Triple
from raytracer.schema.registry import CAMERAS

_ANYWHERE = Site((0.0, 0.0, 0.0), 0.0, 0.0, 0.0)


# ---- Checked scenes


def with_camera(spec: SceneSpec, **values: Any) -> SceneSpec:
    """Replace values of the camera."""
    return spec.model_copy(update={"camera": spec.camera.model_copy(update=values)})


def with_still_camera(spec: SceneSpec) -> SceneSpec:
    """Hold the camera still."""
    return with_camera(spec, shake=None)


def without_motion(spec: SceneSpec) -> SceneSpec:
    """Freeze the scene in the middle of the time in which the shutter is open."""
    span = spec.camera.shutter_interval()
    time = 0.5 * (span.open + span.close)
    still = camera_at_time(spec.camera, time).model_copy(update={"motion": None, "shake": None})
    return spec.model_copy(
        update={
            "camera": still,
            "objects": tuple(item.at_time(time) for item in spec.objects),
            "groups": {name: tuple(item.at_time(time) for item in items) for name, items in spec.groups.items()},
        }
    )


def with_instant_shutter(spec: SceneSpec) -> SceneSpec:
    """Let the shutter open and close at once, exposing for as long, about the same mean time."""
    timing, shutter = spec.camera.timing(), spec.camera.shutter
    assert isinstance(shutter, ShutterSpec)
    times, transmissions = np.array(timing.profile).T
    width, (a, b) = np.diff(times), (transmissions[:-1], transmissions[1:])
    # The integral of the linear transmission times time, over that of transmission.
    moment = (width * (a * (2.0 * times[:-1] + times[1:]) + b * (times[:-1] + 2.0 * times[1:])) / 6.0).sum()
    seconds = timing.seconds()
    begin = timing.opens + float(moment) / seconds - 0.5 * seconds
    update = {"open": begin, "close": None, "duration": seconds, "opening": "instant", "ramp": None}
    return with_camera(spec, shutter=shutter.model_copy(update=update), time=None)


def with_global_shutter(spec: SceneSpec) -> SceneSpec:
    """Expose all of the film when its middle was exposed."""
    timing, shutter = spec.camera.timing(), spec.camera.shutter
    assert isinstance(shutter, ShutterSpec)
    later = 0.5 * timing.readout
    close = None if shutter.close is None else shutter.close + later
    update = {"open": timing.opens + later, "close": close, "readout": 0.0}
    return with_camera(spec, shutter=shutter.model_copy(update=update), time=None)


def with_thin_lens(spec: SceneSpec) -> SceneSpec:
    """Replace the camera's lens of glass by its equivalent thin lens."""
    camera: Any = spec.camera
    keys = camera.thin_lens_equivalent(spec.film.width, spec.film.height)
    thin = CAMERAS.specs()[keys["type"]].model_validate(keys)
    return spec.model_copy(update={"camera": thin})


def without_dispersion(spec: SceneSpec) -> SceneSpec:
    """Remove dispersion within the lens."""
    return with_camera(spec, dispersion=False) if hasattr(spec.camera, "dispersion") else spec


# ---- Packed scenes


def without_path(node: Any, path: Sequence[str]) -> Any:
    """Set a path of fields of a packed NamedTuple to None; of a moving camera, in the camera that it holds."""
    name, *rest = path
    if name not in node._fields:
        return node._replace(camera=without_path(node.camera, path))
    return node._replace(**{name: without_path(getattr(node, name), rest) if rest else None})


def _with_tables(scene: Scene, tables: Sequence[Any], **values: Any) -> Scene:
    """Replace the tables of lights of a scene; without any, rays meet the environment as where there are no lights."""
    return scene._replace(lights=scene.lights._replace(tables=tuple(tables), **values) if tables else None)


def without_environment_sampling(scene: Scene) -> Scene:
    """Remove next-event estimation of the environment."""
    tables = [table for table in scene.lights.tables if not isinstance(table, Background)]
    return _with_tables(scene, tables, background_tables=scene.environment)


def without_light_kind(scene: Scene, module: str) -> Scene:
    """Remove the lights of the kind that a module defines."""
    if scene.lights is None:
        return scene
    return _with_tables(scene, [table for table in scene.lights.tables if type(table).__module__ != module])


def without_media_kind(scene: Scene, module: str) -> Scene:
    """Remove the media of the kind that a module defines."""
    media = scene.media
    left = [number for number, table in enumerate(media.tables) if type(table).__module__ != module]
    numbers = np.full(len(media.tables), NO_MEDIUM, np.int32)
    numbers[left] = np.arange(len(left))

    def renamed(references: NDArray[np.int32]) -> NDArray[np.int32]:
        rows, kinds = np.divmod(np.maximum(references, 0), len(media.tables))
        there = np.where(numbers[kinds] == NO_MEDIUM, NO_MEDIUM, rows * len(left) + numbers[kinds])
        return np.where(references < 0, references, there).astype(np.int32)

    return scene._replace(
        media=media._replace(
            tables=tuple(media.tables[number] for number in left),
            inside=renamed(media.inside),
            outside=renamed(media.outside),
            camera=int(renamed(np.array(media.camera, np.int32))),
        )
    )


# ---- Materials


def _mean(packer: ParameterPacker, field: Texturable, value: str | TextureSpec) -> Any:
    """Compute the plain value nearest to a texture: its mean, or None for a normal or bump map."""
    if field.plain is None:
        return None
    mean = np.clip(packer.mean(value, data=field.data), field.bounds.low, field.bounds.high)
    return tuple(mean.tolist()) if isinstance(field.plain, Triple) else float(mean @ np.array(REC709_LUMINANCE))


def in_all_materials(change: MaterialVariant) -> MaterialVariant:
    """Make a change of a material one of the materials in it too; each is changed once."""
    changed: dict[MaterialSpec, MaterialSpec] = {}

    def change_all(material: MaterialSpec, packer: ParameterPacker) -> MaterialSpec:
        if material not in changed:
            new = change(material, packer)
            if new is not material:
                new = change_all(new, packer)
            elif isinstance(material, SelectorSpec):
                new = material.with_children([change_all(child, packer) for child in material.children().values()])
            changed[material] = new
        return changed[material]

    return change_all


def with_mean_textures(material: MaterialSpec, packer: ParameterPacker, kind: str | None = None) -> MaterialSpec:
    """Replace textures of a material, all or those of a kind, by their means."""
    means = {
        use.key: _mean(packer, use.field, use.value)
        for use in textures_of(material)
        if kind in (None, packer.texture(use.value, data=use.field.data).type)
    }
    return material.with_mean_textures(means) if means else material


def without_material(material: MaterialSpec, packer: ParameterPacker, kind: str) -> MaterialSpec:
    """Replace a material of a kind: by what a selector mostly shows, else by a matte surface."""
    if material.type != kind:
        return material
    if isinstance(material, SelectorSpec):
        return material.nearest_child(packer) or material
    even = with_mean_textures(material, packer)
    albedo = reflectance(row(type(even).pack([even], ParameterPacker()), 0, None, _ANYWHERE))
    # Normal and bump maps are an effect of their own.
    maps = {key: getattr(material, key) for key in MaterialSpec.model_fields if key != "type"}
    return Lambertian().model_copy(update=maps | {"albedo": tuple(np.clip(albedo, 0.0, 1.0).tolist())})


def with_constant_index(material: MaterialSpec, _: ParameterPacker) -> MaterialSpec:
    """Replace dispersive glass by glass that refracts all colours as it refracts the d line."""
    fixed = {
        key: constant_index_glass(float(value.ior()))
        for key, value in material.__dict__.items()
        if isinstance(value, Glass) and value.disperses()
    }
    return material.model_copy(update=fixed) if fixed else material
