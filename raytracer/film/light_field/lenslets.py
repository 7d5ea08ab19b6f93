"""Pictures from behind microlenses: the ray of each pixel, and views for parts of the main lens.

The picture is upright, in pixels right and down from its top left corner.  The middle of a sub-image, `q`, and the
pixel's place from there, `o`, give the ray: it goes through the main lens at `stride o`, and at the slope
`slope (q - middle) - u w` from there, with `w` one over the distance of the plane whose image the microlenses lie in.
A view is all pixels at one place under their microlenses, which saw through one part of the main lens.

References: Ng et al. 2005, "Light Field Photography with a Hand-Held Plenoptic Camera", sec. 3; Lumsdaine, Georgiev
2009, "The Focused Plenoptic Camera", ICCP, sec. 4 (pictures of more pixels than microlenses).
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.film.light_field.bilinear import sample_bilinear
from raytracer.film.light_field.field import LIT_LAYER, RAYS_LAYER, LightField, Rays, Samples, rays_from_layer
from raytracer.film.light_field.lattice import Lattice
from raytracer.film.light_field.lenslet_kinds import Bundle, microlens_kinds, sharpness
from raytracer.film.light_field.openings import OpeningTable, disc_coverage
from raytracer.film.light_field.resampling import Resampler
from raytracer.film.light_field.views import Plane, Pose, Views

if TYPE_CHECKING:
    from raytracer.film.image import Image

FloatArray = NDArray[np.float64]

_SLACK = 1e-9
"""Tolerance (px) for a lattice of whole pixels."""

_MIN_COVERAGE = 1e-6
"""Fraction of a cell: views of which the aperture covers less are dark, and not brightened."""

_HALF = 0.5
"""Threshold between lit, 1, and dark, 0."""

_STEPS, _INSIDE = 2, 12
"""Places per pixel of the table of lit fractions; and places a side of a microlens over which light is averaged."""


class _WholePixelGrid(NamedTuple):
    """Sub-images of whole pixels: their size (px), left and top edge of the first (px), columns and rows of them."""

    pixels: int
    left: int
    top: int
    columns: int
    rows: int


@dataclass(frozen=True)
class Lenslets:
    """The layout of a light field in a picture from behind an array of microlenses.

    lattice : middles of the sub-images, in pixels of the picture.
    width, height (px) : of the picture.
    middle (px) : place of the axis, right and down.
    slope (1/px) : difference of the slopes in which two microlenses look through the middle of the main lens, per
        distance of their sub-images.
    stride (m/px) : distance of the places on the main lens that neighbouring pixels of a sub-image see.
    inverse_distance (1/m) : one over the distance of the plane that is imaged onto the microlenses; 0 for infinity,
        less than 0 beyond it.
    inverse_focus (1/m) : one over the distance of the plane that is sharp on the sensor; `inverse_distance` for a
        plenoptic camera 1.0, whose sensor is focused on the main lens.
    aperture, focal_length, pose : of the main lens; see `Views`.
    opening : table of the main lens's opening; None for the disc of the diameter `aperture`.
    blur (m/px) : distance by which the place on the main lens that a pixel sees moves back, per place in the
        microlens that light goes through (of microlenses as large as their sub-images).
    kinds (m/px) : `blur` of microlenses of three kinds; empty for one kind.
    """

    is_by_view: ClassVar[bool] = False

    lattice: Lattice
    width: int
    height: int
    middle: tuple[float, float]
    slope: float
    stride: float
    inverse_distance: float
    inverse_focus: float
    aperture: float | None = None
    focal_length: float | None = None
    pose: Pose | None = None
    blur: float = 0.0
    kinds: tuple[float, ...] = ()
    opening: OpeningTable | None = None

    @property
    def views(self) -> Views:
        """The geometry of the views.

        Raises ValueError: the picture is too small to hold any.
        """
        whole = self._whole
        if self.is_focused:
            return self._patches.views
        if whole is None:
            grid = self._grid
            return self._views(grid.count, 1.0, grid.middle, grid.pixel, grid.width, grid.height)
        if not whole.columns or not whole.rows:
            raise ValueError(f"a picture of {self.width} x {self.height} pixels holds no whole sub-image")
        count, width, height = whole.pixels, whole.columns, whole.rows
        middle = whole.left + 0.5 * width * count, whole.top + 0.5 * height * count
        return self._views(count, 1.0, middle, float(count), width, height)

    @property
    def holds_views(self) -> bool:
        """Return True if the picture is large enough for views."""
        try:
            _ = self.views
        except ValueError:
            return False
        return True

    @property
    def is_focused(self) -> bool:
        """Return True if microlenses focus the scene on the sensor, and not the main lens (plenoptic 2.0)."""
        return self.inverse_focus != self.inverse_distance

    def light_field(self, image: "Image", lit: FloatArray | None = None) -> LightField:
        """Extract the views; of a focused arrangement also rays, one a pixel.

        Views at the rim of the lens, which gather light through a part of their cell, are brightened as if they did
        through all of it; those without any are black.  Layers stay as they were seen.

        lit : (height, width), fraction of its light that each pixel of the image has; by default `lit`, the camera's.

        Raises ValueError: the picture is too small to hold any view.
        """
        views = self.views
        lit = self.lit if lit is None else lit
        layers = {name: np.asarray(layer) for name, layer in image.layers.items()}
        rays_layer = layers.pop(RAYS_LAYER, None)
        rays = self._rays(image.radiance, lit) if self.is_focused else None
        rays = rays if rays_layer is None else rays_from_layer(rays_layer, views)
        radiance, seen, samples = self._split_radiance(image.radiance, lit)
        parts = {name: self._split_views(layer, None) for name, layer in layers.items()}
        # A view that is lit all over or nowhere has its place within the lens, or outside it.
        if (seen != seen[:, :, :1, :1]).any():
            parts[LIT_LAYER] = seen.astype(np.uint8)
        return LightField(radiance, views, parts, rays, image.settings, samples)

    @cached_property
    def lit(self) -> FloatArray:
        """Fraction of the aperture's cell that each pixel sees which is open, (height, width)."""
        if self.kinds:
            return np.asarray(np.choose(self.pixel_kinds, [self.lit_through(blur) for blur in self.kinds]))
        return self.lit_through(self.blur)

    def lit_through(self, blur: float) -> FloatArray:
        """Compute the fraction that is open, (height, width), if all microlenses were of one `blur` (m/px)."""
        if self.aperture is None:
            return np.ones((self.height, self.width))
        _, away = self._pixels
        if blur == 0.0:
            return self._open_fraction(away[..., 0], away[..., 1])

        # A pixel's light spreads over more of the main lens: look it up by the pixel's place under its microlens.
        reach = math.ceil(_STEPS * max(math.hypot(*self.lattice.along), math.hypot(*self.lattice.across)))
        places = np.arange(-reach, reach + 1) / _STEPS
        x, y = np.meshgrid(places, places)
        inside = self._cell_points()
        spread = blur / self.stride * inside
        table = np.zeros_like(x)
        for right, down in spread:
            table += self._open_fraction(x - right, y - down)
        table /= len(spread)
        fractions, _ = sample_bilinear(table[..., None], None, _STEPS * away + (reach + 0.5), None)
        return fractions[..., 0]

    def _open_fraction(self, right: FloatArray, down: FloatArray) -> FloatArray:
        """Compute the fraction of the aperture's cell that is open, seen through a pinhole, by place under it (px)."""
        edge = self.stride
        return self._coverage(edge * (right - 0.5), edge * (-down - 0.5), edge)

    def _coverage(self, left: FloatArray, bottom: FloatArray, edge: float) -> FloatArray:
        """Compute the fraction of squares in the plane of the main lens (m) that its opening covers."""
        assert self.aperture is not None
        covered = disc_coverage if self.opening is None else self.opening.coverage
        return covered(left, bottom, edge, edge, 0.5 * self.aperture)

    def _cell_points(self) -> FloatArray:
        """Place points (n, 2) evenly in the cell of the lattice about a microlens, from its middle (px)."""
        steps = (np.arange(_INSIDE) + 0.5) / _INSIDE
        c, r = (grid.ravel() for grid in np.meshgrid(steps, steps))
        away = [self.lattice.place(c - i, r - j) - np.asarray(self.lattice.origin) for i in (0, 1) for j in (0, 1)]
        nearest = np.argmin([(place**2).sum(axis=-1) for place in away], axis=0)
        return np.asarray(np.stack(away)[nearest, np.arange(len(nearest))])

    @cached_property
    def _pixels(self) -> tuple[FloatArray, FloatArray]:
        """Middles of the sub-images that pixels belong to, and pixels' places from there: each (height, width, 2)."""
        x, y = np.meshgrid(np.arange(self.width) + 0.5, np.arange(self.height) + 0.5)
        places = np.stack([x, y], axis=-1)
        corner = np.floor(self.lattice.index(places))
        best, least = np.zeros_like(places), np.full(places.shape[:2], np.inf)
        for right, down in np.ndindex(2, 2):
            middles = self.lattice.place(corner[..., 0] + right, corner[..., 1] + down)
            distance = ((places - middles) ** 2).sum(axis=-1)
            nearer = distance < least
            best, least = np.where(nearer[..., None], middles, best), np.where(nearer, distance, least)
        return best, places - best

    @cached_property
    def pixel_kinds(self) -> NDArray[np.intp]:
        """Kinds of the microlenses of all pixels, (height, width)."""
        return microlens_kinds(self.lattice, self._pixels[0])

    def bundle(self, kind: int = 0) -> Bundle:
        """Return the light that comes to a point of the sensor through a microlens of a kind."""
        blur = self.lattice.pitch * (self.kinds[kind] if self.kinds else self.blur)
        return Bundle(self.lattice.pitch * self.slope + blur * self.inverse_distance, blur)

    def _weigh_kinds(self, lit: FloatArray) -> FloatArray:
        """Weigh pixels for views by how sharp their microlenses are in the plane of focus."""
        if not self.kinds:
            return lit
        spots = np.array([self.bundle(kind).spot(self.inverse_focus) for kind in range(len(self.kinds))])
        return np.asarray(lit * sharpness(spots, self.views.plane.pixel)[self.pixel_kinds])

    def _rays(self, radiance: NDArray[Any], lit: FloatArray) -> Rays:
        """Make a ray for each pixel that sees through the aperture, through the middle of its microlens."""
        middles, away = self._pixels
        sides = np.array([1.0, -1.0])
        on_lens = self.stride * away * sides
        image = self.slope * (middles - self.middle) * sides + on_lens * (self.inverse_focus - self.inverse_distance)
        seen = lit > _MIN_COVERAGE
        place = np.concatenate([on_lens[seen], image[seen]], axis=-1)
        bundles = (
            np.array([self.bundle(kind) for kind in range(len(self.kinds))])[self.pixel_kinds[seen]]
            if self.kinds
            else None
        )
        return Rays(place, np.asarray(radiance[seen], dtype=np.float64), lit[seen], bundles)

    # ---- Views

    @cached_property
    def _whole(self) -> _WholePixelGrid | None:
        """The sub-images that are whole in the picture, if they are squares of whole pixels; else None."""
        (x, down), (right, y) = self.lattice.along, self.lattice.across
        corner = (self.lattice.origin[0] - 0.5 * x, self.lattice.origin[1] - 0.5 * x)
        whole = all(abs(number - round(number)) < _SLACK for number in (x, *corner))
        if not whole or abs(down) + abs(right) + abs(x - y) > _SLACK:
            return None
        count = round(x)
        left, top = (round(place) % count for place in corner)
        return _WholePixelGrid(count, left, top, (self.width - left) // count, (self.height - top) // count)

    @cached_property
    def _grid(self) -> Resampler:
        return Resampler(self.lattice, self.width, self.height)

    @property
    def overlap(self) -> float:
        """Number of microlenses, across, that see each point of the plane of focus, in a focused arrangement."""
        return abs(self.inverse_focus - self.inverse_distance) * self.stride / self.slope

    @cached_property
    def _patches(self) -> "_PatchViews":
        return _PatchViews(self)

    def _views(
        self, count: int, step: float, middle: tuple[float, float], pixel: float, width: int, height: int
    ) -> Views:
        """Compute the geometry of count x count views, `step` px of the picture apart, with pixels of size `pixel`."""
        steps = (np.arange(count) - 0.5 * (count - 1)) * step * self.stride
        position, cell = np.stack(np.meshgrid(steps, -steps), axis=-1), step * self.stride
        corner = position - 0.5 * cell
        edge = self.slope * pixel
        right = self.slope * (middle[0] - self.middle[0])
        up = self.slope * (self.middle[1] - middle[1])
        return Views(
            position=position,
            plane=Plane(edge, right - 0.5 * width * edge, up + 0.5 * height * edge),
            width=width,
            height=height,
            inverse_focus=self.inverse_focus,
            cell=(cell, cell),
            aperture=self.aperture,
            focal_length=self.focal_length,
            pose=self.pose,
            coverage=None if self.opening is None else self._coverage(corner[..., 0], corner[..., 1], cell),
        )

    def _split_radiance(
        self, picture: NDArray[Any], lit: FloatArray
    ) -> tuple[NDArray[Any], NDArray[np.bool_], Samples | None]:
        """Sort radiance, brightened to full coverage, by views; also find lit pixels, and samples if interpolated."""
        is_lit = lit > _MIN_COVERAGE
        gain = np.where(is_lit, 1.0 / np.where(is_lit, lit, 1.0), 0.0)
        picture = picture * gain.reshape(*gain.shape, *(1,) * (picture.ndim - 2))
        if self.is_focused:
            # The weighted mean of ones is 1, or 0 where all weights are 0.
            return (
                self._split_views(picture, self._weigh_kinds(lit)),
                self._patches.split_views(np.ones(lit.shape), lit) > _HALF,
                None,
            )
        if self._whole is not None:
            return self._split_views(picture, lit), self._split_views(is_lit, None), None
        grid = self._grid
        views = [[grid.weighted(picture, r, c, lit) for c in range(grid.count)] for r in range(grid.count)]
        radiance, seen, samples = (
            np.array([[getattr(view, name) for view in row] for row in views]) for name in ("values", "seen", "samples")
        )
        return radiance, seen, None if grid.is_direct else Samples(grid.places, samples)

    def _split_views(self, picture: NDArray[Any], lit: FloatArray | None) -> NDArray[Any]:
        """Sort a picture (height, width, ...) by views (rows, columns, height, width, ...); pixels count as `lit`."""
        if self.is_focused:
            return self._patches.split_views(picture, lit)
        whole = self._whole
        if whole is None:
            grid, places = self._grid, range(self._grid.count)
            return np.array([[grid.view(picture, row, column, lit) for column in places] for row in places])
        count = whole.pixels
        inside = picture[whole.top :, whole.left :][: whole.rows * count, : whole.columns * count]
        apart = inside.reshape(whole.rows, count, whole.columns, count, *picture.shape[2:])
        return np.moveaxis(apart, (1, 3), (0, 1))


class _PatchViews:
    """Views of a focused arrangement, made of patches of the sub-images.

    A place x of the plane of focus is seen behind the microlens at q at the pixel
    o = (x - slope (q - middle)) / `reach` from its middle, through the place `stride o` of the main lens.  So there are
    as many views a side as microlenses that see one place; and each has the pixels of the sensor itself.  Between the
    microlenses that see a pixel of a view through the lens's places next to the view's own, values are interpolated
    linearly.
    """

    def __init__(self, lenslets: Lenslets) -> None:
        own = self._own = lenslets
        self._reach = (own.inverse_focus - own.inverse_distance) * own.stride
        count = max(2, round(own.overlap))
        diameter = own.stride * own.lattice.pitch if own.aperture is None else own.aperture
        pixel = own.overlap
        width, height = math.floor(own.width / pixel + _SLACK), math.floor(own.height / pixel + _SLACK)
        if width < 1 or height < 1:
            raise ValueError(f"a picture of {own.width} x {own.height} pixels holds no whole sub-image")
        self.views = own._views(count, diameter / own.stride / count, own.middle, pixel, width, height)

    def split_views(self, picture: NDArray[Any], weight: FloatArray | None) -> NDArray[np.float64]:
        """Sort a picture (height, width, ...) by views (rows, columns, height, width, ...)."""
        views = self.views
        flat = picture.reshape(*picture.shape[:2], -1)
        by_view = np.array(
            [[self._view(flat, weight, place) for place in row] for row in views.position * np.array([1.0, -1.0])]
        )
        return by_view.reshape(*by_view.shape[:4], *picture.shape[2:])

    def _view(self, picture: NDArray[Any], weight: FloatArray | None, place: FloatArray) -> FloatArray:
        """Compute the view from a place of the lens, right and down (m)."""
        own, plane = self._own, self.views.plane
        x = plane.left + plane.pixel * (np.arange(self.views.width) + 0.5)
        y = plane.pixel * (np.arange(self.views.height) + 0.5) - plane.top
        seen = np.stack(np.meshgrid(x, y), axis=-1)
        through = own.lattice.index((seen - place * (self._reach / own.stride)) / own.slope + own.middle)
        values, weights = self._blend(picture, weight, seen, through, 1)
        # Where none of the nearest is lit, as at the rim of the lens, those next to them are.
        missing = weights <= _MIN_COVERAGE
        if missing.any():
            values[missing], weights[missing] = self._blend(picture, weight, seen[missing], through[missing], 2)
        return np.asarray(values / np.where(weights > _MIN_COVERAGE, weights, np.inf)[..., None])

    def _blend(
        self, picture: NDArray[Any], weight: FloatArray | None, seen: FloatArray, through: FloatArray, width: int
    ) -> tuple[FloatArray, FloatArray]:
        """Sum the weighted values of microlenses within `width` steps of the lattice, and their weights."""
        own = self._own
        middles, _ = own._pixels
        corner = np.floor(through)
        total, counted = np.zeros((*seen.shape[:-1], picture.shape[2])), np.zeros(seen.shape[:-1])
        for right in range(1 - width, 1 + width):
            for down in range(1 - width, 1 + width):
                number = corner + np.array([right, down])
                near = np.clip(1.0 - np.abs(through - number) / width, 0.0, None).prod(axis=-1)
                middle = own.lattice.place(number[..., 0], number[..., 1])
                away = (seen - own.slope * (middle - own.middle)) / self._reach
                # Places beyond the sub-image belong to another microlens.
                near *= np.hypot(away[..., 0], away[..., 1]) <= 0.5 * own.lattice.pitch
                values, weights = sample_bilinear(picture, weight, middle + away, (middles, middle))
                total += near[..., None] * values
                counted += near * weights
        return total, counted
