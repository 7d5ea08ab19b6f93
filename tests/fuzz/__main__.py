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
import subprocess
import sys
import tempfile
import time
from collections import deque
from pathlib import Path

from tests.fuzz import harness
from tests.fuzz.harness import SECONDS_LIMIT, findings_in, write_exception, write_finding, write_stack

# Forked processes must not rely on threads that stayed behind.
os.environ["OPENBLAS_NUM_THREADS"] = "1"
os.environ["OMP_NUM_THREADS"] = "1"

ROOT = Path(__file__).parents[2]

_DEFAULT_SECONDS = 60.0
_IN_MEMORY = "/dev/shm"
"""Linux has files in memory there: an execution writes one, which a busy disk would wait for."""

_PARSERS = ("zipfile", "configparser")
"""Packages written in Python that parse for loaders, whose coverage is followed along with raytracer's.

What is imported before is not instrumented, so that this module imports no more than it needs.
"""

_RSS_LIMIT = 2048
_POLL = 0.02

_HEADER = struct.Struct("<QdQ")
"""In memory shared with a target's process: executions so far, start of the one under way or 0, length of its input."""
_KEPT = 2**20

_MOST_DEATHS = 3
"""After which a target is left: it has findings, and each time costs as much as thousands of executions."""

_STUCK = 3
"""Limits of time after which a process is killed that libFuzzer's alarm could not end."""


def main(arguments=None):
    options = _options(arguments)
    try:
        import atheris
    except ImportError:
        if (platform.system(), platform.machine()) == ("Linux", "x86_64"):
            print("fuzzing needs atheris: pip install atheris", file=sys.stderr)
            return 2
        print("fuzzing is skipped: atheris has wheels for Linux on x86-64 alone")
        return 0

    began = time.monotonic()
    known = harness.target_names()
    unknown = [name for name in options.targets if name not in (*known, "planted", "planted_hang")]
    if unknown:
        print(f"no target {unknown[0]!r}; known: {', '.join(known)}", file=sys.stderr)
        return 2
    included = ["raytracer", "tests", *_PARSERS]
    atheris.instrument_imports(included, exclude=_kernels(), enable_loader_override=False).__enter__()
    with open(os.devnull, "w") as nowhere, contextlib.redirect_stderr(nowhere):
        targets = [harness.load_target(name) for name in options.targets or known]
    if options.reproduce:
        return _reproduced(targets[0], options.reproduce, options.timeout)

    options.findings = options.findings or Path(tempfile.mkdtemp(prefix="rt-findings-"))
    memory = _IN_MEMORY if os.access(_IN_MEMORY, os.W_OK) else None
    with tempfile.TemporaryDirectory(prefix="rt-fuzz-", dir=memory, ignore_cleanup_errors=True) as scratch:
        runs = _fuzzed(targets, options, Path(scratch), began)
    results = [_result([run for run in runs if run.target is target]) for target in targets]
    if options.json:
        print(json.dumps(results, indent=2))
    else:
        _show(results, options.findings)
    return int(any(result["findings"] for result in results))


