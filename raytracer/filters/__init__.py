"""Pixel filters: how samples near a pixel make its value.  One file a kind."""
