"""Compiled inner loops of depth and super-resolution; their callers share the work among threads."""
