"""What Ctrl-C does while the compiler works, which would take it for a mistake of its own."""

import signal
import threading
from typing import Any

import pytest

from raytracer import preparation
from raytracer.preparation import compile_for


def _compiling(monkeypatch: pytest.MonkeyPatch, work: Any) -> None:
    """Let compilation be `work`."""
    monkeypatch.setattr(preparation, "render_tile", lambda *arguments: work())


def test_ctrl_c_waits_for_the_compiler(monkeypatch: pytest.MonkeyPatch) -> None:
    done = []

    def work() -> None:
        signal.raise_signal(signal.SIGINT)
        done.append("compiled")

    _compiling(monkeypatch, work)
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt):
        compile_for(None, None)  # type: ignore[arg-type]
    assert done == ["compiled"]
    assert signal.getsignal(signal.SIGINT) is before


def test_ctrl_c_twice_is_not_told_as_a_mistake(monkeypatch: pytest.MonkeyPatch) -> None:
    def work() -> None:
        signal.raise_signal(signal.SIGINT)
        try:
            signal.raise_signal(signal.SIGINT)
        except KeyboardInterrupt:
            raise RuntimeError("as the compiler has it") from None

    _compiling(monkeypatch, work)
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt):
        compile_for(None, None)  # type: ignore[arg-type]
    assert signal.getsignal(signal.SIGINT) is before


def test_mistakes_of_the_compiler_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    def work() -> None:
        signal.raise_signal(signal.SIGINT)
        raise RuntimeError("a mistake")

    _compiling(monkeypatch, work)
    with pytest.raises(RuntimeError, match="a mistake"):
        compile_for(None, None)  # type: ignore[arg-type]


def test_other_threads_compile_as_ever(monkeypatch: pytest.MonkeyPatch) -> None:
    before = signal.getsignal(signal.SIGINT)
    handlers = []
    _compiling(monkeypatch, lambda: handlers.append(signal.getsignal(signal.SIGINT)))
    thread = threading.Thread(target=compile_for, args=(None, None))
    thread.start()
    thread.join()
    compile_for(None, None)  # type: ignore[arg-type]
    assert handlers[0] is before
    assert handlers[1] is not before


def test_an_ignored_signal_stays_ignored(monkeypatch: pytest.MonkeyPatch) -> None:
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        _compiling(monkeypatch, lambda: signal.raise_signal(signal.SIGINT))
        compile_for(None, None)  # type: ignore[arg-type]
        assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, before)
