"""Packed perspective cameras: a frame, an image plane, and a lens or None, and the rays that they make."""

import math
from typing import Any, NamedTuple

from raytracer.core.compiler.dispatch import kernel, optional
from raytracer.core.vec import add, dot, madd, normalize, scale
from raytracer.plugins.cameras.base import interface
from raytracer.plugins.cameras.base.placement import CameraFrame, to_camera_space


class ImagePlane(NamedTuple):
    """Image of the film at a distance of 1.

    pixel : width of a pixel.
    left, top : edges of the film, right and up from the axis.
    """

    pixel: float
    left: float
    top: float


class Irradiance(NamedTuple):
    """Weight of rays whose film gathers irradiance in place of radiance.

    scale : area of the pupil over the square of its distance from the film.
    """

    scale: float


class FlatPupil(NamedTuple):
    """Weight of rays whose film gathers irradiance from a pupil that is an evenly radiating disc.

    image_distance (m) : of the film from the pupil.
    area (m2) : of the pupil.
    """

    image_distance: float
    area: float


class PerspectiveCamera(NamedTuple):
    """Packed perspective camera.

    lens : a ThinLensPupil; None for a pinhole.
    irradiance : an Irradiance or a FlatPupil; None where the film gathers radiance.
    """

    frame: CameraFrame
    plane: ImagePlane
    lens: Any
    irradiance: Any


@optional
def lens_ray(lens, frame, irradiance, direction, draws):
    """Refract the ray through the lens's centre along `direction`: a ray (origin, unit direction, weight).

    `direction` is not a unit vector: its component along the axis is 1.
    """
    return frame.origin, normalize(direction), irradiance_weight(irradiance, direction, (0.0, 0.0, 0.0), direction)


@optional
def irradiance_weight(irradiance, direction, shift, towards):
    """Weight the radiance that a ray brings, so that the film gathers irradiance.

    direction : as in `lens_ray`.
    shift : point of the pupil that the ray goes through, from its middle (m).
    towards : direction in which it goes on, not a unit vector: the component along the axis is 1.
    """
    return 1.0


@irradiance_weight.register(Irradiance)
def irradiance_weight_irradiance(irradiance, direction, shift, towards):
    # What a patch of the plane of focus, at the distance F, sends through an element dA of the pupil arrives in the
    # patch's image, which is z / F times as large: E = integral of L cos^4 / F^2 (F / z)^2 dA.
    square = dot(towards, towards)
    return irradiance.scale / (square * square)


@irradiance_weight.register(FlatPupil)
def irradiance_weight_flat_pupil(irradiance, direction, shift, towards):
    # E = integral of L cos^4 / z^2 dA, with the angle at which the film sees the element of the pupil.
    z = irradiance.image_distance
    way = madd(shift, z, direction)
    ratio = z / dot(way, way)
    return irradiance.area * ratio * ratio


@kernel
def film_direction(frame, plane, x, y):
    """Return the vector from the lens's centre to the image of film position (x, y) in the plane at distance 1."""
    across = scale(plane.left + plane.pixel * x, frame.right)
    return add(madd(across, plane.top - plane.pixel * y, frame.up), frame.forward)


@interface.camera_ray.register(PerspectiveCamera)
def camera_ray_perspective_camera(camera, x, y, time, draws):
    direction = film_direction(camera.frame, camera.plane, x, y)
    return lens_ray(camera.lens, camera.frame, camera.irradiance, direction, draws)


@interface.camera_defocus.register(PerspectiveCamera)
def camera_defocus_perspective_camera(camera: Any) -> interface.Defocus:
    lens, pixel = camera.lens, float(camera.plane.pixel)
    return (
        interface.Defocus(0.0, pixel, 0.0)
        if lens is None
        else interface.Defocus(2.0 * float(lens.radius), pixel, lens.inverse_focus)
    )


@interface.camera_parts.register(PerspectiveCamera)
def camera_parts_perspective_camera(camera: Any) -> interface.CameraParts:
    return thin_lens_parts(camera.lens)


def thin_lens_parts(lens: Any) -> interface.CameraParts:
    """Return the parts of a packed camera with this ThinLensPupil, or None."""
    if lens is None:
        return interface.CameraParts(ray_radius=0.0)
    # Blades and masks reach farther than the round opening of the same area.
    return interface.CameraParts(lens=lens, ray_radius=lens.radius if lens.shape is None else math.inf)


@kernel
def project_to_film(plane, right, up, depth):
    """Project a point (m) in the camera's frame to the film (px): NaN if it is not in front of it; and its depth."""
    if depth <= 0.0:
        return math.nan, math.nan, depth
    return (right / depth - plane.left) / plane.pixel, (plane.top - up / depth) / plane.pixel, depth


@interface.project.register(PerspectiveCamera)
def project_perspective_camera(camera, point, time):
    right, up, depth = to_camera_space(camera.frame, point)
    return project_to_film(camera.plane, right, up, depth)
