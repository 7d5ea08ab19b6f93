"""What renders of like scenes share: files that were read, and structures that the ray caster has built."""
