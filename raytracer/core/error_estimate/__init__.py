"""Noise of pictures: the error measure, its fall with samples, and estimates of it without a reference.

Plain arithmetic on pictures, without the renderer.
"""
