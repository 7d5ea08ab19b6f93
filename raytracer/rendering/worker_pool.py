"""The threads that take samples, and the interface of a cluster that takes them in their place."""

import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Protocol, TypeVar

from raytracer.kernel.packed_scene import Scene
from raytracer.kernel.path_state import Workspace
from raytracer.kernel.path_state import workspace as make_workspace
from raytracer.rendering.options import RenderOptions
from raytracer.rendering.tile_job import TileJob, TileResult
from raytracer.scene.spec import SceneSpec
from raytracer.util.errors import OutputError
from raytracer.util.machine import available_threads as available_threads  # noqa: PLC0414

Item = TypeVar("Item")

_POLL_SECONDS = 0.1


class WorkerPool:
    """Threads that take work from a queue.

    threads : the largest number of threads that work at once.
    interrupted : True once a KeyboardInterrupt has ended the work.
    failure : the reason why a cluster ended the work before its time; None if it did not.
    """

    def __init__(self, threads: int, tick: Callable[[], None] = lambda: None, *, scene: Scene | None = None) -> None:
        """Make a pool that has no work yet.

        tick : to be called about ten times a second while there is work.
        scene : that the threads' workspaces are made for.
        """
        self.threads = threads
        self.interrupted = False
        self.failure: str | None = None
        self.tick, self._scene = tick, scene
        self._stopped = threading.Event()
        self._film_lock = threading.Condition()
        self._active_writers, self._is_reading = 0, False

    @property
    def is_stopped(self) -> bool:
        """Tell if all work is to end as soon as it can."""
        return self._stopped.is_set()

    def stop(self) -> None:
        """End all work as soon as it can; any thread may call it."""
        self._stopped.set()

    @contextmanager
    def stop_on_interrupt(self) -> Iterator[None]:
        """Take a KeyboardInterrupt in the `with` block as the end of all work, and go on after the block.

        Raises
        ------
        KeyboardInterrupt : it is not the first.
        """
        try:
            yield
        except KeyboardInterrupt:
            self._stopped.set()
            if self.interrupted:
                raise
            self.interrupted = True

    @contextmanager
    def film_write_lock(self) -> Iterator[None]:
        """Change the film in the `with` block, once no thread reads it."""
        with self._film_lock:
            self._film_lock.wait_for(lambda: not self._is_reading)
            self._active_writers += 1
        try:
            yield
        finally:
            with self._film_lock:
                self._active_writers -= 1
                self._film_lock.notify_all()

    @contextmanager
    def film_read_lock(self) -> Iterator[None]:
        """Read the film in the `with` block, while no thread changes it; for one thread, which is not of the pool."""
        with self._film_lock:
            self._is_reading = True
            self._film_lock.wait_for(lambda: self._active_writers == 0)
        try:
            yield
        finally:
            with self._film_lock:
                self._is_reading = False
                self._film_lock.notify_all()

    def run_remote(
        self,
        remote: "RemoteExecutor",
        next_job: "Callable[[], TileJob | None]",
        merge: "Callable[[TileJob, TileResult], object]",
        deadline: float | None = None,
    ) -> None:
        """Run jobs on a cluster; after an interrupt, or once it is lost, this and all later calls return at once.

        Parameters
        ----------
        next_job : returns the next job; None if there is none for now.
        merge : called with each job that is done and its result, before `next_job` is called again.
        deadline : a time of `tile_scheduler.now`, after which results are no longer waited for.
        """
        if self.is_stopped:
            return
        try:
            with self.stop_on_interrupt():
                remote.run(next_job, merge, self, deadline)
        except OutputError as error:
            self.failure = str(error)
            self._stopped.set()
        except BaseException:
            self._stopped.set()
            raise

    def run(self, items: Iterable[Item], work: Callable[[Workspace, Item], Item | None]) -> None:
        """Do `work` on all items, begun in their order; what it returns goes to the end of the queue.

        After an interrupt the items in work are finished and this returns, and so does every later call at once.

        Raises
        ------
        BaseException : what `work` has raised.
        """
        if self.is_stopped:
            return
        queue = deque(items)
        failures: list[BaseException] = []

        def take_items() -> None:
            workspace = make_workspace(self._scene)
            while not self.is_stopped:
                try:
                    item = queue.popleft()
                except IndexError:
                    return
                try:
                    rest = work(workspace, item)
                except BaseException as error:  # noqa: BLE001
                    # Raised where the threads are waited for.
                    failures.append(error)
                    self._stopped.set()
                    return
                if rest is not None:
                    queue.append(rest)

        self._run_threads(take_items, min(self.threads, len(queue)))
        if failures:
            raise failures[0]

    def _run_threads(self, work: Callable[[], None], count: int) -> None:
        """Do `work` in so many threads, and wait until each of them has ended, also after an interrupt."""
        all_started = threading.Event()

        def run(ended: threading.Event) -> None:
            try:
                # An interrupt may fall into the start of a thread, which then is not known to have started.
                all_started.wait()
                if not self.is_stopped:
                    work()
            finally:
                ended.set()

        # Before Python 3.13 a thread whose `join` is interrupted is taken for ended, so that events tell who has.
        ends = [threading.Event() for _ in range(count)]
        workers = [threading.Thread(target=run, args=(ended,), daemon=True) for ended in ends]
        try:
            with self.stop_on_interrupt():
                for worker in workers:
                    worker.start()
                all_started.set()
                for ended in ends:
                    while not ended.wait(_POLL_SECONDS):
                        self.tick()
        except BaseException:
            self._stopped.set()
            raise
        finally:
            all_started.set()
            for worker, ended in zip(workers, ends, strict=True):
                if worker.ident is not None:
                    ended.wait()


class RemoteExecutor(Protocol):
    """Workers on other machines that take samples of one scene."""

    @property
    def threads(self) -> int:
        """Count the threads that work at once, as far as they are known; at least 1."""

    @property
    def workers(self) -> Sequence[str]:
        """Name the workers that have returned a result."""

    def run(
        self,
        next_job: Callable[[], TileJob | None],
        merge: Callable[[TileJob, TileResult], object],
        pool: WorkerPool,
        deadline: float | None,
    ) -> None:
        """Run jobs until `next_job` has none and all have returned; or the pool is stopped, or the deadline is past.

        `next_job` and `merge` are called by the caller's thread, and `pool.tick` about ten times a second.

        Raises
        ------
        OutputError : the workers are lost.
        """


class ClusterClient(Protocol):
    """A connection to machines that can take samples of any scene."""

    def connect(self, spec: SceneSpec, options: RenderOptions, warn: Callable[[str], object] | None) -> RemoteExecutor:
        """Have the workers prepare a scene, while the caller does something else.

        spec : with its seed and samples per pixel.
        options, warn : see `rendering.render`.

        Raises
        ------
        InputError : there are no workers, or they cannot render the same picture.
        """
