"""Lytro's files: containers (.lfp, .lfr), their pictures and metadata, and the white pictures of a camera."""
