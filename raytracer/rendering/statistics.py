"""Statistics of a render: its time, rays, samples and error, what is wrong with its picture, and its files' headers."""

import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import psutil

from raytracer import __version__
from raytracer.core.error_estimate.halves import ErrorEstimate
from raytracer.rendering.adaptive_sampling import Outcome
from raytracer.rendering.tile_scheduler import TileQueue, now
from raytracer.scene.spec import SceneSpec


@dataclass
class Stats:
    """Statistics of a render, as `--stats` writes them.

    seconds (s) : time by phase.
    rays : camera, bounce and shadow rays.
    samples : over all pixels.
    spp : the fewest, mean and most samples of a pixel.
    pilot_samples : samples besides, which were thrown away.
    resumed : the `samples` and `rays` of these that a checkpoint had, and the `seconds` that they took; empty without.
    nan_samples : samples dropped because they were not finite.
    first_nan : `pixel` (x, y) and `sample` of the first of them, row by row, or None.
    fireflies : `pixels` that one sample has made far brighter than those around; `light`, their part of the picture's
        light; `brightest` (x, y); the `sample` that made it so; `clamp`, a limit for radiance that would remove them,
        or None; empty without any.
    negative_pixels : pixels of the finished picture with a channel below zero.
    negative : the `lowest` value of any, its `pixel` (x, y), and the `causes` that the scene has for them
        (film/negative_pixels.py); empty without any.
    clamp : its `limit`, and the parts of the `light` that it took and of the `samples` that it did so from; empty
        without a clamp.
    error : `relative` (RMS, of the light that reached the film, before it was denoised); `low` and `high`, the ends of
        its 95 % interval; the local `exponent` of its square over samples; `target`, if one was given; empty below 16
        samples a pixel.
    threads : those of a cluster's workers included.
    workers : addresses of a cluster's workers; empty without a cluster.
    effects : names of the camera effects that are simulated.
    exposure : its numbers by name; empty for a picture of plain radiance.
    peak_rss_bytes (bytes) : of the process.
    version : of rt.
    """

    seconds: dict[str, float] = field(default_factory=dict)
    rays: int = 0
    samples: int = 0
    spp: dict[str, float] = field(default_factory=dict)
    pilot_samples: int = 0
    resumed: dict[str, float] = field(default_factory=dict)
    nan_samples: int = 0
    first_nan: dict[str, Any] | None = None
    fireflies: dict[str, Any] = field(default_factory=dict)
    negative_pixels: int = 0
    negative: dict[str, Any] = field(default_factory=dict)
    clamp: dict[str, float] = field(default_factory=dict)
    error: dict[str, float] = field(default_factory=dict)
    threads: int = 0
    workers: list[str] = field(default_factory=list)
    effects: list[str] = field(default_factory=list)
    exposure: dict[str, float] = field(default_factory=dict)
    peak_rss_bytes: int = 0
    version: str = __version__

    def json(self) -> dict[str, Any]:
        """Return the statistics as `--stats` writes them."""
        return dict(vars(self))

    def record_samples(self, queue: TileQueue, outcome: Outcome) -> None:
        """Note how many samples were taken, of which pixels, and by whom."""
        self.rays = int(queue.rays.sum()) + outcome.pilot_rays
        self.samples, self.pilot_samples = queue.done, outcome.pilot_samples
        self.threads = queue.threads
        self.workers = [] if queue.remote is None else list(queue.remote.workers)
        self.spp = {"fewest": int(queue.counts.min()), "mean": queue.samples, "most": int(queue.counts.max())}

    def record_error(self, estimate: ErrorEstimate | None, target: float | None) -> None:
        """Note the error of the picture, as far as it is known, and the one that was asked for."""
        if estimate is None:
            return
        self.error = {
            "relative": estimate.error,
            "low": estimate.low,
            "high": estimate.high,
            "exponent": estimate.exponent,
        }
        if target is not None:
            self.error["target"] = target


def peak_rss_bytes() -> int:
    """Return the largest resident memory that this process has had.

    Linux's getrusage begins with the memory of the process that started this one (exec_mmap in its fs/exec.c), so that
    a render that a large program starts would seem as large.
    """
    if sys.platform == "win32":
        return int(psutil.Process().memory_info().peak_wset)
    if sys.platform == "darwin":
        import resource

        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    status = Path("/proc/self/status").read_text(encoding="ascii", errors="replace")
    return 1024 * int(status.partition("VmHWM:")[2].split()[0])


class PhaseTimer:
    """A clock that adds up seconds by phase.

    start_time (s) : by `tile_scheduler.now`, when the command would have begun, had it not paused between phases.
    """

    def __init__(self, seconds: dict[str, float]) -> None:
        """Start a clock that adds to the seconds of the phases so far."""
        self._seconds = seconds
        self._start = now()
        self.start_time = self._start - sum(seconds.values())

    def resume(self) -> None:
        """Leave out the time since the last lap: it is no phase's."""
        self._start = now()

    def seconds(self, phase: str) -> float:
        """Return the seconds of a phase that is under way or has been."""
        return self._seconds.get(phase, 0.0) + now() - self._start

    def lap(self, phase: str) -> None:
        """Count the time since the last lap as this phase's."""
        end = now()
        self._seconds[phase] = self._seconds.get(phase, 0.0) + end - self._start
        self._start = end


def image_header(
    spec: SceneSpec, crop: tuple[int, int, int, int] | None, stats: Stats, *, is_adaptive: bool
) -> Mapping[str, str | float | int]:
    """Return the settings of a render and the error of its picture, by name."""
    settings = spec.render
    header: dict[str, str | float | int] = {
        "renderer": f"rt {__version__}",
        "spp": stats.spp["mean"] if is_adaptive else settings.spp,
        "max_depth": settings.max_depth,
        "sampler": settings.sampler,
        "accuracy": settings.accuracy,
        "seed": settings.seed,
        "filter": spec.film.filter.type,
        "camera": spec.camera.type,
    }
    if is_adaptive:
        header |= {"spp_fewest": stats.spp["fewest"], "spp_most": stats.spp["most"]}
    if stats.error:
        names = {"relative": "relative_error", "low": "relative_error_low", "high": "relative_error_high"}
        header |= {name: stats.error[key] for key, name in names.items()}
    if "target" in stats.error:
        header["noise"] = stats.error["target"]
    if stats.clamp:
        header |= {"clamp": stats.clamp["limit"], "clamp_took": stats.clamp["light"]}
    if crop is not None:
        header["crop"] = ",".join(map(str, crop))
    return header
