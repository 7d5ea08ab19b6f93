"""Apertures: the shape of the opening that a lens gathers light through."""
