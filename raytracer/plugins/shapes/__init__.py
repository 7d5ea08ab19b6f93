"""Shapes: what a scene file's objects may be; each lowers itself to tables of primitives."""
