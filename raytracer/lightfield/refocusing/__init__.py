"""Refocusing: photographs focused after the shot, by shift-and-sum, Fourier slices or rays; all-in-focus pictures."""
