"""Feed loaders bytes that nobody would write, led by the coverage of what they have not reached yet: `make fuzz`.

    python -m tests.fuzz                                a minute, shared by all targets
    python -m tests.fuzz lf scene --seconds 600 --jobs 2     those alone
    python -m tests.fuzz lf --reproduce FILE            one input, with its traceback

A mistake does not end the run: exceptions are caught, written down once for each line of raytracer that they come
from, and the run goes on; an input that hangs, or ends the process, costs a restart of its target.  What is found is
left in the folder of findings, an input and a text each; the exit status is 1 if there is anything.

Each target is a process, forked from this one so that it is instrumented once.
"""

import argparse
import contextlib
import faulthandler
import json
import math
import mmap
import os
import platform
import re
import signal
import struct
import sys
import tempfile
import time
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from tests.fuzz import harness
from tests.fuzz.harness import SECONDS_LIMIT, Finding, findings_in, of_stack

# Forked processes must not rely on threads that stayed behind.
os.environ["OPENBLAS_NUM_THREADS"] = "1"
os.environ["OMP_NUM_THREADS"] = "1"

_WHEELS = "Linux on x86-64"
_DEFAULT_SECONDS = 60.0
_IN_MEMORY = "/dev/shm"
"""Linux has files in memory there: an execution writes one, which a busy disk would wait for."""

_RSS_LIMIT = 2048
_POLL = 0.02

_HEADER = struct.Struct("<QdQ")
"""In memory shared with a target's process: executions so far, start of the one under way or 0, length of its input."""
_KEPT = 2**20

_MOST_DEATHS = 3
"""After which a target is left: it has findings, and each time costs as much as thousands of executions."""

_STUCK = 3
"""Limits of time after which a process is killed that libFuzzer's alarm could not end."""


def main(arguments: Sequence[str] | None = None) -> int:
    options = _options(arguments)
    try:
        import atheris
    except ImportError:
        if (platform.system(), platform.machine()) == ("Linux", "x86_64"):
            print("fuzzing needs atheris: pip install atheris", file=sys.stderr)
            return 2
        print(f"fuzzing is skipped: atheris has wheels for {_WHEELS} alone")
        return 0

    began = time.monotonic()
    unknown = [name for name in options.targets if name not in [*harness.target_names(), "planted", "planted_hang"]]
    if unknown:
        print(f"no target {unknown[0]!r}; known: {', '.join(harness.target_names())}", file=sys.stderr)
        return 2
    names = options.targets or harness.target_names()
    atheris.instrument_imports(
        ["raytracer", "tests", *_parsers(names)], exclude=_kernels(), enable_loader_override=False
    ).__enter__()
    with open(os.devnull, "w") as nowhere, contextlib.redirect_stderr(nowhere):
        targets = [harness.load_target(name) for name in names]
    if options.reproduce:
        return _reproduced(targets[0], options.reproduce)

    findings = options.findings or Path(tempfile.mkdtemp(prefix="rt-findings-"))
    memory = _IN_MEMORY if os.access(_IN_MEMORY, os.W_OK) else None
    with tempfile.TemporaryDirectory(prefix="rt-fuzz-", dir=memory, ignore_cleanup_errors=True) as scratch:
        runs = _fuzzed(targets, options, Path(scratch), findings, began)
    results = _results(runs, findings)
    if options.json:
        print(json.dumps(results, indent=2))
    else:
        _show(results, findings)
    return int(any(result["findings"] for result in results))


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m tests.fuzz", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("targets", nargs="*", metavar="TARGET", help="what to fuzz (all)")
    parser.add_argument("--seconds", type=float, help=f"how long all of it takes ({_DEFAULT_SECONDS:g})")
    parser.add_argument("--executions", type=int, help="how often each target is executed at most")
    parser.add_argument("--jobs", type=int, default=1, help="processes at a time (1)")
    parser.add_argument("--seed", type=int, default=1, help="of libFuzzer's random numbers (1)")
    parser.add_argument("--findings", type=Path, metavar="FOLDER", help="where what is found goes (a temporary folder)")
    parser.add_argument("--corpus", type=Path, metavar="FOLDER", help="where inputs that reach new code are kept")
    parser.add_argument("--timeout", type=int, default=SECONDS_LIMIT, help=f"s for one input ({SECONDS_LIMIT})")
    parser.add_argument("--json", action="store_true", help="print the table as JSON")
    parser.add_argument("--reproduce", type=Path, metavar="FILE", help="execute the one target on this input")
    options = parser.parse_args(arguments)
    if options.seconds is None and options.executions is None:
        options.seconds = _DEFAULT_SECONDS
    return options


