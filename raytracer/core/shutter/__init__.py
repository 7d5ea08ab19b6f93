"""Shutters: which part of the film is exposed when, and how the times of rays are drawn from that."""
