"""Count the kernels that tests need, which is what a first run compiles, and hold them within a budget.

A kernel is compiled for the types of its arguments: the path tracer of a scene with one effect or one kind of material
more is another one, and takes seconds.  Tests therefore vary the values of few scenes (`tests/small_scenes.py`), not
their types.  What is on disk makes no difference to the budget: a kernel that is loaded counts like one that is
compiled, once for all processes, and for the test that asks first.

    pytest --kernels 20    the twenty modules, and the twenty tests, that need most

Kernels are compiled as for users: with `NUMBA_OPT=1` in place of 3 a path tracer compiles in 90 % of the time (cover
4.1 -> 3.8 s, studio 15.2 -> 13.7), too little for tests of other machine code.
"""

import hashlib
from collections import Counter
from collections.abc import Iterator
from typing import Any

import pytest

from raytracer.core.compiler.entry import Entry

BUDGET = {"path tracers": 70, "kernels in all": 480}
"""The most that all quick tests together may need; a dozen of them are compiled loops of light fields, and small."""

_PATH_TRACER = "render_tile"

_first_asked: dict[str, tuple[str, str]] = {}
"""By the hash of a kernel: its function, and the test that first asked for it."""

_compiled: Counter[str] = Counter()
"""How often a kernel that can be kept on disk was compiled: more than once only if processes do not share it."""

_running = ["collection"]


def pytest_addoption(parser: Any) -> None:
    parser.addoption(
        "--kernels", type=int, default=0, metavar="N", help="show the N modules and the N tests that need most kernels"
    )


def pytest_configure() -> None:
    """Note each kernel that this process asks for or compiles."""
    load_or_compile, compile_entry = Entry._load_or_compile, Entry._compile

    def asked(self, kinds, arguments):
        key = _hash(f"{self.__module__}:{self.__qualname__}:{kinds!r}")
        _first_asked.setdefault(key, (self.__name__, _running[0]))
        return load_or_compile(self, kinds, arguments)

    def compiled(self, arguments, files, key):
        if key is not None:
            _compiled[_hash(str(files.path(key)))] += 1
        return compile_entry(self, arguments, files, key)

    Entry._load_or_compile, Entry._compile = asked, compiled


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    _running[0] = item.nodeid
    return (yield)


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any) -> None:
    """Take over what a process of xdist asked for and compiled."""
    output = getattr(node, "workeroutput", {})
    for key, asked in output.get("asked", {}).items():
        _first_asked.setdefault(key, tuple(asked))
    _compiled.update(output.get("compiled", {}))


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Fail a run that needs more kernels than the budget has."""
    if hasattr(session.config, "workeroutput"):
        session.config.workeroutput.update(asked=_first_asked, compiled=dict(_compiled))
    elif _exceeded(session.config) and session.exitstatus == pytest.ExitCode.OK:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(terminalreporter: Any) -> None:
    write, needed, config = terminalreporter.write_line, _needed(), terminalreporter.config
    counts = ", ".join(f"{needed[what]} {what} (budget {limit})" for what, limit in BUDGET.items())
    again = f", {_compiled.total() - len(_compiled)} of them again" if _compiled.total() > len(_compiled) else ""
    write(f"kernels that these tests need: {counts}; compiled now: {len(_compiled)}{again}")
    if _exceeded(config):
        write(
            "FAILED: more kernels than the budget has; vary values of the scenes in tests/small_scenes.py, not types, "
            "or say in tests/compilations.py why there must be more",
            red=True,
        )
    for unit in (lambda test: test.partition("::")[0], str):
        kernels = Counter(unit(test) for _, test in _first_asked.values())
        tracers = Counter(unit(test) for name, test in _first_asked.values() if name == _PATH_TRACER)
        for what, count in kernels.most_common(config.option.kernels):
            write(f"{count:4d} kernels, {tracers[what]:3d} of them path tracers: {what}")


def _needed() -> dict[str, int]:
    names = [name for name, _ in _first_asked.values()]
    return {"path tracers": names.count(_PATH_TRACER), "kernels in all": len(names)}


def _exceeded(config: Any) -> list[str]:
    """Name what there is too much of in a run of the quick tests; slow ones have scenes of their own."""
    needed = _needed()
    return [what for what in BUDGET if needed[what] > BUDGET[what]] if "not slow" in config.option.markexpr else []
