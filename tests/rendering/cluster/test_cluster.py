"""Renders by a Dask scheduler and workers that are processes of their own on this machine."""

import os
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

import numpy as np
import pytest

from raytracer.cli.base.app import main
from raytracer.rendering import worker_pool
from raytracer.rendering.checkpoint import CheckpointWriter
from raytracer.rendering.cluster import connection, executor
from raytracer.rendering.cluster.connection import Cluster
from raytracer.rendering.cluster.worker import Fingerprint, find_mismatch, fingerprint
from raytracer.rendering.options import RenderOptions
from raytracer.rendering.render import render
from raytracer.rendering.worker_pool import WorkerPool
from raytracer.scene.load import load
from raytracer.util.errors import InputError, OutputError, StrictError
from tests.rendering.halves import HALVES, assert_same, halves
from tests.repository import REFERENCES, SCENES

pytest.importorskip("distributed")

_SECONDS_TO_START = 60.0
_SECONDS_TO_END = 10.0


class Machines:
    """A scheduler, and workers that come and go.

    address : of the scheduler, whose port the system has chosen.
    """

    def __init__(self, folder):
        self._folder, self._processes, self._logs = folder, [], []
        self.scheduler = self._start("scheduler", "--port", "0", "--no-show")
        self.address = self._said(folder / "scheduler0.log", "Scheduler at:").split()[-1]

    def worker(self, threads=1):
        """A new one, which need not have said hello yet."""
        name = f"worker{len(self._processes)}"
        options = f"--nthreads {threads} --name {name} --memory-limit 0 --no-nanny --death-timeout 30"
        return self._start("worker", self.address, *options.split(), "--local-directory", str(self._folder / name))

    def kill(self, process):
        """Kill one of them, as a power cut would."""
        process.kill()
        process.wait(_SECONDS_TO_END)

    def close(self):
        """End all that still run; at once, since what they leave lies in the folder."""
        for process, log in zip(self._processes, self._logs, strict=True):
            if process.poll() is None:
                self.kill(process)
            log.close()

    def _start(self, kind, *options):
        log = (self._folder / f"{kind}{len(self._processes)}.log").open("wb")
        self._logs.append(log)
        command = [sys.executable, "-m", "distributed.cli.dask_" + kind, *options]
        command += ["--host", "127.0.0.1", "--no-dashboard"]
        process = subprocess.Popen(command, stdout=log, stderr=log, env=os.environ, cwd=self._folder)
        self._processes.append(process)
        return process

    def _said(self, path, beginning):
        """The first line of a log that holds these words."""
        end = time.monotonic() + _SECONDS_TO_START
        while time.monotonic() < end:
            for line in path.read_text().splitlines():
                if beginning in line:
                    return line
            time.sleep(0.05)
        raise TimeoutError(path.read_text())


@contextmanager
def machines(folder, workers):
    """A scheduler and workers, which end with the `with` block."""
    started = Machines(folder)
    try:
        for _ in range(workers):
            started.worker()
        yield started
    finally:
        started.close()


# ---- Pictures

MESH = "\n  - {type: mesh, file: solids/octahedron.obj, transform: [{scale: 0.4}], material: {type: lambertian}}\n"


@pytest.fixture(scope="module")
def two(tmp_path_factory):
    """A scheduler and two workers."""
    with machines(tmp_path_factory.mktemp("machines"), workers=2) as started:
        yield started


@pytest.fixture(scope="module")
def cluster(two):
    with Cluster(two.address) as connected:
        yield connected


@pytest.fixture
def spec(tmp_path):
    """A scene with a file, which the workers cannot find by its name."""
    (tmp_path / "solids").mkdir()
    (tmp_path / "solids" / "octahedron.obj").write_bytes((REFERENCES / "octahedron.obj").read_bytes())
    return halves(HALVES.rstrip() + MESH, base=tmp_path)


def test_two_workers_give_the_bits_of_one_machine(cluster, spec):
    here = render(spec, threads=2)
    far = render(spec, cluster=cluster)
    assert_same(far, here)
    assert 1 <= len(far.stats.workers) <= 2
    assert all(worker.startswith("tcp://127.0.0.1:") for worker in far.stats.workers)
    assert here.stats.workers == []

    # Once more, with other settings, where workers have the file.
    far = render(spec, seed=5, noise=0.1, cluster=cluster)
    assert_same(far, render(spec, seed=5, noise=0.1, threads=2))


