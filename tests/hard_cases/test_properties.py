"""What holds of every scene: it renders, it creates no energy, no ray meets what it leaves, and it does not matter
where the scene is, how it is turned, how large it is, or what is in it by which name.

The scenes are random, by hypothesis: 20 of them in `make test`, with all properties at once, and 500 for each property
in `make test-slow`.
"""

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings

from raytracer.analysis.compare import Verdict, z_test
from raytracer.core.primitives.spheres import Spheres
from raytracer.core.primitives.translated import Translated
from raytracer.core.vec import Vec3
from raytracer.film.image import Image
from raytracer.rendering.render import render
from raytracer.scene.pack.scene import pack
from tests.core.instancing.kernels import Scenery, Stage, cast
from tests.hard_cases.random_scenes import (
    SEEDS,
    Array,
    Document,
    Random,
    decades,
    direction,
    in_a_furnace,
    middles,
    relabelled,
    rotated,
    scaled,
    scenes,
    spec_of,
    translated,
    write_files,
)

QUICK, THOROUGH = 20, 500
FALSE_ALARMS = 1e-3
"""How often all scenes of a property together may fail by chance."""

RAYS = 512
"""Of a scene, by which it is searched for rays that meet what they leave; each bounces BOUNCES times."""

BOUNCES = 3

