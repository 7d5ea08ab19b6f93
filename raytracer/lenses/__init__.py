"""Real lenses: their surfaces, rays through them, and what they do."""
