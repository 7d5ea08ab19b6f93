"""Decoding of raw pictures of microlens cameras: calibration of the microlens grid, devignetting, and views."""
