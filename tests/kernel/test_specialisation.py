"""A scene's kernel holds what the scene calls for, and nothing else; values do not compile anything anew.

What is compiled is asked of a process of its own (tests/probe.py), since Numba keeps what it has once compiled.
"""

import itertools
import json
import os
import re
import time
from collections.abc import Mapping
from typing import Any

import numba
import pytest

from raytracer.kernel.path_state import workspace
from raytracer.scene.load import build
from raytracer.scene.pack.scene import pack
from tests.probe import MATTE, SCENES
from tests.repository import ROOT, run_python
from tests.small_scenes import scene

FAMILIES = {"apertures", "cameras", "environments", "filters", "lights", "materials", "media"}
FAMILIES |= {"primitives", "sampling", "textures"}

# Kinds of the scene `plain`, which all others have too.
PLAIN = {"filters.box", "materials.lambertian", "primitives.spheres", "sampling.independent"}

# Scenes whose kernel is that of `plain`, so that there is nothing to compile.
SAME_AS_PLAIN = {"off"}

# Scenes that one process compiles: of the later one only what it has besides is seen.
TOGETHER = ("plain", "many")


def probe(cache, *names):
    """Run tests/probe.py with this kernel cache, and return its report."""
    return dict(json.loads(run_python("-m", "tests.probe", *names, RAYTRACER_CACHE_DIR=str(cache))))


class Kernels(Mapping[str, Any]):
    """The reports of tests/probe.py on its scenes, made at the first access.

    The processes of a test run share the reports in a folder: the one that first makes a scene's `.begun` file probes
    it, and the others wait.
    """

    def __init__(self, folder):
        self.cache = folder / "cache"
        self._folder = folder

    def __iter__(self):
        return iter((*sorted(SCENES.keys() - SAME_AS_PLAIN), "plain+depth"))

    def __len__(self):
        return sum(1 for _ in self)

    def __getitem__(self, name):
        self._find([name])
        return json.loads((self._folder / f"{name}.json").read_text())

    def all(self):
        """Return the reports of all scenes."""
        self._find(list(self))
        return {name: self[name] for name in self}

    def _find(self, names):
        self._folder.mkdir(exist_ok=True)
        for group in {TOGETHER if name in TOGETHER else (name,) for name in names}:
            try:
                (self._folder / f"{group[0]}.begun").touch(exist_ok=False)
            except FileExistsError:
                continue
            for name, report in probe(self.cache, *group).items():
                temporary = self._folder / f"{name}.temporary"
                temporary.write_text(json.dumps(report))
                temporary.rename(self._folder / f"{name}.json")
        for name in names:
            deadline = time.monotonic() + 300.0
            while not (self._folder / f"{name}.json").exists():
                assert time.monotonic() < deadline, f"the process that was to compile {name} has not"
                time.sleep(0.1)


