"""Scenes of clear solids that overlap, rendered by one kernel."""

from typing import Any

from raytracer.film.image import Image
from tests.small_scenes import image

# Far below, a speck of each kind that any of these scenes has, so that all share one kernel.  Of what is flat it is not
# known what lies below it, so that all cameras look around.
SPECKS = """
  - type: quad
    corner: [0, -96, 0]
    edges: [[1.0e-9, 0, 0], [0, 0, 1.0e-9]]
    material: {type: emitter, radiance: 1.0e-9}
  - type: quad
    corner: [0, -93, 0]
    edges: [[1.0e-9, 0, 0], [0, 0, 1.0e-9]]
    material: {type: emitter, radiance: 1.0e-9}
  - {type: quad, corner: [0, -97, 0], edges: [[1.0e-9, 0, 0], [0, 0, 1.0e-9]], material: {type: lambertian}}
  - {type: sphere, center: [0, -99, 0], radius: 1.0e-9, material: {type: dielectric, outside_absorption: 1.0e-9}}
  - {type: sphere, center: [0, -94, 0], radius: 1.0e-9, material: {type: dielectric, ior: 1}}
  - type: quad
    corner: [0, -95, 0]
    edges: [[1.0e-9, 0, 0], [0, 0, 1.0e-9]]
    material: {type: dielectric, priority: 0, absorption: 1.0e-9}
"""


def picture(text: str, **settings: Any) -> Image:
    """The image of a scene whose `objects` come last, without an end by chance, and practically none by depth."""
    given = {"width": 8, "height": 8, "spp": 1024, "max_depth": 60, **settings}
    return image(text.rstrip() + SPECKS, filled=False, **given)
