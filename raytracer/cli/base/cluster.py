"""The option `--cluster` of several commands: a Dask scheduler whose workers render."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from raytracer.rendering.cluster.connection import Cluster


def _print(sentence: str) -> None:
    print(sentence, file=sys.stderr)


@contextmanager
def connect_cluster(address: str | None, say: Callable[[str], object] = _print) -> "Iterator[Cluster | None]":
    """Connect to the cluster at an address for the time of a `with` block; None stands for this machine.

    Parameters
    ----------
    say : shows a line about workers that come and go.
    """
    if address is None:
        yield None
        return
    from raytracer.rendering.cluster.connection import Cluster

    with Cluster(address, say=lambda sentence: say(f"rt: {sentence}")) as cluster:
        yield cluster
