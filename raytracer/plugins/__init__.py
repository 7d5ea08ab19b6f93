"""Hold the kinds that a scene file can name, one file a kind and one package a family."""
