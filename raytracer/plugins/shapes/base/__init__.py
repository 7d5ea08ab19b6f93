"""Interface of shapes, and the parts that several kinds share."""
