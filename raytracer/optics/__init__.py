"""Describe real lenses and the arithmetic of cameras: glass, lens systems, thin-lens formulas, sensor formats."""
