"""Cameras: where a sample of the film looks.  One file a kind."""
