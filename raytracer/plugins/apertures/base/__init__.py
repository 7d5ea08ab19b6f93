"""Interface of apertures, and the parts that several kinds share."""
