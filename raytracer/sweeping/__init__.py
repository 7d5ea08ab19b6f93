"""Many renders as one question: every combination of some values of a scene's keys."""
