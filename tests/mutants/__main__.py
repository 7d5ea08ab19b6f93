"""Seed faults into copies of the package, one at a time, and see which of them the tests find.

    python -m tests.mutants                            all of faults.yaml, each by the tests near it
    python -m tests.mutants "lambertian*" --jobs 4     those of such names, or of such an area, four at a time
    python -m tests.mutants --whole                    what near tests do not find goes to all quick tests

A test that fails counts only if it passes without the fault.  A run that takes too long, or crashes, counts
as a failure.
"""

import argparse
import fnmatch
import os
import re
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

import psutil
import yaml

from raytracer.core.compiler.cache import WITH_KERNELS
from tests.repository import ROOT

PACKAGE = ROOT / "raytracer"
LIST = Path(__file__).with_name("faults.yaml")

NEAR_SECONDS, WHOLE_SECONDS = 900.0, 5400.0
"""Limits of time for the tests that a fault names, and for all quick tests."""

_PYTEST = ("-x", "-q", "--tb=no", "-m", "not slow and not peer", "-p", "no:cacheprovider", "-n", "0")
_FAILED = re.compile(r"^(?:FAILED|ERROR) (.+?)(?: - .*)?$", re.MULTILINE)

# What the program and its tests do without; all else of the checkout is linked.
_LEFT_OUT = (".venv*", "*.egg-info", ".*_cache", ".hypothesis", "outputs", "build", "dist")


# ---- Faults, each by a snippet of the package, so that code may move between modules


class Fault(NamedTuple):
    """A fault that can be seeded into the package.

    Results are summed up by area; the name says what is wrong then; `old` occurs once in all of the package; `tests`
    are files or folders of tests that should find it, near ones first; or there is a reason why nothing can.
    """

    area: str
    name: str
    old: str
    new: str
    tests: tuple[str, ...]
    reason: str | None = None

    def matches(self, pattern):
        """Tell if a pattern, as of file names, is that of the fault's name or area."""
        return fnmatch.fnmatch(self.name, pattern) or fnmatch.fnmatch(self.area, pattern)


def read_faults():
    """Read the list of faults, in its order."""
    areas = yaml.load(LIST.read_text(encoding="utf-8"), yaml.CSafeLoader)
    return [
        Fault(area, **{**entry, "tests": tuple(entry["tests"].split())})
        for area, entries in areas.items()
        for entry in entries
    ]


def read_sources():
    """Read all modules of the package, by path."""
    return {path: path.read_text(encoding="utf-8") for path in sorted(PACKAGE.rglob("*.py"))}


def find_module(fault, sources):
    """Find the module that holds the text of a fault.

    Raises
    ------
    ValueError : it does not occur exactly once.
    """
    counts = {path: count for path, text in sources.items() if (count := text.count(fault.old))}
    if sum(counts.values()) != 1:
        places = ", ".join(f"{path.relative_to(PACKAGE)} ({count})" for path, count in counts.items()) or "nowhere"
        raise ValueError(f"{fault.name}: its text has to occur once in the package, and does so in: {places}")
    return next(iter(counts))


def seed_fault(fault, source):
    """Return the source of a module with the fault in it."""
    return source.replace(fault.old, fault.new)


# ---- Trying them


class NoVerdictError(Exception):
    """Error that tests say nothing of a fault: there are none, or they fail without it, too."""


def copy_checkout(place):
    """Make a private copy of the checkout in a folder, of hard links if it can have them."""

    def link(source, target):
        try:
            os.link(source, target, follow_symlinks=False)
        except OSError:
            shutil.copy2(source, target)

    ignored = shutil.ignore_patterns(*_LEFT_OUT)
    return Path(shutil.copytree(ROOT, place / "checkout", symlinks=True, ignore=ignored, copy_function=link))


def run_tests(checkout, tests, cache, limit):
    """Run tests in a copy of the checkout: what pytest returned, None after too long, and what it printed.

    cache : folder for compiled kernels; None for the user's own.

    Raises
    ------
    NoVerdictError : another package than that of the copy is imported there.
    """
    environment = {**os.environ, "PYTHONPATH": str(checkout)}
    if cache is not None:
        environment["RAYTRACER_CACHE_DIR"] = str(cache)
    given = {"cwd": checkout, "env": environment, "text": True, "errors": "replace"}
    code = "import importlib.util as util; print(util.find_spec('raytracer').origin, end='')"
    imported = subprocess.check_output([sys.executable, "-c", code], **given)
    if Path(imported) != checkout / "raytracer" / "__init__.py":
        raise NoVerdictError(f"{imported} is imported, and not the copy in {checkout}")
    command = [sys.executable, "-m", "pytest", *_PYTEST, *tests]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, **given)
    try:
        output, _ = process.communicate(timeout=limit)
    except subprocess.TimeoutExpired:
        # Tests have processes of their own.
        for each in [*psutil.Process(process.pid).children(recursive=True), process]:
            each.kill()
        return None, process.communicate()[0]
    return process.returncode, output


