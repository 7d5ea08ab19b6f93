"""Packed camera with a lens of glass: rays go from the film through all of its surfaces, or are reflected there."""

from typing import Any, NamedTuple

from raytracer.core.compiler.dispatch import kernel, optional
from raytracer.core.sampling import sample_2d
from raytracer.core.sampling.warp import sample_disc
from raytracer.core.simd import WIDTH, load, select, store
from raytracer.core.spectra import Spectra
from raytracer.optics.lens_system import packets
from raytracer.optics.lens_system.film_to_direction import direction_to_film
from raytracer.optics.lens_system.ghosts import GhostPaths, aim_ghost_ray, sample_ghost_path, trace_ghost_path
from raytracer.optics.lens_system.pupils.tables import sample_exit_pupil
from raytracer.optics.lens_system.surfaces import LensSurfaces
from raytracer.plugins.cameras.base import interface
from raytracer.plugins.cameras.base.glass import draw_wavelength, exit_ray, start_film_rays
from raytracer.plugins.cameras.base.placement import CameraFrame, to_camera_space

# Rows of a packet that hold the path through the lens: the two surfaces that reflect.
_GHOST_ROW = packets.FREE


class LensFilm(NamedTuple):
    """Film behind a lens (mm).

    pixel : edge of a pixel.
    left, top : edges of the upright picture.
    z : place of the film on the lens's axis.
    """

    pixel: float
    left: float
    top: float
    z: float


class LensFlare(NamedTuple):
    """Light that is reflected in the lens.

    ghost_paths : of two reflections, and the share of samples of each.
    behind (mm) : distance of the film behind the last vertex.
    """

    ghost_paths: GhostPaths
    behind: float


class LensCamera(NamedTuple):
    """Packed camera with a lens of glass; lengths are mm, in the lens's frame.

    film : behind the lens.
    surfaces : of the lens.
    pupils : table of the exit pupil as each place of the film sees it.
    plane : place of the plane of these pupils on the axis.
    pupil : place of the entrance pupil on the axis.
    gain (1/mm2) : weight of a ray over cos^4 times the area that it is drawn from.
    wavelengths : tables of spectra where light has a wavelength in the lens; else None.
    flare : a LensFlare, or None.
    view_table : film positions by direction in the scene.
    thin : the thin lens in place of it.
    """

    frame: CameraFrame
    film: LensFilm
    surfaces: LensSurfaces
    pupils: Any
    plane: float
    pupil: float
    gain: float
    wavelengths: Any
    flare: Any
    view_table: Any
    thin: interface.Defocus


@optional
def aim_camera_ray(flare, camera, rows, lane, x, y, u, v, draws):
    """Draw the path of a sample through the lens, noted in `rows`, and its target, as `pupils.sample_exit_pupil`."""
    return sample_exit_pupil(camera.pupils, x, y, u, v)


@aim_camera_ray.register(LensFlare)
def aim_camera_ray_lens_flare(flare, camera, rows, lane, x, y, u, v, draws):
    number, mix = sample_2d(draws.sampler, draws.key, draws.index, draws.dimension + interface.GHOST)
    pair, first, last, probability = sample_ghost_path(flare.ghost_paths, number)
    rows[_GHOST_ROW, lane], rows[_GHOST_ROW + 1, lane] = first, last
    if first < 0:
        target_x, target_y, area = sample_exit_pupil(camera.pupils, x, y, u, v)
        return target_x, target_y, area / probability
    # From the plane of the last vertex to that of the pupils.
    target_x, target_y, area = aim_ghost_ray(flare.ghost_paths, pair, x, y, u, v, mix)
    away = (camera.film.z - camera.plane) / flare.behind
    return x + away * (target_x - x), y + away * (target_y - y), area * away * away / probability


@optional
def trace_to_scene(flare, camera, rows):
    """Trace the rays of a packet through the lens to the scene."""
    packets.trace_packet(camera.surfaces, rows)


@trace_to_scene.register(LensFlare)
def trace_to_scene_lens_flare(flare, camera, rows):
    for lane in range(WIDTH):
        if rows[packets.WEIGHT, lane] > 0.0:
            origin = rows[packets.ORIGIN, lane], rows[packets.ORIGIN + 1, lane], rows[packets.ORIGIN + 2, lane]
            way = rows[packets.DIRECTION, lane], rows[packets.DIRECTION + 1, lane], rows[packets.DIRECTION + 2, lane]
            first, last = int(rows[_GHOST_ROW, lane]), int(rows[_GHOST_ROW + 1, lane])
            wavelength = wavelength_or_none(camera.wavelengths, rows[packets.WAVELENGTH, lane])
            weight, origin, way = trace_ghost_path(camera.surfaces, origin, way, first, last, wavelength)
            rows[packets.WEIGHT, lane] *= weight
            for axis in range(3):
                rows[packets.ORIGIN + axis, lane] = origin[axis]
                rows[packets.DIRECTION + axis, lane] = way[axis]


