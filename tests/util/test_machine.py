"""What the machine leaves a process."""

import subprocess
import sys
from types import SimpleNamespace

import pytest

from raytracer.util.machine import cgroup_bytes_left, memory_limits


def bytes_left(folder, groups, swap, files):
    """Return what control groups leave, of a free swap space and these files of theirs."""
    (folder / "cgroup").write_text(groups)
    for name, text in files.items():
        path = folder / "mount" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"{text}\n")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("psutil.swap_memory", lambda: SimpleNamespace(free=swap))
        return cgroup_bytes_left(folder / "mount", folder / "cgroup")


# Linux's cgroup-v2.rst: memory.max holds for a group and all in it; cached files are given back.
V2 = "0::/job/step\n"
FREE = {"job/step/memory.max": "max", "job/step/memory.current": 500}
JOB = FREE | {"job/memory.max": 1000, "job/memory.current": 700}
CACHED = JOB | {"job/memory.stat": "anon 600\nfile 100"}
SWAP = JOB | {"job/memory.swap.max": "max"}
# cgroup-v1/memory.rst.  A container that does not see its own place sees its limits at the root.
V1 = "9:cpu:/docker/1a\n4:memory:/docker/1a\n0::/\nnonsense\n"
OLD = {"memory/memory.limit_in_bytes": 1000, "memory/memory.usage_in_bytes": 900}


@pytest.mark.parametrize(
    ("groups", "swap", "files", "left"),
    [
        (V2, 0, {}, None),
        (V2, 0, FREE, None),
        (V2, 0, JOB, 300),
        (V2, 0, CACHED, 400),
        (V2, 0, CACHED | {"job/step/memory.max": 600}, 100),
        (V2, 0, CACHED | {"job/step/memory.max": 400}, 0),
        (V2, 5000, SWAP, 5300),
        ("0::/\n", 5000, {"memory.max": 1000, "memory.current": 700, "memory.swap.max": "max"}, 5300),
        (V2, 5000, SWAP | {"job/memory.swap.max": 50, "job/memory.swap.current": 20}, 330),
        (V1, 0, OLD | {"memory/memory.stat": "total_cache 150\nbroken"}, 100),
        (V1, 0, OLD | {"memory/memory.stat": "cache 0\ntotal_cache 150"}, 250),
        (V1, 0, OLD, 100),
    ],
)
def test_control_groups_leave_the_least_of_what_each_does(tmp_path, groups, swap, files, left):
    assert bytes_left(tmp_path, groups, swap, files) == left
    assert cgroup_bytes_left(tmp_path, tmp_path / "nowhere") is None


def test_this_machine_has_limits_above_nothing():
    found = list(memory_limits())
    assert found[0].source == "free on this machine"
    assert all(limit.bytes > 0 for limit in found)


_LIMITED = """
import resource, sys
from raytracer.util.machine import memory_limits
before = {limit.source: limit.bytes for limit in memory_limits()}
import psutil
_, hard = resource.getrlimit(resource.RLIMIT_AS)
resource.setrlimit(resource.RLIMIT_AS, (psutil.Process().memory_info().vms + 3 * 10**9, hard))
after = {limit.source: limit.bytes for limit in memory_limits()}
(new,) = after.keys() - before.keys()
print(new, after[new])
"""


@pytest.mark.skipif(sys.platform != "linux", reason="a limit on the address space is Linux's to keep")
def test_a_limit_on_the_address_space_counts():
    done = subprocess.run([sys.executable, "-c", _LIMITED], capture_output=True, text=True, check=True, timeout=120)
    assert done.stdout.startswith("left of the limit on this process's address space (ulimit -v) ")
    assert int(done.stdout.split()[-1]) == pytest.approx(3e9, rel=0.05)
