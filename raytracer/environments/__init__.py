"""Environments: the radiance of rays that meet nothing.  One file a kind."""
