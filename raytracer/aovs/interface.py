"""What every AOV gives to packing and to kernels.

An AOV's file holds its spec, which says what it is called and measured in, and its case of `measure`: up to three
numbers of the first surface that a camera path meets.  Means over a pixel take the filter's weights, as radiance does.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.accumulation import merge
from raytracer.film.film import Film
from raytracer.hues import KEPT, finished
from raytracer.integrator import observe, observe_again, observe_direct, observe_end, observe_start
from raytracer.jit import each, generic, kernel
from raytracer.paths import load3, store3
from raytracer.spec import Spec
from raytracer.vec import add, sub


@dataclass(frozen=True)
class Identities:
    """Who is who in a packed scene; number 0 is nobody.

    Attributes
    ----------
    objects : names of the objects from number 1 on.
    first : int64 (tables + 1,), which entries of `start` and `owner` are those of a table of primitives.
    start : int64 (n,), the primitive of the table from which on `owner` holds, rising within a table.
    owner : int32 (n,), numbers of objects.
    placed : int32 (instances,), number of the object that an instance is, in place of the owners of its primitives.
    materials : names of the materials from number 1 on.
    material : int32 (references,), the number of a material by the reference that primitives have.
    spp : samples of each pixel, where all have as many.
    frame : where the packed camera is, a placement.Frame, if it stays there; else None.
    """

    objects: tuple[str, ...]
    first: NDArray[np.int64]
    start: NDArray[np.int64]
    owner: NDArray[np.int32]
    placed: NDArray[np.int32]
    materials: tuple[str, ...]
    material: NDArray[np.int32]
    spp: int = 0
    frame: Any = None


class AovSpec(Spec):
    """Base of the AOVs.

    channels, what the components are called in a file; unit, of the values; empty, what a pixel holds that sees
    nothing; is_by_sample, whether it holds something of each sample, so that all pixels must have as many.
    """

    type: str
    channels: ClassVar[tuple[str, ...]]
    unit: ClassVar[str] = ""
    empty: ClassVar[float] = 0.0
    is_by_sample: ClassVar[bool] = False

    def quantity(self, identities: Identities) -> Any:
        """What kernels measure: the first argument of `measure`."""
        raise NotImplementedError

    def pack(self, height: int, width: int, column: int, identities: Identities) -> Any:
        """The layer that gathers this AOV in a film of height x width pixels, or None if the film itself knows it.

        It may use as many columns of a workspace as it has channels, from `column` on.
        """
        size = len(self.channels)
        return Mean(self.quantity(identities), np.zeros((height, width, size + 1)), column, size)

    def develop(self, layer: Any, film: Film) -> NDArray[Any]:
        """The finished AOV, (height, width) for a single channel, else (height, width, channels)."""
        sums, weight = layer.sums[..., :-1], layer.sums[..., -1:]
        values = np.full(sums.shape, self.empty)
        np.divide(sums, weight, out=values, where=weight != 0.0)
        return values[..., 0] if len(self.channels) == 1 else values

    def components(self, layer: Any) -> tuple[str, ...]:
        """What the components of the finished AOV are called in a file."""
        return self.channels

    def names(self, identities: Identities) -> Mapping[int, str]:
        """What the numbers mean, where they are names."""
        return {}


class Aovs(NamedTuple):
    """The layers that a render gathers besides radiance: a tuple of Mean, Vote, Coverage and Light."""

    layers: tuple[Any, ...]


class Seen(NamedTuple):
    """The first surface that a camera path meets.

    origin and direction, of the camera ray; hit, a geometry.Hit; site, a geometry.Site; normal, as shaded, on the
    camera's side, and front, whether that is the outside; material, the reference of what is there behind all
    selectors; instance, table and primitive, what was hit; time, None or a fraction of the shutter's opening.
    """

    origin: Any
    direction: Any
    hit: Any
    site: Any
    normal: Any
    front: bool
    material: int
    instance: int
    table: int
    primitive: int
    time: Any


class Mean(NamedTuple):
    """The mean over the samples that meet a surface.

    sums (height, width, size + 1) float64, of the weighted values and, last, of the weights; column, where a
    workspace keeps the values, and size, how many.
    """

    quantity: Any
    sums: NDArray[np.float64]
    column: int
    size: int


class Vote(NamedTuple):
    """The number that most samples say, if more than half do, else one of those said.

    winner (height, width) int64, and its lead (height, width) int64 over all others together.

    References: Boyer & Moore 1991, "MJRTY - A Fast Majority Vote Algorithm", Automated Reasoning, pp. 105-117.
    """

    quantity: Any
    winner: NDArray[np.int64]
    lead: NDArray[np.int64]
    column: int


class Coverage(NamedTuple):
    """sums (height, width, 2) float64, of the weights of the samples that meet a surface, and of all."""

    sums: NDArray[np.float64]


class Light(NamedTuple):
    """A part of the radiance.

    part, Direct or Indirect; sums (height, width, 3) float64; column, where a workspace keeps what is direct.
    """

    part: Any
    sums: NDArray[np.float64]
    column: int


@generic
def measure(quantity, scene, seen):
    """The quantity of what is Seen: three numbers, of which a Mean or Vote takes as many as it has columns."""
    raise NotImplementedError


@generic
def share(part, value, direct):
    """The part of a sample's radiance `value`, by channel, of which `direct` came by at most two segments."""
    raise NotImplementedError


# ---- One layer

# Columns of work.features: whether the sample met a surface, whether what was direct of it has been noted, and from
# FIRST on those of the layers.
_MET, _SPLIT, FIRST = 0, 1, 2


@generic
def begin_layer(layer, work, sample, origin, direction):
    """Note the camera ray of a sample; by default there is nothing to note of it."""
    raise NotImplementedError


