"""Bars that tell how far work is, on a terminal and in a notebook."""
