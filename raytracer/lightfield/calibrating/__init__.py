"""Calibration of light-field cameras from pictures of a checkerboard: corners, bundle adjustment, rectification."""