@begin_layer.register(tuple)
def _(layer, work, sample, origin, direction):
    return


@generic
def _note(layer, scene, work, sample, seen):
    raise NotImplementedError


@_note.register(tuple)
def _(layer, scene, work, sample, seen):
    return


@_note.register(Mean)
def _(layer, scene, work, sample, seen):
    value = measure(layer.quantity, scene, seen)
    for i in range(layer.size):
        work.features[sample, layer.column + i] = value[i]


@_note.register(Vote)
def _(layer, scene, work, sample, seen):
    work.features[sample, layer.column] = measure(layer.quantity, scene, seen)[0]


@generic
def _note_direct(layer, work, sample):
    raise NotImplementedError


@_note_direct.register(tuple)
def _(layer, work, sample):
    return


@_note_direct.register(Light)
def _(layer, work, sample):
    store3(work.features, sample, layer.column, load3(work.radiance, sample, 0))


@kernel
def _direct_of(layer, work, sample):
    """All that a sample has gathered, and what of it is direct: all of it, if nothing else was noted."""
    whole = load3(work.radiance, sample, 0)
    return whole, load3(work.features, sample, layer.column) if work.features[sample, _SPLIT] != 0.0 else whole


@generic
def _keep_direct(layer, work, sample):
    raise NotImplementedError


@_keep_direct.register(tuple)
def _(layer, work, sample):
    return


@_keep_direct.register(Light)
def _(layer, work, sample):
    whole, direct = _direct_of(layer, work, sample)
    store3(work.hues, sample, KEPT, sub(direct, whole))


@generic
def _add_direct(layer, work, sample):
    raise NotImplementedError


@_add_direct.register(tuple)
def _(layer, work, sample):
    return


@_add_direct.register(Light)
def _(layer, work, sample):
    _, direct = _direct_of(layer, work, sample)
    store3(work.features, sample, layer.column, add(direct, load3(work.hues, sample, KEPT)))


@generic
def add_layer(layer, spectrum, work, sample, x, y):
    """Add what was noted of a sample to the pixel (x, y) of a layer."""
    raise NotImplementedError


@add_layer.register(Mean)
def _(layer, spectrum, work, sample, x, y):
    if work.features[sample, _MET] == 0.0:
        return
    # Leave out what has no value, such as the way in the picture of a point that passes behind the camera.
    total = 0.0
    for i in range(layer.size):
        total += work.features[sample, layer.column + i]
    if not math.isfinite(total):
        return
    weight = work.radiance[sample, 3]
    for i in range(layer.size):
        layer.sums[y, x, i] += weight * work.features[sample, layer.column + i]
    layer.sums[y, x, layer.size] += weight


@add_layer.register(Vote)
def _(layer, spectrum, work, sample, x, y):
    # A ray that a lens stops sees nothing, which is not the same as seeing that there is nothing.
    if work.radiance[sample, 3] == 0.0:
        return
    number = np.int64(0)
    if work.features[sample, _MET] != 0.0:
        number = np.int64(work.features[sample, layer.column])
    if layer.lead[y, x] == 0:
        layer.winner[y, x] = number
    layer.lead[y, x] += 1 if layer.winner[y, x] == number else -1


@add_layer.register(Coverage)
def _(layer, spectrum, work, sample, x, y):
    weight = work.radiance[sample, 3]
    layer.sums[y, x, 0] += weight * work.features[sample, _MET]
    layer.sums[y, x, 1] += weight


@add_layer.register(Light)
def _(layer, spectrum, work, sample, x, y):
    value = load3(work.radiance, sample, 0)
    direct = load3(work.features, sample, layer.column) if work.features[sample, _SPLIT] != 0.0 else value
    part = finished(spectrum, work, sample, share(layer.part, value, direct))
    for channel in range(3):
        layer.sums[y, x, channel] += work.radiance[sample, 3] * part[channel]


_begin_each = each(begin_layer)
_note_each = each(_note)
_note_direct_each = each(_note_direct)
_keep_direct_each = each(_keep_direct)
_add_direct_each = each(_add_direct)
_add_each = each(add_layer)


# ---- What the integrator calls


@observe_start.register(Aovs)
def _(aovs, work, sample, origin, direction):
    work.features[sample, _MET] = 0.0
    work.features[sample, _SPLIT] = 0.0
    _begin_each(aovs.layers, work, sample, origin, direction)


@observe.register(Aovs)
def _(aovs, scene, work, sample, instance, table, primitive, hit, reference, site, normal, front, ray, time):
    work.features[sample, _MET] = 1.0
    seen = Seen(ray[0], ray[1], hit, site, normal, front, reference, instance, table, primitive, time)
    _note_each(aovs.layers, scene, work, sample, seen)


@observe_direct.register(Aovs)
def _(aovs, work, sample, done):
    # All that comes from here on takes a third segment.
    if done == 2:
        work.features[sample, _SPLIT] = 1.0
        _note_direct_each(aovs.layers, work, sample)


@observe_again.register(Aovs)
def _(aovs, work, sample):
    _keep_direct_each(aovs.layers, work, sample)
    work.features[sample, _SPLIT] = 0.0


@observe_end.register(Aovs)
def _(aovs, work, sample):
    _add_direct_each(aovs.layers, work, sample)
    work.features[sample, _SPLIT] = 1.0


@merge.register(Aovs)
def _(aovs, spectrum, work, x, y, count):
    for sample in range(count):
        value = load3(work.radiance, sample, 0)
        if math.isfinite(work.radiance[sample, 3] * (value[0] + value[1] + value[2])):
            _add_each(aovs.layers, spectrum, work, sample, x, y)