# ---- What is instrumented


def _kernels() -> list[str]:
    """Modules that Numba compiles: what follows the coverage of Python would be compiled along."""
    package = Path(__file__).parents[2] / "raytracer"
    found = []
    for path in package.rglob("*.py"):
        if re.search(r"raytracer\.core\.(compiler|simd|vec)|\bnumba\b", path.read_text(encoding="utf-8")):
            parts = path.relative_to(package.parent).with_suffix("").parts
            found.append(".".join(parts[:-1] if parts[-1] == "__init__" else parts))
    return found


def _parsers(names: Sequence[str]) -> set[str]:
    """Packages that the targets name; read off their sources, since importing a target imports them."""
    packages = set[str]()
    for name in names:
        source = (Path(__file__).parent / "targets" / f"{name}.py").read_text(encoding="utf-8")
        if match := re.search(r"^PARSERS = \((.*)\)$", source, re.MULTILINE):
            packages.update(re.findall(r'"(\w+)"', match[1]))
    return packages


# ---- The runs


@dataclass
class _Run:
    """One target in one process at a time: what it may still spend, and what came of it."""

    target: harness.Target
    number: int
    seed: int
    seconds: float | None
    executions: int | None
    timeout: int
    folder: Path
    corpus: Path
    memory: mmap.mmap = field(default_factory=lambda: mmap.mmap(-1, _HEADER.size + _KEPT))
    process: int = 0
    began: float = 0.0
    done: int = 0
    spent: float = 0.0
    restarts: int = 0
    deaths: int = 0
    edges: int = 0
    features: int = 0
    slow: int = 0

    @property
    def log(self) -> Path:
        return self.folder / "log"

    def exhausted(self) -> bool:
        """Tell if nothing is left of time or executions."""
        return (
            self.deaths >= _MOST_DEATHS
            or (self.seconds is not None and self.spent >= self.seconds)
            or (self.executions is not None and self.done >= self.executions)
        )


