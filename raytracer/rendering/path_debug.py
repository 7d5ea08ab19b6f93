"""Trace one sample of a picture again, and log its path: for `rt render --pixel X,Y --sample K --debug`."""

import math
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core.embree import MISS
from raytracer.core.instancing import resolve_instance
from raytracer.core.primitives.base.interface import row_of_any
from raytracer.kernel import path_log
from raytracer.kernel.path_state import workspace as make_workspace
from raytracer.plugins.materials.base.interface import DIMENSIONS_PER_SEGMENT, PASSTHROUGH
from raytracer.plugins.media.base.interface import NO_MEDIUM
from raytracer.rendering.checked_options import override_settings
from raytracer.rendering.compilation import compile_kernel
from raytracer.rendering.diagnostics import brightest_sample, log_path, replay_samples
from raytracer.rendering.film_region import empty_film, film_view
from raytracer.rendering.options import RenderOptions
from raytracer.scene.pack.scene import PackedScene, pack, scene_ids
from raytracer.scene.spec import SceneSpec
from raytracer.util.errors import InputError

# Contents of the columns of a log's row, from path_log.FIRST on: the event, and the names of its values, as JSON has
# them.  A vector has three columns.
_RAY = "origin direction throughput_before pdf"
_POINT = "point normal smooth_normal uv"
_HIT = "geometry part array placement distance"
_EVENT_LAYOUTS: Mapping[int, tuple[str, str]] = {
    path_log.START: ("camera", "film time origin direction factors wavelength"),
    path_log.SURFACE: (
        "surface",
        f"{_RAY} distance instance table primitive {_POINT} offset front material shown throughput wavelengths",
    ),
    path_log.ESCAPE: ("leaves", f"{_RAY} throughput background"),
    path_log.MEDIUM: ("medium", f"{_RAY} medium surface_distance distance weight throughput"),
    path_log.EMISSION: ("emits", "emitted mis_weight"),
    path_log.SCATTER: ("scatters", "normal direction weight pdf throughput survival wavelengths"),
    path_log.SHADOW_RAY: ("aims", "origin direction target light_weight pdf value path_pdf mis_weight brings distance"),
    path_log.UNOCCLUDED: ("arrives", "brings"),
    path_log.OCCLUDED: ("blocked", _HIT),
    path_log.PASSED_THROUGH: ("passes", _HIT),
    path_log.RETRACE: ("again", ""),
    path_log.FINISHED: ("done", "value factor unclamped wavelength"),
}

_PAIRS = {"film", "uv"}
_VECTORS = {
    *("origin", "direction", "throughput_before", "throughput", "factors", "wavelengths", "weight", "light_weight"),
    *("point", "target", "normal", "smooth_normal", "background", "emitted", "value", "brings", "unclamped"),
}

# Values that may be infinite: distances, and densities of directions and lights without choice.
_MAY_BE_INFINITE = {"pdf", "path_pdf", "distance", "surface_distance", "target"}

# Points of the scene, which may have been packed around another origin than the scene's own.
_POINTS = {"origin", "point", "target"}


class PathTrace(NamedTuple):
    """The path of a sample.

    pixel (px) : x, y.
    sample : its number.
    spp : samples that the pixel gets.
    value : (3,), what the sample adds to its pixel.
    events : in order, each a mapping of plain numbers and strings with the `event` and what is not finite in it.
    first_non_finite : number of the first event that holds what should be finite and is not, or None.
    """

    pixel: tuple[int, int]
    sample: int
    spp: int
    value: tuple[float, ...]
    events: list[dict[str, Any]]
    first_non_finite: int | None

    @property
    def is_finite(self) -> bool:
        """Tell if the sample is finite, so that it is added to its pixel."""
        return all(map(math.isfinite, self.value))

    def json(self) -> dict[str, Any]:
        """Return the trace as `--json` prints it: numbers that JSON lacks are the strings nan, inf and -inf."""
        values = {
            "pixel": self.pixel,
            "sample": self.sample,
            "spp": self.spp,
            "finite": self.is_finite,
            "value": self.value,
            "first_not_finite": self.first_non_finite,
            "events": self.events,
        }
        plain: dict[str, Any] = _to_json(values)
        return plain


def trace_sample(
    spec: SceneSpec, pixel: tuple[int, int], sample: int | None = None, options: RenderOptions | None = None
) -> PathTrace:
    """Trace one sample of a picture again, with the same bits, and log its path.

    Parameters
    ----------
    pixel : (x, y) in the whole picture.
    sample : from 0 on; if None, the first one of the pixel that is not finite, or else its brightest.
    options : those of the picture; all defaults if None.

    Raises
    ------
    InputError : a pixel outside of the film, or a scene that cannot be packed.
    """
    options = options or RenderOptions()
    spec = override_settings(spec, options)
    x, y = pixel
    width, height = spec.picture()
    if not (0 <= x < width and 0 <= y < height):
        raise InputError(f"pixel {x},{y} must lie within the film, from 0,0 to {width - 1},{height - 1}")
    packed = pack(spec)
    # Referenced until the end, since the scene has only its address.
    accel = packed.build()
    scene = packed.scene._replace(accel=accel.address)
    scratch = film_view(empty_film(scene, 1, 1))
    taken = spec.render.spp
    if sample is None:
        compile_kernel(scene, scratch)
        packets = list(replay_samples(scene, scratch, x, y, taken))
        is_dropped = np.isnan(np.concatenate([packet.weights for packet in packets]))
        sample = int(np.argmax(is_dropped)) if is_dropped.any() else brightest_sample(packets)
    compile_kernel(scene, scratch, make_workspace(scene, path_log.path_log(0, 1)))
    # Without a limit of its samples, a picture is taken in whole packets of them.
    rows = log_path(scene, scratch, x, y, sample, options.spp_limit(spec))
    decoder = _EventDecoder(packed)
    events = [decoder.event(row) for row in rows]
    first_non_finite = next((number for number, event in enumerate(events) if event["not_finite"]), None)
    return PathTrace((x, y), sample, taken, tuple(events[-1]["value"]), events, first_non_finite)


