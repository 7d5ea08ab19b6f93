"""Pack a checked scene to a NamedTuple whose type lists the scene's effects.

Only what the picture can depend on is packed: materials that no object has, and lights that nothing could reflect,
are left out, so the compiled kernel holds no code for them.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from raytracer.core.embree import Accel
from raytracer.core.geometry import Exact
from raytracer.core.sampling import SAMPLERS
from raytracer.core.shutter.table import Shutter
from raytracer.core.shutter.timing import pack_shutter
from raytracer.core.spectra import spectra
from raytracer.core.vec import Vec3, neg
from raytracer.core.world_origin import Origin
from raytracer.kernel.aovs.base.interface import SceneIds
from raytracer.kernel.hero_wavelength import DispersiveLens, DispersiveMaterials, MonochromaticCamera
from raytracer.kernel.packed_scene import Scene
from raytracer.kernel.pixel_accumulator import Clamp
from raytracer.kernel.transparency import TransparentShadows
from raytracer.optics.lens_system.surfaces import reverse_lens
from raytracer.plugins.cameras.base.interface import CameraParts, WavelengthSharing, camera_parts
from raytracer.plugins.cameras.base.interface import translate_camera as moved_camera
from raytracer.plugins.cameras.base.moving import MovingCamera, pack_camera
from raytracer.plugins.lights.base.interface import translate_lights as moved_lights
from raytracer.plugins.materials.base.interface import MaterialSpec
from raytracer.plugins.media.base.interface import translate_media as moved_media
from raytracer.scene.pack.autofocus import resolve_focus
from raytracer.scene.pack.layout import Item
from raytracer.scene.pack.lights import light_pulses, pack_lights
from raytracer.scene.pack.objects import Objects
from raytracer.scene.pack.world import MaterialVariant, PackedWorld, pack_world, world_key
from raytracer.scene.scene_assets import AccelInput, AssetProvider, SceneAssets
from raytracer.scene.spec import SceneSpec
from raytracer.scene.validation import bind_camera_files
from raytracer.schema.validation_errors import error_sentence


class PackedScene(NamedTuple):
    """A packed scene, ready for Embree to build its structure.

    scene : the packed scene, whose `accel` is still 0.
    objects : the packed objects, as Embree takes them too.
    materials : names by the references that primitives have.
    spec : the scene that was packed, its camera focused at a distance.
    built : the ray caster's structure, if focusing needed it.
    items : objects that `objects.owners` counts.
    empty : by number of the item, how many triangles without an area its file had, and the first of these.
    resolved_materials : by reference.
    """

    scene: Scene
    objects: Objects
    materials: Mapping[int, str]
    spec: SceneSpec
    built: Accel | None
    items: Sequence[Item]
    empty: Mapping[int, tuple[int, int]]
    resolved_materials: Mapping[int, MaterialSpec]

    @property
    def shift(self) -> Vec3:
        """Return the shift from the scene's coordinates to the packed ones (m)."""
        return (0.0, 0.0, 0.0) if self.scene.origin is None else neg(self.scene.origin.world)

    def build(self, provider: AssetProvider | None = None) -> Accel:
        """Build the ray caster's structure, or get it from `provider`; its address belongs into the scene."""
        if self.built is not None:
            return self.built
        return (provider or AssetProvider()).build_accel(self.accel_input())

    def accel_input(self) -> AccelInput:
        """Collect what the ray caster's structure is built of."""
        return _accel_input(self.spec, self.objects)


def _accel_input(spec: SceneSpec, objects: Objects) -> AccelInput:
    # Unless hits are taken as they are, rays must not slip through the edges between triangles.
    shapes = objects.geometries, objects.groups, objects.placements
    return AccelInput(*shapes, first_instance=len(objects.primitives), robust=spec.render.accuracy != "fast")


def pack(
    spec: SceneSpec,
    spp: int | None = None,
    assets: SceneAssets | None = None,
    material_variant: MaterialVariant | None = None,
    provider: AssetProvider | None = None,
) -> PackedScene:
    """Pack a checked scene.

    spp : samples per pixel that a stratified sampler is to expect; the scene's own if None.
    assets : the files that the scene names; read if None.
    material_variant : replaces each material in use, those that files bring included.
    provider : provides files, and what was packed or built before; None to make everything.

    Raises
    ------
    SceneError : an object's file cannot be read, or its transform does not suit it; or the camera cannot focus.
    """
    if not spec.objects:
        raise spec.error("the scene has no objects, so there is nothing to render", "objects")
    provider = provider or AssetProvider()
    files = assets or SceneAssets(spec, provider)
    spec = bind_camera_files(spec, provider.read)
    if material_variant is None:
        world = provider.get_or_create(
            world_key(spec), lambda: pack_world(spec, files, None), lambda it: it.assets.is_fresh(provider)
        )
    else:
        world = pack_world(spec, files, material_variant)
    return _pack_view(spec, world, files, provider, spp or spec.render.spp)


