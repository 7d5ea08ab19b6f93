"""The command line's frame: help at once, exit statuses, one sentence for every failure."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
import typer

import raytracer
from raytracer.cli.base import app as cli
from raytracer.cli.base.app import main
from raytracer.util.errors import InputError, OutputError

SCENE = (
    "camera: {type: pinhole, look_from: [0, 0, 4], vfov: 40}\nfilm: {width: 8, height: 6}\n"
    "environment: {type: constant, radiance: 1}\n"
)
MAIN = "from raytracer.cli.main import main; raise SystemExit(main())"
BALL = "objects: [{type: sphere, center: [0, 0, 0], radius: 1}]\n"


def commands(group, above=""):
    """Names of all commands, those of groups with the group's before them."""
    for name, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from commands(command, f"{above}{name} ")
        else:
            yield f"{above}{name}"


COMMANDS = list(commands(typer.main.get_command(cli.application())))


def run(program, *words, **settings):
    return subprocess.run(
        [sys.executable, "-c", program, *words], stderr=subprocess.PIPE, text=True, check=False, **settings
    )


def test_help_imports_nothing_slow():
    program = (
        "import sys; from raytracer.cli.base.app import main; assert main(['--help']) == 0;"
        "slow = {'numba', 'numpy', 'pydantic', 'yaml', 'rich', 'trimesh', 'PIL', 'OpenEXR', 'scipy'};"
        "print(sorted(slow & set(sys.modules)), file=sys.stderr)"
    )
    done = run(program, stdout=subprocess.PIPE)
    assert done.stderr.strip() == "[]"
    assert "validate" in done.stdout


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_shows_an_example(command, rt):
    output = rt(f"{command} --help").out
    assert f"Usage: rt {command}" in output
    assert "Example" in output
    # A lens is reported on where nothing else is asked for.
    assert f"  rt {command.removesuffix(' report')} " in f"{output} "


@pytest.mark.parametrize("group", ["", "lightfield "])
def test_lists_of_commands_hold_whole_sentences(group, rt):
    listed = " ".join(rt(f"{group}--help").out.split("Commands:")[1].split())
    inside = typer.main.get_command(cli.application())
    below = inside.commands[group.strip()] if group else inside
    for name, command in below.commands.items():
        assert f"{name} {command.short_help}" in listed
        assert command.short_help.endswith(".")
    assert "..." not in listed


def test_version_is_printed(rt):
    assert rt("--version").out == f"rt {raytracer.__version__}\n"


def test_validate_names_the_right_and_every_wrong_file(here, rt):
    Path("good.yaml").write_text(SCENE + BALL)
    Path("bad.yaml").write_text(SCENE.replace("vfov", "vfv").replace("width", "widht"))
    # A flash without an exposure is seen only when lights and shutter are put together.
    Path("dark.yaml").write_text(SCENE + BALL + "lights: [{type: flash, energy: 1}]\n")
    captured = rt("validate bad.yaml good.yaml worse.yaml dark.yaml", status=2)
    assert captured.out == "good.yaml: valid\n"
    first, other, second, third = captured.err.splitlines()
    assert first.startswith("rt: bad.yaml:1: camera.vfv: unknown key 'vfv'")
    assert other.startswith("rt: bad.yaml:2: film.widht: unknown key 'widht'")
    assert second == "rt: worse.yaml: no such file; did you mean good.yaml?"
    assert third.startswith("rt: dark.yaml:")
    assert "shutter" in third
    assert rt("validate --quiet good.yaml").out == ""


@pytest.mark.parametrize(
    ("error", "status", "sentence"),
    [
        (InputError("no such lens"), 2, "rt: no such lens\n"),
        (OutputError("a.png: no space"), 1, "rt: a.png: no space\n"),
        (PermissionError(13, "Permission denied", "a.png"), 1, "rt: a.png: Permission denied\n"),
        (OSError("broken"), 1, "rt: broken\n"),
        (MemoryError(), 1, "rt: out of memory\n"),
        (KeyboardInterrupt(), 130, "rt: interrupted\n"),
        (ZeroDivisionError("two\nlines"), 1, "rt: internal error, ZeroDivisionError: two lines (RT_TRACEBACK=1 shows"),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, BaseException) else "",
)
def test_every_failure_is_one_sentence(error, status, sentence, monkeypatch, capsys):
    app = typer.Typer()

    @app.callback()
    def group():
        pass

    @app.command()
    def fail():
        raise error

    monkeypatch.setattr(cli, "application", lambda command: app)
    monkeypatch.delenv("RT_TRACEBACK", raising=False)
    assert main(["fail"]) == status
    captured = capsys.readouterr()
    assert captured.err.lstrip("\n").startswith(sentence)
    assert captured.err.strip().count("\n") == 0
    monkeypatch.setenv("RT_TRACEBACK", "1")
    main(["fail"])
    assert ("Traceback" in capsys.readouterr().err) is (status == 1 and not isinstance(error, OutputError))


def test_nothing_of_the_current_folder_tells_the_compiler_what_to_do(here):
    """Else who renders among files that somebody sent has files of their own overwritten."""
    (here / "good.yaml").write_text(SCENE + BALL)
    (here / "precious").write_text("precious")
    (here / ".numba_config.yaml").write_text(f"chrome_trace: {here / 'precious'}\n")
    done = run(MAIN, "validate", "good.yaml", cwd=here)
    assert (here / "precious").read_text() == "precious"
    assert done.returncode == 2
    assert done.stderr.startswith("rt: .numba_config.yaml: Numba would obey this file of the current folder")


@pytest.fixture(params=["", "1"], ids=["at the end", "at once"])
def printed_to(request, monkeypatch):
    """Run `rt --version`, which prints to a file that takes nothing; returns the exit status and what it says."""
    monkeypatch.setenv("PYTHONUNBUFFERED", request.param)

    def print_to(file):
        with open(file, "w") as stdout:
            done = run(MAIN, "--version", stdout=stdout)
        return done.returncode, done.stderr

    return print_to


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
def test_a_full_disk_under_stdout_is_a_failure_in_one_sentence(printed_to):
    assert printed_to("/dev/full") == (1, "rt: No space left on device\n")


def test_a_reader_that_goes_away_is_no_error_message(printed_to):
    reading, writing = os.pipe()
    os.close(reading)
    assert printed_to(writing) == (1, "")
