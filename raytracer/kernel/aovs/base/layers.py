"""Layers of a film that hold AOVs, and the kernels that record them.

Means over a pixel take the filter's weights, as radiance does.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core.compiler.dispatch import each, generic, kernel, optional, overridable
from raytracer.core.vec import add, sub
from raytracer.kernel.lens_dispersion import apply_lens_color
from raytracer.kernel.path_rows import load3, store3


class Aovs(NamedTuple):
    """The layers of a render besides radiance: MeanLayer, MajorityLayer, CoverageLayer and RaysLayer."""

    layers: tuple[Any, ...]


class LightAovs(NamedTuple):
    """The layers of a render besides radiance where a LightLayer is among them: paths record their direct light."""

    layers: tuple[Any, ...]


class MeanLayer(NamedTuple):
    """The mean over the samples that meet a surface.

    Attributes
    ----------
    quantity : first argument of `measure`.
    sums : float64 (height, width, size + 1), of the weighted values and, last, of the weights.
    column : first column of a workspace's AOV values that holds the quantity.
    size : number of values.
    """

    quantity: Any
    sums: NDArray[np.float64]
    column: int
    size: int


class MajorityLayer(NamedTuple):
    """The number that more than half of the samples measure, if there is one, else one of those measured.

    Attributes
    ----------
    quantity : first argument of `measure`.
    winner : int64 (height, width), the number.
    lead : int64 (height, width), its votes less those of all others.
    column : column of a workspace's AOV values that holds the number.

    References: Boyer & Moore 1991, "MJRTY - A Fast Majority Vote Algorithm", Automated Reasoning, pp. 105-117.
    """

    quantity: Any
    winner: NDArray[np.int64]
    lead: NDArray[np.int64]
    column: int


class CoverageLayer(NamedTuple):
    """Weights of samples: sums (height, width, 2) float64, of those that meet a surface, and of all."""

    sums: NDArray[np.float64]


class LightLayer(NamedTuple):
    """A part of the radiance.

    Attributes
    ----------
    part : Direct or Indirect.
    sums : float64 (height, width, 3), of the weighted radiance.
    """

    part: Any
    sums: NDArray[np.float64]


@generic
def measure(quantity, scene, seen):
    """Measure a quantity of an Interaction, a camera path's first: up to three numbers, by the layer's columns."""


@generic
def light_part(part, value, direct):
    """Return the part of a sample's radiance `value`, of which `direct` came by at most two path segments."""


# Columns of work.aov_values: 1 if the sample met a surface, 1 if its direct light has been stored, that, what is saved
# of it while the path is traced again, and from FIRST on those of the layers.
_IS_HIT, _IS_SPLIT, _DIRECT, _SAVED, FIRST = 0, 1, 2, 5, 8


@overridable
def begin_layer(layer, work, sample, origin, direction):
    """Record the camera ray of a sample; most layers need nothing of it."""


@overridable
def _record_layer(layer, scene, work, sample, seen):
    """Record the first hit of a sample."""


@_record_layer.register(MeanLayer)
def _record_layer_mean_layer(layer, scene, work, sample, seen):
    value = measure(layer.quantity, scene, seen)
    for i in range(layer.size):
        work.aov_values[sample, layer.column + i] = value[i]


@_record_layer.register(MajorityLayer)
def _record_layer_majority_layer(layer, scene, work, sample, seen):
    work.aov_values[sample, layer.column] = measure(layer.quantity, scene, seen)[0]


@kernel
def _direct_light(work, sample):
    """Return a sample's radiance and the direct part of it: all of it, if no direct part was stored."""
    whole = load3(work.radiance, sample, 0)
    return whole, load3(work.aov_values, sample, _DIRECT) if work.aov_values[sample, _IS_SPLIT] != 0.0 else whole


@generic
def add_layer(layer, spectrum, work, sample, x, y):
    """Add the recorded values of a sample to the pixel (x, y) of a layer."""


@add_layer.register(MeanLayer)
def add_layer_mean_layer(layer, spectrum, work, sample, x, y):
    if work.aov_values[sample, _IS_HIT] == 0.0:
        return
    # Leave out what has no value, such as the displacement of a point that passes behind the camera.
    total = 0.0
    for i in range(layer.size):
        total += work.aov_values[sample, layer.column + i]
    if not math.isfinite(total):
        return
    weight = work.weight[sample]
    for i in range(layer.size):
        layer.sums[y, x, i] += weight * work.aov_values[sample, layer.column + i]
    layer.sums[y, x, layer.size] += weight


