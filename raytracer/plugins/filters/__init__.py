"""Pixel filters: which samples near a pixel count for it, and how much."""
