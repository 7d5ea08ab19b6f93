"""Render every combination of some values of a scene's keys, and show them side by side."""
