"""Rendering on other machines, by Dask's scheduler and workers (docs/cluster.md).

Dask brings jobs to workers and returns their results; it moves files from worker to worker, and notices workers that
have died or are new.  Added here are the check that a worker renders the same picture, and the jobs.
"""

import importlib
from typing import TYPE_CHECKING, Any

__all__ = ["Cluster"]

if TYPE_CHECKING:
    from raytracer.rendering.cluster.connection import Cluster


def __getattr__(name: str) -> Any:
    """Import `Cluster` only when it is asked for: Dask's scheduler needs only the names of the workers' functions."""
    if name != "Cluster":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return importlib.import_module("raytracer.rendering.cluster.connection").Cluster
