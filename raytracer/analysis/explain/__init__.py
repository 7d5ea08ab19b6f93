"""Explanation of a scene: its effects, each with a reason, and its camera and objects in numbers."""

from raytracer.analysis.explain.camera_numbers import SHARP, Circle, parse_circle
from raytracer.analysis.explain.explanation import Explanation, explain

__all__ = ["SHARP", "Circle", "Explanation", "explain", "parse_circle"]
