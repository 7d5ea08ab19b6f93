"""The fixture of pytest, in projects of other people."""

import importlib.metadata
import subprocess
import sys
from pathlib import Path

import pytest

from raytracer.analysis.regression import pytest_plugin
from raytracer.analysis.regression.check import check_reference
from raytracer.analysis.regression.report import check_page
from tests.analysis.regression.made_up import SCENE, MadeUp
from tests.analysis.regression.made_up import reference as made_reference

pytest_plugins = ["pytester"]

SETTINGS = ["-p", "raytracer.pytest_plugin", "-p", "no:cacheprovider", "-p", "no:xdist", "-o", "addopts="]


@pytest.fixture
def renders(monkeypatch):
    return MadeUp().install(monkeypatch)


@pytest.fixture(scope="module")
def _imported(tmp_path_factory):
    """Import what a check does only when it needs it: Pytester forgets modules, and NumPy cannot be imported twice."""
    with pytest.MonkeyPatch.context() as patch:
        MadeUp().install(patch)
        check_page([check_reference(made_reference(tmp_path_factory.mktemp("imported")))])


@pytest.fixture
def project(pytester, renders, _imported):
    (pytester.path / "ball.yaml").write_text(SCENE, encoding="utf-8")
    (pytester.path / "tests").mkdir()
    return pytester


@pytest.fixture
def run(project):
    """Run a test that makes some call, and tell what it printed if it fails, or that it passed."""

    def run(*arguments, call="rt_regression('../ball.yaml')", more=""):
        lines = ["import raytracer as rt", "def test_ball(rt_regression):", *([f"    {more}"] if more else [])]
        text = "\n".join([*lines, f"    found = {call}", "    assert found.passed", ""])
        (project.path / "tests" / "test_ball.py").write_text(text, encoding="utf-8")
        return project.runpytest_inprocess(*SETTINGS, *arguments)

    return run


@pytest.fixture
def kept(project):
    return project.path / "tests" / "references" / "ball.npz"


def test_it_is_found_by_pytest_once_rt_is_installed_and_costs_nothing_before_it_is_used():
    plugins = {entry.name: entry.value for entry in importlib.metadata.entry_points(group="pytest11")}
    assert plugins["raytracer.pytest_plugin"] == "raytracer.analysis.regression.pytest_plugin"
    program = (
        "import sys, raytracer.analysis.regression.pytest_plugin as p; "
        "print(*(m for m in ('numpy', 'numba', 'yaml') if m in sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


def test_a_reference_is_asked_for_rendered_and_kept(run, kept, renders):
    # Without one, or with a broken one, the test fails and says what to do.
    result = run()
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["there is no reference *ball.npz; pytest --rt-update renders it"])
    assert not kept.exists()
    kept.parent.mkdir()
    kept.write_bytes(b"text")
    run().stdout.fnmatch_lines(["*broken, or not a reference image*; pytest --rt-update renders it"])

    result = run("--rt-update")
    result.assert_outcomes(passed=1)
    result.stdout.fnmatch_lines([f"rt: rendered the reference {kept}"])
    assert [call["spp"] for call in renders.calls] == [4096, 256]
    before = kept.read_bytes()
    run().assert_outcomes(passed=1)
    # What has not changed keeps its reference.
    result = run("--rt-update")
    result.assert_outcomes(passed=1)
    assert "rendered the reference" not in result.stdout.str()
    assert kept.read_bytes() == before


def test_a_picture_that_has_changed_fails_and_is_shown(project, run, kept, renders):
    run("--rt-update")
    renders.change = lambda picture: 1.01 * picture
    result = run()
    result.assert_outcomes(failed=1)
    failed = "ball: FAILED: the mean of * differs: *"
    result.stdout.fnmatch_lines([failed, "  reference: *ball.npz", "  pictures:  *ball.html", "*--rt-update"])
    # Where the variable CI is set, pytest's summary tells all of it once more.
    (line,) = {line for line in result.stdout.lines if line.startswith("  pictures:")}
    assert Path(line.partition(":")[2].strip()).read_bytes().startswith(b"<!doctype html>")
    # No more of the program than that is shown.
    assert "raytracer/analysis/regression/pytest_plugin.py" not in result.stdout.str()

    run("--rt-report", "pages").assert_outcomes(failed=1)
    assert [item.name for item in (project.path / "pages").iterdir()] == ["tests_test_ball.py_test_ball-ball.html"]
    run("--rt-report", "ball.yaml").stdout.fnmatch_lines([failed, "  pictures:  *.html: cannot be written: *"])

    before = kept.read_bytes()
    run("--rt-update").assert_outcomes(passed=1)
    assert kept.read_bytes() != before
    run().assert_outcomes(passed=1)


def test_what_the_test_asks_for_is_what_is_rendered(run, kept, renders):
    asked = "name='near', overrides={'camera.vfov': 20}, width=24, spp=300, seed=5, reference_spp=500"
    run("--rt-update", call=f"rt_regression('../ball.yaml', {asked})").assert_outcomes(passed=1)
    assert kept.with_name("near.npz").exists()
    assert [(call["spp"], call["seed"]) for call in renders.calls] == [(500, 12345), (300, 5)]
    for call in renders.calls:
        assert (call["spec"].camera.vfov, call["spec"].film.width) == (20, 24)


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ("'../ball.yaml', width=24", "*was rendered with film.width=nothing, and the test asks for 24;*--rt-update*"),
        ("'../ball.yaml', overrides={'camera.vfov': 20}", "*with camera.vfov=nothing, and the test asks for 20;*"),
        ("'../other.yaml', name='ball'", "*is the reference of ../../ball.yaml; pytest --rt-update renders it"),
        ("'../none.yaml', name='ball'", "*none.yaml: no such file*"),
        ("'../ball.yaml', overrides={'camera.vfof': 20}", "*camera.vfof*did you mean 'vfov'*"),
        ("'../ball.yaml', seed=12345", "*was rendered with the seed 12345 itself*"),
        ("'../ball.yaml', name='../ball'", "name='../ball': is the name of a reference, not a path"),
    ],
)
def test_what_does_not_fit_the_reference_fails(arguments, sentence, project, run):
    run("--rt-update")
    (project.path / "other.yaml").write_text(SCENE, encoding="utf-8")
    result = run(call=f"rt_regression({arguments})")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines([sentence])


def test_what_cannot_be_written_is_one_sentence(run, kept):
    kept.parent.write_text("no folder")
    result = run("--rt-update")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["*ball.npz: cannot be written: *"])
    result.stdout.no_fnmatch_line("*During handling*")
    result.stdout.no_fnmatch_line("*Error*")


def test_a_scene_that_the_test_builds_has_a_name(run):
    build = "scene = rt.load('ball.yaml')"
    run("--rt-update", call="rt_regression(scene, name='built')", more=build).assert_outcomes(passed=1)
    run(call="rt_regression(scene, name='built')", more=build).assert_outcomes(passed=1)
    result = run(call="rt_regression(scene)", more=build)
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["*built in code needs a name for its reference*"])


@pytest.mark.parametrize(("workers", "threads"), [(None, None), ("3", 2), ("20", 1)])
def test_tests_that_run_at_once_share_the_processors(monkeypatch, workers, threads):
    monkeypatch.setattr("raytracer.rendering.worker_pool.available_threads", lambda: 8)
    monkeypatch.delenv("PYTEST_XDIST_WORKER_COUNT", raising=False)
    if workers:
        monkeypatch.setenv("PYTEST_XDIST_WORKER_COUNT", workers)
    assert pytest_plugin._threads() == threads
