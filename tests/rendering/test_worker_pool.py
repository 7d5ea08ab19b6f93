"""The threads that take samples: an interrupt leaves none of them at work."""

import signal
import threading
import time

import pytest

from raytracer.rendering.worker_pool import WorkerPool


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
