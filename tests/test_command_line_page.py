"""docs/command-line.md: its commands work in the order of the page, and print what it says."""

import os
import re
import subprocess
import sysconfig

from tests.repository import ROOT

PAGE = (ROOT / "docs" / "command-line.md").read_text(encoding="utf-8")


def commands():
    """The commands behind prompts, and what the page shows below each."""
    for language, block in re.findall(r"^```(\w*)\n(.*?)^```$", PAGE, re.DOTALL | re.MULTILINE):
        for piece in re.split(r"^\$ ", "" if language else re.sub(r" \\\n +", " ", block), flags=re.MULTILINE)[1:]:
            command, _, shown = piece.partition("\n")
            yield command, shown


def pattern(shown):
    """What the page shows, where `...` is anything, on a line of its own any lines; columns may be wider."""
    lines = (r"(?:.*\n)*?" if line == "  ..." else re.escape(line).replace(r"\.\.\.", ".*") + "\n" for line in shown)
    return re.sub(r"(?:\\ ){2,}", "  +", "".join(lines))


def test_all_commands_work_in_the_order_of_the_page_and_print_what_it_shows(tmp_path):
    paths = f"{sysconfig.get_path('scripts')}{os.pathsep}{os.environ['PATH']}"
    settings = {"PATH": paths, "XDG_CONFIG_HOME": str(tmp_path / "config"), "NO_COLOR": "1"}
    kept = {name: value for name, value in os.environ.items() if not name.startswith("RT_")}
    # What the page does not show: that something is compiled, for the first time on this machine.
    for words in ("new thin_lens compiled.yaml", "render compiled.yaml -q --scale 1% --spp 1"):
        subprocess.run(["rt", *words.split()], cwd=tmp_path, env=kept | settings, check=True, capture_output=True)
    ran = 0
    for command, shown in commands():
        done = subprocess.run(
            ["bash", "-c", f"{{ {command}; }} 2>&1"],
            cwd=tmp_path,
            env=kept | settings,
            capture_output=True,
            text=True,
            check=False,
        )
        assert re.fullmatch(pattern(shown.splitlines()), done.stdout), (command, done.stdout)
        assert done.returncode == (2 if shown.startswith("rt: ") and "there already, and stays" not in shown else 0)
        ran += 1
    assert ran > 20
