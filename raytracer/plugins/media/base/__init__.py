"""Interface of media, and the parts that several kinds share."""
