"""Views of a light field: those between others, along camera paths, and all of them on one picture."""
