"""Checkpoints: what a render has gathered, in a file beside its picture, from which it goes on to the same bits.

A render's state is its film, sample by sample in order; what is known of its error; and, where samples go where they
are needed, what the rounds have settled.  It is copied while no thread is at work, once in a while, and written while
all go on.  Samples come in packets, and adding a packet is not associative, so that a checkpoint holds whole packets
alone: from a picture of 100 samples a pixel one goes on from 96.
"""

import json
import math
import os
import queue
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from numpy.typing import NDArray

from raytracer import __version__, snapshots
from raytracer.errors import InputError, OutputError, shown
from raytracer.film.image import Image
from raytracer.jit import processor
from raytracer.scene.inputs import contents, described, libraries, program
from raytracer.scene.spec import SceneSpec
from raytracer.scheduling import Crew, now
from raytracer.snapshots import DamagedError, Snapshot

SUFFIX = ".checkpoint"

EVERY = 60.0
"""Seconds between two checkpoints, unless told otherwise."""

_FORMAT = 1

_NO_MEMORY = "out of memory"

# What a checkpoint says of what decides on the bits of a picture, in the order in which differences are looked for.
_DIFFERENCES = {
    "version": "another version of rt",
    "libraries": "other libraries",
    "processor": "another kind of processor",
    "program": "another state of rt's sources",
    "scene": "another scene",
    "files": "other files",
    "settings": "other settings",
}


def checkpoint_of(output: Path) -> Path:
    """Where the checkpoint of a picture lies: beside its file."""
    return output.with_name(output.name + SUFFIX)


class RefusedError(InputError):
    """A checkpoint that a render does not go on from: `sentence` says which, and why."""

    def __init__(self, sentence: str) -> None:
        self.sentence = sentence
        super().__init__(f"{sentence}; without --resume the render begins anew")


class Held(NamedTuple):
    """What a checkpoint holds: its file, the fewest samples that a pixel has there, and the file's size in bytes."""

    path: Path
    samples: int
    bytes: int


class Gathering(Protocol):
    """A render under way, as its checkpoints see it."""

    @property
    def crew(self) -> Crew:
        """Who works on it."""

    @property
    def samples(self) -> int:
        """The fewest that a pixel has by now."""

    @property
    def is_empty(self) -> bool:
        """Whether there are no samples yet that a checkpoint of it can hold."""

    @property
    def is_complete(self) -> bool:
        """Whether it came to its own end, or has all samples that a checkpoint of it can hold."""

    @property
    def seconds(self) -> float:
        """How long it took so far, with what it has gone on from."""

    def identity(self) -> Mapping[str, Any]:
        """All that decides on the bits of the picture, but for how many samples it gets: plain values."""

    def gathered(self) -> Mapping[str, NDArray[Any]]:
        """All arrays that the render goes on from, by name, as they are now."""

    def told(self) -> Mapping[str, Any]:
        """What else there is to know of it: plain values."""

    def take_up(self, gathered: Mapping[str, NDArray[Any]], told: Mapping[str, Any]) -> None:
        """Go on from what was gathered: the arrays of `gathered`, filled with what another render had.

        Raises
        ------
        InputError : that is more than is wanted.
        """

    def picture(self) -> Image:
        """The picture so far; while nobody works on it."""


