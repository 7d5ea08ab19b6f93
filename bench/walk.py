"""Print the functions that a ray passes in a scene's kernel, by the files that they are in.

    python bench/walk.py cover

Each function is listed once, under the one that calls it first, as the compiler comes to them: from `render_tile` to
the next bounce. What an effect does where it is absent is left out, as it is in the machine code. Whoever wants to
follow a ray reads these files; arithmetic and random numbers (`core/`) are listed only with --all.
"""

from __future__ import annotations

import argparse
import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]


def walk(scene: Path) -> list[tuple[int, str, str]]:
    """Compile a scene's kernel from nothing: depth, file and name of each function in the order of their calls."""
    from raytracer.core.compiler import parts
    from raytracer.rendering.compilation import compile_scene
    from raytracer.scene.load import load

    passed: list[tuple[int, str, str]] = [(0, "kernel/path_tracer.py", "render_tile")]
    depth, lower = 1, parts.lower_part

    def lower_and_list(function: Callable[..., Any], *args: Any, **options: Any) -> Any:
        nonlocal depth
        file = function.__module__.removeprefix("raytracer.").replace(".", "/") + ".py"
        passed.append((depth, file, function.__qualname__))
        depth += 1
        try:
            return lower(function, *args, **options)
        finally:
            depth -= 1

    parts.lower_part = lower_and_list
    compile_scene(load(scene))
    return passed


def main() -> None:
    """Compile and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", nargs="?", default="cover", help="default: cover")
    parser.add_argument("--all", action="store_true", help="list functions of core/ too")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        os.environ["RAYTRACER_CACHE_DIR"] = folder
        passed = walk(ROOT / "scenes" / f"{arguments.scene}.yaml")
    # A switch among kinds is the compiler's, not the reader's.
    shown = [
        step for step in passed if "<locals>" not in step[2] and (arguments.all or not step[1].startswith("core/"))
    ]
    for depth, file, name in shown:
        print(f"{'  ' * depth}{name}  ({file})")
    files = sorted({file for _, file, _ in shown})
    own = sum(file.startswith("kernel/") for file in files)
    print(f"\n{len(shown)} functions in {len(files)} files, {own} of kernel/:")
    print("\n".join(files))


if __name__ == "__main__":
    main()
