"""rt: an offline ray tracer for people who think in cameras."""

__version__ = "0.1.0"
