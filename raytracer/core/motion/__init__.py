"""Motion of objects and cameras: as scenes write it, as trajectories over a shutter's time, and in kernels."""
