"""Intersect and sample primitives, one table of rows and one Embree geometry a kind."""
