"""Load scene files to checked scenes, and pack these for the kernels."""
