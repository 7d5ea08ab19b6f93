"""Lights: what next-event estimation samples."""