def test_the_command_renders_on_a_cluster_and_fails_when_it_is_lost(two, spec, tmp_path, capsys, monkeypatch):
    path, here, far = (tmp_path / name for name in ("halves.yaml", "here.npy", "far.npy"))
    spec.save(path)
    words = ["render", str(path), "-q", "-o"]
    assert main([*words, str(here)]) == 0
    said = capsys.readouterr().err
    assert main([*words, str(far), "--cluster", two.address]) == 0
    assert far.read_bytes() == here.read_bytes()
    assert capsys.readouterr().err == said

    def lost(*arguments):
        raise OutputError("the cluster is lost")

    monkeypatch.setattr(executor.ClusterExecutor, "run", lost)
    assert main([*words, str(far), "--cluster", two.address]) == 1
    said = capsys.readouterr().err.splitlines()[-1]
    assert said == f"rt: the cluster is lost; {far} has 0 of 37 samples per pixel"
    assert np.load(far).shape == (36, 44, 3)


def test_several_renders_share_a_cluster(cluster, spec):
    with ThreadPoolExecutor(3) as pool:
        found = list(pool.map(lambda seed: render(spec, seed=seed, cluster=cluster), (1, 2, 3)))
    for seed, far in enumerate(found, 1):
        assert_same(far, render(spec, seed=seed, threads=2))


# ---- Who may take part


def test_a_worker_of_another_version_or_another_instruction_set_is_told_or_refused(cluster, spec, monkeypatch):
    mine, told = fingerprint(), []
    other = mine._replace(versions={**mine.versions, "numba": "0.1"})
    monkeypatch.setattr(executor, "fingerprint", lambda: other)
    with pytest.raises(InputError, match=r"^worker tcp://127\S* has numba .*, and here it is 0.1; install the same"):
        render(spec, cluster=cluster)
    monkeypatch.setattr(executor, "fingerprint", lambda: mine._replace(processor="vax"))
    assert render(spec, cluster=cluster, warn=told.append).complete
    assert len([sentence for sentence in told if "has another instruction set than this machine" in sentence]) == 1
    # Without the warnings that the scene itself raises.
    connected = cluster.connect(spec, RenderOptions(strict=True))
    with pytest.raises(StrictError, match="instruction set"):
        connected.run(lambda: None, lambda job, result: None, WorkerPool(1), time.perf_counter() + 30.0)


def test_what_differs_is_named():
    here = Fingerprint({"rt": "2.0", "Python": "3.12.1"}, "abc", "vax")
    assert find_mismatch(here, here) is None
    assert find_mismatch(here, here._replace(processor="pdp")) is None
    there = here._replace(versions={"rt": "1.0", "Python": "3.12.1"})
    assert find_mismatch(here, there) == "has rt 1.0, and here it is 2.0; install the same versions on all machines"
    there = here._replace(program="def")
    assert (
        find_mismatch(here, there)
        == "has other sources of rt 2.0 than there are here; install the same, and restart it"
    )


# ---- Nobody there


@pytest.mark.parametrize(
    ("address", "said"),
    [
        ("tcp://127.0.0.1:9", "no Dask scheduler answers within 0.3 s; `dask scheduler`"),
        ("pigeon://roof", "is no address of a Dask scheduler"),
        ("tls://127.0.0.1:9", "needs certificates"),
    ],
)
def test_no_scheduler(address, said, monkeypatch, capsys):
    monkeypatch.setattr(connection, "CONNECT_SECONDS", 0.3)
    assert main(["render", str(SCENES / "cornell.yaml"), "--cluster", address, "-q"]) == 2
    assert capsys.readouterr().err.startswith(f"rt: {address}: {said}")


def test_no_dask(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputError, match=r"pip install 'raytracer\[cluster\]'"):
        Cluster("tcp://127.0.0.1:9")


def test_nothing_of_dask_is_imported_unless_it_is_used():
    code = "import sys, raytracer.rendering.cluster, raytracer.cli.base.app; "
    code += "assert not {'dask', 'distributed'} & sys.modules.keys()"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_no_workers(two, spec, monkeypatch):
    told = []
    monkeypatch.setattr(executor, "REPORT_AFTER", 0.2)
    with Cluster(two.address, patience=0.5, say=told.append) as empty:
        monkeypatch.setattr(empty.client, "nthreads", dict)
        with pytest.raises(InputError, match=r"has had no workers for 0.5 s; `dask worker tcp://127.*` starts one"):
            render(spec, cluster=empty)
    assert told == [f"{two.address} has no workers; waiting for one, up to 0.5 s"]