class _EventDecoder:
    """A decoder of a log's rows, into mappings with the names of the scene's objects and materials."""

    def __init__(self, packed: PackedScene) -> None:
        self._scene = packed.scene
        self._identities = scene_ids(packed.spec, packed)
        origin = packed.scene.origin
        self._origin = np.zeros(3) if origin is None else np.array(origin.world)

    def event(self, row: NDArray[np.float64]) -> dict[str, Any]:
        """Decode a row."""
        kind, names = _EVENT_LAYOUTS[int(row[0])]
        event: dict[str, Any] = {"event": kind, "round": int(row[path_log.ROUND])}
        column = path_log.FIRST
        for name in names.split():
            size = 3 if name in _VECTORS else 2 if name in _PAIRS else 1
            values = row[column : column + size]
            if name in _POINTS:
                values = values + self._origin
            event[name] = values.tolist() if size > 1 else float(values[0])
            column += size
        # A path has wavelengths where something disperses.
        if "wavelengths" in event:
            event["wavelengths"] = [wavelength for wavelength in event["wavelengths"] if not math.isnan(wavelength)]
        if math.isnan(event.get("wavelength", 0.0)):
            event["wavelength"] = None
        event["gathered"] = row[path_log.RADIANCE : path_log.RADIANCE + 3].tolist()
        getattr(self, f"_{kind}", lambda event: None)(event)
        event["not_finite"] = list(_not_finite(event))
        return event

    def _camera(self, event: dict[str, Any]) -> None:
        factors = event.pop("factors")
        event |= dict(zip(("filter_weight", "shutter_weight", "camera_weight"), factors, strict=True))
        if math.isnan(event["time"]):
            event["time"] = None

    def _surface(self, event: dict[str, Any]) -> None:
        material, shown = (int(event.pop(key)) for key in ("material", "shown"))
        instance, table, primitive = (int(event.pop(key)) for key in ("instance", "table", "primitive"))
        event |= self._owner(instance, table, primitive)
        event["material"] = self._identities.materials[self._identities.material[material] - 1]
        event["shown"] = None if shown == PASSTHROUGH else self._kind(shown)
        event["side"] = "front" if event.pop("front") else "back"
        # The first random dimension that is used here.
        event["dimension"] = (event["round"] + 1) * DIMENSIONS_PER_SEGMENT

    def _medium(self, event: dict[str, Any]) -> None:
        reference = int(event.pop("medium"))
        tables = self._scene.media.tables
        event["medium"] = None if reference == NO_MEDIUM else _kind_of(tables[reference % len(tables)])

    def _blocked(self, event: dict[str, Any]) -> None:
        table, part, array, placement = (int(event.pop(key)) for key in ("geometry", "part", "array", "placement"))
        if table == MISS:
            event["object"] = None
            return
        row = int(row_of_any(self._scene.primitives, table, np.uint32(part)))
        number = array if array != MISS else -1
        instance, primitive = resolve_instance(self._scene.instances, table, row, number, placement)
        event |= self._owner(int(instance), table, int(primitive))

    _passes = _blocked

    def _owner(self, instance: int, table: int, primitive: int) -> dict[str, Any]:
        """Return the object that a primitive belongs to, with the primitive's place in it."""
        ids = self._identities
        if 0 <= instance < len(ids.placed):
            number = int(ids.placed[instance])
        else:
            first, end = ids.first[table], ids.first[table + 1]
            number = int(ids.owner[first + np.searchsorted(ids.start[first:end], primitive, side="right") - 1])
        kind = type(self._scene.primitives[table]).__name__
        return {"object": ids.objects[number - 1], "instance": instance, "primitives": kind, "primitive": primitive}

    def _kind(self, reference: int) -> str:
        """Return the kind of a material."""
        scene = self._scene
        tables = (*scene.materials, *(scene.selectors.tables if scene.selectors is not None else ()))
        return _kind_of(tables[reference % len(tables)])


def _kind_of(table: Any) -> str:
    return type(table).__module__.rpartition(".")[2]


def _not_finite(event: Mapping[str, Any]) -> Iterator[str]:
    """List the keys of values that should be finite and are not."""
    for key, value in event.items():
        numbers = [number for number in (value if isinstance(value, list) else [value]) if isinstance(number, float)]
        if any(math.isnan(number) or (math.isinf(number) and key not in _MAY_BE_INFINITE) for number in numbers):
            yield key


def _to_json(value: Any) -> Any:
    """Convert a value to what JSON can hold."""
    if isinstance(value, Mapping):
        return {key: _to_json(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_to_json(item) for item in value]
    return str(value) if isinstance(value, float) and not math.isfinite(value) else value
