"""Seeded faults, and which of them the tests find: `make mutants`."""
