"""The checks of `rt doctor`: each really tries what renders need, and none depends on another."""

import importlib
import os
import platform
import shutil
import sys
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

import raytracer
from raytracer.analysis.doctor.packages import EXTRAS, REQUIRED, import_failure, installed_version, missing_modules
from raytracer.report.wording import megabytes, plural
from raytracer.util.errors import InputError, one_line
from raytracer.util.machine import available_threads, memory_limits

Status = Literal["ok", "absent", "warning", "failed"]

# A preview of the cover takes half of it.
_LITTLE_MEMORY = 10**9

# What the packages are that decide on speed and on the bits of a picture.
_NAMED = ("numpy", "numba", "llvmlite", "embreex", "Pillow")

# Extensions of x86-64 and of ARM, the widest last.
_VECTORS = ("sse4.2", "avx", "avx2", "fma", "avx512f", "neon", "sve")

_REINSTALL = "pip install --force-reinstall {} installs it anew"


@dataclass(frozen=True)
class Check:
    """The result of a check.

    name : what was checked.
    status : `ok`; `absent` for what is not there and need not be; `warning` for what works and could do better;
        `failed` for what does not work.
    found : what was found, in words.
    remedy : what to do about it; empty where there is nothing to do.
    """

    name: str
    status: Status
    found: str
    remedy: str = ""

    def json(self) -> dict[str, str]:
        """Return the result as plain values."""
        return asdict(self)


def diagnose() -> Iterator[Check]:
    """Do all checks, one after the other; what a check raises is its failure."""
    for name, check in _CHECKS.items():
        yield _attempt(name, check)
    for extra in EXTRAS:
        yield _attempt(f"[{extra}]", lambda extra=extra: _check_extra(extra))  # type: ignore[misc]


def _attempt(name: str, check: Callable[[], tuple[Any, ...]]) -> Check:
    try:
        return Check(name, *check())
    except Exception as error:  # noqa: BLE001
        # Whatever an installation does that is broken, the other checks are still done.
        return Check(name, "failed", one_line(f"{type(error).__name__}: {error}"), _REMEDIES.get(name, ""))


def _check_python() -> tuple[Status, str]:
    return "ok", f"{platform.python_version()}, {platform.system()} {platform.machine()}, {sys.executable}"


def _check_rt() -> tuple[Status, str]:
    return "ok", f"{raytracer.__version__}, {Path(raytracer.__file__).parent}"


def _check_packages() -> tuple[Status, str, str]:
    failures = [failure for package in REQUIRED if (failure := import_failure(package)) is not None]
    if failures:
        return "failed", one_line("; ".join(failures)), _REINSTALL.format("raytracer")
    named = ", ".join(f"{package} {installed_version(package)}" for package in _NAMED)
    return "ok", f"{named}, and {len(REQUIRED) - len(_NAMED)} others", ""


def _check_processor() -> tuple[Status, str, str]:
    from raytracer.analysis.cost.machine import processor
    from raytracer.core.compiler.cache import processor as target

    _, name, features = target().split(" ", 2)
    enabled = {feature[1:] for feature in features.split(",") if feature.startswith("+")}
    vectors = [vector for vector in _VECTORS if vector in enabled]
    found = f"{processor()}; Numba compiles for {name} with {', '.join(vectors) or 'no vector extensions'}"
    if "NUMBA_CPU_NAME" in os.environ or "NUMBA_CPU_FEATURES" in os.environ:
        return "warning", found, "NUMBA_CPU_NAME and NUMBA_CPU_FEATURES say so; without them it is the whole processor"
    if platform.machine() in ("x86_64", "AMD64") and "avx2" not in enabled:
        return (
            "warning",
            found,
            "slower than with AVX2, which a virtual machine may hide",
        )
    return "ok", found, ""


def _check_threads() -> tuple[Status, str, str]:
    threads, processors = available_threads(), os.cpu_count() or 1
    if os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0"):
        remedy = "unset it: what takes seconds takes an hour"
        return "warning", "NUMBA_DISABLE_JIT is set, so that nothing is compiled", remedy
    if threads < processors:
        remedy = "taskset, a container or a job's scheduler keeps this process from the others"
        return "warning", f"{threads} of the machine's {processors} processors", remedy
    return "ok", f"{threads}, one for each processor", ""


def _check_memory() -> tuple[Status, str, str]:
    least = min(memory_limits(), key=lambda limit: limit.bytes)
    found = f"{_gigabytes(least.bytes)} {least.source}"
    if least.bytes < _LITTLE_MEMORY:
        return "warning", found, "large pictures and meshes will be refused; --crop and fewer AOVs take less"
    return "ok", found, ""


