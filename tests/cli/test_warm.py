"""`rt warm` and `rt cache`, and what a render says about its kernel."""

import json
import os
import subprocess
import sys

import pytest

from raytracer.core.compiler.compile_progress import COMPILATION
from raytracer.rendering import render
from raytracer.rendering.options import RenderOptions
from tests.repository import ROOT

SCENE = (
    "camera: {type: pinhole, look_from: [0, 0, 4], vfov: 40}\nfilm: {width: 8, height: 6}\n"
    "environment: {type: constant, radiance: 1}\n"
    "objects: [{type: sphere, center: [0, 0, 0], radius: 1, material: {type: lambertian}}]\n"
)

MAIN = "from raytracer.cli.main import main; raise SystemExit(main())"


@pytest.fixture
def rt_alone(tmp_path):
    """Run rt in a process of its own, with a cache of its own."""
    (tmp_path / "a.yaml").write_text(SCENE)
    own = {"RAYTRACER_CACHE_DIR": str(tmp_path / "cache"), "RAYTRACER_KEY_DIR": str(tmp_path / "key")}
    environment = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_")} | own

    def run(command, status=0, program=MAIN):
        done = subprocess.run(
            [sys.executable, "-c", program, *command.split()],
            capture_output=True,
            text=True,
            check=False,
            cwd=tmp_path,
            env={**environment, "PYTHONPATH": str(ROOT)},
        )
        assert done.returncode == status, done.stderr
        return done

    return run


_FIRST = "rt: this combination of effects is compiled for the first time"

_SEVERAL = """
import sys
from raytracer.cli.base.app import main
for command in " ".join(sys.argv[1:]).split(";"):
    assert main(command.split()) == 0
"""

_IMPORTED = """
import sys
from raytracer.cli.main import main
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


def test_what_was_rendered_is_warm_and_is_rendered_without_the_compiler(rt_alone, tmp_path):
    cold = rt_alone("render a.yaml -o a.npy --spp 2").stderr.splitlines()
    assert cold[0].startswith(_FIRST)
    assert " s in all, " in cold[1]

    # A package or a kind more is time in each start: these lists grow for a reason, or not at all.
    done = rt_alone("render a.yaml -o a.npy --spp 1", program=_IMPORTED)
    (said,) = done.stderr.splitlines()
    assert "a.npy: 8 x 6, 1 spp in " in said
    modules = set(done.stdout.split())
    third_party = {name.partition(".")[0] for name in modules} - set(sys.stdlib_module_names)
    # Some systems give Python a module of their own.
    others = {"shellingham", "sitecustomize"}
    assert {name for name in third_party if not name.startswith(("_", "cython"))} - others <= _NEEDED
    for family, kinds in _SCENES_OWN.items():
        prefix = f"raytracer.plugins.{family}."
        found = {name.removeprefix(prefix).partition(".")[0] for name in modules if name.startswith(prefix)}
        assert found - {"base"} == kinds, family
    assert {name.split(".")[2] for name in modules if name.startswith("raytracer.cli.")} == {"base", "main", "render"}
    assert not [name for name in modules if name.startswith("raytracer.optics.lens_system.importers")]

    done = rt_alone("warm a.yaml -D render.spp=3; cache; cache --json; cache --clear; cache", program=_SEVERAL)
    kept, brace, described = done.stdout.partition("{")
    folder = f"folder   {tmp_path / 'cache'}\n"
    assert kept.startswith(f"a.yaml: was in the cache\n{folder}kernels  1\nparts    ")
    numbers, end = json.JSONDecoder().raw_decode(brace + described)
    assert numbers["kernels"] == 1
    assert "removed 1 kernel" in done.stderr
    assert described[end - 1 :] == f"\n{folder}kernels  0\nparts    0\nsize     0.0 MB\noldest   -\n"


def test_what_is_warmed_is_what_renders_prepare(here, rt, monkeypatch):
    (here / "a.yaml").write_text(SCENE)
    prepared = []

    def prepare(spec, wanted):
        kernel = (spec.film.filter.type, wanted)
        monkeypatch.setattr(COMPILATION, "count", COMPILATION.count + (kernel not in prepared))
        prepared.append(kernel)

    monkeypatch.setattr(render, "prepare_scene", prepare)
    first, second = rt("warm a.yaml a.yaml -D film.filter=box --aov depth --denoise").out.splitlines()
    assert first.startswith("a.yaml: compiled in ")
    assert second == "a.yaml: was in the cache"
    assert prepared == [("box", RenderOptions(aovs=("depth",), denoise=True))] * 2


def test_where_kernels_cannot_be_kept_nothing_is_warmed(rt_alone, tmp_path):
    (tmp_path / "cache").touch()
    assert "compiled kernels cannot be kept there" in rt_alone("warm a.yaml", status=2).stderr


def test_what_cannot_be_warmed_is_said(here, refused):
    (here / "a.yaml").write_text(SCENE)
    assert refused("warm b.yaml") == "rt: b.yaml: no such file; did you mean a.yaml?\n"
    assert "unknown AOV 'dpth'" in refused("warm a.yaml --aov dpth")
