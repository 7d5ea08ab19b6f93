"""Textures: colours that vary over a surface or through space.  One file a kind."""