@add_layer.register(MajorityLayer)
def add_layer_majority_layer(layer, spectrum, work, sample, x, y):
    # A ray that a lens stops has no vote: it does not see that there is no object.
    if work.weight[sample] == 0.0:
        return
    number = np.int64(0)
    if work.aov_values[sample, _IS_HIT] != 0.0:
        number = np.int64(work.aov_values[sample, layer.column])
    if layer.lead[y, x] == 0:
        layer.winner[y, x] = number
    layer.lead[y, x] += 1 if layer.winner[y, x] == number else -1


@add_layer.register(CoverageLayer)
def add_layer_coverage_layer(layer, spectrum, work, sample, x, y):
    weight = work.weight[sample]
    layer.sums[y, x, 0] += weight * work.aov_values[sample, _IS_HIT]
    layer.sums[y, x, 1] += weight


@add_layer.register(LightLayer)
def add_layer_light_layer(layer, spectrum, work, sample, x, y):
    value, direct = _direct_light(work, sample)
    part = apply_lens_color(spectrum, work, sample, light_part(layer.part, value, direct))
    for channel in range(3):
        layer.sums[y, x, channel] += work.weight[sample] * part[channel]


_begin_each = each(begin_layer)
_record_each = each(_record_layer)
_add_each = each(add_layer)


# ---- What the path tracer calls


@optional
def start_aovs(aovs, work, sample, origin, direction):
    """Clear the AOVs that the batch before recorded, and record the camera ray of this sample."""


@start_aovs.register(Aovs | LightAovs)
def start_aovs_aovs(aovs, work, sample, origin, direction):
    work.aov_values[sample, _IS_HIT] = 0.0
    work.aov_values[sample, _IS_SPLIT] = 0.0
    _begin_each(aovs.layers, work, sample, origin, direction)


@optional
def record_aovs(aovs, scene, work, path, surface):
    """Record the AOVs of a path's first Interaction."""


@record_aovs.register(Aovs | LightAovs)
def record_aovs_aovs(aovs, scene, work, path, surface):
    if path.depth == 1:
        work.aov_values[path.sample, _IS_HIT] = 1.0
        _record_each(aovs.layers, scene, work, path.sample, surface)


@optional(Aovs)
def record_direct_light(aovs, work, path):
    """Record the radiance of a path after its first two segments as direct light."""


@record_direct_light.register(LightAovs)
def record_direct_light_light_aovs(aovs, work, path):
    # All that comes from here on takes a third segment.
    if path.depth == 2:
        work.aov_values[path.sample, _IS_SPLIT] = 1.0
        store3(work.aov_values, path.sample, _DIRECT, load3(work.radiance, path.sample, 0))


@optional(Aovs)
def start_aov_retrace(aovs, work, sample):
    """Save a sample's direct light, less its radiance, while its path is traced again for another wavelength."""


@start_aov_retrace.register(LightAovs)
def start_aov_retrace_light_aovs(aovs, work, sample):
    whole, direct = _direct_light(work, sample)
    store3(work.aov_values, sample, _SAVED, sub(direct, whole))
    work.aov_values[sample, _IS_SPLIT] = 0.0


@optional(Aovs)
def finish_aov_retrace(aovs, work, sample):
    """Add the direct light of a path that was traced again to what was saved."""


@finish_aov_retrace.register(LightAovs)
def finish_aov_retrace_light_aovs(aovs, work, sample):
    _, direct = _direct_light(work, sample)
    store3(work.aov_values, sample, _DIRECT, add(direct, load3(work.aov_values, sample, _SAVED)))
    work.aov_values[sample, _IS_SPLIT] = 1.0


@optional
def add_aovs(aovs, spectrum, work, x, y, first, count):
    """Add the AOVs of samples from `first` on to a pixel, before samples that are not finite are dropped."""


@add_aovs.register(Aovs | LightAovs)
def add_aovs_aovs(aovs, spectrum, work, x, y, first, count):
    for sample in range(first, first + count):
        value = load3(work.radiance, sample, 0)
        if math.isfinite(work.weight[sample] * (value[0] + value[1] + value[2])):
            _add_each(aovs.layers, spectrum, work, sample, x, y)
