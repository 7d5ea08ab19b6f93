"""Shapes: what a scene file's objects may be.  Each kind's spec lowers itself to a table of primitives."""
