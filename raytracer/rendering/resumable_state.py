"""The state of a running render, as checkpoints hold it, and its identity: all that decides on the picture's bits."""

import json
from collections.abc import Callable, Mapping
from typing import Any

from numpy.typing import NDArray

from raytracer import __version__
from raytracer.core.compiler.cache import processor
from raytracer.core.embree import PACKET
from raytracer.film.image import Image
from raytracer.rendering.adaptive_sampling import AdaptiveRender, AdaptiveState, Outcome
from raytracer.rendering.compilation import PreparedScene
from raytracer.rendering.statistics import PhaseTimer
from raytracer.rendering.tile_scheduler import TileQueue
from raytracer.rendering.worker_pool import WorkerPool
from raytracer.scene.digest import file_hashes, libraries, picture_values, program_hash
from raytracer.scene.files import file_stamps
from raytracer.scene.spec import SceneSpec
from raytracer.util.errors import InputError, format_value


class ResumableState:
    """The state of a running render, from which another one goes on.

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
        """Return the threads that render."""
        return self._queue.pool

    @property
    def goal(self) -> int:
        """Return the wanted samples a pixel that a checkpoint can hold: whole packets."""
        spp = self._spec.render.spp
        return spp - spp % PACKET

    @property
    def samples(self) -> int:
        """Return the fewest samples that a pixel has so far."""
        return int(self._queue.counts.min())

    @property
    def is_empty(self) -> bool:
        """Tell if there are no samples yet that a checkpoint can hold."""
        # A packet that is not whole is only ever added after the last checkpoint, but for those of fewer samples.
        return (not self._options.is_adaptive and self.goal == 0) or self._queue.done == 0

    @property
    def is_complete(self) -> bool:
        """Tell if the render has come to its own end, or has all samples that a checkpoint can hold."""
        # Out of time, it has all that was asked for.
        return not self.pool.is_stopped or (not self._options.is_adaptive and self.samples >= self.goal)

    @property
    def seconds(self) -> float:
        """Return the seconds that it took so far, those before the checkpoint that it was resumed from included."""
        return self._timer.seconds("render") + self.resumed.get("seconds", 0.0)

    @property
    def outcome(self) -> Outcome:
        """Return the outcome of the samples so far."""
        if self.adaptive is not None:
            return self.adaptive.outcome
        reached = bool(self._queue.counts.min() >= self._spec.render.spp)
        return Outcome(reached=reached, pilot_samples=0, pilot_rays=0)

    def identity(self) -> Mapping[str, Any]:
        """Return all that decides on the bits of the picture but the number of samples: plain values."""
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
        """Return all arrays that the render needs to go on, by name, as they are now."""
        if not self._options.is_adaptive:
            return self._queue.state_arrays()
        state = self.adaptive_state if self.adaptive is None else self.adaptive.adaptive_state
        rounds = (state or AdaptiveState.initial(len(self._queue.windows))).state_arrays()
        return {**self._queue.state_arrays(), **{f"rounds/{name}": array for name, array in rounds.items()}}

    def metadata(self) -> Mapping[str, Any]:
        """Return the other values that the render needs to go on, as plain values."""
        return {"seconds": self.seconds}

    def restore(self, arrays: Mapping[str, NDArray[Any]], metadata: Mapping[str, Any]) -> None:
        """Go on from the arrays of `state_arrays`, which were filled with those of another render.

        Raises
        ------
        InputError : it has more samples than are wanted.
        """
        queue, options, spp = self._queue, self._options, self._spec.render.spp
        most = int(queue.counts.max())
        if not options.is_adaptive and most > spp:
            raise InputError(f"has up to {most} samples per pixel already, more than the {spp} wanted")
        if options.is_adaptive:
            rounds = {name: arrays[f"rounds/{name}"] for name in AdaptiveState.initial(0).state_arrays()}
            self.adaptive_state = AdaptiveState.from_arrays(rounds)
        self.resumed = {"samples": queue.done, "rays": int(queue.rays.sum()), "seconds": float(metadata["seconds"])}

    def picture(self) -> Image:
        """Make the picture so far; while no thread renders."""
        return self._preview(self.outcome)


# ---- The identity of a render, to refuse checkpoints of another one

# Sections of an identity, with their names where they differ, in the order in which they are compared.
_SECTIONS = {
    "version": "another version of rt",
    "libraries": "other libraries",
    "processor": "another kind of processor",
    "program": "another state of rt's sources",
    "scene": "another scene",
    "files": "other files",
    "settings": "other settings",
}


def render_identity(spec: SceneSpec, settings: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return all that decides on the bits of a picture: plain values, by the names of sections.

    settings : all that the picture depends on besides its scene.

    Raises
    ------
    InputError : a file of the scene cannot be read.
    """
    platform, name, features = processor().split(" ", 2)
    return {
        "version": __version__,
        "libraries": libraries(),
        "processor": {"platform": platform, "name": name, "features": dict.fromkeys(features.split(","), True)},
        "program": program_hash(),
        "scene": picture_values(spec),
        "files": file_hashes(spec),
        "settings": dict(settings),
    }


def identity_difference(then: Mapping[str, Any], current: Mapping[str, Any]) -> str | None:
    """Describe the first difference of two identities, "another scene: film.width was 4 and is 8"; None without any.

    then : from a checkpoint's JSON.
    """
    current = json.loads(json.dumps(current))
    for section, name in _SECTIONS.items():
        difference = _first_difference(then.get(section), current[section], "")
        if difference is not None:
            return f"{name}: {difference}"
    return None


def _first_difference(then: Any, current: Any, place: str) -> str | None:
    """Describe the first difference of two plain values; None if they are equal."""
    if isinstance(then, Mapping) and isinstance(current, Mapping):
        for key in [*then, *(key for key in current if key not in then)]:
            difference = _first_difference(then.get(key), current.get(key), f"{place}.{key}" if place else str(key))
            if difference is not None:
                return difference
        return None
    if isinstance(then, list) and isinstance(current, list) and len(then) == len(current):
        pairs = enumerate(zip(then, current, strict=True))
        return next((text for i, pair in pairs if (text := _first_difference(*pair, f"{place}[{i}]"))), None)
    if then == current:
        return None
    before, after = ("not given" if value is None else format_value(value) for value in (then, current))
    return f"{place} was {before} and is {after}".lstrip()
