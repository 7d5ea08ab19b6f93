"""Processors and memory that are left to this process, also inside of containers and jobs."""

import contextlib
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple


def available_threads() -> int:
    """Count the processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class MemoryLimit(NamedTuple):
    """Bytes that this process may add to its memory, and the source of this limit."""

    bytes: int
    source: str


def memory_limits() -> Iterator[MemoryLimit]:
    """List all limits of the memory that this process may add, as far as they are known here."""
    import psutil

    machine = psutil.virtual_memory()
    yield MemoryLimit(int(machine.available) + int(psutil.swap_memory().free), "free on this machine")
    with contextlib.suppress(ImportError):
        # Windows has none.
        import resource

        soft, _ = resource.getrlimit(resource.RLIMIT_AS)
        if soft != resource.RLIM_INFINITY:
            left = max(0, soft - int(psutil.Process().memory_info().vms))
            yield MemoryLimit(left, "left of the limit on this process's address space (ulimit -v)")
    if sys.platform == "linux":
        left_in_group = cgroup_bytes_left()
        if left_in_group is not None:
            yield MemoryLimit(left_in_group, "left of the limit on this control group (container or job)")


def cgroup_bytes_left(mounts: Path = Path("/sys/fs/cgroup"), groups: Path = Path("/proc/self/cgroup")) -> int | None:
    """Return the bytes that the control groups of this process leave it; None where none has a limit.

    mounts, groups : folder in which Linux shows the groups, and file that lists those of this process.

    References: Linux, Documentation/admin-guide/cgroup-v2.rst (memory.max, memory.current, memory.stat) and
        cgroup-v1/memory.rst.
    """
    with contextlib.suppress(OSError):
        lines = [line.split(":", 2) for line in groups.read_text().splitlines()]
        left: list[int] = []
        for line in lines:
            if len(line) != 3:
                continue
            _, controllers, path = line
            if controllers == "":
                left += _each_cgroup_left(mounts, path, _V2)
            elif "memory" in controllers.split(","):
                left += _each_cgroup_left(mounts / "memory", path, _V1)
        return min(left, default=None)
    return None


# Files of a control group: limit, memory in use, limit and use of swap; and the entry of memory.stat for pages that the
# system gives back at need.
_V2 = ("memory.max", "memory.current", "memory.swap.max", "memory.swap.current", "file")
_V1 = ("memory.limit_in_bytes", "memory.usage_in_bytes", "", "", "total_cache")


def _each_cgroup_left(mount: Path, path: str, names: tuple[str, ...]) -> Iterator[int]:
    """List the bytes that a group, and each that it is in, leave."""
    import psutil

    inside = [part for part in path.split("/") if part not in ("", "..", ".")]
    for depth in range(len(inside), -1, -1):
        folder = mount.joinpath(*inside[:depth])
        most, now, swap_most, swap_now = (_number(folder / name) if name else None for name in names[:4])
        if most is None or now is None:
            continue
        cached = 0
        with contextlib.suppress(OSError, ValueError):
            statistics = dict(line.split(None, 1) for line in (folder / "memory.stat").read_text().splitlines())
            cached = int(statistics.get(names[4], 0))
        swap = int(psutil.swap_memory().free)
        if swap_most is not None:
            swap = min(swap, max(0, swap_most - (swap_now or 0)))
        yield max(0, most - now + cached + swap)


def _number(path: Path) -> int | None:
    """Read the number in a file; None if there is none, as where it says `max`."""
    with contextlib.suppress(OSError, ValueError):
        return int(path.read_text())
    return None
