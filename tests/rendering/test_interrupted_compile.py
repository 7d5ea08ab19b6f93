"""Ctrl-C while the compiler works, which would take it for an error of its own."""

import signal
import threading
import time
from typing import Any

import pytest

from raytracer.kernel.path_state import workspace
from raytracer.rendering import compilation
from raytracer.rendering.compilation import compile_kernel

_PATIENCE = 60.0


def _compiling(monkeypatch: pytest.MonkeyPatch, work: Any) -> None:
    """Let compilation be `work`."""
    monkeypatch.setattr(compilation, "render_tile", lambda *arguments: work())


def test_ctrl_c_does_not_wait_for_the_compiler(monkeypatch: pytest.MonkeyPatch) -> None:
    interrupted, compiled = threading.Event(), threading.Event()

    def work() -> None:
        signal.raise_signal(signal.SIGINT)
        # Were it waited for, this would take as long as there is patience, and fail.
        assert interrupted.wait(_PATIENCE)
        compiled.set()

    _compiling(monkeypatch, work)
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt):
        compile_kernel(None, None, workspace())  # type: ignore[arg-type]
    assert not compiled.is_set()
    interrupted.set()
    # What was under way gets done, for the next one who needs it.
    assert compiled.wait(_PATIENCE)
    assert signal.getsignal(signal.SIGINT) is before


def test_the_next_to_compile_waits_for_what_an_interrupt_has_left(monkeypatch: pytest.MonkeyPatch) -> None:
    interrupted = threading.Event()
    order: list[str] = []

    def first() -> None:
        signal.raise_signal(signal.SIGINT)
        interrupted.wait(_PATIENCE)
        time.sleep(0.2)
        order.append("first")

    _compiling(monkeypatch, first)
    with pytest.raises(KeyboardInterrupt):
        compile_kernel(None, None, workspace())  # type: ignore[arg-type]
    _compiling(monkeypatch, lambda: order.append("second"))
    interrupted.set()
    compile_kernel(None, None, workspace())  # type: ignore[arg-type]
    assert order == ["first", "second"]


def test_mistakes_of_the_compiler_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    def work() -> None:
        raise RuntimeError("a mistake")

    _compiling(monkeypatch, work)
    with pytest.raises(RuntimeError, match="a mistake"):
        compile_kernel(None, None, workspace())  # type: ignore[arg-type]


def test_other_threads_compile_by_themselves(monkeypatch: pytest.MonkeyPatch) -> None:
    workers = []
    _compiling(monkeypatch, lambda: workers.append(threading.current_thread()))
    thread = threading.Thread(target=compile_kernel, args=(None, None, workspace()))
    thread.start()
    thread.join()
    compile_kernel(None, None, workspace())  # type: ignore[arg-type]
    assert workers[0] is thread
    assert workers[1] not in (thread, threading.main_thread())


def test_an_ignored_signal_stays_ignored(monkeypatch: pytest.MonkeyPatch) -> None:
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        _compiling(monkeypatch, lambda: signal.raise_signal(signal.SIGINT))
        compile_kernel(None, None, workspace())  # type: ignore[arg-type]
        assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, before)
