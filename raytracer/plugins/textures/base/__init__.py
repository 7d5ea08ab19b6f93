"""Interface of textures, and the parts that several kinds share."""
