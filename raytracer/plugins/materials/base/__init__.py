"""Interface of materials, and the parts that several kinds share."""
