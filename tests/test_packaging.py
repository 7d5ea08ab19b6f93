"""The package as others install it: a wheel with all that it needs, in an environment that has no sources."""

import os
import re
import shutil
import subprocess
import sys
import sysconfig
import zipfile
from importlib.metadata import PackageNotFoundError
from pathlib import Path

import pytest

import raytracer
from raytracer.analysis.doctor.diagnosis import _CHECKS
from raytracer.analysis.doctor.packages import EXTRAS
from raytracer.film import load
from tests.cli.test_render import SCENE
from tests.repository import ROOT

CONTAINERFILE = ROOT / "docs" / "examples" / "Containerfile"
INSTALL = (ROOT / "docs" / "install.md").read_text(encoding="utf-8")


def run(*words, folder: Path, **environment: str) -> str:
    done = subprocess.run(
        [*map(str, words)], cwd=folder, env={**os.environ, **environment}, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def sources(tmp_path_factory) -> Path:
    """What a wheel is built from, without the repository's history."""
    folder = tmp_path_factory.mktemp("sources")
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, folder)
    shutil.copytree(ROOT / "raytracer", folder / "raytracer", ignore=shutil.ignore_patterns("__pycache__"))
    return folder


def wheel(sources: Path) -> Path:
    """Build the wheel of some sources."""
    command = (sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--wheel-dir", "dist", ".")
    run(*command, folder=sources)
    (built,) = (sources / "dist").glob("*.whl")
    return built.rename(sources.parent / built.name)


@pytest.fixture(scope="module")
def installed(sources, tmp_path_factory) -> Path:
    """An environment with the wheel; what the wheel depends on is taken from the one that runs the tests."""
    built = wheel(sources)
    with zipfile.ZipFile(built) as archive:
        files = {name for name in archive.namelist() if ".dist-info/" not in name}
    tracked = run("git", "ls-files", "raytracer", folder=ROOT).split()
    assert files == set(tracked)
    folder = tmp_path_factory.mktemp("environment")
    run(sys.executable, "-m", "venv", "--without-pip", folder, folder=ROOT)
    site = Path(
        run(folder / "bin" / "python", "-c", "import site; print(site.getsitepackages()[0])", folder=ROOT).strip()
    )
    (site / "dependencies.pth").write_text(sysconfig.get_path("purelib"))
    run(
        sys.executable,
        "-m",
        "pip",
        "--python",
        folder / "bin" / "python",
        "install",
        "-q",
        "--no-deps",
        built,
        folder=ROOT,
    )
    return folder / "bin"


@pytest.mark.slow
def test_the_wheel_renders_and_writes_pages_from_an_empty_folder(installed, tmp_path):
    (tmp_path / "ball.yaml").write_text(SCENE)
    where = run(installed / "python", "-c", "import raytracer; print(raytracer.__file__)", folder=tmp_path)
    assert Path(where.strip()).is_relative_to(installed.parent)
    # Sources without Git are those of the last release.
    assert run(installed / "rt", "--version", folder=tmp_path) == "rt 0.1.0\n"
    run(installed / "rt", "render", "ball.yaml", "-o", "ball.png", folder=tmp_path)
    assert load(tmp_path / "ball.png").shape == (16, 24, 3)
    run(installed / "rt", "sweep", "ball.yaml", "-D", "camera.vfov=30,40", "-o", "sweep", folder=tmp_path)
    assert "<style>" in (tmp_path / "sweep" / "index.html").read_text(encoding="utf-8")
    run(installed / "rt", "doctor", folder=tmp_path)


@pytest.mark.slow
def test_the_version_is_the_tags(sources):
    git = ("git", "-c", "user.name=a", "-c", "user.email=a@example.com")
    for command in (["init", "-q"], ["add", "pyproject.toml"], ["commit", "-qm", "a"], ["tag", "v3.2.1"]):
        run(*git, *command, folder=sources)
    (sources / ".git" / "info" / "exclude").write_text("*\n")
    assert wheel(sources).name == "raytracer-3.2.1-py3-none-any.whl"


def test_sources_that_nobody_has_installed_have_a_version_too(monkeypatch):
    def missing(name):
        raise PackageNotFoundError

    monkeypatch.setattr("importlib.metadata.version", missing)
    monkeypatch.delattr(raytracer, "__version__", raising=False)
    assert raytracer.__version__ == "0+unknown"
    monkeypatch.delattr(raytracer, "__version__")


# ---- The container's file, as far as it can be checked without building it


def instructions() -> list[tuple[str, str]]:
    """The instructions of the file and their arguments."""
    lines = CONTAINERFILE.read_text(encoding="utf-8").splitlines()
    return [tuple(line.split(" ", 1)) for line in lines if line and not line.startswith("#")]


def test_the_image_is_of_one_stage_with_a_fixed_base_and_its_user_is_not_root():
    steps = instructions()
    names = [name for name, _ in steps]
    (base,) = (argument for name, argument in steps if name == "FROM")
    image, _, tag = base.rpartition(":")
    assert image
    assert re.match(r"\d+\.\d+-", tag)
    (user,) = (argument for name, argument in steps if name == "USER")
    assert user not in ("root", "0")
    assert any(f'useradd --uid "$UID" --create-home {user} ' in argument for _, argument in steps)
    # What follows is that user's: the kernels' folder and what is run.
    assert names.index("USER") < names.index("ENV") < len(names) - names[::-1].index("RUN") - 1
    assert names[-2:] == ["ENTRYPOINT", "CMD"]
    assert dict(steps)["ENTRYPOINT"] == '["rt"]'


def test_the_image_has_what_it_is_built_from_and_warms_what_it_has():
    steps, copied = instructions(), {}
    for *sources, target in (argument.split() for name, argument in steps if name == "COPY"):
        assert all((ROOT / source).exists() for source in sources)
        copied |= {f"{target}{Path(source).name}": source for source in sources}
    runs = " ".join(argument for name, argument in steps if name == "RUN")
    assert "pip install --no-cache-dir '/opt/rt[bayer,compare,denoise]'" in runs
    (warmed,) = re.findall(r"rt warm (\S+) (\S+) && rt doctor", runs)
    # By themselves: no file beside them is in the image.
    for path in warmed:
        assert "file:" not in (ROOT / copied[path]).read_text(encoding="utf-8")
    assert {"RAYTRACER_CACHE_DIR", "RAYTRACER_KEY_DIR"} == set(re.findall(r"(\w+)=", dict(steps)["ENV"]))


# ---- The page


def test_the_page_has_the_extras_the_container_and_the_lines_of_the_doctor():
    rows = dict(re.findall(r"^\| `raytracer\[(\w+)\]` \| (.*) \|$", INSTALL, re.MULTILINE))
    assert rows == {name: extra.gives for name, extra in EXTRAS.items()}
    shown = re.findall(r"^(?:ok|warning|-) +(\S+)", INSTALL, re.MULTILINE)
    assert shown == [*_CHECKS, *(f"[{extra}]" for extra in EXTRAS)]
    head = CONTAINERFILE.read_text(encoding="utf-8")
    assert all(f"#   {line}\n" in head for line in re.findall(r"^podman .*$", INSTALL, re.MULTILINE))
    for named in re.findall(r"'raytracer\[([\w,]+)\]'", INSTALL):
        assert set(named.split(",")) <= set(EXTRAS)
