"""Interface of pixel filters, and the parts that several kinds share."""
