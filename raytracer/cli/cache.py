"""`rt cache`: shows what the cache of compiled kernels holds, and clears it."""

import sys
from typing import Annotated

from typer import Option

from raytracer.cli.base import options
from raytracer.cli.base.outputs import print_json
from raytracer.util.errors import OutputError

EXAMPLE = """\b
Example:
  rt cache
  rt cache --json
  rt cache --clear
"""


def cache(
    clear: Annotated[bool, Option("--clear", help="Remove all kernels; the next renders compile anew.")] = False,
    as_json: options.AsJson = False,
) -> None:
    """Show where compiled kernels are kept, how many there are, and how large, or remove them.

    RAYTRACER_CACHE_DIR names another folder.
    """
    from datetime import datetime

    from raytracer.core.compiler.cache import cache_contents, clear_cache

    held = cache_contents()
    if clear:
        left = clear_cache()
        if left.kernels or left.parts:
            raise OutputError(f"{left.folder}: {left.kernels} kernels and {left.parts} parts cannot be removed")
        size = f"{held.bytes / 1e6:.1f} MB"
        print(f"{held.folder}: removed {held.kernels} kernels and {held.parts} parts, {size}", file=sys.stderr)
        held = left
    if as_json:
        print_json({**held._asdict(), "folder": str(held.folder)})
    elif not clear:
        oldest = "-" if held.oldest is None else f"{datetime.fromtimestamp(held.oldest):%Y-%m-%d %H:%M}"
        print(f"folder   {held.folder}\nkernels  {held.kernels}\nparts    {held.parts}")
        print(f"size     {held.bytes / 1e6:.1f} MB\noldest   {oldest}")
