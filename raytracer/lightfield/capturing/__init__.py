"""Capture of a light field: all views of a camera array, rendered in bands that fit into memory, into one file."""
