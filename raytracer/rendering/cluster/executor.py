"""Render one scene on a cluster: prepare its workers, send them jobs, and receive the results."""

import hashlib
import pickle
import time
import uuid
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import CancelledError
from dataclasses import dataclass, field
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from raytracer.rendering.cluster import worker
from raytracer.rendering.cluster.worker import fingerprint
from raytracer.rendering.options import RenderOptions
from raytracer.rendering.tile_job import TileJob, TileResult
from raytracer.rendering.tile_scheduler import now
from raytracer.rendering.worker_pool import WorkerPool
from raytracer.scene.bundle import bundle
from raytracer.scene.spec import SceneSpec
from raytracer.util.errors import InputError, OutputError, StrictError

# Dask's, whose methods are typed in part.
Client: TypeAlias = Any
Future: TypeAlias = Any

_POLL_SECONDS = 1.0
_TICK_SECONDS = 0.1
_SLEEP_SECONDS = 0.005

# Jobs that workers have for each of their threads: one that is worked on, and one on its way.
_JOBS_PER_THREAD = 2

# Times that a failed job is sent.  Dask by itself tries four workers that die each time.
_ATTEMPTS = 4

# Seconds that a render that has begun waits for workers when all are gone: those of a queue may come back.
_RECONNECT_SECONDS = 600.0

# Seconds after which the wait for workers is reported.
REPORT_AFTER = 2.0

_RESULT_SECONDS = 20.0


@dataclass
class _WorkerState:
    """The state of a worker.

    threads : of the worker.
    request : its request to prepare the scene, while that has no reply.
    is_ready : True once it has prepared the scene.
    reason : why it cannot take part; None if it can.
    """

    threads: int
    request: Future | None = None
    is_ready: bool = False
    reason: str | None = None


class _SubmittedJob(NamedTuple):
    """A job, the number of its failures so far, and the workers that may do it."""

    job: TileJob
    attempt: int = 0
    workers: frozenset[str] = frozenset()


@dataclass
class _JobState:
    """The jobs of one run.

    in_flight : jobs that workers have, by the futures of their results.
    retries : jobs to be sent again.
    is_exhausted : True if there are no others for now.
    """

    in_flight: dict[Future, _SubmittedJob] = field(default_factory=dict)
    retries: deque[_SubmittedJob] = field(default_factory=deque)
    is_exhausted: bool = False