def _gigabytes(size: float) -> str:
    return f"{size / 1e9:.3g} GB"


def _check_embree() -> tuple[Status, str]:
    from raytracer.core.embree_library import find_library
    from raytracer.core.trial import DISTANCE, cast_ray, is_exact

    distance = cast_ray()
    if not is_exact(distance):
        return "failed", f"a ray met a triangle at {distance:g} m, which lies at {DISTANCE:g} m"
    return "ok", f"a ray met a triangle where it lies; {find_library().name} of embreex {installed_version('embreex')}"


def _check_compiler() -> tuple[Status, str]:
    from raytracer.core.trial import DISTANCE, cast_ray_in_kernel, is_exact, kernel_source

    distance = cast_ray_in_kernel()
    if not is_exact(distance):
        return "failed", f"a kernel met a triangle at {distance:g} m, which lies at {DISTANCE:g} m"
    return "ok", f"a small kernel was {kernel_source()}, and its ray met the triangle"


def _check_cache() -> tuple[Status, str, str]:
    from raytracer.core.compiler.cache import cache_contents, check_cache

    held = cache_contents()
    found = f"{held.folder}: {held.kernels} {plural(held.kernels, 'kernel')}, {megabytes(held.bytes)}"
    try:
        check_cache()
    except InputError:
        remedy = "each render compiles anew, for seconds: RAYTRACER_CACHE_DIR=FOLDER names a folder that is yours"
        return "warning", f"{found}; it cannot be written, or may be another user's", remedy
    return "ok", found, ""


def _check_folder() -> tuple[Status, str, str]:
    folder = Path.cwd()
    if not os.access(folder, os.W_OK):
        return "warning", f"{folder} cannot be written", "rt render -o FOLDER/NAME.png writes elsewhere"
    return "ok", f"{folder}: {_gigabytes(shutil.disk_usage(folder).free)} free", ""


def _check_terminal() -> tuple[Status, str, str]:
    encoding = (sys.stdout.encoding or "ascii").lower()
    if not sys.stdout.isatty():
        return "ok", f"the output is no terminal: no colour, no bar; {encoding}", ""
    has_colour = not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb"
    found = f"{shutil.get_terminal_size().columns} columns, {'colour' if has_colour else 'no colour'}, {encoding}"
    if encoding != "utf-8":
        return "warning", found, "PYTHONUTF8=1 has names with accents shown as they are"
    return "ok", found, ""


def _check_browser() -> tuple[Status, str, str]:
    import webbrowser

    try:
        browser = webbrowser.get()
    except webbrowser.Error:
        return "absent", "none here", "reports are single files: copy them to where there is one"
    return "ok", f"{getattr(browser, 'name', '') or 'the default one'} opens reports", ""


def _check_extra(extra: str) -> tuple[Status, str, str]:
    gives = EXTRAS[extra].gives
    if missing := missing_modules(extra):
        some = len(missing) < len(EXTRAS[extra].modules)
        found = f"{', '.join(missing)} is missing" if some else "not installed"
        return "absent", found, f"pip install 'raytracer[{extra}]' gives {gives}"
    try:
        if extra == "denoise":
            from raytracer.film.denoise import require_denoiser

            require_denoiser()
        else:
            for module in EXTRAS[extra].modules:
                importlib.import_module(module)
    except Exception as error:  # noqa: BLE001
        # Also of a package that is damaged, and raises whatever it likes.
        return "failed", one_line(f"{type(error).__name__}: {error}"), _REINSTALL.format(f"'raytracer[{extra}]'")
    return "ok", gives, ""


_CHECKS: dict[str, Callable[[], tuple[Any, ...]]] = {
    "Python": _check_python,
    "rt": _check_rt,
    "packages": _check_packages,
    "processor": _check_processor,
    "threads": _check_threads,
    "memory": _check_memory,
    "Embree": _check_embree,
    "compiler": _check_compiler,
    "cache": _check_cache,
    "folder": _check_folder,
    "terminal": _check_terminal,
    "browser": _check_browser,
}

_REMEDIES = {
    "processor": _REINSTALL.format("llvmlite"),
    "memory": _REINSTALL.format("psutil"),
    "Embree": _REINSTALL.format("embreex") + ", for Linux on x86-64, macOS 13 on Apple's processors, or Windows",
    "compiler": _REINSTALL.format("'numba<0.69' llvmlite embreex"),
    "cache": "RAYTRACER_CACHE_DIR=FOLDER names a folder that is yours",
    "folder": "go to a folder that exists",
}
"""Advice where a check raised something."""
