"""A variant of a scene: the scene with one change."""

from collections.abc import Callable
from typing import Any, NamedTuple

from raytracer.analysis.cost.removals import in_all_materials
from raytracer.kernel.packed_scene import Scene
from raytracer.scene.pack.scene import PackedScene, pack
from raytracer.scene.pack.world import MaterialVariant
from raytracer.scene.scene_assets import SceneAssets
from raytracer.scene.spec import SceneSpec


def identity(value: Any) -> Any:
    """Return the value itself."""
    return value


class Variant(NamedTuple):
    """A scene that differs in one thing from the one that is measured.

    name : short, as on the command line.
    group : "control", "effect", "setting" or "sampler".
    what : the change, in one sentence.
    spec_variant : changes the checked scene.
    packed_variant : changes the packed scene.
    material_variant : changes each material in use when the scene is packed; None for no change.
    needs_repacking : True if the scene must be packed again, and its ray caster built; else both can be shared, as
        `packed_variant` makes the change of `spec_variant` in the packed scene.
    same_mean : True if by construction the picture is that of the scene but for noise; what looks like a bias then is
        light that is found so rarely that no sample of it was seen.
    """

    name: str
    group: str
    what: str
    spec_variant: Callable[[SceneSpec], SceneSpec] = identity
    packed_variant: Callable[[Scene], Scene] = identity
    needs_repacking: bool = False
    material_variant: MaterialVariant | None = None
    same_mean: bool = False

    def pack(self, spec: SceneSpec, assets: SceneAssets | None = None) -> PackedScene:
        """Pack the variant of a scene, without `packed_variant`.

        assets : the scene's files if they have been read.

        Raises
        ------
        InputError : it cannot be packed.
        """
        change = self.material_variant and in_all_materials(self.material_variant)
        return pack(self.spec_variant(spec), assets=assets, material_variant=change)
