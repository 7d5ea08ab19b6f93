"""The state of a running render, as its checkpoints hold it."""

from collections.abc import Callable, Mapping
from typing import Any

from numpy.typing import NDArray

from raytracer.core.embree import PACKET
from raytracer.film.image import Image
from raytracer.rendering.adaptive_sampling import AdaptiveRender, AdaptiveState, Outcome
from raytracer.rendering.checkpoint_identity import render_identity
from raytracer.rendering.prepared_scene import PreparedScene
from raytracer.rendering.statistics import PhaseTimer
from raytracer.rendering.tile_scheduler import TileQueue
from raytracer.rendering.worker_pool import WorkerPool
from raytracer.scene.files import file_stamps
from raytracer.util.errors import InputError


class ResumableState:
    """The state of a running render: a `checkpoint.RenderState`.

    Attributes
    ----------
    adaptive : the adaptive sampling, once it has begun; None without it.
    adaptive_state : the state from which adaptive sampling is to go on; None to begin anew.
    resumed : `Stats.resumed`, what the checkpoint had.
    """

    def __init__(
        self, prepared: PreparedScene, queue: TileQueue, timer: PhaseTimer, preview: Callable[[Outcome], Image]
    ) -> None:
        """Observe a queue and a timer; `preview` makes the picture so far."""
        self._options, self._spec = prepared.options, prepared.packed.spec
        self._sampler, self._stamps = prepared.scene.sampler, prepared.stamps
        self._queue, self._timer, self._preview = queue, timer, preview
        self.adaptive: AdaptiveRender | None = None
        self.adaptive_state: AdaptiveState | None = None
        self.resumed: dict[str, float] = {}

    @property
    def pool(self) -> WorkerPool:
        return self._queue.pool

    @property
    def goal(self) -> int:
        """Return the wanted samples a pixel that a checkpoint can hold: whole packets."""
        spp = self._spec.render.spp
        return spp - spp % PACKET

    @property
    def samples(self) -> int:
        return int(self._queue.counts.min())

    @property
    def is_empty(self) -> bool:
        # A packet that is not whole is only ever added after the last checkpoint, but for those of fewer samples.
        return (not self._options.is_adaptive and self.goal == 0) or self._queue.done == 0

    @property
    def is_complete(self) -> bool:
        # Out of time, it has all that was asked for.
        return not self.pool.is_stopped or (not self._options.is_adaptive and self.samples >= self.goal)

    @property
    def seconds(self) -> float:
        return self._timer.seconds("render") + self.resumed.get("seconds", 0.0)

    @property
    def outcome(self) -> Outcome:
        """Return the outcome of the samples so far."""
        if self.adaptive is not None:
            return self.adaptive.outcome
        reached = bool(self._queue.counts.min() >= self._spec.render.spp)
        return Outcome(reached=reached, pilot_samples=0, pilot_rays=0)

    def identity(self) -> Mapping[str, Any]:
        options, spec = self._options, self._spec
        # Samplers that spread all samples of a pixel evenly depend on how many they are.
        sampler = self._sampler._asdict()
        rounds = {"noise": options.noise, "spp": options.max_spp} if options.is_adaptive else {}
        identity = render_identity(
            spec,
            {
                "pixels": list(options.window),
                "aovs": dict.fromkeys(sorted(options.aovs), True),
                "denoise": options.denoise,
                "adaptive": options.is_adaptive,
                f"{spec.render.sampler} sampler": sampler,
                **rounds,
            },
        )
        changed = [path for path, stamp in file_stamps(spec).items() if self._stamps.get(path) != stamp]
        if changed:
            raise InputError(f"{changed[0]}: has changed since it was read")
        return identity

    def state_arrays(self) -> Mapping[str, NDArray[Any]]:
        if not self._options.is_adaptive:
            return self._queue.state_arrays()
        state = self.adaptive_state if self.adaptive is None else self.adaptive.adaptive_state
        rounds = (state or AdaptiveState.initial(len(self._queue.windows))).state_arrays()
        return {**self._queue.state_arrays(), **{f"rounds/{name}": array for name, array in rounds.items()}}

    def metadata(self) -> Mapping[str, Any]:
        return {"seconds": self.seconds}

    def restore(self, arrays: Mapping[str, NDArray[Any]], metadata: Mapping[str, Any]) -> None:
        queue, options, spp = self._queue, self._options, self._spec.render.spp
        most = int(queue.counts.max())
        if not options.is_adaptive and most > spp:
            raise InputError(f"has up to {most} samples per pixel already, more than the {spp} wanted")
        if options.is_adaptive:
            rounds = {name: arrays[f"rounds/{name}"] for name in AdaptiveState.initial(0).state_arrays()}
            self.adaptive_state = AdaptiveState.from_arrays(rounds)
        self.resumed = {
            "samples": queue.done,
            "rays": int(queue.rays.sum()),
            "seconds": float(metadata["seconds"]),
        }

    def picture(self) -> Image:
        return self._preview(self.outcome)
