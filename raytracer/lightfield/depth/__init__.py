"""Depth from the views of a light field: by plane sweep (focus), by structure tensor (slopes), and by both."""
