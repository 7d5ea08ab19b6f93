"""One scene rendered by a cluster: who of its workers is ready for it, and the errands that are out."""

import hashlib
import time
import uuid
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import CancelledError
from dataclasses import dataclass, field
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from raytracer.cluster import worker
from raytracer.cluster.fitness import fingerprint
from raytracer.errands import Errand, Haul
from raytracer.errors import InputError, OutputError, StrictError
from raytracer.scene.inputs import bundle
from raytracer.scene.spec import SceneSpec
from raytracer.scheduling import Crew, now

# Dask's, whose methods are typed in part.
Client: TypeAlias = Any
Future: TypeAlias = Any

_LOOK_SECONDS = 1.0
_TICK_SECONDS = 0.1
_NAP_SECONDS = 0.005

# Errands that are with workers for each of their threads: one that is worked on, and one for the way.
_WITH_A_THREAD = 2

# How often an errand is sent that comes back undone.  Dask by itself tries four workers that die each time.
_ATTEMPTS = 4

# How long a render that has begun waits for workers when all are gone: those of a queue may come back.
_PATIENCE_BETWEEN = 600.0

# How soon it is said that one waits.
SAY_AFTER = 2.0

_RESULT_SECONDS = 20.0


class Waiting(NamedTuple):
    """For how many seconds to wait for the first worker, and who is told so."""

    patience: float
    say: Callable[[str], object]


@dataclass
class _Hand:
    """A worker: its threads; what it was asked, while it has not answered; whether it is ready, or why it never is."""

    threads: int
    asked: Future | None = None
    is_ready: bool = False
    reason: str | None = None


class _Sent(NamedTuple):
    """An errand, how often it was sent, and the workers that may do it."""

    errand: Errand
    attempt: int = 0
    workers: frozenset[str] = frozenset()


@dataclass
class _Run:
    """Errands out, by what they will bring; those to be sent again; whether there are no others for now."""

    out: dict[Future, _Sent] = field(default_factory=dict)
    again: deque[_Sent] = field(default_factory=deque)
    is_exhausted: bool = False


