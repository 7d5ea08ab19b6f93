"""Compile kernels with Numba: dispatch by type, passes, and the cache of compiled kernels."""
