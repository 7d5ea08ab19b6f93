"""Provide what rendering is built of: the compiler, vectors, sampling, geometry, Embree, motion, spectra."""
