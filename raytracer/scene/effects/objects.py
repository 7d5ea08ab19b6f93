"""Effects of objects: their placement, materials, textures and media."""

from collections.abc import Sequence
from itertools import chain

from raytracer.core.primitives.base.interface import has_vertex_normals
from raytracer.kernel.packed_scene import Scene
from raytracer.plugins.materials.base.interface import MaterialSpec
from raytracer.plugins.textures.base.interface import textures_of
from raytracer.report.wording import count, plural
from raytracer.scene.effects.effect import Effect, kind_effects
from raytracer.scene.spec import SceneSpec
from raytracer.schema.registry import MATERIALS, MEDIA, SHAPES, TEXTURES


def surface_effects(
    of_objects: Sequence[MaterialSpec], made_of: Sequence[MaterialSpec], scene: Scene
) -> dict[str, Effect]:
    """List the effects of surfaces; `of_objects`: the material of each object, `made_of`: with the parts of these."""
    is_smooth = any(has_vertex_normals(table) for table in scene.primitives)
    return {
        "relief": _normal_mapping(made_of, scene),
        "smooth_shading": Effect(
            is_smooth,
            "meshes are shaded with normals that run smoothly from vertex to vertex"
            if is_smooth
            else "no mesh is smooth, so faces are shaded as flat as they are",
        ),
        "passage": Effect(scene.transparency is not None, _why_transparency(of_objects, scene)),
        "nested_dielectrics": Effect(scene.nested_dielectrics is not None, _why_nested(scene)),
    }


def placement_effects(spec: SceneSpec, scene: Scene) -> dict[str, Effect]:
    """List the effects of media, instances, and the shift of the origin."""
    return {
        "media": Effect(scene.media is not None, _why_media(spec, scene)),
        "instances": Effect(scene.instances is not None, _why_instances(scene)),
        "recentring": Effect(scene.origin is not None, _why_origin_shift(scene)),
    }


def object_kinds(
    spec: SceneSpec, scene: Scene, by_object: Sequence[Sequence[MaterialSpec]], made_of: Sequence[MaterialSpec]
) -> dict[str, Effect]:
    """List one effect a kind of material, texture, medium and shape, active where any in use is of it."""
    materials = chain.from_iterable({part.type for part in parts} for parts in by_object)
    surfaces = (*scene.materials, *(scene.selectors.tables if scene.selectors is not None else ()))
    values = [use.value for part in made_of for use in textures_of(part)]
    textures = [(spec.textures[value] if isinstance(value, str) else value).type for value in values]
    media = [spec.media[name].type for name in _media(spec)]
    spaces = scene.media.tables if scene.media is not None else ()
    shapes = [item.type for item in spec.objects]
    return {
        **kind_effects("material", MATERIALS.modules, materials, "object", len(by_object), surfaces),
        **kind_effects("texture", TEXTURES.modules, textures, "parameter", "materials", scene.textures or ()),
        **kind_effects("medium", MEDIA.modules, media, "use", len(media), spaces),
        **kind_effects("shape", SHAPES.modules, shapes, "object", len(shapes)),
    }


def _media(spec: SceneSpec) -> list[str]:
    """List the name of a medium for each time that the scene uses one."""
    objects = [name for _, item in spec.all_objects() for name in (item.medium, item.outside_medium)]
    return [name for name in (spec.medium, spec.camera.medium, *objects) if name is not None]


def _why_media(spec: SceneSpec, scene: Scene) -> str:
    used = _media(spec)
    if scene.media is not None:
        inside = sum(item.medium is not None for _, item in spec.all_objects())
        places = [f"{spec.medium!r} fills the scene"] if spec.medium is not None else []
        return "; ".join([*places, f"{count(inside, 'object')} of {len(spec.all_objects())} with a medium inside"])
    if used:
        return "the media that are used take nothing from light"
    return "no medium is used, so light travels without absorption or scattering"


def _why_instances(scene: Scene) -> str:
    if scene.instances is None:
        return "no object is placed more than once, turns, or is stretched to an ellipsoid"
    instances = scene.instances
    number, moving = len(instances.group), len(instances.group) - len(instances.pose)
    moves = f", of which {moving:,} move{'s' if moving == 1 else ''}" if moving else ""
    groups = count(len(instances.rows), "group")
    return f"{number:,} {plural(number, 'placement')} of {groups} of primitives{moves}"


def _why_origin_shift(scene: Scene) -> str:
    if scene.origin is None:
        return "the scene, and each group, lies near enough to its origin for float32"
    x, y, z = scene.origin.world
    away = f"the scene is packed round its point [{x:.10g}, {y:.10g}, {z:.10g}]" if any(scene.origin.world) else ""
    moved = 0 if scene.origin.groups is None else int(scene.origin.groups.any(axis=1).sum())
    inside = f"{count(moved, 'group')} of primitives round a point of its own" if moved else ""
    return " and ".join(filter(None, (away, inside))) + ", since float32 is coarse far from the origin"


def _why_transparency(of_objects: Sequence[MaterialSpec], scene: Scene) -> str:
    if scene.transparency is None:
        return "no surface has holes or is a mere boundary, so what is met ends a ray"
    holes = sum(material.has_passthrough() for material in of_objects)
    if scene.nested_dielectrics is not None and not holes:
        return "rays, those for shadows too, go on straight through surfaces that others hide by their priority"
    where = count(holes, "object") if holes else "the file of a mesh"
    return f"rays, those for shadows too, go on straight through {where}"


def _why_nested(scene: Scene) -> str:
    if scene.nested_dielectrics is None:
        return "no material in use has a priority, so each surface is a boundary to its `outside_ior`"
    number = len(scene.nested_dielectrics.surface)
    look = "; rays of the camera find out what they begin in" if scene.nested_dielectrics.camera is not None else ""
    return f"{count(number, 'material')} in use have a priority, by which they may overlap{look}"


def _normal_mapping(made_of: Sequence[MaterialSpec], scene: Scene) -> Effect:
    """Tell whether materials have bump or normal maps."""
    packed = scene.normal_mapping
    if packed is None or (packed.normal_maps is None and packed.bumps is None):
        why = "no material in use has a bump or a normal map, so surfaces are shaded as smooth as they are"
        return Effect(False, why)
    number = sum(part.bump is not None or part.normal_map is not None for part in made_of)
    return Effect(True, f"{count(number, 'material')} in use have a bump or a normal map")
