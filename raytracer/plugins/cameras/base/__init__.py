"""Interface of cameras, and the parts that several kinds share."""