def _fuzzed(targets, options, scratch: Path, findings: Path, began: float) -> list[_Run]:
    """Run all targets, `options.jobs` at a time."""
    a_target = max(1, options.jobs // len(targets))
    runs = []
    for number, target in enumerate(t for t in targets for _ in range(a_target)):
        folder = scratch / f"{target.name}-{number}"
        corpus = (options.corpus or scratch / "corpus") / target.name
        for path in (folder / "files", corpus, findings):
            path.mkdir(parents=True, exist_ok=True)
        executions = math.ceil(options.executions / a_target) if options.executions else None
        runs.append(_Run(target, number, options.seed + number, None, executions, options.timeout, folder, corpus))
    waiting, running = deque(runs), list[_Run]()
    try:
        while waiting or running:
            while waiting and len(running) < options.jobs:
                run = waiting.popleft()
                if options.seconds is not None and run.seconds is None:
                    left = options.seconds - (time.monotonic() - began)
                    run.seconds = max(1.0, left / max(1, math.ceil((len(waiting) + 1) / options.jobs)))
                _start(run, findings)
                running.append(run)
            time.sleep(_POLL)
            for run in list(running):
                if _ended(run, findings):
                    running.remove(run)
                    if not run.exhausted():
                        waiting.appendleft(run)
    except KeyboardInterrupt:
        for run in running:
            with contextlib.suppress(ProcessLookupError):
                os.kill(run.process, signal.SIGKILL)
            os.waitpid(run.process, 0)
            _account(run)
    return runs


def _start(run: _Run, findings: Path) -> None:
    _HEADER.pack_into(run.memory, 0, 0, 0.0, 0)
    run.began = time.monotonic()
    run.process = os.fork()
    if run.process == 0:
        status = 1
        try:
            _fuzz(run, findings)
            status = 0
        except BaseException:  # noqa: BLE001
            faulthandler.dump_traceback(all_threads=False)
            sys.excepthook(*sys.exc_info())
        finally:
            os._exit(status)


def _ended(run: _Run, findings: Path) -> bool:
    """Tell if the run's process has ended; the reason is written down."""
    process, status = os.waitpid(run.process, os.WNOHANG)
    if process == 0:
        _, since, _ = _HEADER.unpack_from(run.memory)
        if since and time.monotonic() - since > _STUCK * run.timeout:
            os.kill(run.process, signal.SIGKILL)
        return False
    _account(run)
    if status:
        run.deaths += 1
        _write_down(run, os.waitstatus_to_exitcode(status), findings)
    run.restarts += 1
    return True


def _account(run: _Run) -> None:
    executions, _, _ = _HEADER.unpack_from(run.memory)
    run.done += executions
    run.spent += time.monotonic() - run.began
    text = run.log.read_text(encoding="utf-8", errors="replace")
    if found := re.findall(r"cov: (\d+) ft: (\d+)", text):
        run.edges, run.features = max(run.edges, int(found[-1][0])), max(run.features, int(found[-1][1]))


def _write_down(run: _Run, code: int, findings: Path) -> None:
    """Keep the input that ended a process: executed once more, so that its stack can be told."""
    _, since, length = _HEADER.unpack_from(run.memory)
    log = run.log.read_text(encoding="utf-8", errors="replace")
    if not since:
        raise RuntimeError(f"{run.target.name} ended with {code} outside of any execution:\n{log[-2000:]}")
    data = run.memory[_HEADER.size : _HEADER.size + length]
    again, stack = _once_more(run, data)
    if again == 0 and "ERROR: libFuzzer: timeout" in log:
        run.slow += 1
        return
    kind = "hang" if "Timeout (" in stack or again == -signal.SIGKILL else "memory" if code == 71 else "crash"
    if again == 0:
        Finding(run.target.name, f"{kind}-once", data, log[-20000:]).write(findings)
    else:
        of_stack(run.target.name, kind, stack, data).write(findings)


def _once_more(run: _Run, data: bytes) -> tuple[int, str]:
    """Execute one input in a process of its own: its exit status, 0 if nothing happened, and its stack at the end."""
    path = run.folder / "stack"
    process = os.fork()
    if process == 0:
        try:
            with open(path, "w", encoding="utf-8") as stack:
                faulthandler.enable(stack)
                faulthandler.dump_traceback_later(run.timeout, exit=True, file=stack)
                with harness.strict(), contextlib.suppress(BaseException):
                    harness.execute(run.target, data, run.folder / "files")
        finally:
            os._exit(0)
    deadline = time.monotonic() + _STUCK * run.timeout
    while (ended := os.waitpid(process, os.WNOHANG))[0] == 0:
        if time.monotonic() > deadline:
            os.kill(process, signal.SIGKILL)
        time.sleep(_POLL)
    return os.waitstatus_to_exitcode(ended[1]), path.read_text(encoding="utf-8", errors="replace")


# ---- Within a target's process


def _fuzz(run: _Run, findings: Path) -> None:
    """Execute the target until its time or executions are spent; does not return."""
    import atheris

    log = open(run.log, "w", encoding="utf-8")  # noqa: SIM115
    os.dup2(log.fileno(), 1)
    os.dup2(log.fileno(), 2)
    faulthandler.enable(log)
    files = run.folder / "files"
    os.chdir(files)
    for number, seed in enumerate(run.target.seeds()):
        (run.corpus / f"seed-{number:03d}").write_bytes(seed)
    for path in (harness.CORPUS / run.target.name).glob("*"):
        (run.corpus / path.name).write_bytes(path.read_bytes())

    memory, done = run.memory, 0
    used, asked = _Peak(b"VmHWM:"), _Peak(b"VmPeak:")

    def execute(data: bytes) -> None:
        nonlocal done
        memory[_HEADER.size : _HEADER.size + min(len(data), _KEPT)] = data[:_KEPT]
        _HEADER.pack_into(memory, 0, done, time.monotonic(), len(data))
        try:
            harness.execute(run.target, data, files)
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # noqa: BLE001
            harness.of_exception(run.target.name, error, data).write(findings)
        for peak, limit in ((used, harness.MEMORY_LIMIT), (asked, run.target.address_limit)):
            if (taken := peak.rise()) > limit:
                text = f"{peak.name} rose by {taken / 2**20:.0f} MB for {len(data)} bytes\n"
                Finding(run.target.name, f"memory-{peak.name}", data, text).write(findings)
        harness.emptied(files)
        done += 1
        _HEADER.pack_into(memory, 0, done, 0.0, 0)

    arguments = [
        run.target.name,
        f"-seed={run.seed + 1000 * run.restarts}",
        f"-timeout={run.timeout}",
        f"-rss_limit_mb={_RSS_LIMIT}",
        f"-max_len={run.target.max_length}",
        f"-artifact_prefix={run.folder}/",
        *(f"-handle_{name}=0" for name in ("segv", "bus", "abrt", "ill", "fpe")),
    ]
    if run.seconds is not None:
        arguments.append(f"-max_total_time={max(1, round(run.seconds - run.spent))}")
    if run.executions is not None:
        arguments.append(f"-runs={run.executions - run.done}")
    if run.target.dictionary:
        words = run.folder / "words"
        escaped = ("".join(f"\\x{byte:02x}" for byte in word) for word in run.target.dictionary)
        words.write_text("".join(f'"{word}"\n' for word in escaped), encoding="ascii")
        arguments.append(f"-dict={words}")
    with harness.strict():
        atheris.Setup([*arguments, str(run.corpus)], execute)
        atheris.Fuzz()


class _Peak:
    """The most memory that this process has used so far (VmHWM), or the most address space that it had (VmPeak)."""

    def __init__(self, key: bytes) -> None:
        self._key = key
        self._status = os.open("/proc/self/status", os.O_RDONLY)
        self._held = self._now()

    @property
    def name(self) -> str:
        return self._key.decode("ascii").rstrip(":")

    def _now(self) -> int:
        text = os.pread(self._status, 4096, 0)
        return 1024 * int(text[text.index(self._key) + len(self._key) :].split(None, 1)[0])

    def rise(self) -> int:
        """Bytes by which it has risen since it was asked last."""
        before, self._held = self._held, self._now()
        return self._held - before


def _reproduced(target: harness.Target, file: Path) -> int:
    began = time.monotonic()
    faulthandler.enable()
    faulthandler.dump_traceback_later(harness.SECONDS_LIMIT, exit=True)
    data = file.read_bytes()
    with tempfile.TemporaryDirectory() as folder, harness.strict():
        try:
            target.run(data, Path(folder))
            print("loaded", end="")
        except (harness.InputError, harness.OutputError) as error:
            print(f"refused: {error}", end="")
    print(f" ({time.monotonic() - began:.3f} s)")
    return 0


# ---- What came of it


def _results(runs: Sequence[_Run], findings: Path) -> list[dict[str, object]]:
    results = []
    for name in dict.fromkeys(run.target.name for run in runs):
        own = [run for run in runs if run.target.name == name]
        executions, seconds = sum(run.done for run in own), sum(run.spent for run in own)
        results.append(
            {
                "target": name,
                "executions": executions,
                "seconds": round(seconds, 1),
                "executions_per_second": round(executions / seconds, 1) if seconds else 0.0,
                "edges": max(run.edges for run in own),
                "features": max(run.features for run in own),
                "slow_once": sum(run.slow for run in own),
                "findings": findings_in(findings, name),
            }
        )
    return results


def _show(results: Sequence[dict[str, object]], findings: Path) -> None:
    head = ("target", "executions", "a second", "edges", "features", "findings")
    keys = ("target", "executions", "executions_per_second", "edges", "features")
    rows = [[str(result[key]) for key in keys] + [str(len(result["findings"]))] for result in results]
    rows.append(["all", str(sum(result["executions"] for result in results)), "", "", "", ""])
    widths = [max(len(row[i]) for row in [head, *rows]) for i in range(len(head))]
    for row in [head, *rows]:
        cells = (
            cell.ljust(width) if i == 0 else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        )
        print("  ".join(cells).rstrip())
    for result in results:
        for name in result["findings"]:
            print(f"  {findings / str(result['target']) / name}.txt")


if __name__ == "__main__":
    sys.exit(main())
