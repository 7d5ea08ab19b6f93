"""Which effects a scene calls for, and why: read off its packed type, so that what is said is what is compiled."""

from collections.abc import Iterable
from typing import NamedTuple

from raytracer.integrator import Scene
from raytracer.kinds import MATERIALS, SHAPES, Family
from raytracer.scene.pack import material_of
from raytracer.scene.spec import SceneSpec
from raytracer.textures.interface import Book


class Effect(NamedTuple):
    """Whether an effect is simulated, and the reason in words."""

    active: bool
    why: str


def effects_of(spec: SceneSpec, scene: Scene) -> dict[str, Effect]:
    """Every effect that the program knows, by name; those of a packed scene are active."""
    lens = getattr(scene.camera, "lens", None)
    emitting = [item for item in spec.objects if material_of(spec, item).exitance(Book()) > 0.0]
    return {
        "defocus": Effect(lens is not None, _why_defocus(spec, lens is not None)),
        "light_sampling": Effect(scene.lights is not None, _why_light_sampling(spec, scene, len(emitting))),
        "environment": Effect(scene.environment is not None, _why_environment(spec, scene)),
        "roulette": Effect(
            scene.roulette < scene.depth,
            f"paths may end by chance after {scene.roulette} of at most {scene.depth} segments"
            if scene.roulette < scene.depth
            else f"rr_depth {scene.roulette} is not below max_depth {scene.depth}",
        ),
        **_kinds("material", MATERIALS, (material_of(spec, item).type for item in spec.objects)),
        **_kinds("shape", SHAPES, (item.type for item in spec.objects)),
    }


def _why_defocus(spec: SceneSpec, active: bool) -> str:
    if active:
        numbers = spec.camera.describe(spec.film.width, spec.film.height)
        width, focus = numbers["aperture_diameter_mm"], numbers["focus_distance_m"]
        return f"the lens is {width:.4g} mm wide and focused at {focus:.4g} m"
    return f"the {spec.camera.type} camera has no aperture, so everything is sharp"


def _why_light_sampling(spec: SceneSpec, scene: Scene, emitting: int) -> str:
    if scene.lights is not None:
        primitives = sum(len(table.table) for table in scene.lights.tables)
        return f"{_count(primitives, 'primitive')} of {_count(emitting, 'object')} emit light"
    if not emitting:
        return "no object emits light, so paths find the environment by themselves"
    if scene.depth == 1:
        return "max_depth 1 leaves no segment for light that a surface reflects"
    return "no material can be lit by choice: mirrors and glass find lights only by being followed"


def _why_environment(spec: SceneSpec, scene: Scene) -> str:
    if scene.environment is not None and spec.environment is not None:
        return f"rays that meet nothing see the {spec.environment.type} environment"
    if spec.environment is not None:
        return f"the {spec.environment.type} environment is black"
    return "the scene names none, so rays that meet nothing see black"


def _kinds(noun: str, family: Family, present: Iterable[str]) -> dict[str, Effect]:
    """One effect a kind of the family: whether any object has it."""
    names = list(present)
    return {
        f"{noun}.{kind}": Effect(kind in names, f"{_count(names.count(kind), 'object')} of {len(names)}")
        for kind in family.specs()
    }


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
