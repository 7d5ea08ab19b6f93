"""What a scene makes the program do: its effects, each with a reason, and its camera and objects in numbers."""

from raytracer.explanation.numbers import SHARP, Circle, parse_circle
from raytracer.explanation.report import Explanation, explain

__all__ = ["SHARP", "Circle", "Explanation", "explain", "parse_circle"]
