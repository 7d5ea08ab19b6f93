"""Diagrams of the lecture, drawn from the formulas that the program uses."""
