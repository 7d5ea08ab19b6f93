"""One execution of a target: what it may raise, and how what it must not raise is written down."""

import contextlib
import importlib
import pkgutil
import shutil
import traceback
import warnings
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

import raytracer
from raytracer.util.errors import InputError, OutputError, SceneWarning
from tests.fuzz import targets

CORPUS = Path(__file__).parent / "corpus"
"""What fuzzing has found, a folder a target; each is loaded by a test since."""

SECONDS_LIMIT = 5
"""Longer than this no input may take."""

MEMORY_LIMIT = 2**29
"""Bytes of memory that an input of a few kilobytes may take at most."""

ADDRESS_LIMIT = 2**30
"""Bytes of address space that one may ask for at most, whether it is used or not."""

MAX_LENGTH = 4096

_SOURCES = Path(raytracer.__file__).parent
_OF_TARGETS = Path(targets.__file__).parent


@dataclass(frozen=True, slots=True)
class Target:
    """A loader that is fuzzed; its module says how (`tests/fuzz/targets/__init__.py`)."""

    name: str
    seeds: Callable[[], Iterable[bytes]]
    run: Callable[[bytes, Path], None]
    max_length: int
    dictionary: tuple[bytes, ...]
    address_limit: int


def target_names() -> list[str]:
    return sorted(
        module.name for module in pkgutil.iter_modules(targets.__path__) if not module.name.startswith(("_", "planted"))
    )


def load_target(name: str) -> Target:
    module = importlib.import_module(f"{targets.__name__}.{name}")
    return Target(
        name,
        module.seeds,
        module.run,
        getattr(module, "MAX_LENGTH", MAX_LENGTH),
        tuple(getattr(module, "DICTIONARY", ())),
        getattr(module, "ADDRESS_LIMIT", ADDRESS_LIMIT),
    )


@contextlib.contextmanager
def strict() -> Iterator[None]:
    """Numerical and other warnings are errors: users would read them among the sentences. Those for users are not."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for harmless in (SceneWarning, DeprecationWarning, PendingDeprecationWarning, ResourceWarning):
            warnings.simplefilter("ignore", harmless)
        yield


def execute(target: Target, data: bytes, folder: Path) -> None:
    """Load `data`; what is raised is no refusal."""
    with contextlib.suppress(InputError, OutputError):
        target.run(data, folder)


def emptied(folder: Path) -> None:
    """Remove what an execution has left in its folder."""
    for path in folder.iterdir():
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        else:
            path.unlink()


# ---- Findings


@dataclass(frozen=True, slots=True)
class Finding:
    """A mistake, by where it lies; `data` is the shortest input that showed it, `text` the traceback."""

    target: str
    name: str
    data: bytes
    text: str

    def write(self, folder: Path) -> None:
        """Keep it in `folder`, unless there is a shorter input for the same mistake."""
        place = folder / self.target
        place.mkdir(parents=True, exist_ok=True)
        path = place / f"{self.name}.input"
        if path.exists() and path.stat().st_size <= len(self.data):
            return
        path.write_bytes(self.data)
        path.with_suffix(".txt").write_text(self.text, encoding="utf-8")


def of_exception(target: str, error: BaseException, data: bytes) -> Finding:
    """The finding that `error` is, named by its class and the innermost line of raytracer that it went through."""
    where = _innermost(error.__traceback__)
    text = "".join(traceback.format_exception(error, limit=-200, chain=True))
    return Finding(target, f"{type(error).__name__}-{where}", data, text)


def of_stack(target: str, kind: str, stack: str, data: bytes) -> Finding:
    """The finding of a process that ended without an exception, by the stack that `faulthandler` wrote."""
    for line in stack.splitlines():
        if '", line ' in line and (place := _place(Path(line.split('"')[1]))):
            number = line.split('", line ')[1].split()[0]
            return Finding(target, f"{kind}-{place}-{number}", data, stack)
    return Finding(target, f"{kind}-unknown", data, stack)


def _innermost(trace: TracebackType | None) -> str:
    found = "nowhere"
    while trace is not None:
        if place := _place(Path(trace.tb_frame.f_code.co_filename)):
            found = f"{place}-{trace.tb_lineno}"
        trace = trace.tb_next
    return found


def _place(file: Path) -> str | None:
    """`plenoptic.lf` of a source file of raytracer, `targets.lf` of a target's; None of any other."""
    for folder, prefix in ((_SOURCES, ()), (_OF_TARGETS, ("targets",))):
        if file.is_relative_to(folder):
            return ".".join((*prefix, *file.relative_to(folder).with_suffix("").parts))
    return None


def findings_in(folder: Path, target: str) -> list[str]:
    """Names of what has been found."""
    return sorted(path.stem for path in (folder / target).glob("*.input"))
