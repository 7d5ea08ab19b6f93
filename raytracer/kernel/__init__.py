"""Trace paths: the compiled path tracer and what it carries along a path."""
