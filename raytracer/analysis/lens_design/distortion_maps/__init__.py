"""Distortion maps: between a lens's picture and an ideal projection, by traced rays and as OpenCV's models."""
