"""One sample of a picture, vertex by vertex: what `rt render --pixel X,Y --sample K --debug` prints."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer import pathlog
from raytracer.embree import MISS
from raytracer.errors import InputError
from raytracer.instances import find
from raytracer.interior import ranks_of
from raytracer.materials.interface import PASS, SLOTS
from raytracer.media.interface import NONE
from raytracer.paths import workspace
from raytracer.preparation import compile_for, film_for, view
from raytracer.primitives.interface import row_of_any
from raytracer.replay import brightest_of, log_path, samples
from raytracer.scene.identities import identify
from raytracer.scene.pack import Packed, pack
from raytracer.scene.spec import SceneSpec

# What the columns of a row hold, from pathlog.FIRST on, with the number of columns: names as JSON has them.
_RAY = (("origin", 3), ("direction", 3), ("throughput_before", 3), ("pdf", 1))
_FOUND = (("geometry", 1), ("part", 1), ("array", 1), ("placement", 1), ("distance", 1))
_LAYOUTS: Mapping[int, tuple[str, tuple[tuple[str, int], ...]]] = {
    pathlog.START: (
        "camera",
        (("film", 2), ("time", 1), ("origin", 3), ("direction", 3), ("factors", 3), ("wavelength", 1)),
    ),
    pathlog.SURFACE: (
        "surface",
        (
            *_RAY,
            *(("distance", 1), ("instance", 1), ("table", 1), ("primitive", 1)),
            *(("point", 3), ("normal", 3), ("smooth_normal", 3), ("uv", 2), ("offset", 1)),
            *(("front", 1), ("material", 1), ("shown", 1), ("throughput", 3), ("wavelengths", 3)),
        ),
    ),
    pathlog.LEAVES: ("leaves", (*_RAY, ("throughput", 3), ("background", 3))),
    pathlog.FLIGHT: (
        "medium",
        (*_RAY, ("medium", 1), ("surface_distance", 1), ("distance", 1), ("weight", 3), ("throughput", 3)),
    ),
    pathlog.EMITS: ("emits", (("emitted", 3), ("mis_weight", 1))),
    pathlog.SCATTERS: (
        "scatters",
        (
            *(("normal", 3), ("direction", 3), ("weight", 3), ("pdf", 1), ("throughput", 3), ("survival", 1)),
            ("wavelengths", 3),
        ),
    ),
    pathlog.AIMS: (
        "aims",
        (
            *(("origin", 3), ("direction", 3), ("target", 3), ("light_weight", 3), ("pdf", 1)),
            *(("value", 3), ("path_pdf", 1), ("mis_weight", 1), ("brings", 3), ("distance", 1)),
        ),
    ),
    pathlog.ARRIVES: ("arrives", (("brings", 3),)),
    pathlog.BLOCKED: ("blocked", _FOUND),
    pathlog.PASSES: ("passes", _FOUND),
    pathlog.AGAIN: ("again", ()),
    pathlog.DONE: ("done", (("value", 3), ("factor", 1), ("unclamped", 3), ("wavelength", 1))),
}

# Which may be infinite: distances, and densities of directions and lights without choice.
_ENDLESS = {"pdf", "path_pdf", "distance", "surface_distance", "target"}

# Points of the scene, which may have been packed around another origin than the scene's own.
_POINTS = {"origin", "point", "target"}


class Trace(NamedTuple):
    """The path of a sample.

    pixel (x, y); sample; taken, samples that the pixel gets; value (3,), what the sample adds to its pixel; events, in
    order, each a mapping of plain numbers and strings with the `event` and what is not finite in it; bad, the number of
    the first event that holds what should be finite and is not, or None.
    """

    pixel: tuple[int, int]
    sample: int
    taken: int
    value: tuple[float, ...]
    events: list[dict[str, Any]]
    bad: int | None

    @property
    def is_finite(self) -> bool:
        """Whether the sample is added to its pixel, and not dropped."""
        return all(map(math.isfinite, self.value))

    def json(self) -> dict[str, Any]:
        """As `--json` prints it: numbers that JSON lacks are the strings nan, inf and -inf."""
        found = {
            "pixel": self.pixel,
            "sample": self.sample,
            "spp": self.taken,
            "finite": self.is_finite,
            "value": self.value,
            "first_not_finite": self.bad,
            "events": self.events,
        }
        plain: dict[str, Any] = _plain(found)
        return plain


def trace(
    spec: SceneSpec,
    pixel: tuple[int, int],
    sample: int | None = None,
    *,
    spp: int | None = None,
    seed: int | None = None,
    whole: bool = False,
) -> Trace:
    """Take one sample of a picture again, with the same bits, and write down its path.

    Parameters
    ----------
    pixel : (x, y) in the whole picture.
    sample : from 0 on; if None, the first one of the pixel that is not finite, or else its brightest.
    spp, seed : in place of the scene's.
    whole : whether the picture was taken in whole packets of samples, as by `noise` without `spp`.

    Raises
    ------
    InputError : a pixel outside of the film, or a scene that cannot be packed.
    """
    given = {name: value for name, value in (("spp", spp), ("seed", seed)) if value is not None}
    spec = spec.model_copy(update={"render": spec.render.model_copy(update=given)})
    x, y = pixel
    width, height = spec.picture()
    if not (0 <= x < width and 0 <= y < height):
        raise InputError(f"pixel {x},{y} must lie within the film, from 0,0 to {width - 1},{height - 1}")
    packed = pack(spec)
    # Held until the end, since its address is all that the scene knows of it.
    accel = packed.build()
    scene = packed.scene._replace(accel=accel.address)
    scratch = view(film_for(scene, 1, 1))
    taken = spec.render.spp
    if sample is None:
        compile_for(scene, scratch)
        sample = _suspect(list(samples(scene, scratch, x, y, taken)))
    compile_for(scene, scratch, workspace(pathlog.path_log(0, 1), solids=ranks_of(scene.interior)))
    rows = log_path(scene, scratch, x, y, sample, None if whole else taken)
    names = _Names(packed)
    events = [names.event(row) for row in rows]
    bad = next((number for number, event in enumerate(events) if event["not_finite"]), None)
    return Trace((x, y), sample, taken, tuple(events[-1]["value"]), events, bad)


def _suspect(packets: Sequence[Any]) -> int:
    """The first sample that is not finite, or else the brightest."""
    weights = np.concatenate([packet.weights for packet in packets])
    if np.isnan(weights).any():
        return int(np.argmax(np.isnan(weights)))
    return brightest_of(packets)


class _Names:
    """Rows of a log as mappings, with the names that the scene gives to what is in them."""

    def __init__(self, packed: Packed) -> None:
        self._scene = packed.scene
        self._identities = identify(packed.spec, packed)
        origin = packed.scene.origin
        self._origin = np.zeros(3) if origin is None else np.array(origin.world)

    def event(self, row: NDArray[np.float64]) -> dict[str, Any]:
        """What a row tells."""
        kind, layout = _LAYOUTS[int(row[0])]
        found: dict[str, Any] = {"event": kind, "round": int(row[pathlog.ROUND])}
        column = pathlog.FIRST
        for name, size in layout:
            values = row[column : column + size]
            if name in _POINTS:
                values = values + self._origin
            found[name] = values.tolist() if size > 1 else float(values[0])
            column += size
        # A path has wavelengths where something disperses.
        if "wavelengths" in found:
            found["wavelengths"] = [wavelength for wavelength in found["wavelengths"] if not math.isnan(wavelength)]
        if math.isnan(found.get("wavelength", 0.0)):
            found["wavelength"] = None
        found["gathered"] = row[pathlog.GATHERED : pathlog.GATHERED + 3].tolist()
        getattr(self, f"_{kind}", lambda event: None)(found)
        found["not_finite"] = list(_not_finite(found))
        return found

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
        event["shown"] = None if shown == PASS else self._kind(shown)
        event["side"] = "front" if event.pop("front") else "back"
        # The first random dimension that is used here.
        event["dimension"] = (event["round"] + 1) * SLOTS

    def _medium(self, event: dict[str, Any]) -> None:
        reference = int(event.pop("medium"))
        tables = self._scene.media.tables
        event["medium"] = None if reference == NONE else _kind_of(tables[reference % len(tables)])

    def _blocked(self, event: dict[str, Any]) -> None:
        table, part, array, placement = (int(event.pop(key)) for key in ("geometry", "part", "array", "placement"))
        if table == MISS:
            event["object"] = None
            return
        row = int(row_of_any(self._scene.primitives, table, np.uint32(part)))
        number = array if array != MISS else -1
        instance, primitive = find(self._scene.instances, table, row, number, placement)
        event |= self._owner(int(instance), table, int(primitive))

    _passes = _blocked

    def _owner(self, instance: int, table: int, primitive: int) -> dict[str, Any]:
        """Whose a primitive is."""
        found = self._identities
        if 0 <= instance < len(found.placed):
            number = int(found.placed[instance])
        else:
            first, end = found.first[table], found.first[table + 1]
            number = int(found.owner[first + np.searchsorted(found.start[first:end], primitive, side="right") - 1])
        kind = type(self._scene.primitives[table]).__name__
        return {"object": found.objects[number - 1], "instance": instance, "primitives": kind, "primitive": primitive}

    def _kind(self, reference: int) -> str:
        """What kind of material this is."""
        scene = self._scene
        tables = (*scene.materials, *(scene.selectors.tables if scene.selectors is not None else ()))
        return _kind_of(tables[reference % len(tables)])


def _kind_of(table: Any) -> str:
    return type(table).__module__.rpartition(".")[2]


def _not_finite(event: Mapping[str, Any]) -> Iterator[str]:
    """The keys of what should be finite and is not."""
    for key, value in event.items():
        numbers = [number for number in (value if isinstance(value, list) else [value]) if isinstance(number, float)]
        if any(math.isnan(number) or (math.isinf(number) and key not in _ENDLESS) for number in numbers):
            yield key


def _plain(value: Any) -> Any:
    """A value as JSON can hold it."""
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return str(value) if isinstance(value, float) and not math.isfinite(value) else value


# ---- As text


def text(found: Trace) -> str:
    """A path in words and numbers, an event after the other."""
    x, y = found.pixel
    # The last event is of the whole packet, whose other paths may be longer.
    segments = 1 + max(event["round"] for event in found.events[:-1])
    count = f"{segments} ray{'' if segments == 1 else 's'} long"
    state = "" if found.is_finite else ", which is not finite, so it was dropped"
    lines = [f"pixel {x},{y} sample {found.sample}: {count}, adds {_numbers(found.value)}{state}"]
    for number, event in enumerate(found.events):
        head, *rest = _LINES[event["event"]](event)
        lines += ["", head] if event["event"] in _VERTICES else [f"  {head}"]
        lines += [f"  {line}" for line in rest]
        if event["event"] in ("leaves", "emits", "arrives"):
            lines.append(f"  gathered so far {_numbers(event['gathered'])}")
        if number == found.bad:
            lines.append(f"  ^ not finite from here on: {', '.join(event['not_finite'])}")
    return "\n".join(lines) + "\n"


_VERTICES = {"camera", "surface", "leaves", "medium", "again", "done"}


def _number(value: float) -> str:
    # No sign of zero.
    return f"{value + 0.0:.9g}"


def _numbers(values: Sequence[float]) -> str:
    return f"({', '.join(map(_number, values))})"


def _lines_of_camera(event: Mapping[str, Any]) -> list[str]:
    time = "" if event["time"] is None else f", at {_number(event['time'])} of the shutter's time"
    weights = [f"{name} {_number(event[f'{name}_weight'])}" for name in ("filter", "shutter", "camera")]
    stopped = ["stopped in the camera, so it sees nothing"] if event["camera_weight"] == 0.0 else []
    hue = "" if event["wavelength"] is None else f", of {_number(event['wavelength'])} nm"
    return [
        f"camera ray through film position {_numbers(event['film'])}{time}{hue}",
        f"from {_numbers(event['origin'])} towards {_numbers(event['direction'])}",
        f"weights: {', '.join(weights)}",
        *stopped,
    ]


def _lines_of_surface(event: Mapping[str, Any]) -> list[str]:
    material = event["material"] if event["shown"] in (None, event["material"]) else None
    shown = material or f"{event['material']}, {event['shown']}"
    through = ", which lets it straight through" if event["shown"] is None else ""
    return [
        f"ray {event['round'] + 1} meets {event['object']} ({shown}) on its {event['side']}{through}",
        f"after {_number(event['distance'])} m at {_numbers(event['point'])}",
        f"{event['primitives']} {event['primitive']}, uv {_numbers(event['uv'])}",
        f"from {_numbers(event['origin'])} towards {_numbers(event['direction'])}, pdf {_number(event['pdf'])} / sr",
        f"normal {_numbers(event['normal'])}, spawned rays start {_number(event['offset'])} m off it",
        *_smooth(event),
        f"throughput {_numbers(event['throughput'])}{_by_wavelength(event)}",
    ]


def _by_wavelength(event: Mapping[str, Any]) -> str:
    """Of what light three numbers are, where they are not of red, green and blue."""
    waves = event["wavelengths"]
    if not waves:
        return ""
    return (
        f" at {' '.join(map(_number, waves))} nm"
        if len(waves) > 1
        else f", the first of them at {_number(waves[0])} nm"
    )


def _smooth(event: Mapping[str, Any]) -> list[str]:
    if event["smooth_normal"] == event["normal"]:
        return []
    return [f"shaded with the normal {_numbers(event['smooth_normal'])}"]


def _lines_of_leaving(event: Mapping[str, Any]) -> list[str]:
    return [
        f"ray {event['round'] + 1} leaves the scene",
        f"from {_numbers(event['origin'])} towards {_numbers(event['direction'])}, pdf {_number(event['pdf'])} / sr",
        f"throughput {_numbers(event['throughput'])}",
        f"meets radiance {_numbers(event['background'])}, weighted against light samples",
    ]


def _lines_of_medium(event: Mapping[str, Any]) -> list[str]:
    far = f"scatters after {_number(event['distance'])} m"
    if math.isinf(event["distance"]):
        far = f"comes through to what is met after {_number(event['surface_distance'])} m"
    return [
        f"ray {event['round'] + 1} in a {event['medium']} medium {far}",
        f"from {_numbers(event['origin'])} towards {_numbers(event['direction'])}, pdf {_number(event['pdf'])} / sr",
        f"weight {_numbers(event['weight'])}, throughput then {_numbers(event['throughput'])}",
    ]


def _lines_of_emission(event: Mapping[str, Any]) -> list[str]:
    return [f"it emits {_numbers(event['emitted'])}, which counts with the weight {_number(event['mis_weight'])}"]


def _lines_of_scattering(event: Mapping[str, Any]) -> list[str]:
    if not any(event["weight"]):
        return ["the path ends here: nothing is scattered"]
    head = f"scattered towards {_numbers(event['direction'])}, pdf {_number(event['pdf'])} / sr"
    survival = f"survives with probability {_number(event['survival'])}" if event["survival"] else "ends here"
    then = f"{_numbers(event['throughput'])}{_by_wavelength(event)}"
    weights = f"weight {_numbers(event['weight'])}, throughput then {then}; {survival}"
    normal = [f"  as shaded with the normal {_numbers(event['normal'])}"] if any(event["normal"]) else []
    return [head, *normal, f"  {weights}"]


def _lines_of_aiming(event: Mapping[str, Any]) -> list[str]:
    return [
        f"aims at a light {_number(event['distance'])} m away, towards {_numbers(event['direction'])}",
        f"  pdf {_number(event['pdf'])} / sr, of a path {_number(event['path_pdf'])} / sr",
        f"  weight {_number(event['mis_weight'])}, light over pdf {_numbers(event['light_weight'])}",
        f"  scattered that way {_numbers(event['value'])} / sr; would bring {_numbers(event['brings'])}",
    ]


def _lines_of_arrival(event: Mapping[str, Any]) -> list[str]:
    return [f"nothing is in the way of the light: {_numbers(event['brings'])}"]


def _lines_of_block(event: Mapping[str, Any]) -> list[str]:
    if event["object"] is None:
        return ["something is in the way of the light"]
    return [f"{event['object']} is in the way of the light, after {_number(event['distance'])} m"]


def _lines_of_passing(event: Mapping[str, Any]) -> list[str]:
    return [f"{event['object']} lets the light through, after {_number(event['distance'])} m"]


def _lines_of_return(event: Mapping[str, Any]) -> list[str]:
    return ["once more from the camera, for the next wavelength: what it meets counts from where wavelengths part"]


def _lines_of_end(event: Mapping[str, Any]) -> list[str]:
    gathered, value = _numbers(event["gathered"]), _numbers(event["value"])
    times = f"times {_number(event['factor'])}"
    if event["wavelength"] is not None:
        times = f"as light of {_number(event['wavelength'])} nm {times}"
    if event["not_finite"] or event["value"] == event["unclamped"]:
        return [f"gathered {gathered}, {times} is what the sample adds: {value}"]
    return [f"gathered {gathered}, {times} is {_numbers(event['unclamped'])}; after the clamp it adds {value}"]


_LINES = {
    "camera": _lines_of_camera,
    "surface": _lines_of_surface,
    "leaves": _lines_of_leaving,
    "medium": _lines_of_medium,
    "emits": _lines_of_emission,
    "scatters": _lines_of_scattering,
    "aims": _lines_of_aiming,
    "arrives": _lines_of_arrival,
    "blocked": _lines_of_block,
    "passes": _lines_of_passing,
    "again": _lines_of_return,
    "done": _lines_of_end,
}