def _options(arguments):
    parser = argparse.ArgumentParser(
        prog="python -m tests.fuzz", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("targets", nargs="*", metavar="TARGET", help="what to fuzz (all)")
    add("--seconds", type=float, help=f"how long all of it takes ({_DEFAULT_SECONDS:g})")
    add("--executions", type=int, help="how often each target is executed at most")
    add("--jobs", type=int, default=1, help="processes at a time (1)")
    add("--seed", type=int, default=1, help="of libFuzzer's random numbers (1)")
    add("--findings", type=Path, metavar="FOLDER", help="where what is found goes (a temporary folder)")
    add("--corpus", type=Path, metavar="FOLDER", help="where inputs that reach new code are kept")
    add("--timeout", type=int, default=SECONDS_LIMIT, help=f"s for one input ({SECONDS_LIMIT})")
    add("--json", action="store_true", help="print the table as JSON")
    add("--reproduce", type=Path, metavar="FILE", help="execute the one target on this input")
    options = parser.parse_args(arguments)
    if options.seconds is None and options.executions is None:
        options.seconds = _DEFAULT_SECONDS
    return options


def _kernels():
    """Modules that Numba compiles: what follows the coverage of Python would be compiled along."""
    for path in (ROOT / "raytracer").rglob("*.py"):
        if re.search(r"raytracer\.core\.(compiler|simd|vec)|\bnumba\b", path.read_text(encoding="utf-8")):
            yield ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


# ---- The runs


class _Run:
    """One target in one process at a time: what it may still spend, and what came of it."""

    def __init__(self, target, number, executions, options, scratch):
        self.target, self.executions, self.timeout = target, executions, options.timeout
        self.seed, self.seconds = options.seed + number, None
        self.folder = scratch / f"{target.name}-{number}"
        self.corpus = (options.corpus or scratch / "corpus") / target.name
        self.findings = options.findings / target.name
        self.log, self.files = self.folder / "log", self.folder / "files"
        for path in (self.files, self.corpus):
            path.mkdir(parents=True, exist_ok=True)
        self.memory = mmap.mmap(-1, _HEADER.size + _KEPT)
        self.process = self.done = self.restarts = self.deaths = self.edges = self.features = self.slow = 0
        self.began = self.spent = 0.0

    def exhausted(self):
        """Tell if nothing is left of time or executions."""
        return (
            self.deaths >= _MOST_DEATHS
            or (self.seconds is not None and self.spent >= self.seconds)
            or (self.executions is not None and self.done >= self.executions)
        )

    def start(self):
        _HEADER.pack_into(self.memory, 0, 0, 0.0, 0)
        self.began = time.monotonic()
        self.process = os.fork()
        if self.process == 0:
            try:
                _fuzz(self)
            except BaseException:  # noqa: BLE001
                sys.excepthook(*sys.exc_info())
            finally:
                os._exit(1)

    def ended(self):
        """Tell if the process has ended; the reason is written down."""
        process, status = os.waitpid(self.process, os.WNOHANG)
        if process == 0:
            _, since, _ = _HEADER.unpack_from(self.memory)
            if since and time.monotonic() - since > _STUCK * self.timeout:
                os.kill(self.process, signal.SIGKILL)
            return False
        self.account()
        if status:
            self.deaths += 1
            self._write_down(os.waitstatus_to_exitcode(status))
        self.restarts += 1
        return True

    def account(self):
        executions, _, _ = _HEADER.unpack_from(self.memory)
        self.done += executions
        self.spent += time.monotonic() - self.began
        for edges, features in re.findall(r"cov: (\d+) ft: (\d+)", self._logged())[-1:]:
            self.edges, self.features = max(self.edges, int(edges)), max(self.features, int(features))

    def _logged(self):
        return self.log.read_text(encoding="utf-8", errors="replace")

    def _write_down(self, code):
        """Keep the input that ended a process: executed once more, so that its stack can be told."""
        _, since, length = _HEADER.unpack_from(self.memory)
        if not since:
            raise RuntimeError(
                f"{self.target.name} ended with {code} outside of any execution:\n{self._logged()[-2000:]}"
            )
        data = self.memory[_HEADER.size : _HEADER.size + length]
        again, stack = self._once_more(data)
        if again == 0 and "ERROR: libFuzzer: timeout" in self._logged():
            self.slow += 1
            return
        kind = "hang" if "Timeout (" in stack or again == -signal.SIGKILL else "memory" if code == 71 else "crash"
        if again == 0:
            write_finding(self.findings, f"{kind}-once", data, self._logged()[-20000:])
        else:
            write_stack(self.findings, kind, stack, data)

    def _once_more(self, data):
        """Execute one input in a process of its own: its exit status, 0 if nothing happened, and what it said."""
        path = self.folder / "input"
        path.write_bytes(data)
        command = [sys.executable, "-m", "tests.fuzz", self.target.name, "--timeout", str(self.timeout)]
        said = {"capture_output": True, "text": True, "errors": "replace"}
        done = subprocess.run([*command, "--reproduce", path], cwd=ROOT, check=False, **said)
        return done.returncode, done.stderr


def _fuzzed(targets, options, scratch, began):
    """Run all targets, `options.jobs` at a time."""
    each = max(1, options.jobs // len(targets))
    executions = math.ceil(options.executions / each) if options.executions else None
    many = (target for target in targets for _ in range(each))
    runs = [_Run(target, number, executions, options, scratch) for number, target in enumerate(many)]
    waiting, running = deque(runs), []
    try:
        while waiting or running:
            while waiting and len(running) < options.jobs:
                run = waiting.popleft()
                if options.seconds is not None and run.seconds is None:
                    left = options.seconds - (time.monotonic() - began)
                    run.seconds = max(1.0, left / max(1, math.ceil((len(waiting) + 1) / options.jobs)))
                run.start()
                running.append(run)
            time.sleep(_POLL)
            for run in list(running):
                if run.ended():
                    running.remove(run)
                    if not run.exhausted():
                        waiting.appendleft(run)
    except KeyboardInterrupt:
        for run in running:
            with contextlib.suppress(ProcessLookupError):
                os.kill(run.process, signal.SIGKILL)
            os.waitpid(run.process, 0)
            run.account()
    return runs


# ---- Within a target's process


def _fuzz(run):
    """Execute the target until its time or executions are spent; does not return."""
    import atheris

    log = open(run.log, "w", encoding="utf-8")  # noqa: SIM115
    os.dup2(log.fileno(), 1)
    os.dup2(log.fileno(), 2)
    faulthandler.enable(log)
    os.chdir(run.files)
    for number, seed in enumerate(run.target.seeds()):
        (run.corpus / f"seed-{number:03d}").write_bytes(seed)
    for path in (harness.CORPUS / run.target.name).glob("*"):
        (run.corpus / path.name).write_bytes(path.read_bytes())

    memory, done = run.memory, 0
    status = os.open("/proc/self/status", os.O_RDONLY)
    peaks = _peaks(status)

    def execute(data):
        nonlocal done, peaks
        memory[_HEADER.size : _HEADER.size + min(len(data), _KEPT)] = data[:_KEPT]
        _HEADER.pack_into(memory, 0, done, time.monotonic(), len(data))
        try:
            harness.execute(run.target, data, run.files)
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # noqa: BLE001
            write_exception(run.findings, error, data)
        before, peaks = peaks, _peaks(status)
        limits = {"VmPeak": run.target.address_limit, "VmHWM": harness.MEMORY_LIMIT}
        for (name, limit), least, most in zip(limits.items(), before, peaks, strict=True):
            if (taken := most - least) > limit:
                text = f"{name} rose by {taken / 2**20:.0f} MB for {len(data)} bytes\n"
                write_finding(run.findings, f"memory-{name}", data, text)
        harness.emptied(run.files)
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


def _peaks(status):
    """The most address space (bytes) that this process has had so far, VmPeak, and the most memory, VmHWM."""
    return [1024 * int(kilobytes) for kilobytes in re.findall(rb"Vm(?:HWM|Peak):\s+(\d+)", os.pread(status, 4096, 0))]


def _reproduced(target, file, timeout):
    began = time.monotonic()
    faulthandler.enable()
    faulthandler.dump_traceback_later(timeout, exit=True)
    with tempfile.TemporaryDirectory() as folder, harness.strict():
        try:
            target.run(file.read_bytes(), Path(folder))
            print("loaded", end="")
        except (harness.InputError, harness.OutputError) as error:
            print(f"refused: {error}", end="")
    print(f" ({time.monotonic() - began:.3f} s)")
    return 0


# ---- What came of it


def _result(runs):
    """What came of the runs of a target."""
    executions, seconds = sum(run.done for run in runs), sum(run.spent for run in runs)
    return {
        "target": runs[0].target.name,
        "executions": executions,
        "seconds": round(seconds, 1),
        "executions_per_second": round(executions / seconds, 1) if seconds else 0.0,
        "edges": max(run.edges for run in runs),
        "features": max(run.features for run in runs),
        "slow_once": sum(run.slow for run in runs),
        "findings": findings_in(runs[0].findings),
    }


def _show(results, findings):
    from rich.console import Console
    from rich.table import Table

    table = Table("target", "executions", "a second", "edges", "features", "findings", box=None)
    for result in results:
        keys = ("target", "executions", "executions_per_second", "edges", "features")
        table.add_row(*(str(result[key]) for key in keys), str(len(result["findings"])))
    table.add_row("all", str(sum(result["executions"] for result in results)))
    Console().print(table)
    for result in results:
        for name in result["findings"]:
            print(f"  {findings / result['target'] / name}.txt")


if __name__ == "__main__":
    sys.exit(main())
