"""Compiled inner loops of depth, super-resolution and pictures from any pose; callers share the work among threads."""
