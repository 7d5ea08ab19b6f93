"""Rendering on other machines, by Dask's scheduler and workers (docs/cluster.md).

Dask brings jobs to workers and returns their results; it moves files from worker to worker, and notices workers that
have died or are new.  Added here are the check that a worker renders the same picture, and the jobs.
"""
