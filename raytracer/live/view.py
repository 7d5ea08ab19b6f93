"""A scene file, its live render, and what a page may ask of them."""

import threading
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from raytracer.film.image import Image
from raytracer.live.camera_controls import RANGES, controls, sharpness
from raytracer.live.engine import LiveEngine, sentences
from raytracer.live.picture import RADIANCE, REFOCUSED, Frame, PictureSource, make_frame
from raytracer.live.scene_file import SceneFile
from raytracer.rendering.develop import film_process
from raytracer.rendering.options import RenderOptions
from raytracer.scene.picking import Pick, pick
from raytracer.scene.spec import SceneSpec
from raytracer.util.errors import InputError, OutputError

WATCH_SECONDS = 0.1
"""Time between two looks at the files."""

# Digits of a distance that is focused at, which are those that a file gets.
_DISTANCE_DIGITS = 6

CURVE_BEGIN, CURVE_STOPS = -14, 20
"""Stops, above and below 1, for which a page gets the scene's tone curve; the script counts on the same."""

Reply = dict[str, Any]


class LiveView:
    """A live render of a scene file, which follows the file's edits until it is closed; a context manager.

    outputs : files that `save` writes.
    """

    def __init__(self, file: SceneFile, options: RenderOptions, outputs: Sequence[Path]) -> None:
        """Begin to render the file, and to watch it."""
        self._file, self._options, self._outputs = file, options, tuple(outputs)
        self._lock = threading.Lock()
        self._listeners: set[Callable[[], object]] = set()
        self._errors: tuple[str, ...] = ()
        self._shown: SceneSpec | None = None
        self._refocused: float | None = None
        self._camera: tuple[tuple[int, int], Reply] = ((0, 0), {})
        self._engine = LiveEngine(options, self._tell)
        self._closed = threading.Event()
        self._load()
        self._watcher = threading.Thread(target=self._watch, name="live watch", daemon=True)
        self._watcher.start()

    def __enter__(self) -> "LiveView":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the render and the watch, and wait for both."""
        self._closed.set()
        self._watcher.join()
        self._engine.close()

    def listen(self, listener: Callable[[], object]) -> Callable[[], None]:
        """Have a function called, by any thread, when there is something new to show; return what ends that."""
        self._listeners.add(listener)
        return partial(self._listeners.discard, listener)

    def _tell(self) -> None:
        for listener in tuple(self._listeners):
            listener()

    # ---- The file

    def _watch(self) -> None:
        while not self._closed.wait(WATCH_SECONDS):
            if self._file.has_changed():
                self._load()

    def _load(self) -> None:
        """Read the file, and render what it says; an error is shown, and the picture stays."""
        with self._lock:
            try:
                spec = self._file.load()
            except (InputError, OSError) as error:
                self._errors = sentences(error)
            else:
                self._errors = ()
                # What the page has written into the file is rendered already.
                is_shown = self._shown is not None and _same(self._shown, spec) and not self._engine.state.errors
                if not is_shown:
                    self._show(spec)
        self._tell()

    def _show(self, spec: SceneSpec) -> None:
        self._shown = spec
        self._engine.show(spec)

    # ---- What a page shows

    def state(self) -> Reply:
        """Return all that the page shows besides the picture, as plain values."""
        engine, source = self._engine.state, self._engine.source
        state: Reply = {
            "file": self._file.path,
            "job": engine.job,
            "status": engine.status.value,
            "paused": self._engine.is_paused,
            "seconds": engine.seconds,
            "error": engine.error,
            "warnings": engine.warnings,
            "errors": self._errors or engine.errors,
            "tried": {key.removeprefix("camera."): value for key, value in self._file.tried.items()},
            "outputs": [str(path) for path in self._outputs],
        }
        if self._shown is not None:
            state["width"], state["height"] = self._shown.picture()
        if source is not None:
            state |= self._describe(source)
        return state

    def _describe(self, source: PictureSource) -> Reply:
        """Describe a picture."""
        shown = source.job, source.step
        if self._camera[0] != shown:
            packed = source.prepared.packed
            self._camera = (
                shown,
                {"controls": controls(packed), "sharpness": sharpness(packed), "curve": _curve(packed.spec)},
            )
        options = source.prepared.options
        return {
            "shown": source.job,
            "step": source.step,
            "samples": source.samples,
            "wanted": options.max_spp if source.step == 1 else None,
            "layers": source.layers,
            **self._camera[1],
        }

    def mark(self) -> tuple[int, int, bool, float | None, int] | None:
        """Return a value that is another whenever the picture is."""
        source = self._engine.source
        return (
            None
            if source is None
            else (source.job, source.step, source.rendered is not None, self._refocused, source.session.queue.done)
        )

    def frame(self, layer: str = RADIANCE) -> Frame | None:
        """Return the picture so far; None before there is one."""
        source = self._engine.source
        return None if source is None else make_frame(source, layer, self._refocused)

    # ---- What a page asks for

    def handle(self, message: Mapping[str, Any]) -> Reply | None:
        """Do what a page asks for, and return what there is to say.

        Raises
        ------
        InputError : it cannot be done.
        OutputError : a file cannot be written.
        """
        actions: Mapping[str, Callable[[Mapping[str, Any]], Reply | None]] = {
            "set": self._set,
            "forget": self._forget,
            "write": self._write,
            "pause": self._pause,
            "save": self._save,
            "values": self._values,
            "focus": self._focus,
            "path": self._path,
        }
        action = actions.get(str(message.get("do")))
        if action is None:
            raise InputError(f"there is no action {message.get('do')!r}")
        return action(message)

    def _set(self, message: Mapping[str, Any]) -> None:
        """Try values of the camera."""
        values = {str(key): value for key, value in dict(message["values"]).items()}
        unknown = [key for key in values if key not in RANGES]
        if unknown:
            raise InputError(f"{unknown[0]} is no value that a slider sets")
        self._try(values)

    def _try(self, values: Mapping[str, Any]) -> None:
        with self._lock:
            self._show(self._file.try_camera(values))

    def _forget(self, _: Mapping[str, Any]) -> None:
        with self._lock:
            self._show(self._file.forget())

    def _write(self, _: Mapping[str, Any]) -> Reply:
        with self._lock:
            self._file.write()
        return {"kind": "notice", "text": f"wrote {self._file.path}"}

    def _pause(self, message: Mapping[str, Any]) -> None:
        self._engine.pause(bool(message["on"]))

    def _save(self, _: Mapping[str, Any]) -> Reply:
        if self._engine.source is None or self._engine.state.errors:
            raise InputError("there is no picture to save")
        written: list[Exception | None] = []
        done = threading.Event()

        def write(image: Image) -> None:
            try:
                for path in self._outputs:
                    image.save(path)
                written.append(None)
            except (InputError, OutputError) as error:
                written.append(error)
            done.set()

        self._engine.save(write)
        while not done.wait(WATCH_SECONDS):
            if self._closed.is_set() or self._engine.state.errors:
                raise InputError("there is no picture to save")
        if written[0] is not None:
            raise written[0]
        return {"kind": "notice", "text": f"wrote {', '.join(map(str, self._outputs))}"}

    def _values(self, message: Mapping[str, Any]) -> Reply:
        """Return all layers at a pixel of the picture, which may be a preview."""
        source = self._source()
        x, y = _place(message)
        width, height = source.prepared.packed.spec.picture()
        values = source.values(int(x * width), int(y * height))
        return {"kind": "values", "x": x, "y": y, "values": values}

    def _focus(self, message: Mapping[str, Any]) -> Reply:
        """Focus on what is seen at a place: at its distance, or by `on` on the object; a light field, afterwards."""
        place = _place(message)
        if self._source().has_views:
            return self._refocus(place, is_view=message.get("layer") == REFOCUSED)
        found = self._pick(place)
        camera: Any = None if self._shown is None else self._shown.camera
        if not hasattr(camera, "focus_distance"):
            raise InputError(f"the camera {getattr(camera, 'type', '')} has no focus to set")
        if message.get("on"):
            if found.name is None:
                raise InputError(f"{found.object} has no name to focus on: give it one, or focus at its distance")
            self._try({"focus_on": found.name})
            return {"kind": "notice", "text": f"focused on the middle of {found.object}"}
        distance = float(f"{found.distance:.{_DISTANCE_DIGITS}g}")
        self._try({"focus_distance": distance})
        return {"kind": "notice", "text": f"focused on {found.object}, {distance:g} m away", "distance": distance}

    def _refocus(self, place: tuple[float, float], *, is_view: bool) -> Reply:
        """Refocus a light field on what is seen at a place of its picture, or of one view."""
        spec = self._source().prepared.packed.spec
        x, y = place
        if not is_view:
            # Of a mosaic all views see much the same.
            width, height = spec.picture()
            x, y = x * (width // spec.film.width) % 1.0, y * (height // spec.film.height) % 1.0
        found = self._pick((x, y))
        self._refocused = found.distance
        self._tell()
        text = f"refocused on {found.object}, {found.distance:.{_DISTANCE_DIGITS}g} m away"
        return {"kind": "notice", "text": text, "distance": found.distance, "layer": REFOCUSED}

    def _pick(self, place: tuple[float, float]) -> Pick:
        prepared = self._source().prepared
        try:
            found = pick(prepared.packed, prepared.accel, *place)
        except ValueError as error:
            raise InputError(str(error)) from None
        if found is None:
            raise InputError("there is nothing but the background at this place")
        return found

    def _path(self, message: Mapping[str, Any]) -> Reply:
        """Trace the sample of a pixel that `rt render --debug` would."""
        from raytracer.rendering.path_debug import trace_sample
        from raytracer.rendering.path_text import format_path

        spec = self._shown
        if spec is None:
            raise InputError(f"{self._file.path} is wrong; mend it first")
        width, height = spec.picture()
        x, y = _place(message)
        trace = trace_sample(spec, (int(x * width), int(y * height)), None, self._options)
        return {"kind": "path", "text": format_path(trace)}

    def _source(self) -> PictureSource:
        source = self._engine.source
        if source is None:
            raise InputError("there is no picture yet")
        return source


def _place(message: Mapping[str, Any]) -> tuple[float, float]:
    """Return a place in the frame: fractions of its width and height, from the top left."""
    x, y = float(message["x"]), float(message["y"])
    if not (0.0 <= x < 1.0 and 0.0 <= y < 1.0):
        raise InputError(f"the place {x:g}, {y:g} lies outside of the picture")
    return x, y


def _curve(spec: SceneSpec) -> list[float] | None:
    """Sample the tone curve of a scene at the sixteenths of stops from CURVE_BEGIN on; None for clipping."""
    process = film_process(spec)
    curve = process.tone_curve.curve(saturates=process.sensor is not None)
    if curve is None:
        return None
    stops = CURVE_BEGIN + np.arange(16 * CURVE_STOPS + 1) / 16.0
    values: list[float] = curve(np.exp2(stops)).tolist()
    return values


def _same(one: SceneSpec, other: SceneSpec) -> bool:
    """Tell if two scenes say the same, wherever it is written."""
    return one.__dict__ == other.__dict__
