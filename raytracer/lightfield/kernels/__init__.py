"""Compiled inner loops of depth, super-resolution and pictures from any pose; their callers share the work among threads."""
