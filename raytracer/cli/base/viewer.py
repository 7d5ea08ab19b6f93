"""The viewer of `--tev`, in which a picture is seen while it is rendered."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from raytracer.cli.base.options import parse_value

if TYPE_CHECKING:
    from raytracer.rendering.tev.viewer import Address, TevViewer


def parse_viewer(text: str | None) -> "Address | None":
    """Parse the address that `--tev` gives; None without one."""
    if text is None:
        return None
    from raytracer.rendering.tev.viewer import parse_address

    return parse_value("--tev", text, parse_address)


@contextmanager
def connect_viewer(
    address: "Address | None", output: Path, warn: Callable[[str], object]
) -> "Iterator[TevViewer | None]":
    """Show the picture that a file will hold in a viewer, for the time of a `with` block; None stands for no viewer.

    warn : called with a sentence if the viewer does not take it.
    """
    if address is None:
        yield None
        return
    from raytracer.rendering.tev.viewer import TevViewer

    with TevViewer(address, str(output), warn) as viewer:
        yield viewer
