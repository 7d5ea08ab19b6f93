"""Render a packed scene: schedule tiles on threads or other machines, write checkpoints, develop the image."""