class Keeper:
    """Keeps what a render gathers in a file, from time to time and at its end, and takes up from there.

    It is for one render at a time.

    Parameters
    ----------
    path : the file of the checkpoint; the one before it is kept beside it while the render goes on.  None to keep
        nothing, and only show.
    every : seconds between two.
    resume : whether to go on from what is there.
    always : whether to keep what was gathered by a render that has ended before `every` seconds, too.
    say : told, a sentence each, that a checkpoint cannot be written, that it can again, or was found damaged.
    show : what is done with the picture so far when that is asked for.

    Attributes
    ----------
    held : what the file holds; None if this render has written none.
    resumed : samples that every pixel had already; 0 if the render began anew.
    """

    def __init__(
        self,
        path: str | os.PathLike[str] | None,
        *,
        every: float = EVERY,
        resume: bool = False,
        always: bool = False,
        say: Callable[[str], object] = lambda sentence: None,
        show: Callable[[Image], object] | None = None,
    ) -> None:
        if not 0.0 < every < math.inf:
            raise InputError(f"the time between checkpoints must be greater than 0 and finite, got {every:g}")
        self.path = None if path is None else Path(path)
        self.held: Held | None = None
        self.resumed = 0
        self._every, self._resume, self._always = every, resume, always
        self._say, self._show = say, show
        # Reentrant, as a signal's handler needs it.
        self._wishes: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._identity: Mapping[str, Any] | None = None
        self._begun = self._failing = self._is_good = False

    def ask(self) -> None:
        """Have the picture so far shown, soon."""
        self._wishes.put("show")

    def anew(self) -> "Keeper":
        """The same keeper, with nothing to go on from: what there was is removed."""
        self.forget()
        self._resume = False
        return self

    def forget(self) -> None:
        """Remove the checkpoint."""
        if self.path is not None:
            snapshots.forget(self.path)
        self.held = None

    # ---- At the beginning

    def resume(self, render: Gathering) -> None:
        """Have a render that has gathered nothing go on from the checkpoint, if that was asked for.

        Raises
        ------
        InputError : it is of another picture (`RefusedError`), is damaged, as is the one before it (the same), or
            cannot be read.
        """
        self._identity = None
        self.held, self.resumed = None, 0
        self._begun = self._failing = self._is_good = False
        if not self._resume or self.path is None:
            return
        damage: list[str] = []
        for path in (self.path, snapshots.previous_of(self.path)):
            try:
                self._take_up(path, render)
            except FileNotFoundError:
                continue
            except DamagedError as error:
                damage.append(f"{path}: is damaged: {error}")
                continue
            except OSError as error:
                raise InputError(f"{path}: cannot be read: {error.strerror or error}") from error
            for sentence in damage:
                self._say(f"{sentence}; {path.name} is used in its place")
            # Only what can be gone on from may take the place of the one before.
            self._begun, self._is_good = True, path == self.path
            self.resumed = render.samples
            self.held = Held(path, render.samples, path.stat().st_size)
            return
        if damage:
            raise RefusedError(f"{damage[0]}; there is no other to go on from")
        self._say(f"there is no {self.path} to go on from: the render begins anew")

    def _take_up(self, path: Path, render: Gathering) -> None:
        arrays = render.gathered()

        def accept(about: Mapping[str, Any]) -> Mapping[str, NDArray[Any]]:
            if about.get("format") != _FORMAT:
                raise RefusedError(f"{path}: is of another version of rt")
            told, identity = about.get("told"), about.get("identity")
            if not isinstance(told, dict) or not isinstance(identity, dict) or not _is_number(told.get("seconds")):
                raise DamagedError("does not say what it is of")
            self._check(path, identity, render)
            return arrays

        about = snapshots.read(path, accept)
        try:
            render.take_up(arrays, about["told"])
        except InputError as error:
            raise RefusedError(f"{path}: {error}") from None

    def _check(self, path: Path, then: Mapping[str, Any], render: Gathering) -> None:
        """Make sure that the picture of a checkpoint is the one of a render.

        Raises
        ------
        RefusedError : it is another.
        """
        current = json.loads(json.dumps(self._identity_of(render)))
        for section, name in _DIFFERENCES.items():
            what = _difference(then.get(section), current[section], "")
            if what is not None:
                raise RefusedError(f"{path}: is of {name}: {what}")

    def _identity_of(self, render: Gathering) -> Mapping[str, Any]:
        if self._identity is None:
            self._identity = render.identity()
        return self._identity

    # ---- While it is rendered

    @contextmanager
    def watching(self, render: Gathering) -> Iterator[None]:
        """Write checkpoints while the `with` block renders.

        Raises
        ------
        Exception : what `say` or `show` have raised, at the end: checkpoints are written all the same.
        """
        failures: list[Exception] = []
        watcher = threading.Thread(target=self._watch, args=(render, failures), name="keeper", daemon=True)
        try:
            watcher.start()
            yield
        finally:
            self._wishes.put("end")
            if watcher.ident is not None:
                watcher.join()
        if failures:
            raise failures[0]

    def _watch(self, render: Gathering, failures: list[Exception]) -> None:
        due = now() + self._every
        while True:
            try:
                wish = self._wishes.get(timeout=min(max(0.0, due - now()), threading.TIMEOUT_MAX))
            except queue.Empty:
                wish = "keep"
            if wish == "end":
                return
            start = now()
            try:
                if wish == "show":
                    self._show_picture(render)
                else:
                    self._write(render, by_copy=True)
            except Exception as error:  # noqa: BLE001
                # Raised where this thread is waited for: the samples of hours do not depend on it.
                failures.append(error)
            if wish == "keep":
                # However often they are asked for, the render has as much time as its checkpoints.
                due = now() + max(self._every, now() - start)

    def _show_picture(self, render: Gathering) -> None:
        if self._show is None:
            return
        try:
            with render.crew.resting():
                image = render.picture()
            self._show(image)
        except (OutputError, MemoryError) as error:
            self._say(f"{str(error) or _NO_MEMORY}; the render goes on")

    # ---- At the end

    def finish(self, render: Gathering) -> None:
        """Keep what a render that has ended has gathered: all of it, or as far as it came."""
        if render.is_complete and not (self._always or self._begun or render.seconds >= self._every):
            return
        if self._write(render, by_copy=False) and render.is_complete and self.path is not None:
            snapshots.forget_previous(self.path)

    def _write(self, render: Gathering, *, by_copy: bool) -> bool:
        """Write a checkpoint; whether that went well.

        by_copy : whether the render goes on meanwhile.
        """
        if self.path is None:
            return False
        try:
            with render.crew.resting():
                if render.is_empty:
                    return False
                samples, told = render.samples, dict(render.told())
                arrays = render.gathered()
                if by_copy:
                    arrays = {name: array.copy() for name, array in arrays.items()}
            about = {"format": _FORMAT, "identity": self._identity_of(render), "told": told}
            size = snapshots.write(self.path, Snapshot(about, arrays), keep=self._is_good)
        except (OutputError, InputError, MemoryError) as error:
            if not self._failing:
                self._failing = True
                reason = str(error) or _NO_MEMORY
                self._say(f"{reason}; the render goes on in memory, and tries to keep its samples again")
            return False
        if not self._begun:
            snapshots.forget_previous(self.path)
        was_failing = self._failing
        self._begun, self._is_good, self._failing = True, True, False
        self.held = Held(self.path, samples, size)
        if was_failing:
            self._say(f"{self.path}: is written again")
        return True


