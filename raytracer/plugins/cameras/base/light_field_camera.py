"""Packed light-field cameras: rays from the sensor through a microlens, and on through a thin lens or one of glass."""

import math
from typing import Any, NamedTuple

from raytracer.core.compiler.dispatch import generic, kernel, optional
from raytracer.core.sampling import sample_1d, sample_2d
from raytracer.core.simd import load, store
from raytracer.core.vec import add, madd, normalize, scale
from raytracer.film.light_field.lattice import Lattice
from raytracer.optics.lens_system import packets
from raytracer.optics.lens_system.film_to_direction import direction_to_film
from raytracer.optics.lens_system.surfaces import LensSurfaces, aperture_transmission
from raytracer.plugins.apertures.base.interface import rim_visibility
from raytracer.plugins.cameras.base import interface
from raytracer.plugins.cameras.base.glass import draw_wavelength, exit_ray, start_film_rays
from raytracer.plugins.cameras.base.perspective_camera import irradiance_weight, thin_lens_parts
from raytracer.plugins.cameras.base.placement import CameraFrame, to_camera_space


class SquareCell(NamedTuple):
    """Cell of a microlens in a square lattice, in steps of the lattice."""


class HexagonCell(NamedTuple):
    """Cell of a microlens in a hexagonal lattice, whose steps are at 60 degrees."""


@generic
def nearest_node(cell, i, j):
    """Find the node of a lattice in whose cell a place lies, both in steps of the lattice."""


@nearest_node.register(SquareCell)
def nearest_node_square_cell(cell, i, j):
    return math.floor(i + 0.5), math.floor(j + 0.5)


@nearest_node.register(HexagonCell)
def nearest_node_hexagon_cell(cell, i, j):
    # Of three directions at 120 degrees, whose steps add up to 0, the one that rounding changes most is given up.
    a, b, c = math.floor(i + 0.5), math.floor(j + 0.5), math.floor(0.5 - i - j)
    da, db, dc = abs(a - i), abs(b - j), abs(c + i + j)
    if da > db and da > dc:
        return -b - c, b
    return (a, -a - c) if db > dc else (a, b)


@generic
def sample_cell(cell, u1, u2):
    """Draw a point of the cell about a node, uniformly by area, in steps of the lattice."""


@sample_cell.register(SquareCell)
def sample_cell_square_cell(cell, u1, u2):
    return u1 - 0.5, u2 - 0.5


@sample_cell.register(HexagonCell)
def sample_cell_hexagon_cell(cell, u1, u2):
    # Three rhombi, each between two of every other corner: (1, 1) / 3, (-2, 1) / 3, (1, -2) / 3.
    part = 3.0 * u1
    number = min(math.floor(part), 2.0)
    part -= number
    if number == 0.0:
        return (part - 2.0 * u2) / 3.0, (part + u2) / 3.0
    if number == 1.0:
        return (u2 - 2.0 * part) / 3.0, (part - 2.0 * u2) / 3.0
    return (part + u2) / 3.0, (u2 - 2.0 * part) / 3.0


class PackedLattice(NamedTuple):
    """Packed lattice.

    x, y (px) : its origin.
    along_x, along_y, across_x, across_y (px) : its two steps.
    i_x, i_y, j_x, j_y (1/px) : the inverse, from pixels to steps.
    """

    x: float
    y: float
    along_x: float
    along_y: float
    across_x: float
    across_y: float
    i_x: float
    i_y: float
    j_x: float
    j_y: float


def pack_lattice(lattice: Lattice) -> PackedLattice:
    """Pack a lattice."""
    (ax, ay), (bx, by) = lattice.along, lattice.across
    area = ax * by - ay * bx
    return PackedLattice(*lattice.origin, ax, ay, bx, by, by / area, -bx / area, -ay / area, ax / area)


class MicrolensBlur(NamedTuple):
    """Microlenses of a real size, in place of pinholes.

    blur (m/px) : shift on the main lens of the point that a pixel sees, by the shift of the ray on its microlens.
    """

    blur: float


class Crosstalk(NamedTuple):
    """Light that comes to a place of the sensor through any microlens near it.

    reach (px) : distance from the middle of a sub-image beyond which no light of its microlens falls.
    rings : number of neighbours on each side, in steps of the lattice, among which all within that reach are.
    """

    reach: float
    rings: int


def pack_crosstalk(lattice: Lattice, reach: float) -> Crosstalk:
    """Pack the crosstalk of sub-images that light falls on up to `reach` from their middles (px)."""
    (ax, ay), (bx, by) = lattice.along, lattice.across
    area = abs(ax * by - ay * bx)
    # A step of the lattice leads at least this far from its other direction.  The place lies within a step of the node
    # that the count starts from.
    least = area / max(math.hypot(ax, ay), math.hypot(bx, by))
    return Crosstalk(reach, math.ceil(reach / least) + 1)


