"""Evaluate a lens by itself, as lens designers do: numbers, curves and a drawing of its cross-section."""
