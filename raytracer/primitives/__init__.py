"""Primitives: what shapes are made of when a scene is packed, one table a kind, one Embree geometry a table."""
