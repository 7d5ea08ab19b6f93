"""Measure what a pixel sees besides its radiance (arbitrary output variables), one file a family of quantities."""
