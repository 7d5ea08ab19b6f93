"""Lenses of glass: reading and setting one from a camera's keys, and the rays through it in kernels."""

from collections.abc import Mapping
from typing import ClassVar, Literal, Self, TypeAlias

from pydantic import PrivateAttr

from raytracer.core.compiler.dispatch import kernel, optional
from raytracer.core.sampling import sample_1d
from raytracer.core.simd import load, sqrt_lanes, store
from raytracer.core.spectra import FIRST, LAST, Spectra, sample_hero_wavelength
from raytracer.core.vec import add, madd, scale
from raytracer.optics.lens_system import packets
from raytracer.optics.lens_system.focusing import film_position
from raytracer.optics.lens_system.lens import Lens
from raytracer.optics.lens_system.lens_setup import LensSetup, set_up_lens, stop_radius_or_none
from raytracer.plugins.cameras.base.exposed import FocusedSpec
from raytracer.plugins.cameras.base.interface import WAVELENGTH, Assets
from raytracer.schema.spec import field_error
from raytracer.schema.units import METRES_PER_MILLIMETRE

FocusCriterion: TypeAlias = Literal["marginal", "rms"]

PADDING_PIXELS = 8
"""Pixels by which the film for which pupils are tabulated is larger than the picture: filters reach out of it."""

PUPIL_WAVELENGTHS = (FIRST, 500.0, LAST)
"""Wavelengths (nm) for which the pupil is tabulated: refraction is monotonous between them."""


class GlassLensSpec(FocusedSpec):
    """Base of the cameras that can have a lens of glass, whose prescription their key `lens` names."""

    loads: ClassVar[Mapping[str, str]] = {"lens": "lens"}
    bound_fields: ClassVar[tuple[str, ...]] = ("lens",)

    _bound: Lens | None = PrivateAttr(default=None)

    def stop_f_number(self) -> float | None:
        """Return the f-number to which the stop closes; None for wide open."""
        raise NotImplementedError

    def focus_criterion(self) -> FocusCriterion:
        """Return the criterion by which the lens is focused, see the key `focus` of the camera `lens`."""
        return "marginal"

    def bind_assets(self, assets: Assets) -> Self:
        if "lens" not in assets:
            return self
        bound = self.model_copy()
        bound._bound = assets["lens"]
        radius = bound._stop_radius()
        try:
            film_position(bound.glass(), bound.focus_criterion(), stop_radius=radius)
        except ValueError as error:
            field_error("lens", str(error))
        if not bound.has_focus_target():
            bound.check_focus()
        return bound

    def glass(self) -> Lens:
        """Return the lens that its file holds; the camera must be `bind_assets`."""
        if self._bound is None:
            raise TypeError("the camera has not been bound to the lens that its file holds")
        return self._bound

    def _stop_radius(self) -> float | None:
        """Return the radius of the stop (mm) for the f-number; None for wide open."""
        f_number = self.stop_f_number()
        if f_number is None:
            return None
        try:
            return stop_radius_or_none(self.glass(), f_number)
        except ValueError as error:
            field_error("f_number", str(error))

    def lens_setup(self) -> LensSetup:
        """Set the lens to its f-number and focus.

        Raises
        ------
        ValueError : it cannot be focused so.
        """
        return set_up_lens(self.glass(), self._stop_radius(), 1e3 * self.plane_of_focus(), self.focus_criterion())

    def check_focus(self) -> None:
        try:
            self.lens_setup()
        except ValueError as error:
            field_error("lens" if self.focus_distance is None else "focus_distance", str(error))


@optional
def draw_wavelength(wavelengths, rows, lane, draws):
    """Draw the wavelength (nm) of a sample, if light has one."""


@draw_wavelength.register(Spectra)
def draw_wavelength_spectra(wavelengths, rows, lane, draws):
    drawn = sample_1d(draws.sampler, draws.key, draws.index, draws.dimension + WAVELENGTH)
    rows[packets.DRAWN, lane] = drawn
    rows[packets.WAVELENGTH, lane], _ = sample_hero_wavelength(wavelengths, drawn)


@kernel
def ray_to_world(frame, pupil, origin, direction):
    """Transform a ray before a lens (mm), whose entrance pupil is at `pupil` on its axis (mm), to the scene (m)."""
    ahead = METRES_PER_MILLIMETRE * (pupil - origin[2])
    side = scale(METRES_PER_MILLIMETRE * origin[0], frame.right)
    side = madd(side, METRES_PER_MILLIMETRE * origin[1], frame.up)
    start = add(frame.origin, madd(side, ahead, frame.forward))
    way = add(scale(direction[0], frame.right), scale(direction[1], frame.up))
    return start, madd(way, -direction[2], frame.forward)


@kernel
def start_film_rays(rows, z, behind):
    """Start a packet's rays on the film at `z`, towards their targets in a plane `behind` before it (mm).

    rows : the packet, with the offsets to the targets, right and up, in its rows `packets.DIRECTION` and the next (mm).

    Returns
    -------
    The square of the cosines of their angles with the axis.
    """
    x, y = load(rows, packets.DIRECTION), load(rows, packets.DIRECTION + 1)
    inverse = 1.0 / sqrt_lanes(x * x + y * y + behind * behind)
    cosine = behind * inverse
    store(rows, packets.ORIGIN + 2, z)
    store(rows, packets.DIRECTION, x * inverse)
    store(rows, packets.DIRECTION + 1, y * inverse)
    store(rows, packets.DIRECTION + 2, -cosine)
    return cosine * cosine


@kernel
def exit_ray(camera, rows, lane):
    """Return the ray (origin, unit direction, weight) in the scene of a lane that has gone through a camera's lens."""
    origin = rows[packets.ORIGIN, lane], rows[packets.ORIGIN + 1, lane], rows[packets.ORIGIN + 2, lane]
    way = rows[packets.DIRECTION, lane], rows[packets.DIRECTION + 1, lane], rows[packets.DIRECTION + 2, lane]
    start, direction = ray_to_world(camera.frame, camera.pupil, origin, way)
    return start, direction, rows[packets.WEIGHT, lane]
