"""Participating media: how light is absorbed and scattered between surfaces."""