@pytest.fixture(scope="session")
def kernels(tmp_path_factory):
    base = tmp_path_factory.getbasetemp()
    return Kernels((base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "kernels")


def kinds(report):
    """Name the kinds in a kernel, FAMILY.KIND: modules of the families without those that their kinds share."""
    shared = ("interface", "hashing", "phase", "warp", "perspective_camera", "light_choice", "dispatch", "clear")
    shared += ("voxel_traversal",)
    # raytracer.plugins.FAMILY.KIND, raytracer.core.FAMILY.KIND, or these with a `base` between.
    paths = [module.split(".")[2:] for module in report["modules"] if not module.endswith(shared)]
    return {f"{path[0]}.{path[-1]}" for path in paths if len(path) > 1 and path[0] in FAMILIES}


def test_plain_scene_holds_its_own_kinds_only(kernels):
    # A matte ball in the dark before a pinhole: no lens, glass, metal, light, environment, and no optics at all.
    plain = kernels["plain"]
    assert kinds(plain) == PLAIN
    assert not any(
        module.startswith(("raytracer.core.motion.", "raytracer.core.fresnel")) for module in plain["modules"]
    )
    assert plain["calls"] == {"rtcIntersect8": 1, "rtcOccluded8": 0}


EFFECTS = pytest.mark.parametrize(
    ("name", "brings"),
    [
        ("sky", {"environments.constant"}),
        ("lens", {"cameras.thin_lens_ray"}),
        ("iris", {"cameras.thin_lens_ray", "apertures.polygon", "apertures.vignetting"}),
        ("fisheye", {"cameras.fisheye"}),
        ("glass", {"materials.dielectric"}),
        ("lamp", {"lights.emitters", "materials.emitter", "sampling.alias"}),
        ("fog", {"media.homogeneous"}),
        ("sun", {"lights.sun", "sampling.alias"}),
        ("gauze", {"materials.cutout", "materials.emitter", "lights.emitters", "sampling.alias"}),
        ("flight", {"primitives.translated"}),
        ("checked", {"textures.checker"}),
        ("dolly", {"cameras.moving"}),
        ("daylight", {"environments.equirectangular", "lights.background"}),
    ],
)


def classes_in(numba_type):
    """Modules of the classes that a scene's type is made of."""
    own = getattr(numba_type, "instance_class", None)
    inner = set().union(*map(classes_in, getattr(numba_type, "types", ())))
    return inner if own is None else {own.__module__, *inner}


# What paths and shadow rays carry besides what all of them do.
CARRIED = {"fog": {"medium"}, "flight": {"time"}, "dolly": {"time"}, "gauze": {"vertex", "passthroughs"}}
SHADOWS = {"fog": {"medium", "medium_numbers"}, "gauze": {"target"}}


@EFFECTS
def test_an_effect_brings_its_own_classes_and_rows_of_paths(name, brings):
    # From these follows what is compiled; what functions a class needs besides, compiled kernels show below.
    packed = pack(scene(SCENES[name], filled=False)).scene
    work = workspace(packed)
    parts = (work.paths._asdict(), work.shadows._asdict())
    paths, shadows = ({key for key, rows in part.items() if rows is not None} for part in parts)
    assert paths == {"draws", "ray"} | CARRIED.get(name, set())
    assert shadows == {"queue", "radiance", "rays"} | SHADOWS.get(name, set())
    assert work.wavelengths is None
    used = kinds({"modules": classes_in(numba.typeof(packed))})
    assert used <= brings | PLAIN | {"cameras.placement"}
    assert used & brings


def test_no_glass_is_compiled_for_scenes_without_a_real_lens(kernels):
    glass = (
        "raytracer.optics.lens_system.",
        "raytracer.plugins.cameras.base.lens_camera",
        "raytracer.core.simd",
        "raytracer.core.spectra",
    )
    lens = f"camera: {{type: lens, lens: '{ROOT}/scenes/lenses/double-gauss-50mm.yaml'}}\n"
    used = classes_in(numba.typeof(pack(scene(lens + MATTE, filled=False)).scene))
    assert all(any(module.startswith(name) for module in used) for name in glass if name != "raytracer.core.simd")
    for name in ("plain", "many"):
        assert not [module for module in kernels[name]["modules"] if module.startswith(glass)]


def test_many_effects_bring_their_own_code(kernels):
    # One scene for most of the next test's: whatever is none of these effects' is brought by nobody.
    many = kernels["many"]
    assert kinds(many) - PLAIN == {
        "apertures.polygon",
        "apertures.vignetting",
        "cameras.thin_lens_ray",
        "environments.constant",
        "lights.emitters",
        "materials.cutout",
        "materials.dielectric",
        "materials.emitter",
        "media.homogeneous",
        "primitives.translated",
        "sampling.alias",
        "textures.checker",
    }
    assert many["calls"] == {"rtcIntersect8": 2, "rtcOccluded8": 0}
    assert many["llvm_size"] > kernels["plain"]["llvm_size"]
    # Counts are atomic and shared by all threads; they cost a third of the time.
    assert many["reference_counts"] == kernels["plain"]["reference_counts"] == 0


@pytest.mark.slow
@EFFECTS
def test_an_effect_brings_its_own_code(kernels, name, brings):
    used = kinds(kernels[name])
    assert brings <= used
    # Nothing besides, but for kinds that are there anyway.
    assert used - brings <= PLAIN
    assert ("raytracer.core.fresnel" in kernels[name]["modules"]) == (name == "glass")
    assert kernels[name]["llvm_size"] > kernels["plain"]["llvm_size"]


@pytest.mark.slow
def test_shadow_rays_are_compiled_where_there_are_lights(kernels):
    lit = {name for name, report in kernels.all().items() if report["calls"]["rtcOccluded8"]}
    assert lit == {"lamp", "sun", "daylight"}
    # Where light may pass, as rays that look for what they meet, and not only whether they meet anything.
    twice = {name for name, report in kernels.all().items() if report["calls"]["rtcIntersect8"] > 1}
    assert twice == {"gauze", "many"}
    assert max(sum(report["calls"].values()) for report in kernels.all().values()) == 2


@pytest.mark.slow
def test_what_only_some_scenes_call_for_is_compiled_for_these_alone(kernels):
    def users(module):
        return {name for name, report in kernels.all().items() if module in report["modules"]}

    assert not any(report["reference_counts"] for report in kernels.all().values())
    # A checker is its texture in both; the second one shades with its slopes too.  What all scenes have of
    # `kernel.normal_mapping` is what is done without maps; the geometry of bent normals is only where there are any.
    assert users("raytracer.core.shading_normals") == {"bumpy"}
    assert kernels["bumpy"]["llvm_size"] > kernels["checked"]["llvm_size"] > kernels["plain"]["llvm_size"]
    # A matte ellipsoid is the matte ball of `plain`, and besides it the transforms of rays and hits.
    assert kinds(kernels["egg"]) <= kinds(kernels["plain"])
    assert {"egg"} <= users("raytracer.core.motion.interpolation") <= kernels.all().keys() - {"plain"}
    assert kernels["egg"]["llvm_size"] > kernels["plain"]["llvm_size"]
    # AOVs that are asked for.
    aovs = "raytracer.kernel.aovs."
    found = {name: [m for m in report["modules"] if m.startswith(aovs)] for name, report in kernels.all().items()}
    assert found.pop("plain+depth") == [aovs + "base.layers", aovs + "surface"]
    assert not any(found.values())


# ---- The page of what scenes weigh

PAGE = (ROOT / "docs" / "only-what-is-called-for.md").read_text(encoding="utf-8")
WEIGHTS = {
    name: (added, int(count.replace(",", "")), float(times))
    for name, added, count, times in re.findall(r"^\| (\w+) \| (.*) \| ([\d,]+) \| ([\d.]+) \|$", PAGE, re.MULTILINE)
}


def test_the_page_of_weights_tells_of_scenes_that_are_compiled_here(kernels):
    (text,) = re.findall(r"^```yaml\n(.*?)^```$", PAGE, re.DOTALL | re.MULTILINE)
    assert type_of(text) == numba.typeof(pack(scene(SCENES["plain"], filled=False)).scene)
    for name, (added, count, times) in WEIGHTS.items():
        assert all(piece.strip("{}") in SCENES[name] for piece in re.findall(r"`(.*?)`", added)), name
        assert times == round(count / WEIGHTS["plain"][1], 2)
    # Other processors have other instructions.
    for name in ("plain", "many"):
        assert kernels[name]["instructions"] == pytest.approx(WEIGHTS[name][1], rel=0.25)


@pytest.mark.slow
def test_kernels_weigh_what_the_page_says(kernels):
    plain = kernels["plain"]["instructions"]
    for name, (_, _, times) in WEIGHTS.items():
        assert kernels[name]["instructions"] / plain == pytest.approx(times, rel=0.15), name


def test_a_second_process_compiles_nothing(kernels):
    # Nor does a scene in which all that `plain` lacks is named and switched off: its kernel is that of `plain`.
    for name in ("plain", "many"):
        assert kernels[name]["compiled"] > 10
        assert kernels[name]["cache_misses"] == 1
    again = probe(kernels.cache, "off", "many")
    for report in again.values():
        assert (report["compiled"], report["cache_hits"], report["cache_misses"]) == (0, 1, 0)


# ---- Types

BASE = """
camera: {type: pinhole, look_from: [0, 0, 4], look_at: [0, 0, 0], vfov: 40}
film: {width: 16, height: 9}
render: {spp: 4, max_depth: 5, seed: 0, sampler: sobol}
environment: {type: constant, radiance: [1, 0.5, 0.25]}
materials:
  a: {type: lambertian, albedo: [0.1, 0.2, 0.3]}
objects:
  - {type: sphere, center: [0, 0, 0], radius: 1, material: a}
  - {type: sphere, name: lamp, center: [3, 0, 0], radius: 1, material: {type: emitter, radiance: [1, 2, 3]}}
"""


def scene_of(text=BASE, **overrides):
    return pack(build(text, "test.yaml", {key.replace("__", "."): value for key, value in overrides.items()})).scene


def type_of(text=BASE, **overrides):
    return numba.typeof(scene_of(text, **overrides))


LENS = {"type": "thin_lens", "look_from": [0, 0, 4], "look_at": [0, 0, 0]}
MAPS = "textures: {squares: {type: checker}, veins: {type: noise}}\nmaterials:"
UNUSED = "  tiles: {type: metal, albedo: squares, bump: veins}\n  glass: {type: dielectric}\nobjects:"
BALL = "  - {type: sphere, center: [0, 3, 0], radius: 0.5, material: {type: lambertian, albedo: 0.7}}\n"


@pytest.mark.parametrize("sampler", ["independent", "stratified", "sobol"])
def test_values_and_what_nothing_uses_are_not_part_of_the_type(sampler):
    # Integers where numbers are meant, one object more, another size: the same kernel.
    base = BASE.replace("sobol", sampler)
    changes = [
        {"film__width": 1920, "film__height": 1080},
        {"render__spp": 7, "render__seed": 2**32 - 1},
        {"render__max_depth": 1000, "render__rr_depth": 0},
        {"camera__vfov": 41.5, "camera__look_from": [0.25, 0, 9]},
        {"camera": LENS | {"aperture": 0}},
        {"environment__radiance": 2},
        {"materials__a__albedo": 1},
        {"objects__lamp__radius": -2},
        {"objects__lamp__material__two_sided": True},
        {"objects__lamp__transform": [{"rotate": {"axis": [0, 1, 0], "angle": 30}}]},
        {"render__light_sampling": "mis"},
        {"text": base + BALL},
        {"text": base.replace("materials:", MAPS).replace("objects:", UNUSED)},
    ]
    for change in changes:
        assert type_of(**{"text": base, **change}) == type_of(base), change


@pytest.mark.parametrize(
    "change",
    [
        {"camera": LENS | {"aperture": 10}},
        {"environment": {"type": "gradient"}},
        {"environment__radiance": 0},
        {"render__sampler": "independent"},
        {"render__accuracy": "fast"},
        {"render__light_sampling": "lights"},
        {"render__light_sampling": "paths"},
        {"film__filter": "mitchell"},
        {"objects__lamp__material__radiance": 0},
        {"render__max_depth": 1},
        {"materials__a": {"type": "metal"}},
        # A plain value is one whichever key of the material may be textured.
        {"materials__a__bump": {"type": "noise"}, "materials__a__bump_height": 0},
    ],
    ids=str,
)
def test_effects_are_the_type(change):
    assert type_of(**change) != type_of()


def test_order_of_the_objects_is_not_part_of_the_type():
    objects = [
        "  - {type: sphere, center: [0, 0, 0], radius: 1, material: {type: metal}}\n",
        "  - {type: disc, center: [0, 0, 0], normal: [0, 1, 0], radius: 1, material: {type: emitter, radiance: 1}}\n",
        "  - {type: box, min: [0, 0, 0], max: [1, 1, 1], material: {type: dielectric}}\n",
    ]
    assert len({type_of(BASE + "".join(order)) for order in itertools.permutations(objects)}) == 1


def test_how_light_is_sampled_is_the_type_only_where_there_is_light_to_sample():
    # Nothing of lights is left where paths find them.
    assert type_of(render__light_sampling="paths") == numba.typeof(scene_of()._replace(lights=None))
    modes = ("mis", "lights", "paths")
    dark = {type_of(objects__lamp__material__radiance=0, render__light_sampling=mode) for mode in modes}
    assert len(dark) == 1
