"""Lights: what a shaded point may aim at.  One file a kind."""
