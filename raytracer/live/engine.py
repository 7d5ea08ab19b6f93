"""The thread that renders: coarse pictures first, then the full one, until the scene is replaced by another.

The full picture is the one that `rt render` makes, to the bit: the same session takes its samples.
"""

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from time import perf_counter

from raytracer.film.image import Image
from raytracer.live.picture import PictureSource
from raytracer.rendering.options import RenderOptions
from raytracer.rendering.progress import Progress
from raytracer.rendering.render import prepare_scene
from raytracer.rendering.session import Cancelled, RenderSession
from raytracer.scene.cache import RenderCache
from raytracer.scene.spec import SceneSpec
from raytracer.util.errors import InputError, OutputError

STEPS = (8, 4)
"""Pictures of a part of the width and height that come before the full one: an eighth, a quarter."""

PREVIEW_SPP = 8
"""Samples per pixel of these: one packet, so that they take 1 / 64 and 1 / 16 of the full picture's first pass."""


PASS_SECONDS = 0.05
"""Longest pass over a tile, for which the next picture has to wait."""


class Status(StrEnum):
    """The state of a live render."""

    WAITING = "waiting"
    PREPARING = "preparing"
    RENDERING = "rendering"
    PAUSED = "paused"
    DONE = "done"
    FAILED = "failed"


@dataclass(frozen=True)
class EngineState:
    """The state of the engine.

    job : number of the scene that it was given last.
    error : relative error as last estimated, or None.
    warnings : of the scene, sentences.
    errors : why it cannot be rendered, sentences.
    """

    job: int = 0
    status: Status = Status.WAITING
    seconds: float = 0.0
    error: float | None = None
    warnings: tuple[str, ...] = ()
    errors: tuple[str, ...] = ()


