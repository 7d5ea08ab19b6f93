"""`rt warm` and `rt cache`, and what a render says about its kernel."""

import json
import os
import shutil
import subprocess
import sys

import pytest

from tests.repository import ROOT

SCENE = (
    "camera: {type: pinhole, look_from: [0, 0, 4], vfov: 40}\nfilm: {width: 8, height: 6}\n"
    "environment: {type: constant, radiance: 1}\n"
    "objects: [{type: sphere, center: [0, 0, 0], radius: 1, material: {type: lambertian}}]\n"
)


def rt(folder, *words, status=0):
    """Run rt in a process of its own, with a cache of its own."""
    own = {"RAYTRACER_CACHE_DIR": str(folder / "cache"), "RAYTRACER_KEY_DIR": str(folder / "key")}
    done = subprocess.run(
        [sys.executable, "-c", "from raytracer.cli.main import main; raise SystemExit(main())", *words],
        capture_output=True,
        text=True,
        check=False,
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT)} | own,
    )
    assert done.returncode == status, done.stderr
    return done


@pytest.fixture
def scene(tmp_path):
    (tmp_path / "a.yaml").write_text(SCENE)
    return tmp_path


_FIRST = "rt: this combination of effects is compiled for the first time"


def test_what_was_warmed_is_rendered_without_the_compiler(scene):
    first = rt(scene, "warm", "a.yaml", "a.yaml").stdout.splitlines()
    assert first[0].startswith("a.yaml: compiled in ")
    assert first[1:] == ["a.yaml: was in the cache"]
    # Another sampler is another kernel, and so is one that records depth.
    assert rt(scene, "warm", "a.yaml", "-D", "render.sampler=stratified").stdout.startswith("a.yaml: compiled in ")
    assert rt(scene, "warm", "a.yaml", "--aov", "depth").stdout.startswith("a.yaml: compiled in ")
    assert rt(scene, "warm", "a.yaml", "-D", "render.spp=3", "--quiet").stdout == ""
    held = json.loads(rt(scene, "cache", "--json").stdout)
    assert held["kernels"] == 3
    done = rt(scene, "render", "a.yaml", "--aov", "depth", "-o", "a.exr", "--spp", "2")
    assert _FIRST not in done.stderr
    assert json.loads(rt(scene, "cache", "--json").stdout)["kernels"] == 3


def test_a_render_says_that_it_compiles_and_what_the_command_took(scene):
    cold = rt(scene, "render", "a.yaml", "-o", "a.npy", "--spp", "2").stderr.splitlines()
    assert cold[0].startswith(_FIRST)
    assert " s in all, " in cold[1]
    (again,) = rt(scene, "render", "a.yaml", "-o", "a.npy", "--spp", "2").stderr.splitlines()
    assert "a.npy: 8 x 6, 2 spp in " in again
    assert rt(scene, "cache", "--clear").stdout == ""
    assert rt(scene, "render", "a.yaml", "-o", "a.npy", "--spp", "2", "--quiet").stderr == ""


def test_the_cache_is_shown_and_cleared(scene):
    rt(scene, "warm", "a.yaml", "--quiet")
    shown = rt(scene, "cache").stdout
    assert f"folder   {scene / 'cache'}\nkernels  1\nparts    " in shown
    assert "removed 1 kernels" in rt(scene, "cache", "--clear").stderr
    assert "kernels  0\nparts    0\nsize     0.0 MB\noldest   -\n" in rt(scene, "cache").stdout


def test_what_cannot_be_warmed_is_said(scene):
    assert rt(scene, "warm", "b.yaml", status=2).stderr == "rt: b.yaml: no such file\n"
    assert "unknown AOV 'dpth'" in rt(scene, "warm", "a.yaml", "--aov", "dpth", status=2).stderr
    shutil.rmtree(scene / "cache")
    (scene / "cache").touch()
    assert "compiled kernels cannot be kept there" in rt(scene, "warm", "a.yaml", status=2).stderr


_IMPORTED = """
import sys
from raytracer.cli.main import main
sys.argv = ["rt", "render", "a.yaml", "-o", "a.npy", "--spp", "1"]
assert main() == 0
print(*sorted(sys.modules))
"""

# Beside Python's own.
_NEEDED = {
    *("annotated_doc", "annotated_types", "llvmlite", "numpy", "psutil", "pydantic", "pydantic_core"),
    *("raytracer", "tqdm", "typer", "typing_extensions", "typing_inspection", "yaml"),
}

_SCENES_OWN = {
    "apertures": set(),
    "cameras": {"pinhole"},
    "environments": {"constant"},
    "filters": {"box"},
    "lights": {"background", "emitters", "flash", "point", "spot", "sun"},
    "materials": {"lambertian"},
    "media": set(),
    "shapes": {"sphere"},
    "textures": set(),
}


def test_a_plain_render_imports_what_its_scene_names(scene):
    """A package or a kind more is time in each start: this list grows for a reason, or not at all."""
    rt(scene, "warm", "a.yaml", "--quiet")
    own = {"RAYTRACER_CACHE_DIR": str(scene / "cache"), "RAYTRACER_KEY_DIR": str(scene / "key")}
    environment = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_")} | own
    done = subprocess.run(
        [sys.executable, "-c", _IMPORTED],
        capture_output=True,
        text=True,
        check=True,
        cwd=scene,
        env={**environment, "PYTHONPATH": str(ROOT)},
    )
    modules = set(done.stdout.split())
    third_party = {name.partition(".")[0] for name in modules} - set(sys.stdlib_module_names)
    assert {name for name in third_party if not name.startswith(("_", "cython"))} - {"shellingham"} <= _NEEDED
    for family, kinds in _SCENES_OWN.items():
        prefix = f"raytracer.plugins.{family}."
        found = {name.removeprefix(prefix).partition(".")[0] for name in modules if name.startswith(prefix)}
        assert found - {"base"} == kinds, family
    commands = {name.split(".")[2] for name in modules if name.startswith("raytracer.cli.")}
    assert commands == {"base", "main", "render"}
    assert not [name for name in modules if name.startswith("raytracer.optics.lens_system.importers")]
