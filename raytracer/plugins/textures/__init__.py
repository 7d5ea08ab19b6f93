"""Textures: colours and numbers that vary over a surface or through space."""