class MicrolensArray(NamedTuple):
    """Packed microlenses before a sensor; lengths on it are pixels of sub-images.

    lattice : of the sub-images.
    cell : of a microlens, a SquareCell or a HexagonCell.
    spread : a MicrolensBlur, or MicrolensKinds; None for pinholes.
    crosstalk : a Crosstalk; None where each pixel sees through its own microlens alone.
    x, y (px) : place of the axis.
    slope, stride : as in `film.light_field.lenslets.Lenslets`.
    """

    lattice: PackedLattice
    cell: Any
    spread: Any
    crosstalk: Any
    x: float
    y: float
    slope: float
    stride: float


class LightFieldCamera(NamedTuple):
    """Packed light-field camera with a thin lens.

    lens : a ThinLensPupil, whose plane of focus is that in whose image the microlenses lie.
    grid : the microlenses.
    irradiance : an Irradiance or a FlatPupil; None where the sensor gathers radiance.
    thin : the lens of a photograph without microlenses.
    """

    frame: CameraFrame
    lens: Any
    grid: MicrolensArray
    irradiance: Any
    thin: interface.Defocus


class GlassLightFieldCamera(NamedTuple):
    """Packed light-field camera with a lens of glass; lengths are mm, in the lens's frame.

    surfaces : of the lens.
    grid : the microlenses.
    edge : edge of a pixel of sub-images, on the array.
    edge_growth (mm/m) : of places in the exit pupil over those on the thin lens in place of it.
    behind : distance of the array behind the exit pupil.
    z : place of the array on the axis.
    pupil : place of the entrance pupil on the axis.
    gain : weight of a ray over cos^4.
    wavelengths : tables of spectra where the glass disperses; else None.
    view_table : film positions by direction in the scene.
    beyond : size of the picture on the array over that on the film.
    thin : the thin lens in place of the lens.
    """

    frame: CameraFrame
    surfaces: LensSurfaces
    grid: MicrolensArray
    edge: float
    edge_growth: float
    behind: float
    z: float
    pupil: float
    gain: float
    wavelengths: Any
    view_table: Any
    beyond: float
    thin: interface.Defocus


@optional
def sample_microlens(spread, grid, middle_x, middle_y, draws):
    """Draw the point of a microlens that a ray goes through, from its middle (px), and the shift on the main lens (m).

    All right and down.

    middle_x, middle_y (px) : of its sub-image.
    """
    return 0.0, 0.0, 0.0, 0.0


@sample_microlens.register(MicrolensBlur)
def sample_microlens_microlens_blur(spread, grid, middle_x, middle_y, draws):
    u1, u2 = sample_2d(draws.sampler, draws.key, draws.index, draws.dimension + interface.LENS)
    i, j = sample_cell(grid.cell, u1, u2)
    x = i * grid.lattice.along_x + j * grid.lattice.across_x
    y = i * grid.lattice.along_y + j * grid.lattice.across_y
    return x, y, -spread.blur * x, -spread.blur * y


@kernel
def sub_image_middle(lattice, i, j):
    """Return the middle of a sub-image (px), right and down."""
    return (
        lattice.x + i * lattice.along_x + j * lattice.across_x,
        lattice.y + i * lattice.along_y + j * lattice.across_y,
    )


@optional
def choose_microlens(crosstalk, grid, x, y, i, j, draws):
    """Choose the microlens by which light comes to a place: the middle of its sub-image (px), and the ray's weight.

    i, j : of the microlens whose sub-image the place is part of, in steps of the lattice.
    """
    middle_x, middle_y = sub_image_middle(grid.lattice, i, j)
    return middle_x, middle_y, 1.0


@choose_microlens.register(Crosstalk)
def choose_microlens_crosstalk(crosstalk, grid, x, y, i, j, draws):
    square, rings = crosstalk.reach * crosstalk.reach, crosstalk.rings
    count = 0
    for right in range(-rings, rings + 1):
        for down in range(-rings, rings + 1):
            middle_x, middle_y = sub_image_middle(grid.lattice, i + right, j + down)
            count += int((x - middle_x) ** 2 + (y - middle_y) ** 2 <= square)

    # One of those that can send light there, all with the same probability.
    drawn = sample_1d(draws.sampler, draws.key, draws.index, draws.dimension + interface.GHOST)
    wanted = min(int(drawn * count), count - 1)
    chosen_x, chosen_y = sub_image_middle(grid.lattice, i, j)
    number = 0
    for right in range(-rings, rings + 1):
        for down in range(-rings, rings + 1):
            middle_x, middle_y = sub_image_middle(grid.lattice, i + right, j + down)
            if (x - middle_x) ** 2 + (y - middle_y) ** 2 <= square:
                if number == wanted:
                    chosen_x, chosen_y = middle_x, middle_y
                number += 1
    return chosen_x, chosen_y, float(count)


@optional
def keep_choice(crosstalk, rows, lane, weight):
    """Note the weight of a lane's microlens until its packet starts."""


@keep_choice.register(Crosstalk)
def keep_choice_crosstalk(crosstalk, rows, lane, weight):
    rows[packets.FREE, lane] = weight


@optional
def weigh_choice(crosstalk, rows):
    """Multiply the weights of a packet by those of its microlenses."""


