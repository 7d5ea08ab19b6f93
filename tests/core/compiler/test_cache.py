"""The folder of compiled kernels, and the sources that they depend on."""

import ast
import os
import re
import sys
from importlib.machinery import ModuleSpec
from pathlib import Path

import pytest

import raytracer
from raytracer.core.compiler import cache
from raytracer.core.compiler.dispatch import entry


def test_sources_of_kernels_and_numba_make_another_cache_and_others_do_not(tmp_path, monkeypatch):
    # Numba looks at the file of the function it caches, not at those of the functions it calls.
    monkeypatch.setattr(cache, "_PACKAGE", tmp_path)
    (tmp_path / "core" / "sub").mkdir(parents=True)
    (tmp_path / "cli").mkdir()
    a, b, c = (tmp_path / "core" / name for name in ("a.py", "sub/b.py", "sub/c.py"))
    a.write_text("x = 1\n")
    b.write_text("y = 1\n")
    before = cache._source_hash()
    (tmp_path / "cli" / "a.py").write_text("z = 1\n")
    assert cache._source_hash() == before
    # Without importing it: a kernel that is there needs no compiler.
    numba = tmp_path / "numba" / "__init__.py"
    numba.parent.mkdir()
    numba.with_name("_version.py").write_text("version = '0.0.1'\n")
    seen = {before}
    for change in (
        lambda: b.write_text("y = 2\n"),
        c.touch,
        lambda: c.rename(a.with_name("c.py")),
        lambda: monkeypatch.setattr("importlib.util.find_spec", lambda name: ModuleSpec(name, None, origin=str(numba))),
    ):
        change()
        assert cache._source_hash() not in seen
        seen.add(cache._source_hash())


_COMPILES = re.compile(r"from raytracer\.core\.compiler\.\w+ import .*\b(kernel|entry|generic|each|switch|share)\b")


def test_kernels_are_where_the_cache_looks_for_them():
    package = Path(raytracer.__file__).parent
    sources = {path: path.read_text(encoding="utf-8") for path in package.rglob("*.py")}
    modules = {
        ".".join(path.relative_to(package).with_suffix("").parts)
        for path, source in sources.items()
        if _COMPILES.search(source)
    }
    found = {next((name for name in cache.WITH_KERNELS if module.startswith(f"{name}.")), module) for module in modules}
    assert found == set(cache.WITH_KERNELS)


def test_kernels_use_nothing_that_the_cache_does_not_look_at():
    package = Path(raytracer.__file__).parent
    used = set()
    for path in (path for name in cache.WITH_KERNELS for path in (package / name.replace(".", "/")).rglob("*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        outside = {
            alias.asname or alias.name
            for node in tree.body
            if isinstance(node, ast.ImportFrom) and not f"{node.module}.".startswith(_OF_KERNELS)
            for alias in node.names
            if (node.module or "").startswith("raytracer.")
        }
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef) and any(map(_compiles, node.decorator_list)):
                locals_ = {name.id for name in ast.walk(node) if isinstance(name, ast.Name) and _is_stored(name)}
                named = {name.id for part in node.body for name in ast.walk(part) if isinstance(name, ast.Name)}
                used |= (named - locals_ - {argument.arg for argument in node.args.args}) & outside
    # A metre will go on having a thousand.
    assert used <= {"METRES_PER_MILLIMETRE"}


_OF_KERNELS = tuple(f"raytracer.{name}." for name in cache.WITH_KERNELS)


def _compiles(decorator):
    name = ast.unparse(decorator).split("(")[0].split(".")[-1]
    return name in {"kernel", "entry", "generic", "optional", "routine", "register"}


def _is_stored(name):
    return isinstance(name.ctx, ast.Store)


def test_the_processor_is_called_as_numba_calls_it(monkeypatch):
    from numba.core.registry import cpu_target

    expected = " ".join(cpu_target.target_context.codegen().magic_tuple())
    assert cache.processor() == expected
    with monkeypatch.context() as patch:
        patch.delitem(sys.modules, "numba")
        for name in [name for name in os.environ if name.startswith("NUMBA_")]:
            patch.delenv(name)
        assert cache.processor() == expected


def test_old_caches_are_dropped(tmp_path, monkeypatch):
    monkeypatch.setenv("RAYTRACER_CACHE_DIR", str(tmp_path))
    for age in range(8):
        folder = tmp_path / f"kernels-{age}"
        folder.mkdir()
        (folder / "file.nbc").touch()
        os.utime(folder, (1000.0 - age, 1000.0 - age))
    (tmp_path / "something else").mkdir()
    current = cache._make_cache_folder()
    assert current.parent == tmp_path
    left = sorted(path.name for path in tmp_path.iterdir())
    assert left == sorted([current.name, "kernels-0", "kernels-1", "kernels-2", "something else"])


@pytest.mark.parametrize("place", ["locked/cache", "file", "link", "a/b/c"])
def test_wherever_the_cache_is_to_be_kernels_run(place, tmp_path, monkeypatch):
    (tmp_path / "locked").mkdir(0o500)
    (tmp_path / "file").touch()
    (tmp_path / "link").symlink_to(tmp_path / "nowhere" / "at all")
    monkeypatch.setenv("RAYTRACER_CACHE_DIR", str(tmp_path / place))
    monkeypatch.setattr(cache, "CACHE_FOLDER", cache._make_cache_folder())

    @entry
    def double(x):
        return 2.0 * x

    assert double(1.5) == 3.0


@pytest.mark.skipif(sys.platform == "win32", reason="homes are found in another way there")
def test_a_user_without_a_home_has_a_cache_all_the_same(tmp_path, monkeypatch):
    def no_home():
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.delenv("RAYTRACER_CACHE_DIR", raising=False)
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr(Path, "home", no_home)
    monkeypatch.setattr("tempfile.gettempdir", lambda: str(tmp_path))
    assert cache._cache_root() == tmp_path / f"raytracer-{os.getuid()}"


def test_cache_lies_where_each_system_keeps_caches(tmp_path, monkeypatch):
    monkeypatch.delenv("RAYTRACER_CACHE_DIR", raising=False)
    monkeypatch.setattr(Path, "home", lambda: tmp_path)
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.delenv("LOCALAPPDATA", raising=False)
    for platform, place in (
        ("linux", tmp_path / ".cache"),
        ("darwin", tmp_path / "Library" / "Caches"),
        ("win32", tmp_path / "AppData" / "Local" / "raytracer"),
    ):
        monkeypatch.setattr("sys.platform", platform)
        assert cache._cache_root() == place / ("Cache" if platform == "win32" else "raytracer")
