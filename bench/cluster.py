"""What it costs to render on a cluster rather than in one process, on the same cores of this machine.

Dask starts the workers, as processes on the loopback device.  The same picture is rendered here and there in turns;
the first render there, for which fresh workers make the scene ready, is told by itself.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import distributed
import numpy as np

from raytracer.rendering.cluster.connection import Cluster
from raytracer.rendering.render import render
from raytracer.rendering.session import Rendered
from raytracer.rendering.worker_pool import available_threads
from raytracer.scene.load import load
from raytracer.scene.spec import SceneSpec

SCENE = Path(__file__).parents[1] / "scenes" / "cover.yaml"

# Samples a pixel by which the pace is found.
_TRIAL_SPP = 64


def timed(spec: SceneSpec, spp: int, cluster: Cluster | None = None) -> tuple[float, Rendered]:
    """Time a whole render, from the checked scene to the image (s); return that and the render."""
    begin = time.perf_counter()
    rendered = render(spec, spp=spp, cluster=cluster)
    return time.perf_counter() - begin, rendered


def measure(spec: SceneSpec, spp: int, workers: int, threads: int, rounds: int) -> str:
    """Measure a line of the table, for so many workers of so many threads each."""
    here: list[float] = []
    there: list[float] = []
    local_cluster: Any = distributed.LocalCluster
    settings = {"host": "127.0.0.1", "dashboard_address": None, "preload": "raytracer.rendering.cluster.worker"}
    with (
        local_cluster(n_workers=workers, threads_per_worker=threads, **settings) as dask,
        Cluster(dask) as cluster,
    ):
        cluster.client.wait_for_workers(workers)
        first, far = timed(spec, spp, cluster)
        for _ in range(rounds):
            seconds, own = timed(spec, spp)
            here.append(seconds)
            there.append(timed(spec, spp, cluster)[0])
    same = np.array_equal(own.image.radiance, far.image.radiance)
    local, cluster_seconds = statistics.median(here), statistics.median(there)
    return (
        f"{workers:8d} {threads:8d} {local:9.2f} {cluster_seconds:9.2f} {cluster_seconds / local - 1.0:+9.1%}"
        f" {first:9.2f} {first / local - 1.0:+9.1%}  {'same bits' if same else 'OTHER BITS'}"
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=30.0, help="what the render is to take here")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--quick", action="store_true", help="5 seconds, one round")
    given = parser.parse_args(arguments)
    seconds, rounds = (5.0, 1) if given.quick else (given.seconds, given.rounds)
    spec, cores = load(SCENE), available_threads()
    render(spec, spp=8)
    spp = 8 * max(1, round(seconds / timed(spec, _TRIAL_SPP)[0] * _TRIAL_SPP / 8))
    print(f"cover, {spec.film.width} x {spec.film.height}, {spp} spp, {cores} cores; medians of {rounds}, seconds")
    print(f"{'workers':>8} {'threads':>8} {'here':>9} {'there':>9} {'':>9} {'first':>9}")
    for workers, threads in ((1, cores), (cores, 1)):
        print(measure(spec, spp, workers, threads, rounds), flush=True)


if __name__ == "__main__":
    main()