@optional
def wavelength_or_none(wavelengths, wavelength):
    """Return the wavelength of light that has one, else None."""


@wavelength_or_none.register(Spectra)
def wavelength_or_none_spectra(wavelengths, wavelength):
    return wavelength


@interface.packet_rays.register(LensCamera)
def packet_rays_lens_camera(camera):
    return interface.PacketRays()


@kernel
def _film_point(film, x, y):
    """Transform a film position to the lens's frame (mm), in which the picture is upside down."""
    return -(film.left + film.pixel * x), film.pixel * y - film.top


@interface.set_lane.register(LensCamera)
def set_lane_lens_camera(camera, rows, lane, x, y, draws):
    film_x, film_y = _film_point(camera.film, x, y)
    u1, u2 = sample_2d(draws.sampler, draws.key, draws.index, draws.dimension + interface.LENS)
    u, v = sample_disc(u1, u2)
    target_x, target_y, area = aim_camera_ray(camera.flare, camera, rows, lane, film_x, film_y, u, v, draws)
    rows[packets.ORIGIN, lane], rows[packets.ORIGIN + 1, lane] = film_x, film_y
    rows[packets.DIRECTION, lane], rows[packets.DIRECTION + 1, lane] = target_x - film_x, target_y - film_y
    rows[packets.WEIGHT, lane] = area
    draw_wavelength(camera.wavelengths, rows, lane, draws)


@interface.trace_lanes.register(LensCamera)
def trace_lanes_lens_camera(camera, rows):
    square = start_film_rays(rows, camera.film.z, camera.film.z - camera.plane)
    extent = load(rows, packets.WEIGHT) * (square * square)
    store(rows, packets.EXTENT, extent)
    store(rows, packets.WEIGHT, camera.gain * extent)
    trace_to_scene(camera.flare, camera, rows)


@interface.share_wavelengths.register(LensCamera)
def share_wavelengths_lens_camera(camera, sharing, rows, others, x, y):
    # Back through the lens, which stands in a mirror.
    weight = load(rows, packets.WEIGHT)
    whole = camera.gain * load(rows, packets.EXTENT)
    store(others, packets.WEIGHT, select(weight > 0.0, whole / weight, 0.0))
    for axis in range(2):
        store(others, packets.ORIGIN + axis, load(rows, packets.ORIGIN + axis))
        store(others, packets.DIRECTION + axis, -load(rows, packets.DIRECTION + axis))
    store(others, packets.ORIGIN + 2, -load(rows, packets.ORIGIN + 2))
    store(others, packets.DIRECTION + 2, load(rows, packets.DIRECTION + 2))
    packets.trace_packet(sharing.back, others)

    # Meet the film, and compare with the middle of the pixel.
    along = load(others, packets.DIRECTION + 2)
    onward = (-camera.film.z - load(others, packets.ORIGIN + 2)) / along
    square = along * along
    store(others, packets.EXTENT, square * square)
    for axis in range(2):
        place = load(others, packets.ORIGIN + axis) + onward * load(others, packets.DIRECTION + axis)
        store(others, packets.ORIGIN + axis, place)
    middle_x, middle_y = _film_point(camera.film, x + 0.5, y + 0.5)
    reach = 0.5 * sharing.tolerance * camera.film.pixel
    for lane in range(WIDTH):
        film_x, film_y = others[packets.ORIGIN, lane], others[packets.ORIGIN + 1, lane]
        _, _, area = sample_exit_pupil(camera.pupils, film_x, film_y, 0.0, 0.0)
        others[packets.EXTENT, lane] *= area
        if not (abs(film_x - middle_x) <= reach and abs(film_y - middle_y) <= reach and area > 0.0):
            others[packets.WEIGHT, lane] = 0.0


@interface.lane_ray.register(LensCamera)
def lane_ray_lens_camera(camera, rows, lane, x, y, time, draws):
    return exit_ray(camera, rows, lane)


@interface.camera_parts.register(LensCamera)
def camera_parts_lens_camera(camera: LensCamera) -> interface.CameraParts:
    return interface.CameraParts(
        glass=camera.surfaces,
        has_flare=camera.flare is not None,
        spectra=camera.wavelengths,
        shares_wavelengths=camera.flare is None,
    )


@interface.project.register(LensCamera)
def project_lens_camera(camera, point, time):
    right, up, depth = to_camera_space(camera.frame, point)
    x, y = direction_to_film(camera.view_table, right, up, depth)
    return (x - camera.film.left) / camera.film.pixel, (camera.film.top - y) / camera.film.pixel, depth
