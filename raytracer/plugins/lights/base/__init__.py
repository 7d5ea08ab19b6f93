"""Interface of lights, and the parts that several kinds share."""