class Outcome(NamedTuple):
    """What became of a fault.

    Attributes
    ----------
    fault : which one.
    found_by : the test that fails of it, or the limit of time that it passes, or its crash; None if it survived.
    error : why nothing is known of it, or None.
    seconds : that its tests took.
    """

    fault: Fault
    found_by: str | None
    error: str | None
    seconds: float

    def __str__(self):
        survived = "SURVIVED" + (f" ({self.fault.reason})" if self.fault.reason else "")
        words = self.error or (f"found by {self.found_by}" if self.found_by else survived)
        return f"{self.fault.name}: {words}, {self.seconds:.0f} s"


class Laboratory:
    """Copies of the checkout in a folder: one without a fault, and one for each that is tried."""

    def __init__(self, folder, *, whole):
        self._folder, self._whole = folder, whole
        self._sources, self._clean = read_sources(), copy_checkout(folder)
        self._passes = {}
        self._lock = threading.Lock()

    def _passes_without_fault(self, test):
        with self._lock:
            if test not in self._passes:
                self._passes[test] = run_tests(self._clean, [test], None, NEAR_SECONDS)[0] == 0
            return self._passes[test]

    def _try_tests(self, checkout, tests, cache, limit):
        """Run tests on a copy with a fault: what found it, or None if they all pass."""
        code, output = run_tests(checkout, tests, cache, limit)
        if code is None:
            return f"taking longer than {limit:g} s"
        if code < 0:
            return f"a process that signal {-code} ended"
        if code == 0:
            return None
        failed = _FAILED.findall(output)
        if not failed:
            raise NoVerdictError(f"pytest returned {code}: {' '.join(output.split())[-300:]}")
        if not self._passes_without_fault(failed[0]):
            raise NoVerdictError(f"{failed[0]} fails without the fault, too")
        return failed[0]

    def judge(self, fault):
        """Seed a fault into a copy of its own, and run the tests on that."""
        start, found, wrong = time.monotonic(), None, None
        module = find_module(fault, self._sources)
        with tempfile.TemporaryDirectory(dir=self._folder) as place:
            checkout = copy_checkout(Path(place))
            faulty = checkout / module.relative_to(ROOT)
            # The link first, or the fault would be seeded into the checkout itself.
            faulty.unlink()
            faulty.write_text(seed_fault(fault, self._sources[module]), encoding="utf-8")
            # A fault in packages without kernels leaves those of the checkout as they are.
            dotted = ".".join(module.relative_to(PACKAGE).parts)
            has_kernels = any(dotted.startswith(f"{name}.") for name in WITH_KERNELS)
            cache = Path(place) / "cache" if has_kernels else None
            try:
                found = self._try_tests(checkout, fault.tests, cache, NEAR_SECONDS)
                if found is None and self._whole:
                    found = self._try_tests(checkout, ["tests"], cache, WHOLE_SECONDS)
            except NoVerdictError as error:
                wrong = f"ERROR: {error}"
        return Outcome(fault, found, wrong, time.monotonic() - start)


def summary(outcomes):
    """Sum up what was found: a line an area, and the share of all that can be."""
    lines = []
    for area in dict.fromkeys(outcome.fault.area for outcome in outcomes):
        own = [outcome.found_by is not None for outcome in outcomes if outcome.fault.area == area]
        lines.append(f"{area}: {sum(own)} of {len(own)}")
    found = sum(outcome.found_by is not None for outcome in outcomes)
    excused = sum(outcome.found_by is None and outcome.fault.reason is not None for outcome in outcomes)
    possible = len(outcomes) - excused
    lines.append(f"found {found} of {possible} ({found / max(1, possible):.1%}), and {excused} that nothing can find")
    return "\n".join(lines)


def main():
    """Seed faults and print what becomes of them; 1 if one survives without a reason."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("patterns", nargs="*", metavar="NAME", help="patterns of names or areas (default: all)")
    parser.add_argument("--jobs", type=int, default=1, help="faults that are tried at once (default: 1)")
    parser.add_argument("--list", action="store_true", help="print the faults and where they are, and try none")
    parser.add_argument("--whole", action="store_true", help="give what survives its near tests to all quick tests")
    arguments = parser.parse_args()
    patterns = arguments.patterns or ["*"]
    faults = [fault for fault in read_faults() if any(map(fault.matches, patterns))]
    if arguments.list:
        sources = read_sources()
        for fault in faults:
            print(f"{fault.area}: {fault.name} ({find_module(fault, sources).relative_to(PACKAGE)})")
        return 0
    outcomes = []
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder, ThreadPoolExecutor(arguments.jobs) as pool:
        for outcome in pool.map(Laboratory(Path(folder), whole=arguments.whole).judge, faults):
            outcomes.append(outcome)
            print(outcome, flush=True)
    print(summary(outcomes))
    return int(any(o.error or (o.found_by is None and o.fault.reason is None) for o in outcomes))


if __name__ == "__main__":
    sys.exit(main())
