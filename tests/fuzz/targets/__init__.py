"""Loaders that are fuzzed, each a function that `@target` declares (`tests/fuzz/harness.py`); by what they read."""
