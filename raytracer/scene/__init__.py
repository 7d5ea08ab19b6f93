"""Scene files: read, checked, and packed for the kernels."""
