"""Show how much machine code scenes need, or whether it is that of another revision.

    python bench/kernels.py --sizes cover glass
    python bench/kernels.py --against HEAD~1 cover glass

A scene pays for what it names, so what is added for other scenes must leave its kernel as it was. Each scene is
compiled by the sources as they are and by those of the revision, in processes and with kernel caches of their own, and
the instructions of the two kernels are counted by what they do. Where things are in memory is left out: an effect that
a scene does not have still has a place in it. So is what Numba puts round a kernel for calls by Python, once a tile.
Prints Markdown; exits with 1 if a kernel has changed.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

from warm import ROOT, SCENES, Failed, say, table

DEFAULT_SCENES = ("cover", "cornell", "glass", "textures", "studio")

# A line of assembly that begins a function, with its name; and one that is an instruction, with what it does.
_LABEL = re.compile(r'^"?([_A-Za-z][^:"]*)"?:')
_INSTRUCTION = re.compile(r"^\s+([a-z]\w*)(?:\s|$)")

# The compiler's name of the kernel, `render_tile`, in whatever module of the package it is.
_KERNEL = re.compile(r"_ZN9raytracer(?:\d+[a-z_]+?)+11render_tile|(?:call\.)?part\.render_tile\.")


def instructions(scene: Path) -> Counter[str]:
    """Count the instructions of a scene's kernel, as the sources that this process imports compile it."""
    from raytracer.scene.load import load

    try:
        from raytracer.kernel.path_tracer import render_tile
        from raytracer.rendering.compilation import compile_scene
    except ImportError:
        # Older revisions have these under other names.
        from raytracer.kernel.path_tracer import render_tile
        from raytracer.rendering.cluster.worker import prepare as compile_scene

    return counted_in(_assembly(lambda: compile_scene(load(scene)), render_tile))


def counted_in(code: str) -> Counter[str]:
    """Count the instructions of the kernel in its assembly."""
    counts: Counter[str] = Counter()
    inside = False
    for line in code.splitlines():
        if label := _LABEL.match(line):
            inside = _KERNEL.match(label[1]) is not None
        elif inside and (instruction := _INSTRUCTION.match(line)):
            counts[instruction[1]] += 1
    return counts


def _assembly(compile_it: Callable[[], object], kernel: Any) -> str:
    """Return the assembly of a kernel that `compile_it` compiles."""
    try:
        from raytracer.core.compiler import build_entry
    except ImportError:
        # Older revisions leave this to Numba.
        compile_it()
        (code,) = kernel.inspect_asm().values()
        return str(code)
    linked, link = [], build_entry.link_entry

    def link_and_keep(*arguments: Any) -> Any:
        linked.append(link(*arguments))
        return linked[-1]

    vars(build_entry).update(link_entry=link_and_keep)
    compile_it()
    return str(build_entry._target_machine().emit_assembly(linked[-1]))


def counted(tree: Path, scene: Path) -> Counter[str]:
    """Count them as the sources of a tree compile them, in a process of its own.

    Raises
    ------
    Failed : it did not exit with 0.
    """
    with tempfile.TemporaryDirectory() as cache:
        environment = {**os.environ, "PYTHONPATH": f"{tree}", "RAYTRACER_CACHE_DIR": cache}
        done = subprocess.run(
            [sys.executable, __file__, "--count", str(scene)],
            capture_output=True,
            text=True,
            check=False,
            env=environment,
            cwd=tree,
        )
    if done.returncode:
        raise Failed((done.stderr.strip().splitlines() or [f"exit status {done.returncode}"])[-1])
    return Counter(json.loads(done.stdout))


def exported(revision: str, folder: Path) -> Path:
    """Export the tree of a revision into a folder, with the generated files of this one."""
    archive = subprocess.run(["git", "-C", str(ROOT), "archive", revision], capture_output=True, check=True)
    subprocess.run(["tar", "-x", "-C", str(folder)], input=archive.stdout, check=True)
    generated = folder / "scenes" / "generated"
    if not generated.exists() and (SCENES / "generated").exists():
        generated.symlink_to(SCENES / "generated", target_is_directory=True)
    return folder


def compare(scene: str, before: Path) -> list[str]:
    """Make the row of a scene: its instructions by the sources of `before`, by ours, and how many differ."""
    say(scene)
    old = counted(before, before / "scenes" / f"{scene}.yaml")
    new = counted(ROOT, SCENES / f"{scene}.yaml")
    moved = sum(((old - new) + (new - old)).values())
    return [scene, str(old.total()), str(new.total()), str(moved), "the same" if moved == 0 else "changed"]


def size(scene: str) -> list[str]:
    """Make the row of a scene: its name and the instructions of its kernel."""
    say(scene)
    return [scene, f"{counted(ROOT, SCENES / f'{scene}.yaml').total():,}"]


def main() -> None:
    """Compile, count, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=DEFAULT_SCENES, help=f"default: {' '.join(DEFAULT_SCENES)}")
    parser.add_argument("--against", default="HEAD", metavar="REVISION", help="default: HEAD")
    parser.add_argument("--sizes", action="store_true", help="count the instructions, and compare with nothing")
    parser.add_argument("--count", type=Path, metavar="SCENE", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.count is not None:
        print(json.dumps(instructions(arguments.count)))
        return
    if arguments.sizes:
        print(table(("scene", "instructions"), map(size, arguments.scenes)))
        return
    with tempfile.TemporaryDirectory() as folder:
        before = exported(arguments.against, Path(folder))
        rows = [compare(scene, before) for scene in arguments.scenes]
    print(table(("scene", f"instructions at {arguments.against}", "now", "in one of them alone", ""), rows))
    sys.exit(any(row[-1] != "the same" for row in rows))


if __name__ == "__main__":
    main()