# ---- Workers that come and go


def once(part, step):
    """Call something in a thread of its own once a render has this part of its samples."""
    steps = [step]

    def watch(progress):
        if steps and progress.done >= part * progress.wanted:
            steps.pop()()

    return watch


@pytest.fixture(scope="module")
def long():
    """Some ten seconds of work of one thread, on a scene that is compiled already."""
    return halves(width=160, height=120, spp=2000)


@pytest.fixture(scope="module")
def expected(long):
    return render(long, threads=2)


@pytest.mark.slow
def test_a_worker_that_is_killed_changes_nothing(tmp_path, long, expected):
    with machines(tmp_path, workers=2) as found, Cluster(found.address) as cluster:
        victim = found.worker()
        assert_same(render(long, cluster=cluster, progress=once(0.3, lambda: found.kill(victim))), expected)
        assert victim.poll() is not None


@pytest.mark.slow
def test_a_worker_that_comes_late_takes_part(tmp_path, long, expected):
    with machines(tmp_path, workers=1) as found, Cluster(found.address) as cluster:
        far = render(long, cluster=cluster, progress=once(0.05, lambda: found.worker(threads=2)))
        assert_same(far, expected)
        assert len(far.stats.workers) == 2


@pytest.mark.slow
def test_all_may_die_if_another_comes(tmp_path, long, expected):
    told = []
    with machines(tmp_path, workers=0) as found, Cluster(found.address, say=told.append) as cluster:
        first = [found.worker(), found.worker()]

        def disaster():
            for worker in first:
                found.kill(worker)
            threading.Timer(4.0, found.worker).start()

        far = render(long, cluster=cluster, progress=once(0.30, disaster))
        assert_same(far, expected)
        assert 2 <= len(far.stats.workers) <= 3
    assert any("has no workers; waiting for one" in sentence for sentence in told)


@pytest.mark.slow
def test_a_lost_scheduler_leaves_the_picture_so_far(tmp_path, long, monkeypatch):
    monkeypatch.setattr(connection, "CONNECT_SECONDS", 2.0)
    with machines(tmp_path, workers=2) as found:
        time.sleep(3.0)
        with Cluster(found.address) as cluster:
            far = render(long, cluster=cluster, progress=once(0.30, lambda: found.kill(found.scheduler)))
    assert far.failure == "the cluster is lost: its scheduler does not answer any more"
    assert not far.complete
    assert 0 < far.fewest_samples < 2000
    assert np.all(np.isfinite(far.image.radiance))


@pytest.mark.slow
def test_ctrl_c_leaves_the_picture_so_far(cluster, long):
    def press():
        raise KeyboardInterrupt

    far = render(long, cluster=cluster, progress=once(0.30, press))
    assert far.interrupted
    assert far.failure is None
    assert 0 < far.fewest_samples < 2000
    # Nothing of it goes on there.
    assert_same(render(long, spp=8, cluster=cluster), render(long, spp=8, threads=2))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "keys"),
    [("textures", {}), ("smoke", {"render.clamp": 5}), ("instances", {}), ("cover", {"render.sampler": "stratified"})],
)
def test_every_effect_goes_along(cluster, name, keys):
    shown = load(SCENES / f"{name}.yaml", {"film.width": 40, "film.height": 30, "render.spp": 20, **keys})
    aovs = ("normal", "depth", "object_id", "direct", "coverage", "samples")
    here, far = render(shown, aovs=aovs, threads=2), render(shown, aovs=aovs, cluster=cluster)
    assert_same(far, here)
    assert here.stats.clamp == far.stats.clamp


@pytest.mark.parametrize("order", ["there, then here", "here, then there"])
def test_a_render_goes_on_elsewhere(spec, cluster, tmp_path, order, monkeypatch):
    monkeypatch.setattr(worker_pool, "_POLL_SECONDS", 1e-3)
    first, second = (cluster, None) if order.startswith("there") else (None, cluster)
    path, spp = tmp_path / "a.checkpoint", 1000

    def stop(progress):
        # As early as can be: on a busy machine much may be done between two looks.
        if progress.done > 0:
            raise KeyboardInterrupt

    broken = render(spec, spp=spp, cluster=first, checkpoint_writer=CheckpointWriter(path), progress=stop)
    assert broken.interrupted
    result = render(spec, spp=spp, cluster=second, checkpoint_writer=CheckpointWriter(path, resume=True))
    assert_same(result, render(spec, spp=spp))
    assert result.stats.resumed["samples"] > 0
