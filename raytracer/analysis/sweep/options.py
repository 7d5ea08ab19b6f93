"""The options of a sweep: those of each point's render, and its own."""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from typing import Any

from raytracer.analysis.sweep.animation import FPS
from raytracer.analysis.sweep.points import MAX_POINTS
from raytracer.analysis.sweep.results import PointResult
from raytracer.rendering.options import RenderOptions
from raytracer.rendering.worker_pool import ClusterClient
from raytracer.scene.cache import RenderCache
from raytracer.scene.spec import SceneSpec
from raytracer.util.path_sandbox import AllowFiles
from raytracer.util.progress import BatchProgress


@dataclass(frozen=True)
class SweepOptions(RenderOptions):
    """Options of `run.sweep`; see there."""

    scene: SceneSpec | str | os.PathLike[str]
    values: Mapping[str, Any] | None = None
    _: KW_ONLY
    folder: str | os.PathLike[str] | None = None
    allow_files: AllowFiles = ()
    zipped: bool = False
    preview: bool = False
    formats: Sequence[str] = ("png",)
    animate: Sequence[str] = ()
    fps: float = FPS
    max_points: int = MAX_POINTS
    cluster: ClusterClient | None = None
    cache: RenderCache | None = None
    stock: RenderCache | None = None
    progress: Callable[[BatchProgress], object] | bool | None = None
    report: Callable[[PointResult], object] | None = None
    warn: Callable[[str], object] | None = None
