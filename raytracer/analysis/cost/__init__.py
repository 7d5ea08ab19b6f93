"""Measure what accuracy costs in time: a scene and variants of it, error against samples, and predictions."""