@weigh_choice.register(Crosstalk)
def weigh_choice_crosstalk(crosstalk, rows):
    store(rows, packets.WEIGHT, load(rows, packets.WEIGHT) * load(rows, packets.FREE))


@kernel
def sample_sensor_ray(grid, x, y, draws):
    """Draw the path by which light comes to a place of the sensor.

    Returns
    -------
    Its points on the array, right and up from the axis (px), and on the main lens, right and up (m); and its weight.
    """
    lattice = grid.lattice
    from_x, from_y = x - lattice.x, y - lattice.y
    i, j = nearest_node(
        grid.cell, lattice.i_x * from_x + lattice.i_y * from_y, lattice.j_x * from_x + lattice.j_y * from_y
    )
    middle_x, middle_y, weight = choose_microlens(grid.crosstalk, grid, x, y, i, j, draws)
    off_x, off_y, moved_x, moved_y = sample_microlens(grid.spread, grid, middle_x, middle_y, draws)
    right = grid.stride * (x - middle_x) + moved_x
    down = grid.stride * (y - middle_y) + moved_y
    return middle_x + off_x - grid.x, grid.y - middle_y - off_y, right, -down, weight


@interface.camera_ray.register(LightFieldCamera)
def camera_ray_light_field_camera(camera, x, y, time, draws):
    frame, lens = camera.frame, camera.lens
    array_x, array_y, right, up, choice = sample_sensor_ray(camera.grid, x, y, draws)
    slope_x, slope_y = camera.grid.slope * array_x, camera.grid.slope * array_y
    shift = add(scale(right, frame.right), scale(up, frame.up))
    direction = add(add(scale(slope_x, frame.right), scale(slope_y, frame.up)), frame.forward)
    towards = madd(direction, -lens.inverse_focus, shift)
    passes = aperture_transmission(lens.shape, right / lens.radius, up / lens.radius)
    passes *= rim_visibility(
        lens.rim, right, up, slope_x - lens.inverse_focus * right, slope_y - lens.inverse_focus * up
    )
    weight = choice * passes * irradiance_weight(camera.irradiance, direction, shift, towards)
    return add(frame.origin, shift), normalize(towards), weight


@interface.packet_rays.register(GlassLightFieldCamera)
def packet_rays_glass_light_field_camera(camera):
    return interface.PacketRays()


@interface.set_lane.register(GlassLightFieldCamera)
def set_lane_glass_light_field_camera(camera, rows, lane, x, y, draws):
    array_x, array_y, right, up, choice = sample_sensor_ray(camera.grid, x, y, draws)
    keep_choice(camera.grid.crosstalk, rows, lane, choice)
    # The picture lies upside down behind the lens.
    place_x, place_y = -camera.edge * array_x, -camera.edge * array_y
    rows[packets.ORIGIN, lane], rows[packets.ORIGIN + 1, lane] = place_x, place_y
    rows[packets.DIRECTION, lane] = camera.edge_growth * right - place_x
    rows[packets.DIRECTION + 1, lane] = camera.edge_growth * up - place_y
    draw_wavelength(camera.wavelengths, rows, lane, draws)


@interface.trace_lanes.register(GlassLightFieldCamera)
def trace_lanes_glass_light_field_camera(camera, rows):
    square = start_film_rays(rows, camera.z, camera.behind)
    store(rows, packets.WEIGHT, camera.gain * (square * square))
    weigh_choice(camera.grid.crosstalk, rows)
    packets.trace_packet(camera.surfaces, rows)


@interface.lane_ray.register(GlassLightFieldCamera)
def lane_ray_glass_light_field_camera(camera, rows, lane, x, y, time, draws):
    return exit_ray(camera, rows, lane)


@interface.camera_defocus.register(GlassLightFieldCamera)
def camera_defocus_glass_light_field_camera(camera: GlassLightFieldCamera) -> interface.Defocus:
    return camera.thin


@interface.camera_parts.register(LightFieldCamera)
def camera_parts_light_field_camera(camera: LightFieldCamera) -> interface.CameraParts:
    return thin_lens_parts(camera.lens)


@interface.camera_parts.register(GlassLightFieldCamera)
def camera_parts_glass_light_field_camera(camera: GlassLightFieldCamera) -> interface.CameraParts:
    return interface.CameraParts(glass=camera.surfaces, spectra=camera.wavelengths)


@interface.project.register(LightFieldCamera)
def project_light_field_camera(camera, point, time):
    right, up, depth = to_camera_space(camera.frame, point)
    if depth <= 0.0:
        return math.nan, math.nan, depth
    grid = camera.grid
    return grid.x + right / depth / grid.slope, grid.y - up / depth / grid.slope, depth


@interface.project.register(GlassLightFieldCamera)
def project_glass_light_field_camera(camera, point, time):
    right, up, depth = to_camera_space(camera.frame, point)
    x, y = direction_to_film(camera.view_table, right, up, depth)
    scaled = camera.beyond / camera.edge
    return camera.grid.x + scaled * x, camera.grid.y - scaled * y, depth
