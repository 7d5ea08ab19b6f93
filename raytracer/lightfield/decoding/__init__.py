"""Raw pictures of cameras with microlenses: the grid of microlenses found, devignetted, turned into views."""