class ClusterExecutor:
    """The workers of a cluster, taking samples of one scene: a `worker_pool.RemoteExecutor`.

    workers : addresses of those that have returned a result.
    """

    def __init__(
        self,
        client: Client,
        spec: SceneSpec,
        options: RenderOptions,
        warn: Callable[[str], object] | None,
        patience: float,
        say: Callable[[str], object],
    ) -> None:
        """Request all workers that are there to prepare the scene.

        Parameters
        ----------
        options, warn : see `rendering.render`.
        patience (s) : longest wait for the first worker.
        say : called with a sentence about that wait.

        Raises
        ------
        InputError : a file of the scene cannot be read.
        """
        self._client, self._warn, self._strict = client, warn, options.strict
        self._patience, self._say = patience, say
        whole = bundle(spec)
        digests = {name: hashlib.sha256(content).hexdigest() for name, content in whole.files.items()}
        self._contents = {digests[name]: content for name, content in whole.files.items()}
        request = worker.PrepareRequest(
            "", whole.text, whole.name, digests, tuple(options.aovs), options.denoise, fingerprint()
        )
        self._request = request._replace(key=hashlib.sha256(repr(request).encode()).hexdigest())
        self._files: dict[str, Future] = {}
        self._worker_states: dict[str, _WorkerState] = {}
        self._known_processors = {fingerprint().processor}
        self._last_poll = -float("inf")
        self._no_workers_since: float | None = None
        self._has_said = False
        self.workers: list[str] = []
        self._poll_workers()

    @property
    def threads(self) -> int:
        """Count the threads of all workers that are ready; while none is, of those that may become so."""
        states = self._worker_states.values()
        ready = sum(state.threads for state in states if state.is_ready)
        return max(1, ready or sum(state.threads for state in states if state.reason is None))

    def run(
        self,
        next_job: Callable[[], TileJob | None],
        merge: Callable[[TileJob, TileResult], object],
        pool: WorkerPool,
        deadline: float | None,
    ) -> None:
        """Run jobs until there are none, or the pool is stopped, or the deadline is past; see `RemoteExecutor.run`.

        Raises
        ------
        InputError : no worker can take part, or none came in time.
        StrictError : a worker's processor is another one, and that counts as an error.
        OutputError : the cluster was lost, or a job fails again and again.
        """
        jobs = _JobState()
        ticked = now()
        try:
            while not pool.is_stopped and (deadline is None or now() < deadline):
                self._poll_workers()
                self._send(jobs, next_job)
                if jobs.is_exhausted and not jobs.in_flight and not jobs.retries:
                    return
                if not self._receive(jobs, merge):
                    self._check_workers()
                    time.sleep(_SLEEP_SECONDS)
                if now() - ticked >= _TICK_SECONDS:
                    ticked = now()
                    pool.tick()
        finally:
            for future in jobs.in_flight:
                future.release()

    # ---- Jobs

    def _send(self, jobs: _JobState, next_job: Callable[[], TileJob | None]) -> None:
        """Send the workers that are ready as many jobs as keep them busy."""
        ready = {address: state.threads for address, state in self._worker_states.items() if state.is_ready}
        while len(jobs.in_flight) < _JOBS_PER_THREAD * sum(ready.values()):
            if jobs.retries:
                sent = jobs.retries.popleft()
            else:
                job = None if jobs.is_exhausted else next_job()
                if job is None:
                    jobs.is_exhausted = True
                    return
                sent = _SubmittedJob(job)
            # Pickled, as the scheduler, which reads what passes through it, need not know a job's classes.
            job_bytes = pickle.dumps(sent.job, pickle.HIGHEST_PROTOCOL)
            future = self._submit(worker.run_job, self._request.key, job_bytes, workers=list(ready))
            if future is None:
                jobs.retries.append(sent)
                return
            jobs.in_flight[future] = sent._replace(workers=frozenset(ready))

    def _receive(self, jobs: _JobState, merge: Callable[[TileJob, TileResult], object]) -> bool:
        """Receive results, and return True if there were any."""
        done = [future for future in jobs.in_flight if future.status != "pending"]
        for future in done:
            sent = jobs.in_flight.pop(future)
            result, error = self._unpack_result(future)
            future.release()
            if result is not None:
                merge(sent.job, result)
                jobs.is_exhausted = False
            elif error is None:
                jobs.retries.append(sent)
            elif sent.attempt + 1 < _ATTEMPTS:
                jobs.retries.append(sent._replace(attempt=sent.attempt + 1))
            else:
                raise OutputError(f"the cluster has failed {_ATTEMPTS} times to take the same samples: {error}")

        # Jobs of which all workers are gone.
        present = self._worker_states
        for future in [future for future, sent in jobs.in_flight.items() if sent.workers.isdisjoint(present)]:
            jobs.retries.append(jobs.in_flight.pop(future))
            future.release()
        return bool(done)

    def _unpack_result(self, future: Future) -> tuple[TileResult | None, str | None]:
        """Return the result of a job; None and the error, if the job itself has failed."""
        answer, error = _result(future)
        if answer is None:
            return None, error
        address, result = answer
        if result is None:
            # The worker has forgotten the scene.
            self._request_prepare(address)
        elif address not in self.workers:
            self.workers.append(address)
        return result, None

    def _submit(self, function: Callable[..., Any], *arguments: Any, workers: Sequence[str] | None) -> Future | None:
        """Submit a call to one of some workers; return None if the scheduler cannot be reached."""
        if self._client.status != "running":
            return None
        name = f"rt-{function.__name__}-{uuid.uuid4().hex}"
        return self._client.submit(function, *arguments, key=name, workers=workers, pure=False)

    # ---- Workers

    def _poll_workers(self) -> None:
        """Receive replies, and once a second update the list of workers and send requests to new ones."""
        for address, state in self._worker_states.items():
            if state.request is not None and state.request.status != "pending":
                request, state.request = state.request, None
                self._handle_reply(address, state, request)
                request.release()
        if now() - self._last_poll < _POLL_SECONDS:
            return
        self._last_poll = now()
        if self._client.status == "closed":
            raise OutputError("the cluster is lost: its scheduler does not answer any more")
        try:
            present = self._client.nthreads() if self._client.status == "running" else None
        except (OSError, TimeoutError):
            present = None
        if present is None:
            return
        for address in self._worker_states.keys() - present.keys():
            del self._worker_states[address]
        for address in sorted(present.keys() - self._worker_states.keys()):
            self._worker_states[address] = _WorkerState(present[address])
            self._request_prepare(address)

    def _request_prepare(self, address: str, missing: Sequence[str] = ()) -> None:
        """Request a worker to prepare the scene, and send the files that it lacks."""
        state = self._worker_states.get(address)
        if state is None or state.request is not None:
            return
        state.is_ready = False
        files = {digest: self._file(digest) for digest in missing}
        state.request = self._submit(worker.prepare, self._request, files, workers=[address])
        if state.request is None:
            # Asked again when the scheduler is back.
            del self._worker_states[address]

    def _file(self, digest: str) -> Future:
        """Publish a file's content, which workers hand on to each other."""
        if digest not in self._files or self._files[digest].status in ("cancelled", "lost", "error"):
            content = np.frombuffer(self._contents[digest], dtype=np.uint8)
            self._files[digest] = self._client.submit(worker.publish_file, content, key=f"rt-hold-{uuid.uuid4().hex}")
        return self._files[digest]

    def _handle_reply(self, address: str, state: _WorkerState, request: Future) -> None:
        """Handle a worker's reply to the request to prepare the scene."""
        reply, error = _result(request)
        if error is not None:
            state.reason = f"cannot take part: {error}"
        elif reply is None:
            self._request_prepare(address)
        elif reply.missing:
            self._request_prepare(address, reply.missing)
        elif reply.mismatch or reply.failure:
            state.reason = reply.mismatch or f"cannot make the scene ready: {reply.failure}"
            if len(self._worker_states) > 1:
                self._warn_or_raise(f"worker {address} {state.reason}; it is left out")
        else:
            state.is_ready = True
            if reply.processor not in self._known_processors:
                self._known_processors.add(reply.processor)
                self._warn_or_raise(
                    f"worker {address} has another instruction set than this machine, so that bits may differ from one "
                    "render to the next"
                )

    def _warn_or_raise(self, sentence: str) -> None:
        if self._strict:
            raise StrictError([sentence])
        if self._warn is not None:
            self._warn(sentence)

    def _check_workers(self) -> None:
        """Give up if no worker can take part, or none has come for long."""
        able = [state for state in self._worker_states.values() if state.reason is None]
        if able:
            self._no_workers_since, self._has_said = None, False
            return
        error = OutputError if self.workers else InputError
        for address, state in self._worker_states.items():
            raise error(f"worker {address} {state.reason}")
        self._no_workers_since = self._no_workers_since or now()
        waited = now() - self._no_workers_since
        patience = _RECONNECT_SECONDS if self.workers else self._patience
        place = self._client.scheduler.address if self._client.scheduler is not None else "the scheduler"
        if waited > patience:
            raise error(f"{place} has had no workers for {patience:g} s; `dask worker {place}` starts one")
        if waited > REPORT_AFTER and not self._has_said:
            self._has_said = True
            self._say(f"{place} has no workers; waiting for one, up to {patience:g} s")


def _result(future: Future) -> tuple[Any, str | None]:
    """Return the result of a future, and its error; neither if the worker that had it is gone, or the scheduler is."""
    if future.status not in ("finished", "error"):
        return None, None
    try:
        return future.result(timeout=_RESULT_SECONDS), None
    except (TimeoutError, OSError, CancelledError):
        return None, None
    except Exception as error:  # noqa: BLE001
        # Any error of a worker; a job that killed several of them raises one, too.
        return None, f"{type(error).__name__}: {error}"
