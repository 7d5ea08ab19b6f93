"""Declare what all AOVs share."""
