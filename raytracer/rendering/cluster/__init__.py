"""Renders on other machines, by Dask's scheduler and workers (docs/cluster.md).

Dask brings tasks to workers, and back what comes of them; it moves files from worker to worker, notices who has died
and who is new.  What is added here is what a worker must be asked before it may take part, and what a task is.
"""

import importlib
from typing import TYPE_CHECKING, Any

__all__ = ["Cluster"]

if TYPE_CHECKING:
    from raytracer.cluster.connection import Cluster


def __getattr__(name: str) -> Any:
    """Import what is asked for only then: Dask's scheduler wants but the names of what workers do."""
    if name != "Cluster":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return importlib.import_module("raytracer.cluster.connection").Cluster