def identity_of(spec: SceneSpec, settings: Mapping[str, Any]) -> Mapping[str, Any]:
    """All that decides on the bits of a picture: plain values, by the names of sections.

    Parameters
    ----------
    settings : what the picture depends on besides its scene.

    Raises
    ------
    InputError : a file of the scene cannot be read.
    """
    return {
        "version": __version__,
        "libraries": libraries(),
        "processor": _processor(),
        "program": program(),
        "scene": described(spec),
        "files": contents(spec),
        "settings": dict(settings),
    }


def _processor() -> dict[str, Any]:
    """What kernels are compiled for, by its parts."""
    platform, name, features = processor().split(" ", 2)
    return {"platform": platform, "name": name, "features": dict.fromkeys(features.split(","), True)}


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _difference(then: Any, current: Any, place: str) -> str | None:
    """Where two plain values differ first, and in what; None if they are alike."""
    if isinstance(then, Mapping) and isinstance(current, Mapping):
        for key in [*then, *(key for key in current if key not in then)]:
            found = _difference(then.get(key), current.get(key), f"{place}.{key}" if place else str(key))
            if found is not None:
                return found
        return None
    if isinstance(then, list) and isinstance(current, list) and len(then) == len(current):
        pairs = enumerate(zip(then, current, strict=True))
        return next((found for i, pair in pairs if (found := _difference(*pair, f"{place}[{i}]"))), None)
    if then == current:
        return None
    before, after = ("not given" if value is None else shown(value) for value in (then, current))
    return f"{place} was {before} and is {after}".lstrip()
