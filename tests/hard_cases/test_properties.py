"""What holds of every scene: it renders, it creates no energy, no ray meets what it leaves, and it does not matter
where the scene is, how it is turned, how large it is, or what is in it by which name.

The scenes are random, by hypothesis: 20 of them in `make test`, with all properties at once, and 500 for each property
in `make test-slow`.
"""

import json
import math

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings

from raytracer.analysis.compare import z_test
from raytracer.core.primitives.spheres import Spheres
from raytracer.core.primitives.translated import Translated
from raytracer.rendering.render import render
from raytracer.scene.pack.scene import pack
from tests.core.instancing.kernels import Scenery, Stage, cast
from tests.hard_cases import random_scenes
from tests.hard_cases.random_scenes import SEEDS, decades, direction, scaled, spec_of, translated
from tests.plugins.shapes.kernels import unit

QUICK, THOROUGH = 20, 500
FALSE_ALARMS = 1e-3
"""How often all scenes of a property together may fail by chance."""

RAYS = 512
"""Of a scene, by which it is searched for rays that meet what they leave; each bounces BOUNCES times."""

BOUNCES = 3

ROUNDING = 1e-12
"""By how much the weights of a path, each at most 1, may come to more: some ulp for each of its few segments."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("scenes")
    random_scenes.write_files(path)
    return path


def rendered(document, folder, seed=1):
    """The picture, without a sample that is not finite."""
    result = render(spec_of(document, folder), seed=seed, threads=2)
    assert result.stats.nan_samples == 0
    assert np.isfinite(result.image.radiance).all()
    return result.image


def compared(a, b, alpha):
    """Tell if two pictures are the same within their noise."""
    return z_test(a.radiance, a.variance, b.radiance, b.variance, tile=4, alpha=alpha)


def _scale_of(document):
    """The distance of what the camera looks at."""
    return math.dist(document["camera"]["look_from"], document["camera"]["look_at"])


CHANGES = {
    # As far from the origin as a million times its scale, and of any size from a micrometre to a megametre.
    "translation": lambda d, random: translated(d, decades(random, 0.0, 6.0) * _scale_of(d) * direction(random)),
    "rotation": lambda d, random: random_scenes.rotated(d, direction(random), random.uniform(0.0, 360.0)),
    "scaling": lambda d, random: scaled(d, decades(random, -6.0, 6.0) / _scale_of(d)),
    "relabelling": lambda d, random: random_scenes.relabelled(d, random.permutation(len(d["objects"]))),
}
"""What changes no picture, of a document and random numbers."""


def _invariance(change):
    def check(folder, alpha, document, random):
        other = rendered(change(document, random), folder, seed=2)
        verdict = compared(rendered(document, folder), other, alpha)
        assert verdict.passed, verdict.reason

    return check


def _scaling_by_powers_of_two(folder, alpha, document, random):
    """The picture stays as it is: nothing is compared with a length of its own.

    All that is done to lengths then leaves their digits alone, but for powers of 2/3, by which instances of lamps are
    chosen.
    """
    other = scaled(document, 2.0 ** round(math.log2(decades(random, -6.0, 6.0) / _scale_of(document))))
    assert np.allclose(rendered(document, folder).radiance, rendered(other, folder).radiance, rtol=ROUNDING, atol=0.0)


def _energy(folder, alpha, document, random):
    """In a furnace no path is worth more than 1, since nothing weights one by more."""
    assert rendered(random_scenes.in_a_furnace(document), folder).radiance.max() <= 1.0 + ROUNDING


def _is_outside(table, primitive):
    """1 for a closed surface whose normal points outwards, -1 for one whose normal does not, 0 for an open one."""
    base = table.base if isinstance(table, Translated) else table
    return float(np.sign(base.radius[primitive])) if isinstance(base, Spheres) else 0.0


def _onwards(normals, random):
    """Directions to both sides of surfaces with these normals (n, 3): every other one within 1e-6 of grazing."""
    any_way = np.array([direction(random) for _ in normals])
    along = unit(any_way - np.sum(any_way * normals, axis=1, keepdims=True) * normals)
    height = 10.0 ** random.uniform(-6.0, 0.0, (len(normals), 1)) * random.choice((-1.0, 1.0), (len(normals), 1))
    return np.where(random.random((len(normals), 1)) < 0.5, any_way, unit(along + height * normals))


def self_hits(document, folder, random, *, off=True):
    """What rays that leave a surface meet of it: one that leaves a flat primitive never meets it again, one that leaves
    a convex one to the outside does neither, and one to the inside meets it from within.

    Parameters
    ----------
    off : whether rays start off the surface, as they do; for the test of this test.
    """
    packed = pack(spec_of(document, folder))
    scene = packed.scene
    scenery = Scenery(Stage(scene.primitives, scene.accuracy, scene.instances), packed.build())
    eye = np.array(document["camera"]["look_from"])

    # Look at the objects, and from some of them at others.
    aims = random.permutation(np.resize(random_scenes.middles(document), (RAYS, 3))) - eye
    ways = unit(aims + 0.2 * np.linalg.norm(aims, axis=1, keepdims=True) * random.normal(size=(RAYS, 3)))
    times = random.random(RAYS)
    starts = np.broadcast_to(eye - (0.0 if scene.origin is None else np.array(scene.origin.world)), (RAYS, 3))
    wrong = []
    for _ in range(BOUNCES):
        first = cast(scenery, starts, ways, times=times)
        met = (first.table >= 0)[:, None]
        onwards = _onwards(np.where(met, first.normal, ways), random)
        left = cast(scenery, starts, ways, onwards, times)
        starts = np.where(met, left.start if off else left.point, starts)
        second = cast(scenery, starts, onwards, times=times)
        again = met[:, 0] & (second.table == first.table) & (second.primitive == first.primitive)
        for ray in np.flatnonzero(again & (second.instance == first.instance)):
            side = _is_outside(scene.primitives[first.table[ray]], int(first.primitive[ray]))
            leaves, arrives = (side * float(onwards[ray] @ hits.normal[ray]) for hits in (first, second))
            if not leaves < 0.0 < arrives:
                wrong.append(f"ray {ray} leaves table {first.table[ray]} at {leaves}, and meets it at {arrives}")
        ways = onwards
    return wrong


def _self_hits(folder, alpha, document, random):
    assert self_hits(document, folder, random) == []


PROPERTIES = {
    **{name: _invariance(change) for name, change in CHANGES.items()},
    "powers of two": _scaling_by_powers_of_two,
    "energy": _energy,
    "self-hits": _self_hits,
}


def _everything(folder, alpha, document, random):
    other = document
    for name in ("rotation", "scaling", "translation"):
        other = CHANGES[name](other, random)
    _invariance(lambda _, random: CHANGES["relabelling"](other, random))(folder, alpha, document, random)
    _energy(folder, alpha, other, random)
    _self_hits(folder, alpha, other, random)


def _for_scenes(count, check, **more):
    """Call a function for so many scenes, each with random numbers of its own."""

    @settings(max_examples=count, suppress_health_check=list(HealthCheck), **more)
    @given(random_scenes.scenes(), SEEDS)
    def call(document, seed):
        check(document, np.random.default_rng(seed))

    call()


def test_properties(folder):
    _for_scenes(QUICK, lambda document, random: _everything(folder, FALSE_ALARMS / QUICK, document, random))


@pytest.mark.slow
@pytest.mark.parametrize("name", PROPERTIES)
def test_property(folder, name):
    _for_scenes(THOROUGH, lambda *scene: PROPERTIES[name](folder, FALSE_ALARMS / THOROUGH, *scene))


# ---- That they can fail


def test_places_in_float32_are_noticed(folder):
    kept, failed = [], []

    def check(document, random):
        far = translated(document, np.array([1e7 * _scale_of(document), 0.0, 0.0]))
        rounded = json.loads(json.dumps(far), parse_float=lambda text: float(np.float32(text)))
        here = rendered(document, folder)
        for other, passed in ((far, kept), (rounded, failed)):
            passed.append(compared(here, rendered(other, folder, seed=2), FALSE_ALARMS).passed)

    _for_scenes(10, check, phases=[Phase.generate])
    assert kept == [True] * 10
    assert failed.count(False) >= 3


def test_rays_that_start_on_their_surface_are_noticed(folder):
    found = []
    _for_scenes(
        10, lambda *scene: found.extend(self_hits(scene[0], folder, scene[1], off=False)), phases=[Phase.generate]
    )
    # Half of those that start on a flat surface, and float32 rounds some of these to where they do no harm.
    assert len(found) > 0.05 * 10 * RAYS * BOUNCES
