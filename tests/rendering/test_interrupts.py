"""Ctrl-C while the compiler works, which would take it for an error of its own, and while threads take samples."""

import signal
import threading
import time

import pytest

from raytracer.kernel.path_state import workspace
from raytracer.rendering import compilation
from raytracer.rendering.worker_pool import WorkerPool

PATIENCE = 60.0


@pytest.fixture
def compiled(monkeypatch):
    """Compile what is `work`."""

    def compile_it(work):
        monkeypatch.setattr(compilation, "render_tile", lambda *arguments: work())
        compilation.compile_kernel(None, None, workspace())

    return compile_it


def interrupt():
    signal.raise_signal(signal.SIGINT)


def test_ctrl_c_does_not_wait_for_the_compiler_and_the_next_one_to_compile_does(compiled):
    interrupted, order = threading.Event(), []

    def first():
        interrupt()
        # Were it waited for, this would take as long as there is patience, and fail.
        assert interrupted.wait(PATIENCE)
        time.sleep(0.2)
        # What was under way gets done, for the next one who needs it.
        order.append("first")

    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt):
        compiled(first)
    assert not order
    interrupted.set()
    compiled(lambda: order.append("second"))
    assert order == ["first", "second"]
    assert signal.getsignal(signal.SIGINT) is before


def test_mistakes_of_the_compiler_are_told(compiled):
    def work():
        raise RuntimeError("a mistake")

    with pytest.raises(RuntimeError, match="a mistake"):
        compiled(work)


def test_other_threads_compile_by_themselves(compiled):
    workers = []

    def work():
        workers.append(threading.current_thread())

    thread = threading.Thread(target=compiled, args=(work,))
    thread.start()
    thread.join()
    compiled(work)
    assert workers[0] is thread
    assert workers[1] not in (thread, threading.main_thread())


def test_an_ignored_signal_stays_ignored(compiled):
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        compiled(interrupt)
        assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, before)


# ---- The threads that take samples: none is left at work


@pytest.mark.parametrize("delay", [0.0, 0.05, 0.2])
def test_an_interrupt_waits_for_the_items_in_work(delay):
    # Whoever goes on frees what kernels read: Embree's structure, for one.
    pool, begun, done, first = WorkerPool(2), [], [], threading.Event()

    def work(_, item):
        begun.append(item)
        first.set()
        time.sleep(0.4)
        done.append(item)

    def interrupt():
        first.wait()
        time.sleep(delay)
        signal.pthread_kill(threading.main_thread().ident, signal.SIGINT)

    interrupter = threading.Thread(target=interrupt)
    interrupter.start()
    pool.run(range(100), work)
    assert pool.interrupted
    assert sorted(done) == sorted(begun)
    interrupter.join()
    pool.run(range(100), work)
    assert 1 <= len(done) <= 2
