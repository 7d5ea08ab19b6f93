"""Cameras: which ray belongs to a place on the film."""
