"""Participating media: what fills space between surfaces.  One file a kind."""
