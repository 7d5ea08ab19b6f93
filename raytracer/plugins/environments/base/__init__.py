"""Interface of environments, and the parts that several kinds share."""