class Engagement:
    """Workers of a cluster who take samples of one scene: `scheduling.Elsewhere`.

    Attributes
    ----------
    workers : addresses of those who have brought something.
    """

    def __init__(
        self,
        client: Client,
        spec: SceneSpec,
        waiting: Waiting,
        *,
        aovs: Sequence[str],
        denoise: bool,
        warn: Callable[[str], object] | None,
        strict: bool,
    ) -> None:
        """Ask all workers that are there to make the scene ready.

        Parameters
        ----------
        warn, strict : see `rendering.render`.

        Raises
        ------
        SceneError : a file of the scene cannot be taken along.
        """
        self._client, self._waiting, self._warn, self._strict = client, waiting, warn, strict
        whole = bundle(spec)
        digests = {name: worker.digest_of(content) for name, content in whole.files.items()}
        self._contents = {digests[name]: content for name, content in whole.files.items()}
        order = worker.Order("", whole.text, whole.name, digests, tuple(aovs), denoise, fingerprint())
        self._order = order._replace(key=hashlib.sha256(repr(order).encode()).hexdigest())
        self._files: dict[str, Future] = {}
        self._hands: dict[str, _Hand] = {}
        self._known_processors = {fingerprint().processor}
        self._looked = -float("inf")
        self._lonely: float | None = None
        self._has_said = False
        self.workers: list[str] = []
        self._look()

    @property
    def threads(self) -> int:
        """Of all workers that are ready; or while none is, of those who may become so."""
        ready = sum(hand.threads for hand in self._hands.values() if hand.is_ready)
        return max(1, ready or sum(hand.threads for hand in self._hands.values() if hand.reason is None))

    def run(
        self,
        draw: Callable[[], Errand | None],
        bring: Callable[[Errand, Haul], object],
        crew: Crew,
        deadline: float | None,
    ) -> None:
        """See `scheduling.Elsewhere`.

        Raises
        ------
        InputError : no worker can take part, or none came in time.
        StrictError : a worker's processor is another one, and that counts as an error.
        OutputError : the cluster was lost, or an errand fails again and again.
        """
        state = _Run()
        ticked = now()
        try:
            while not crew.stopped and (deadline is None or now() < deadline):
                self._look()
                self._send(state, draw)
                if state.is_exhausted and not state.out and not state.again:
                    return
                if not self._receive(state, bring):
                    self._check_company()
                    time.sleep(_NAP_SECONDS)
                if now() - ticked >= _TICK_SECONDS:
                    ticked = now()
                    crew.tick()
        finally:
            for future in state.out:
                future.release()

    # ---- Errands

    def _send(self, state: _Run, draw: Callable[[], Errand | None]) -> None:
        """Give the workers that are ready as much as they need to be busy."""
        ready = {address: hand.threads for address, hand in self._hands.items() if hand.is_ready}
        while len(state.out) < _WITH_A_THREAD * sum(ready.values()):
            if state.again:
                sent = state.again.popleft()
            else:
                errand = None if state.is_exhausted else draw()
                if errand is None:
                    state.is_exhausted = True
                    return
                sent = _Sent(errand)
            future = self._submit(worker.fetch, self._order.key, worker.packed(sent.errand), workers=list(ready))
            if future is None:
                state.again.append(sent)
                return
            state.out[future] = sent._replace(workers=frozenset(ready))

    def _receive(self, state: _Run, bring: Callable[[Errand, Haul], object]) -> bool:
        """Take what has come back; whether anything has."""
        came = [future for future in state.out if future.status != "pending"]
        for future in came:
            sent = state.out.pop(future)
            haul, trouble = self._opened(future)
            future.release()
            if haul is not None:
                bring(sent.errand, haul)
                state.is_exhausted = False
            elif trouble is None:
                state.again.append(sent)
            elif sent.attempt + 1 < _ATTEMPTS:
                state.again.append(sent._replace(attempt=sent.attempt + 1))
            else:
                raise OutputError(f"the cluster has failed {_ATTEMPTS} times to take the same samples: {trouble}")

        # What nobody is left to do.
        for future in [future for future, sent in state.out.items() if sent.workers.isdisjoint(self._hands)]:
            state.again.append(state.out.pop(future))
            future.release()
        return bool(came)

    def _opened(self, future: Future) -> tuple[Haul | None, str | None]:
        """What an errand has brought; None and why, if that is its own doing."""
        if future.status not in ("finished", "error"):
            return None, None
        try:
            address, haul = future.result(timeout=_RESULT_SECONDS)
        except (TimeoutError, OSError, CancelledError):
            # Who had it is gone, or the scheduler is.
            return None, None
        except Exception as error:  # noqa: BLE001
            # Whatever a worker may run into; what killed several of them is one, too.
            return None, f"{type(error).__name__}: {error}"
        if haul is None:
            # The worker has forgotten the scene.
            self._ask(address)
        elif address not in self.workers:
            self.workers.append(address)
        return haul, None

    def _submit(self, function: Callable[..., Any], *arguments: Any, workers: Sequence[str] | None) -> Future | None:
        """Have a function called on one of some workers; None if the scheduler is not in reach."""
        if self._client.status != "running":
            return None
        name = f"rt-{function.__name__}-{uuid.uuid4().hex}"
        return self._client.submit(function, *arguments, key=name, workers=workers, pure=False)

    # ---- Workers

    def _look(self) -> None:
        """Once a second, see who is there, ask who is new, and hear who has answered."""
        for address, hand in self._hands.items():
            if hand.asked is not None and hand.asked.status != "pending":
                asked, hand.asked = hand.asked, None
                self._hear(address, hand, asked)
                asked.release()
        if now() - self._looked < _LOOK_SECONDS:
            return
        self._looked = now()
        if self._client.status == "closed":
            raise OutputError("the cluster is lost: its scheduler does not answer any more")
        try:
            present = self._client.nthreads() if self._client.status == "running" else None
        except (OSError, TimeoutError):
            present = None
        if present is None:
            return
        for address in self._hands.keys() - present.keys():
            del self._hands[address]
        for address in sorted(present.keys() - self._hands.keys()):
            self._hands[address] = _Hand(present[address])
            self._ask(address)

    def _ask(self, address: str, missing: Sequence[str] = ()) -> None:
        """Ask a worker to make the scene ready, with what it lacks for that."""
        hand = self._hands.get(address)
        if hand is None or hand.asked is not None:
            return
        hand.is_ready = False
        files = {digest: self._file(digest) for digest in missing}
        hand.asked = self._submit(worker.prepare, self._order, files, workers=[address])
        if hand.asked is None:
            # Met again when the scheduler is back.
            del self._hands[address]

    def _file(self, digest: str) -> Future:
        """A file's content, which workers hand on to each other."""
        if digest not in self._files or self._files[digest].status in ("cancelled", "lost", "error"):
            content = np.frombuffer(self._contents[digest], dtype=np.uint8)
            self._files[digest] = self._client.submit(worker.hold, content, key=f"rt-hold-{uuid.uuid4().hex}")
        return self._files[digest]

    def _hear(self, address: str, hand: _Hand, asked: Future) -> None:
        """Take a worker's answer."""
        try:
            answer = asked.result(timeout=_RESULT_SECONDS) if asked.status in ("finished", "error") else None
        except (TimeoutError, OSError, CancelledError):
            answer = None
        except Exception as error:  # noqa: BLE001
            hand.reason = f"cannot take part: {type(error).__name__}: {error}"
            return
        if answer is None:
            self._ask(address)
        elif answer.missing:
            self._ask(address, answer.missing)
        elif answer.obstacle or answer.failure:
            hand.reason = answer.obstacle or f"cannot make the scene ready: {answer.failure}"
            if len(self._hands) > 1:
                self._doubt(f"worker {address} {hand.reason}; it is left out")
        else:
            hand.is_ready = True
            if answer.processor not in self._known_processors:
                self._known_processors.add(answer.processor)
                self._doubt(
                    f"worker {address} has another instruction set than this machine, so that bits may differ from one "
                    "render to the next"
                )

    def _doubt(self, sentence: str) -> None:
        if self._strict:
            raise StrictError([sentence])
        if self._warn is not None:
            self._warn(sentence)

    def _check_company(self) -> None:
        """Give up where nobody can take part, or nobody has come for long."""
        able = [hand for hand in self._hands.values() if hand.reason is None]
        if able:
            self._lonely, self._has_said = None, False
            return
        error = OutputError if self.workers else InputError
        for address, hand in self._hands.items():
            raise error(f"worker {address} {hand.reason}")
        self._lonely = self._lonely or now()
        waited, patience = now() - self._lonely, _PATIENCE_BETWEEN if self.workers else self._waiting.patience
        place = self._client.scheduler.address if self._client.scheduler is not None else "the scheduler"
        if waited > patience:
            raise error(f"{place} has had no workers for {patience:g} s; `dask worker {place}` starts one")
        if waited > SAY_AFTER and not self._has_said:
            self._has_said = True
            self._waiting.say(f"{place} has no workers; waiting for one, up to {patience:g} s")
