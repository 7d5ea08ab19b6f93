"""Survey of a packed scene, and what several kinds of warnings read off it."""
