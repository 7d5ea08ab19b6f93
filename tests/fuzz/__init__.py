"""Fuzzing with coverage: what reads files is fed bytes that nobody would write (`python -m tests.fuzz`)."""
