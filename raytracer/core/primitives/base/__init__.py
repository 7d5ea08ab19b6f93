"""Declare what all primitives share."""
