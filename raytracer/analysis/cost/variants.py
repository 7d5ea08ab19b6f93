"""Variants of a scene, each without one effect or with one setting changed, which `rt cost` compares.

The effects of a scene follow from its packed form, where an absent effect is None, and from the families of kinds: a
new kind of material, texture, light, medium or camera has its variant without a line here.  A variant keeps the
picture's brightness where an effect is not about brightness: a lens without its opening lets in as much light as
before.
"""

from collections.abc import Mapping, Sequence

from raytracer.analysis.cost.effect_variants import EffectVariants
from raytracer.analysis.cost.setting_variants import setting_variants
from raytracer.analysis.cost.variant import Variant
from raytracer.scene.pack.scene import PackedScene
from raytracer.scene.spec import SceneSpec
from raytracer.util.errors import InputError, suggest_name

REPEAT = "A/A"
"""Name of the repeat of the same, the variant that differs in nothing."""


def make_variants(spec: SceneSpec, packed: PackedScene) -> list[Variant]:
    """Make all variants of a scene, the control first; the scene itself is not among them.

    Parameters
    ----------
    packed : the packed scene; its own spec, whose camera is focused, may stand for `spec`.
    """
    what = "the scene itself once more: what differs is the noise of measuring"
    control = Variant(REPEAT, "control", what, same_mean=True)
    return [control, *EffectVariants(spec, packed).variants, *setting_variants(spec, packed.scene)]


def reasons_without_variant(spec: SceneSpec, packed: PackedScene) -> dict[str, str]:
    """Say why an active effect has no variant without it, by its name: one clause each."""
    return dict(EffectVariants(spec, packed).reasons_without_variant)


def select_variants(
    variants: Sequence[Variant], names: Sequence[str], reasons: Mapping[str, str] | None = None
) -> list[Variant]:
    """Select variants by name, in their order, and the control.

    Parameters
    ----------
    reasons : see `reasons_without_variant`.

    Raises
    ------
    InputError : a name that no variant has.
    """
    known = [variant.name for variant in variants]
    for name in names:
        if reasons and name in reasons:
            raise InputError(f"there is no variant without {name}: {reasons[name]}")
        if name not in known:
            raise InputError(f"unknown variant {name!r}; {suggest_name(name, known, 'variants')}")
    return [variant for variant in variants if variant.name in names or variant.group == "control"]