def _pack_view(
    spec: SceneSpec, world: PackedWorld, assets: SceneAssets, provider: AssetProvider, spp: int
) -> PackedScene:
    """Pack the view of a world: the camera, the lights and the render settings."""
    origin, objects, used, references = world.origin, world.objects, world.used, world.references
    is_aimed = spec.camera.focused_place() is not None
    built = provider.build_accel(_accel_input(spec, objects)) if is_aimed else None
    spec = resolve_focus(spec, world, built)
    camera = _pack_camera(spec, assets)
    if origin is not None:
        camera = moved_camera(camera, neg(origin.world))
    interior = world.solids.pack(references, world.boundaries, world.bounds, spec.camera, camera)
    moving = isinstance(camera, MovingCamera) or objects.moves()
    settings = spec.render
    is_lit = settings.max_depth > 1 and (
        world.media.scatters() or any(material.has_non_delta_bsdf() for material in used)
    )
    lights, instances = pack_lights(spec, world.environment, objects, used, references, world.packer, is_lit, moving)
    space = world.media.pack(references, world.interfaces)
    if origin is not None:
        lights, space = _shift_tables(lights, moved_lights, origin), _shift_tables(space, moved_media, origin)
    pulses, shutter = light_pulses(lights), None
    # Without these no path needs a time.
    if moving or pulses:
        shutter = pack_shutter(spec.camera.timing(), spec.film.width, spec.film.height, pulses)
    scene = Scene(
        accel=0,
        accuracy=Exact() if settings.accuracy == "exact" else None,
        primitives=objects.primitives,
        instances=instances,
        materials=world.tables,
        selectors=world.selectors,
        transparency=TransparentShadows()
        if interior is not None or any(material.has_passthrough() for material in used)
        else None,
        normal_mapping=world.normal_mapping,
        textures=world.packer.tables,
        lights=lights,
        environment=world.environment,
        media=space,
        camera=camera,
        shutter=shutter,
        filter=spec.film.filter.pack(),
        sampler=SAMPLERS[settings.sampler](settings.seed, spp),
        depth=settings.max_depth,
        roulette=settings.rr_depth,
        origin=origin,
        clamp=None if settings.clamp is None else Clamp(settings.clamp),
        nested_dielectrics=interior,
        spectrum=pack_spectrum(world.dispersion_mode, camera, spec.film.filter.box_width(), shutter),
    )
    of_items = world.layout.items, world.empty, world.resolved_materials
    return PackedScene(scene, objects, world.names, spec, built, *of_items)


def _shift_tables(held: Any, moved: Callable[[Any, Vec3], Any], origin: Origin) -> Any:
    """Shift the tables of lights or media to the packed world."""
    if held is None:
        return None
    return held._replace(tables=tuple(moved(table, neg(origin.world)) for table in held.tables))


def _pack_camera(spec: SceneSpec, assets: SceneAssets) -> Any:
    """Pack the camera, as a moving one if it moves while its shutter is open."""
    files = assets.of(spec.camera, ("camera",))
    try:
        return pack_camera(spec.camera, spec.film.width, spec.film.height, files)
    except ValidationError as error:
        (detail,) = error.errors(include_url=False)
        raise spec.error(error_sentence(detail), "camera", *detail["loc"]) from None
    except ValueError as error:
        raise spec.error(str(error), "camera", "motion") from None


def scene_ids(spec: SceneSpec, packed: PackedScene) -> SceneIds:
    """Number and name the objects and materials of a packed scene.

    Objects are numbered from 1 in the scene's order, and materials in the order in which objects first have them; an
    object or material without a name is called by its path in the scene.
    """
    by_reference = np.zeros(max(packed.materials) + 1, np.int32)
    for number, reference in enumerate(packed.materials, 1):
        by_reference[reference] = number
    owners = packed.objects.owners
    return SceneIds(
        objects=tuple(item.name or f"objects[{i}]" for i, item in enumerate(spec.objects)),
        first=np.cumsum([0, *(len(ranges.start) for ranges in owners)], dtype=np.int64),
        start=np.concatenate([ranges.start for ranges in owners]),
        owner=np.concatenate([ranges.number for ranges in owners]) + np.int32(1),
        placed=packed.objects.instance_objects + np.int32(1),
        materials=tuple(packed.materials.values()),
        material=by_reference,
        spp=spec.render.spp,
        frame=getattr(packed.scene.camera, "frame", None),
    )


def pack_spectrum(
    modes: NDArray[np.uint8] | None, camera: Any, edge: float | None, shutter: Shutter | None
) -> DispersiveMaterials | DispersiveLens | None:
    """Pack the dispersion of a scene; None where nothing disperses.

    modes : of the materials, as `dispersion_modes` gives them.
    camera : the packed one.
    edge : see `FilterSpec.box_width`.
    shutter : the packed one.
    """
    parts: CameraParts = camera_parts(camera)
    if modes is None:
        return None if parts.spectra is None else DispersiveLens(parts.spectra, _share_lens(parts, edge, shutter))
    if parts.spectra is None:
        return DispersiveMaterials(spectra(), modes, None)
    return DispersiveMaterials(parts.spectra, modes, MonochromaticCamera())


def _share_lens(
    parts: CameraParts, edge: float | None, shutter: Shutter | None
) -> WavelengthSharing | MonochromaticCamera:
    """Pack the lens by which wavelengths share rays; MonochromaticCamera where they do not."""
    if not parts.shares_wavelengths or parts.glass is None or edge is None:
        return MonochromaticCamera()
    if shutter is not None and shutter.scan is not None:
        return MonochromaticCamera()
    return WavelengthSharing(edge, reverse_lens(parts.glass))
