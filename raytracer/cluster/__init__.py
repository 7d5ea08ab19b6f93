"""Renders on other machines, by Dask's scheduler and workers."""