ROUNDING = 1e-12
"""By how much the weights of a path, each at most 1, may come to more: some ulp for each of its few segments."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path: Path = tmp_path_factory.mktemp("scenes")
    write_files(path)
    return path


def rendered(document: Document, folder: Path, seed: int = 1) -> Image:
    """The picture, without a sample that is not finite."""
    result = render(spec_of(document, folder), seed=seed, threads=2)
    assert result.stats.nan_samples == 0
    assert np.isfinite(result.image.radiance).all()
    return result.image


def compared(document: Document, other: Document, folder: Path, alpha: float) -> Verdict:
    """Tell if two scenes have the same picture within its noise."""
    a, b = rendered(document, folder), rendered(other, folder, seed=2)
    return z_test(a.radiance, a.variance, b.radiance, b.variance, tile=4, alpha=alpha)


def assert_same(document: Document, other: Document, folder: Path, alpha: float) -> None:
    verdict = compared(document, other, folder, alpha)
    assert verdict.passed, verdict.reason


def _scale_of(document: Document) -> float:
    """The distance of what the camera looks at."""
    camera = document["camera"]
    return math.dist(camera["look_from"], camera["look_at"])


# ---- What is done to a scene


def _moved(document: Document, random: Random) -> Document:
    """The scene as far from the origin as a million times its scale."""
    return translated(document, decades(random, 0.0, 6.0) * _scale_of(document) * direction(random))


def _turned(document: Document, random: Random) -> Document:
    return rotated(document, direction(random), random.uniform(0.0, 360.0))


def _resized(document: Document, random: Random) -> Document:
    """The scene at any size from a micrometre to a megametre."""
    return scaled(document, decades(random, -6.0, 6.0) / _scale_of(document))


def _shuffled(document: Document, random: Random) -> Document:
    return relabelled(document, random.permutation(len(document["objects"])))


# ---- Properties


def _invariance(change: Callable[[Document, Random], Document]) -> "Check":
    def check(folder: Path, alpha: float, document: Document, random: Random) -> None:
        assert_same(document, change(document, random), folder, alpha)

    return check


def _scaling_by_powers_of_two(folder: Path, alpha: float, document: Document, random: Random) -> None:
    """The picture stays as it is: nothing is compared with a length of its own.

    All that is done to lengths then leaves their digits alone, but for powers of 2/3, by which instances of lamps are
    chosen.
    """
    other = scaled(document, 2.0 ** round(math.log2(decades(random, -6.0, 6.0) / _scale_of(document))))
    assert np.allclose(rendered(document, folder).radiance, rendered(other, folder).radiance, rtol=ROUNDING, atol=0.0)


def _energy(folder: Path, alpha: float, document: Document, random: Random) -> None:
    """In a furnace no path is worth more than 1, since nothing weights one by more."""
    assert rendered(in_a_furnace(document), folder).radiance.max() <= 1.0 + ROUNDING


def _is_outside(table: Any, primitive: int) -> float:
    """1 for a closed surface whose normal points outwards, -1 for one whose normal does not, 0 for an open one."""
    base = table.base if isinstance(table, Translated) else table
    return float(np.sign(base.radius[primitive])) if isinstance(base, Spheres) else 0.0


def _onwards(normals: Array, random: Random) -> Array:
    """Directions to both sides of surfaces with these normals (n, 3): every other one within 1e-6 of grazing."""
    any_way = np.array([direction(random) for _ in normals])
    along = any_way - np.sum(any_way * normals, axis=1, keepdims=True) * normals
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    height = 10.0 ** random.uniform(-6.0, 0.0, (len(normals), 1)) * random.choice((-1.0, 1.0), (len(normals), 1))
    grazing = along + height * normals
    return np.asarray(
        np.where(
            random.random((len(normals), 1)) < 0.5, any_way, grazing / np.linalg.norm(grazing, axis=1, keepdims=True)
        )
    )


def self_hits(document: Document, folder: Path, random: Random, *, off: bool = True) -> list[str]:
    """What rays that leave a surface meet of it: one that leaves a flat primitive never meets it again, one that leaves
    a convex one to the outside does neither, and one to the inside meets it from within.

    Parameters
    ----------
    off : whether rays start off the surface, as they do; for the test of this test.
    """
    packed = pack(spec_of(document, folder))
    accel = packed.build()
    scene = packed.scene
    scenery = Scenery(Stage(scene.primitives, scene.accuracy, scene.instances), accel)
    eye = np.array(document["camera"]["look_from"])

    # Look at the objects, and from some of them at others.
    aims = (middles(document) - eye)[random.integers(len(middles(document)), size=RAYS)]
    aims = aims + 0.2 * np.linalg.norm(aims, axis=1, keepdims=True) * random.normal(size=(RAYS, 3))
    ways = aims / np.linalg.norm(aims, axis=1, keepdims=True)
    times = random.random(RAYS)
    starts = np.broadcast_to(eye - np.array(_origin_of(scene)), (RAYS, 3))
    wrong: list[str] = []
    for _ in range(BOUNCES):
        first = cast(scenery, starts, ways, times=times)
        met = first.table >= 0
        onwards = _onwards(np.where(met[:, None], first.normal, ways), random)
        left = cast(scenery, starts, ways, onwards, times)
        starts = np.where(met[:, None], left.start if off else left.point, starts)
        second = cast(scenery, starts, onwards, times=times)
        again = met & (second.table == first.table) & (second.primitive == first.primitive)
        for ray in np.flatnonzero(again & (second.instance == first.instance)):
            side = _is_outside(scene.primitives[first.table[ray]], int(first.primitive[ray]))
            leaves, arrives = (side * float(onwards[ray] @ hits.normal[ray]) for hits in (first, second))
            if not leaves < 0.0 < arrives:
                wrong.append(f"ray {ray} leaves table {first.table[ray]} at {leaves}, and meets it at {arrives}")
        ways = onwards
    return wrong


def _self_hits(folder: Path, alpha: float, document: Document, random: Random) -> None:
    assert self_hits(document, folder, random) == []


def _origin_of(scene: Any) -> Vec3:
    """Return the origin of the packed scene."""
    origin: Vec3 = (0.0, 0.0, 0.0) if scene.origin is None else scene.origin.world
    return origin


def _everything(folder: Path, alpha: float, document: Document, random: Random) -> None:
    other = _moved(_resized(_turned(document, random), random), random)
    assert_same(document, _shuffled(other, random), folder, alpha)
    _energy(folder, alpha, other, random)
    _self_hits(folder, alpha, other, random)


Check: TypeAlias = Callable[[Path, float, Document, Random], None]

PROPERTIES: dict[str, Check] = {
    "translation": _invariance(_moved),
    "rotation": _invariance(_turned),
    "scaling": _invariance(_resized),
    "relabelling": _invariance(_shuffled),
    "powers of two": _scaling_by_powers_of_two,
    "energy": _energy,
    "self-hits": _self_hits,
}


def _holds(check: Check, folder: Path, examples: int) -> None:
    """Check a property of so many scenes."""

    @settings(max_examples=examples, suppress_health_check=list(HealthCheck))
    @given(scenes(), SEEDS)
    def holds(document: Document, seed: int) -> None:
        check(folder, FALSE_ALARMS / examples, document, np.random.default_rng(seed))

    holds()


def test_properties(folder: Path) -> None:
    _holds(_everything, folder, QUICK)


@pytest.mark.slow
@pytest.mark.parametrize("name", PROPERTIES)
def test_property(folder: Path, name: str) -> None:
    _holds(PROPERTIES[name], folder, THOROUGH)


# ---- That they can fail


def _first(count: int) -> list[tuple[Document, Random]]:
    """Some of the scenes."""
    found: list[tuple[Document, Random]] = []

    @settings(max_examples=count, suppress_health_check=list(HealthCheck), phases=[Phase.generate])
    @given(scenes(), SEEDS)
    def keep(document: Document, seed: int) -> None:
        found.append((document, np.random.default_rng(seed)))

    keep()
    return found


def test_places_in_float32_are_noticed(folder: Path) -> None:
    def in_float32(document: Document) -> Document:
        values = json.loads(json.dumps(document), parse_float=lambda text: float(np.float32(text)))
        return dict(values)

    kept = failed = 0
    for document, _ in _first(10):
        far = translated(document, [1e7 * _scale_of(document), 0.0, 0.0])
        kept += compared(document, far, folder, FALSE_ALARMS).passed
        failed += not compared(document, in_float32(far), folder, FALSE_ALARMS).passed
    assert kept == 10
    assert failed >= 3


def test_rays_that_start_on_their_surface_are_noticed(folder: Path) -> None:
    found = [len(self_hits(document, folder, random, off=False)) for document, random in _first(10)]
    # Half of those that start on a flat surface, and float32 rounds some of these to where they do no harm.
    assert sum(found) > 0.05 * 10 * RAYS * BOUNCES
