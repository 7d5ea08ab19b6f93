"""A picture from behind microlenses: which pixel saw where to, and through which part of the main lens.

The picture is upright, in pixels right and down from its top left corner.  The middle of a sub-image, `q`, and the
pixel's place from there, `o`, give the ray: it goes through the main lens at `stride o`, and at the slope
`slope (q - middle) - u w` from there, with `w` one over the distance of the plane whose image the microlenses lie in.
A view is all pixels at one place under their microlenses, so all that came through one part of the main lens.

References: Ng et al. 2005, "Light Field Photography with a Hand-Held Plenoptic Camera", sec. 3; Lumsdaine, Georgiev
2009, "The Focused Plenoptic Camera", ICCP, sec. 4 (pictures of more pixels than microlenses).
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.plenoptic.disc_coverage import disc_share
from raytracer.plenoptic.field import LIT, LightField, Rays, Samples
from raytracer.plenoptic.rays import LAYER, rays_of
from raytracer.plenoptic.resampling import Lattice, Resampler
from raytracer.plenoptic.views import Plane, Pose, Views

if TYPE_CHECKING:
    from raytracer.film.image import Image

Floats = NDArray[np.float64]

_SLACK = 1e-9
"""Of a pixel: within this a lattice counts as one of whole pixels."""

_LEAST_SHARE = 1e-6
"""Of a cell: what an aperture covers less of is dark, and not made as bright as the others."""

_HALF = 0.5
"""Between what is lit, 1, and what is not, 0."""

_SAME = 0.5
"""Of a pixel: middles of sub-images that are nearer to each other are one."""

_STEPS, _INSIDE = 2, 12
"""Of a table of what is lit: places a pixel; and of a microlens: places a side over which light is averaged."""


class _Whole(NamedTuple):
    """Sub-images of whole pixels: how many across; left and top edge of the first (pixels), and how many of them."""

    pixels: int
    left: int
    top: int
    columns: int
    rows: int


@dataclass(frozen=True)
class Lenslets:
    """How a picture from behind an array of microlenses holds a light field.

    Attributes
    ----------
    lattice : middles of the sub-images, in pixels of the picture.
    width, height : pixels of the picture.
    middle : where the axis is (pixels right and down).
    slope : by how much the slopes differ in which two microlenses look through the middle of the lens, over the
        distance of their sub-images (1/pixel).
    stride : by how much the places on the main lens differ which two pixels of a sub-image see (m/pixel).
    inverse_distance : one over the distance of the plane whose image the microlenses lie in (1/m); 0 for infinity, less
        than 0 beyond it.
    inverse_focus : one over the distance of the plane that is sharp on the sensor; `inverse_distance` of a plenoptic
        1.0, whose sensor is sharp on the main lens.
    aperture, focal_length, pose : of the main lens; see `Views`.
    blur : by how much the place on the main lens moves back that a pixel sees, by where light goes through the
        microlens (m/pixel, the microlenses being as large as their sub-images).
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

    @property
    def views(self) -> Views:
        """The geometry of the views.

        Raises
        ------
        ValueError : the picture is too small to hold any.
        """
        whole = self._whole
        if self.is_focused:
            return self._patches.views
        if whole is None:
            grid = self._grid
            return self._views(grid.count, grid.step, grid.middle, grid.pixel, grid.width, grid.height)
        if not whole.columns or not whole.rows:
            raise ValueError(f"a picture of {self.width} x {self.height} pixels holds no whole sub-image")
        count, width, height = whole.pixels, whole.columns, whole.rows
        middle = whole.left + 0.5 * width * count, whole.top + 0.5 * height * count
        return self._views(count, 1.0, middle, float(count), width, height)

    @property
    def holds_views(self) -> bool:
        """Whether the picture is large enough for views."""
        try:
            _ = self.views
        except ValueError:
            return False
        return True

    @property
    def is_focused(self) -> bool:
        """Whether microlenses show the scene sharply on the sensor, and not the main lens."""
        return self.inverse_focus != self.inverse_distance

    def light_field(self, image: "Image") -> LightField:
        """What the picture holds, by views; of a focused arrangement also by rays, one a pixel.

        Views at the rim of the lens, which gather light through a part of their cell, are made as bright as they would
        be through all of it; those of which nothing is covered are black.  Layers are not: they are of what was seen.

        Raises
        ------
        ValueError : the picture is too small to hold any view.
        """
        views = self.views
        lit = self.lit
        layers = {name: np.asarray(layer) for name, layer in image.layers.items()}
        kept = layers.pop(LAYER, None)
        rays = self._rays(image.radiance, lit) if self.is_focused else None
        radiance, seen, samples = self._light_apart(image.radiance, lit)
        parts = {name: self._apart(layer, None) for name, layer in layers.items()}
        # A view that is lit all over or nowhere has its place within the lens, or outside it.
        if (seen != seen[:, :, :1, :1]).any():
            parts[LIT] = seen.astype(np.uint8)
        return LightField(
            radiance=radiance,
            views=views,
            layers=parts,
            rays=rays if kept is None else rays_of(kept, views),
            settings=image.settings,
            samples=samples,
        )

    @cached_property
    def lit(self) -> Floats:
        """Which part of the aperture's cell that a pixel sees is open (height, width)."""
        if self.aperture is None:
            return np.ones((self.height, self.width))
        _, away = self._pixels
        if self.blur == 0.0:
            return self._open(away[..., 0], away[..., 1])

        # A pixel's light spreads over more of the main lens: look it up by the pixel's place under its microlens.
        reach = math.ceil(_STEPS * max(math.hypot(*self.lattice.along), math.hypot(*self.lattice.across)))
        places = np.arange(-reach, reach + 1) / _STEPS
        x, y = np.meshgrid(places, places)
        inside = self._cell()
        spread = self.blur / self.stride * inside
        table = np.mean([self._open(x - right, y - down) for right, down in spread], axis=0)
        found, _ = _sampled(table[..., None], None, _STEPS * away + (reach + 0.5), None)
        return found[..., 0]

    def _open(self, right: Floats, down: Floats) -> Floats:
        """Which part of the aperture is open that is seen through a pinhole, by place under it (pixels)."""
        assert self.aperture is not None
        edge = self.stride
        return disc_share(edge * (right - 0.5), edge * (-down - 0.5), edge, edge, 0.5 * self.aperture)

    def _cell(self) -> Floats:
        """Places (n, 2) evenly in the part of the lattice that is nearest to a microlens, from its middle (pixels)."""
        steps = (np.arange(_INSIDE) + 0.5) / _INSIDE
        c, r = (grid.ravel() for grid in np.meshgrid(steps, steps))
        away = [self.lattice.place(c - i, r - j) - np.asarray(self.lattice.origin) for i in (0, 1) for j in (0, 1)]
        nearest = np.argmin([(place**2).sum(axis=-1) for place in away], axis=0)
        return np.asarray(np.stack(away)[nearest, np.arange(len(nearest))])

    @cached_property
    def _pixels(self) -> tuple[Floats, Floats]:
        """Middles of the sub-images that pixels belong to, and their own places from there: each (height, width, 2)."""
        x, y = np.meshgrid(np.arange(self.width) + 0.5, np.arange(self.height) + 0.5)
        places = np.stack([x, y], axis=-1)
        corner = np.floor(self.lattice.index(places))
        best, least = np.zeros_like(places), np.full(places.shape[:2], np.inf)
        for right in (0.0, 1.0):
            for down in (0.0, 1.0):
                middles = self.lattice.place(corner[..., 0] + right, corner[..., 1] + down)
                distance = ((places - middles) ** 2).sum(axis=-1)
                nearer = distance < least
                best, least = np.where(nearer[..., None], middles, best), np.where(nearer, distance, least)
        return best, places - best

    def _rays(self, radiance: NDArray[Any], lit: Floats) -> Rays:
        """A ray a pixel, through the middle of its microlens, of those that come through the aperture."""
        middles, away = self._pixels
        sides = np.array([1.0, -1.0])
        on_lens = self.stride * away * sides
        image = self.slope * (middles - self.middle) * sides + on_lens * (self.inverse_focus - self.inverse_distance)
        seen = lit > _LEAST_SHARE
        place = np.concatenate([on_lens[seen], image[seen]], axis=-1)
        return Rays(place, np.asarray(radiance[seen], dtype=np.float64), lit[seen])

    # ---- Views

    @cached_property
    def _whole(self) -> _Whole | None:
        """The sub-images that are whole in the picture, if all are squares of whole pixels; None if they are not."""
        (x, down), (right, y) = self.lattice.along, self.lattice.across
        corner = (self.lattice.origin[0] - 0.5 * x, self.lattice.origin[1] - 0.5 * x)
        whole = all(abs(number - round(number)) < _SLACK for number in (x, *corner))
        if not whole or abs(down) + abs(right) + abs(x - y) > _SLACK:
            return None
        count = round(x)
        left, top = (round(place) % count for place in corner)
        return _Whole(count, left, top, (self.width - left) // count, (self.height - top) // count)

    @cached_property
    def _grid(self) -> Resampler:
        return Resampler(self.lattice, self.width, self.height)

    @property
    def overlap(self) -> float:
        """How many microlenses, across, see each place of the plane that is sharp: behind focused ones."""
        return abs(self.inverse_focus - self.inverse_distance) * self.stride / self.slope

    @cached_property
    def _patches(self) -> "_Patches":
        return _Patches(self)

    def _views(
        self, count: int, step: float, middle: tuple[float, float], pixel: float, width: int, height: int
    ) -> Views:
        """The geometry of count x count views, `step` pixels of the picture apart, with pixels of an edge `pixel`."""
        steps = (np.arange(count) - 0.5 * (count - 1)) * step * self.stride
        edge = self.slope * pixel
        right = self.slope * (middle[0] - self.middle[0])
        up = self.slope * (self.middle[1] - middle[1])
        return Views(
            position=np.stack(np.meshgrid(steps, -steps), axis=-1),
            plane=Plane(edge, right - 0.5 * width * edge, up + 0.5 * height * edge),
            width=width,
            height=height,
            inverse_focus=self.inverse_focus,
            cell=(step * self.stride, step * self.stride),
            aperture=self.aperture,
            focal_length=self.focal_length,
            pose=self.pose,
        )

    def _light_apart(
        self, picture: NDArray[Any], lit: Floats
    ) -> tuple[NDArray[Any], NDArray[np.bool_], Samples | None]:
        """Radiance by views as if all of it were lit, which pixels are, and what they are interpolated from, if so."""
        is_lit = lit > _LEAST_SHARE
        gain = np.where(is_lit, 1.0 / np.where(is_lit, lit, 1.0), 0.0)
        picture = picture * gain.reshape(*gain.shape, *(1,) * (picture.ndim - 2))
        if self.is_focused:
            # The mean of ones by what counts is 1, or 0 where nothing does.
            return self._apart(picture, lit), self._patches.apart(np.ones(lit.shape), lit) > _HALF, None
        if self._whole is not None:
            return self._apart(picture, lit), self._apart(is_lit, None), None
        grid = self._grid
        views = [[grid.weighted(picture, r, c, lit) for c in range(grid.count)] for r in range(grid.count)]
        radiance, seen, samples = (
            np.array([[getattr(view, name) for view in row] for row in views]) for name in ("values", "seen", "samples")
        )
        return radiance, seen, None if grid.is_direct else Samples(grid.places, samples)

    def _apart(self, picture: NDArray[Any], lit: Floats | None) -> NDArray[Any]:
        """Sort a picture (height, width, ...) by views (rows, columns, height, width, ...); pixels count as `lit`."""
        if self.is_focused:
            return self._patches.apart(picture, lit)
        whole = self._whole
        if whole is None:
            grid, places = self._grid, range(self._grid.count)
            return np.array([[grid.view(picture, row, column, lit) for column in places] for row in places])
        count = whole.pixels
        inside = picture[whole.top :, whole.left :][: whole.rows * count, : whole.columns * count]
        apart = inside.reshape(whole.rows, count, whole.columns, count, *picture.shape[2:])
        return np.moveaxis(apart, (1, 3), (0, 1))


class _Patches:
    """Views of a focused arrangement: of every sub-image the part that the plane that is sharp continues in the next.

    A place x of that plane is seen behind the microlens at q at the pixel o = (x - slope (q - middle)) / `reach` from
    its middle, through the place `stride o` of the main lens.  So there are as many views a side as microlenses that
    see one place; and each has the pixels of the sensor itself.  Between the microlenses that see a pixel of a view
    through the lens's places next to the view's own, what they see there is interpolated linearly.
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

    def apart(self, picture: NDArray[Any], weight: Floats | None) -> NDArray[np.float64]:
        """A picture (height, width, ...) by views (rows, columns, height, width, ...)."""
        views = self.views
        flat = picture.reshape(*picture.shape[:2], -1)
        found = np.array(
            [[self._view(flat, weight, place) for place in row] for row in views.position * np.array([1.0, -1.0])]
        )
        return found.reshape(*found.shape[:4], *picture.shape[2:])

    def _view(self, picture: NDArray[Any], weight: Floats | None, place: Floats) -> Floats:
        """The view from a place of the lens, right and down (m)."""
        own, plane = self._own, self.views.plane
        x = plane.left + plane.pixel * (np.arange(self.views.width) + 0.5)
        y = plane.pixel * (np.arange(self.views.height) + 0.5) - plane.top
        seen = np.stack(np.meshgrid(x, y), axis=-1)
        through = own.lattice.index((seen - place * (self._reach / own.stride)) / own.slope + own.middle)
        values, weights = self._mixed(picture, weight, seen, through, 1)
        # Where none of the nearest is lit, as at the rim of the lens, those next to them are.
        missing = weights <= _LEAST_SHARE
        if missing.any():
            values[missing], weights[missing] = self._mixed(picture, weight, seen[missing], through[missing], 2)
        return np.asarray(values / np.where(weights > _LEAST_SHARE, weights, np.inf)[..., None])

    def _mixed(
        self, picture: NDArray[Any], weight: Floats | None, seen: Floats, through: Floats, width: int
    ) -> tuple[Floats, Floats]:
        """Sums of what microlenses see, that are within `width` steps of the lattice, and of what they count for."""
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
                # What lies beyond the sub-image is another microlens's.
                near *= np.hypot(away[..., 0], away[..., 1]) <= 0.5 * own.lattice.pitch
                values, weights = _sampled(picture, weight, middle + away, (middles, middle))
                total += near[..., None] * values
                counted += near * weights
        return total, counted


def _sampled(
    picture: NDArray[Any], weight: Floats | None, place: Floats, of: tuple[Floats, Floats] | None
) -> tuple[Floats, Floats]:
    """Values times weights, and weights, at places of a picture (..., 2), linear between the middles of its pixels.

    of : middles of the sub-images that pixels belong to (height, width, 2), and of those that are meant (..., 2): the
        pixels of others do not count.
    """
    height, width = picture.shape[:2]
    x, y = place[..., 0] - 0.5, place[..., 1] - 0.5
    left, top = np.floor(x).astype(np.intp), np.floor(y).astype(np.intp)
    total, counted = np.zeros((*x.shape, picture.shape[2])), np.zeros(x.shape)
    for column, part_x in ((left, left + 1.0 - x), (left + 1, x - left)):
        for row, part_y in ((top, top + 1.0 - y), (top + 1, y - top)):
            inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
            i, j = np.where(inside, row, 0), np.where(inside, column, 0)
            if of is not None:
                inside &= (np.abs(of[0][i, j] - of[1]) < _SAME).all(axis=-1)
            share = np.where(inside, part_x * part_y, 0.0) * (1.0 if weight is None else weight[i, j])
            total += share[..., None] * picture[i, j]
            counted += share
    return total, counted
