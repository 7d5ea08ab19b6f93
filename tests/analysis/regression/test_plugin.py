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

TEST = 'def test_ball(rt_regression): rt_regression("../ball.yaml")\n'


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
    """A scene, and a test of it in a folder."""
    (pytester.path / "ball.yaml").write_text(SCENE, encoding="utf-8")
    (pytester.path / "tests").mkdir()
    write(pytester, TEST)
    return pytester


def write(project, test):
    (project.path / "tests" / "test_ball.py").write_text(test, encoding="utf-8")


def run(project, *arguments):
    settings = (
        "-p",
        "raytracer.pytest_plugin",
        "-p",
        "no:cacheprovider",
        "-p",
        "no:xdist",
        "-o",
        "addopts=",
    )
    return project.runpytest_inprocess(*settings, *arguments)


def reference(project, name="ball"):
    return project.path / "tests" / "references" / f"{name}.npz"


def test_it_is_found_by_pytest_once_rt_is_installed():
    plugins = {entry.name: entry.value for entry in importlib.metadata.entry_points(group="pytest11")}
    assert plugins["raytracer.pytest_plugin"] == "raytracer.analysis.regression.pytest_plugin"


def test_it_costs_nothing_before_it_is_used():
    program = (
        "import sys, raytracer.analysis.regression.pytest_plugin as p; "
        "print(*(m for m in ('numpy', 'numba', 'yaml') if m in sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


def test_a_reference_is_asked_for_rendered_and_kept(project, renders):
    # Without one the test fails, and says what to do.
    result = run(project)
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["there is no reference *ball.npz; pytest --rt-update renders it"])
    assert not reference(project).exists()

    result = run(project, "--rt-update")
    result.assert_outcomes(passed=1)
    result.stdout.fnmatch_lines([f"rt: rendered the reference {reference(project)}"])
    assert [call["spp"] for call in renders.calls] == [4096, 256]
    kept = reference(project).read_bytes()

    run(project).assert_outcomes(passed=1)
    # What has not changed keeps its reference.
    result = run(project, "--rt-update")
    result.assert_outcomes(passed=1)
    assert "rendered the reference" not in result.stdout.str()
    assert reference(project).read_bytes() == kept


def test_a_picture_that_has_changed_fails_and_is_shown(project, renders):
    run(project, "--rt-update")
    renders.change = lambda picture: 1.01 * picture
    result = run(project)
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(
        ["ball: FAILED: the mean of * differs: *", "  reference: *ball.npz", "  pictures:  *ball.html", "*--rt-update"]
    )
    # Where the variable CI is set, pytest's summary tells all of it once more.
    (line,) = {line for line in result.stdout.lines if line.startswith("  pictures:")}
    page = Path(line.partition(":")[2].strip())
    assert page.read_bytes().startswith(b"<!doctype html>")
    # No more of the program than that is shown.
    assert "raytracer/analysis/regression/pytest_plugin.py" not in result.stdout.str()

    result = run(project, "--rt-report", "pages")
    result.assert_outcomes(failed=1)
    assert [item.name for item in (project.path / "pages").iterdir()] == ["tests_test_ball.py_test_ball-ball.html"]

    result = run(project, "--rt-report", "ball.yaml")
    result.stdout.fnmatch_lines(["ball: FAILED: the mean of * differs: *", "  pictures:  *.html: cannot be written: *"])

    kept = reference(project).read_bytes()
    run(project, "--rt-update").assert_outcomes(passed=1)
    assert reference(project).read_bytes() != kept
    run(project).assert_outcomes(passed=1)


def test_what_the_test_asks_for_is_what_is_rendered(project, renders):
    write(
        project,
        "def test_near(rt_regression):\n"
        "    found = rt_regression('../ball.yaml', name='near', overrides={'camera.vfov': 20}, width=24, spp=300,\n"
        "                          seed=5, reference_spp=500)\n"
        "    assert found.passed and found.image.radiance.shape == (16, 24, 3)\n",
    )
    run(project, "--rt-update").assert_outcomes(passed=1)
    assert reference(project, "near").exists()
    assert [(call["spp"], call["seed"]) for call in renders.calls] == [(500, 12345), (300, 5)]
    for call in renders.calls:
        assert (call["spec"].camera.vfov, call["spec"].film.width) == (20, 24)


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        ("'../ball.yaml', width=24", "*was rendered with film.width=nothing, and the test asks for 24;*--rt-update*"),
        ("'../ball.yaml', overrides={'camera.vfov': 20}", "*with camera.vfov=nothing, and the test asks for 20;*"),
        ("'../other.yaml', name='ball'", "*is the reference of ../../ball.yaml; pytest --rt-update renders it"),
        ("'../none.yaml', name='ball'", "*none.yaml: no such file"),
        ("'../ball.yaml', overrides={'camera.vfof': 20}", "*camera.vfof*did you mean 'vfov'*"),
        ("'../ball.yaml', seed=12345", "*was rendered with the seed 12345 itself*"),
        ("'../ball.yaml', spp=3", "a check takes at least 16 samples per pixel*"),
    ],
)
def test_what_does_not_fit_the_reference_fails(call, sentence, project, renders):
    run(project, "--rt-update")
    (project.path / "other.yaml").write_text(SCENE, encoding="utf-8")
    write(project, f"def test_ball(rt_regression): rt_regression({call})\n")
    result = run(project)
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines([sentence])


def test_a_broken_reference_is_rendered_anew(project, renders):
    run(project, "--rt-update")
    reference(project).write_bytes(b"text")
    result = run(project)
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["*broken, or not a reference image*; pytest --rt-update renders it"])
    run(project, "--rt-update").assert_outcomes(passed=1)


def test_a_scene_that_the_test_builds_has_a_name(project, renders):
    build = "import raytracer as rt\ndef test_ball(rt_regression):\n    scene = rt.load('ball.yaml')\n"
    write(project, build + "    rt_regression(scene, name='built')\n")
    run(project, "--rt-update").assert_outcomes(passed=1)
    run(project).assert_outcomes(passed=1)
    write(project, build + "    rt_regression(scene)\n")
    result = run(project)
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["*built in code needs a name for its reference*"])


def test_tests_that_run_at_once_share_the_processors(monkeypatch):
    monkeypatch.setattr("raytracer.rendering.worker_pool.available_threads", lambda: 8)
    monkeypatch.delenv("PYTEST_XDIST_WORKER_COUNT", raising=False)
    assert pytest_plugin._threads() is None
    monkeypatch.setenv("PYTEST_XDIST_WORKER_COUNT", "3")
    assert pytest_plugin._threads() == 2
    monkeypatch.setenv("PYTEST_XDIST_WORKER_COUNT", "20")
    assert pytest_plugin._threads() == 1


@pytest.mark.parametrize(
    ("call", "says"),
    [
        ('rt_regression("../none.yaml")', "*none.yaml: no such file"),
        ('rt_regression("../ball.yaml", name="../ball")', "name='../ball': is the name of a reference, not a path"),
        ('rt_regression("../ball.yaml")', "*ball.npz: cannot be written: *"),
    ],
)
def test_what_is_wrong_is_one_sentence(project, call, says):
    write(project, f"def test_ball(rt_regression): {call}\n")
    (project.path / "tests" / "references").write_text("no folder")
    result = run(project, "--rt-update")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines([says])
    result.stdout.no_fnmatch_line("*During handling*")
    result.stdout.no_fnmatch_line("*Error*")