class LiveEngine:
    """A thread that renders the scene that it was given last.

    cache : what its renders share: a change of the camera's values packs, builds and compiles nothing else anew.
    """

    def __init__(self, options: RenderOptions, changed: Callable[[], object] = lambda: None) -> None:
        """Make an engine that waits for its first scene.

        changed : called by the thread when there is something new to show.
        """
        self.cache = RenderCache()
        self._options, self._changed = options, changed
        self._wake = threading.Condition()
        self._next: SceneSpec | None = None
        self._is_closed = self._is_paused = False
        self._state = EngineState()
        self._source: PictureSource | None = None
        self._session: RenderSession | None = None
        self._saves: list[Callable[[Image], object]] = []
        self._thread = threading.Thread(target=self._run, name="live render", daemon=True)
        self._thread.start()

    @property
    def state(self) -> EngineState:
        """Return what it does."""
        return self._state

    @property
    def source(self) -> PictureSource | None:
        """Return the latest picture; None before there is one."""
        return self._source

    @property
    def is_paused(self) -> bool:
        """Tell if it is to wait."""
        return self._is_paused

    def show(self, spec: SceneSpec) -> int:
        """Render another scene in place of the present one; return its number."""
        with self._wake:
            self._next = spec
            self._state = EngineState(self._state.job + 1, Status.PREPARING)
            if self._session is not None:
                self._session.cancel()
            self._wake.notify_all()
            return self._state.job

    def pause(self, is_paused: bool) -> None:
        """Wait, or go on."""
        with self._wake:
            self._is_paused = is_paused
            self._wake.notify_all()
        self._changed()

    def save(self, write: Callable[[Image], object]) -> None:
        """Have a function called with the picture so far, soon, by a thread of its own; not before there is one."""
        with self._wake:
            self._saves.append(write)
            self._wake.notify_all()

    def close(self) -> None:
        """End the thread, and wait for it."""
        with self._wake:
            self._is_closed = True
            if self._session is not None:
                self._session.cancel()
            self._wake.notify_all()
        self._thread.join()

    # ---- The thread

    def _run(self) -> None:
        while True:
            with self._wake:
                self._wake.wait_for(lambda: self._is_closed or self._next is not None or self._can_save())
                if self._is_closed:
                    return
                spec, self._next = self._next, None
                job = self._state.job
            if spec is None:
                self._save()
                continue
            try:
                self._render(job, spec)
            except Cancelled:
                pass
            except (InputError, OutputError) as error:
                self._set(job, status=Status.FAILED, errors=sentences(error))
            except Exception as error:  # noqa: BLE001
                # Any other failure is the scene's too: the view stays, and shows it.
                self._set(job, status=Status.FAILED, errors=(f"internal error, {type(error).__name__}: {error}",))

    def _render(self, job: int, spec: SceneSpec) -> None:
        """Render a scene from its coarsest picture to its last sample."""
        began = perf_counter()
        below: PictureSource | None = None
        sizes = [step for step in STEPS if min(spec.film.width, spec.film.height) >= 2 * step]
        for step in (*sizes, 1):
            source = self._prepare(job, spec, step, is_quiet=below is not None)
            if below is not None:
                source.below = below.film_mean(*spec.picture())
            if step == 1:
                self._publish(source)
            source.rendered = source.session.run()
            if source.rendered.failure is not None:
                raise OutputError(source.rendered.failure)
            self._publish(source)
            below = source
        error = source.rendered.stats.error.get("relative") if source.rendered is not None else None
        self._set(job, status=Status.DONE, seconds=perf_counter() - began, error=error)

    def _prepare(self, job: int, spec: SceneSpec, step: int, *, is_quiet: bool) -> PictureSource:
        """Prepare a picture of a part of the size.

        is_quiet : the scene's warnings were shown already.

        Raises
        ------
        Cancelled : there is another scene to show.
        """
        options, warnings = self._options, list[str]()
        if step > 1:
            film = spec.film
            size = {"width": round(film.width / step), "height": round(film.height / step)}
            spec = spec.model_copy(update={"film": film.model_copy(update=size)})
            spp = min(PREVIEW_SPP, options.spp_limit(spec) or PREVIEW_SPP)
            options = replace(options, spp=spp, noise=None, time_limit=None)
        prepared = prepare_scene(spec, options, cache=self.cache, warn=warnings.append)
        session = RenderSession(prepared, lambda progress: self._tick(job, session, progress), None, None)
        session.queue.max_pass_seconds = PASS_SECONDS
        with self._wake:
            if self._next is not None or self._is_closed:
                raise Cancelled
            self._session = session
        if not is_quiet:
            self._set(job, warnings=tuple(warnings))
        return PictureSource(job, step, prepared, session)

    def _publish(self, source: PictureSource) -> None:
        self._source = source
        self._set(source.job, status=Status.RENDERING)

    def _tick(self, job: int, session: RenderSession, progress: Progress) -> None:
        """Save, or wait, while a render is under way; ten times a second."""
        if self._can_save():
            with session.queue.pool.film_read_lock():
                self._save()
        if self._is_paused and not session.queue.pool.is_stopped:
            with session.queue.pool.film_read_lock():
                self._set(job, status=Status.PAUSED)
                self._wait_while_paused(session)
            self._set(job, status=Status.RENDERING)
        self._set(job, seconds=progress.seconds, error=progress.error)

    def _wait_while_paused(self, session: RenderSession) -> None:
        pool = session.queue.pool
        while True:
            with self._wake:
                self._wake.wait_for(lambda: not self._is_paused or pool.is_stopped or self._can_save())
                if not self._can_save():
                    return
            self._save()

    def _can_save(self) -> bool:
        return bool(self._saves) and self._source is not None and self._source.job == self._state.job

    def _save(self) -> None:
        """Hand the picture so far to those who asked for it."""
        with self._wake:
            saves, self._saves = self._saves, []
        source = self._source
        if source is None:
            return
        image = source.image()
        for write in saves:
            threading.Thread(target=write, args=(image,), name="live save", daemon=True).start()

    def _set(self, job: int, **values: object) -> None:
        """Change the state of a job, if it is still the latest."""
        with self._wake:
            if job != self._state.job:
                return
            self._state = replace(self._state, **values)  # type: ignore[arg-type]
        self._changed()


def sentences(error: Exception) -> tuple[str, ...]:
    """Return the sentences of an error: all that was found wrong in a file."""
    others: Sequence[Exception] = getattr(error, "others", ())
    more: Sequence[str] = getattr(error, "sentences", ())
    return tuple(more) or tuple(map(str, (error, *others)))
