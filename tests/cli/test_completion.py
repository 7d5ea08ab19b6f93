"""Completion in shells: what bash, zsh and fish offer after some words, and that it takes no slow imports."""

import os
import shutil
import subprocess
import sys
import sysconfig

import pytest
import typer

from raytracer.cli.base.app import application
from raytracer.film.light_field.lf.stored_array import TYPES
from raytracer.lightfield.depth import depth_map
from raytracer.lightfield.formats.registry import light_field_formats
from raytracer.lightfield.refocusing import refocus
from raytracer.lightfield.views.camera_paths import PATHS

# What each shell does when Tab is pressed behind `{line}`; `{words}` and `{place}` are what it gives to a function.
PROGRAMS = {
    "bash": """eval "$(rt completion bash)"; COMP_WORDS=({words}); COMP_CWORD={place}
_rt_completion rt; printf '%s\\n' "${{COMPREPLY[@]}}" """,
    "zsh": """compdef() {{}}; _files() {{}}; _arguments() {{ print -rl -- ${{(Q)${{(z)${{${{1#*\\(\\(}}%))}}}}}}; }}
eval "$(rt completion zsh)"; words=({words}); CURRENT={place}+1; _rt_completion""",
    "fish": "rt completion fish | source; complete -C '{line}'",
}
NO_START_UP = {"bash": "--norc", "zsh": "-f", "fish": "--no-config"}

LINES = {
    "rt ren": ["render"],
    "rt lightfield all": ["all-in-focus"],
    "rt render --progr": ["--progress"],
    "rt render a.yaml --progress ": ["bar", "json", "off"],
    "rt render a.yaml --format e": ["exr"],
    "rt explain ": ["a.yaml", "b.yml", "scenes/"],
    "rt render s": ["scenes/deep/c.yaml", "scenes/deep/d.yaml"],
    "rt completion f": ["fish"],
}


@pytest.fixture
def folder(here, monkeypatch):
    for name in ("a.yaml", "b.yml", "notes.txt", ".hidden.yaml", "scenes/deep/c.yaml", "scenes/deep/d.yaml"):
        path = here / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    monkeypatch.setenv("PATH", f"{sysconfig.get_path('scripts')}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.setenv("HOME", str(here))
    return here


@pytest.mark.parametrize("shell", PROGRAMS)
def test_shells_complete_commands_options_scenes_and_values(shell, folder):
    if shutil.which(shell) is None:
        pytest.skip(f"{shell} is not installed")
    for line, wanted in LINES.items():
        words = f"{line} ''" if line.endswith(" ") else line
        program = PROGRAMS[shell].format(line=line, words=words, place=len(line.split(" ")) - 1)
        done = subprocess.run([shell, NO_START_UP[shell], "-c", program], capture_output=True, text=True, check=False)
        # Behind a word stands its help, behind a tab or a colon.
        offered = [word.split("\t")[0].split(":")[0].strip('"') for word in done.stdout.splitlines()]
        assert sorted(offered) == wanted, (line, done.stderr)


@pytest.mark.parametrize("line", ["rt ", "rt render --", "rt render "])
def test_words_are_found_without_what_is_slow(line, folder):
    program = (
        "import atexit, sys\n"
        "slow = {'numba', 'numpy', 'yaml', 'scipy', 'llvmlite'}\n"
        "atexit.register(lambda: print(sorted(slow & set(sys.modules)), file=sys.stderr))\n"
        "from raytracer.cli.main import main; main()"
    )
    settings = {"_RT_COMPLETE": "complete_bash", "COMP_WORDS": line, "COMP_CWORD": str(line.count(" "))}
    done = subprocess.run(
        [sys.executable, "-c", program], env=os.environ | settings, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "[]\n")
    assert {"rt ": "render", "rt render --": "--spp", "rt render ": "a.yaml"}[line] in done.stdout.split()


VALUES = {
    "render --dtype": TYPES,
    "import --dtype": TYPES,
    "export --layout": light_field_formats(),
    "import --layout": light_field_formats(),
    "move --path": PATHS,
    "depth --method": depth_map.METHODS,
    "refocus --method": refocus.METHODS,
}


@pytest.mark.parametrize("option", VALUES)
def test_values_are_those_that_the_option_takes(option):
    name, flag = option.split()
    group = typer.main.get_command(application("lightfield")).commands["lightfield"]
    (parameter,) = (each for each in group.commands[name].params if flag in each.opts)
    context = typer.Context(group.commands[name])
    assert {item.value for item in parameter.shell_complete(context, "")} == set(VALUES[option])


def test_the_script_is_that_of_the_shell_and_others_are_refused(rt, refused, here):
    assert "complete -o default -F _rt_completion rt" in rt("completion bash").out
    assert "'csh' is not one of 'bash', 'zsh', 'fish'" in refused("completion csh")
