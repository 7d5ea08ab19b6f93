"""Live view: a scene that is rendered anew at each edit, and the local page that shows it."""
