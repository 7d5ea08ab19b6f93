"""Environments: the radiance of rays that meet nothing."""
