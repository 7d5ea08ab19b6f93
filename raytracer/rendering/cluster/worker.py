"""What workers do: make scenes ready, and take samples of them.

Dask's scheduler imports this module too, so it loads nothing heavy by itself.
"""

import hashlib
import importlib
import os
import pickle
import shutil
import threading
from collections import OrderedDict
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.cluster.fitness import Fingerprint, fingerprint, obstacle
from raytracer.errors import InputError, OutputError

if TYPE_CHECKING:
    from raytracer.accumulation import FilmView
    from raytracer.embree import Accel
    from raytracer.errands import Errand, Haul
    from raytracer.integrator import Scene
    from raytracer.stock import Stock

_SCENES_KEPT = 4
_FOLDERS_KEPT = 8


class Order(NamedTuple):
    """A scene to be made ready.

    key, by which errands name it; text, name, files, of its bundle (`scene.inputs.Bundle`), but of each file only the
    sha256; aovs, denoise, what is gathered besides radiance; sender, who will merge what is sampled.
    """

    key: str
    text: str
    name: str
    files: dict[str, str]
    aovs: tuple[str, ...]
    denoise: bool
    sender: Fingerprint


class Answer(NamedTuple):
    """What a worker says to an order: nothing of the following, if it is ready.

    missing, the sha256 of the files that it lacks; obstacle, why it cannot take part (`fitness.obstacle`); failure,
    what went wrong with the scene there; processor, its own.
    """

    missing: tuple[str, ...] = ()
    obstacle: str | None = None
    failure: str | None = None
    processor: str = ""


class _Ready(NamedTuple):
    """A scene to take samples of, what it points into, and how to make a film of one tile for it."""

    scene: "Scene"
    accel: "Accel"
    scratch: "Callable[[], FilmView]"


_lock = threading.Lock()
_scenes: OrderedDict[str, _Ready] = OrderedDict()
_preparing = threading.Lock()
_stock: "Stock | None" = None


def prepare(order: Order, files: Mapping[str, NDArray[np.uint8]]) -> Answer:
    """Make a scene ready, unless it is; `files` are what was said to be missing, by sha256."""
    reason = obstacle(order.sender, fingerprint())
    if reason is not None:
        return Answer(obstacle=reason)
    answer = Answer(processor=fingerprint().processor)
    # Errands for other scenes go on meanwhile.
    with _preparing:
        with _lock:
            if order.key in _scenes:
                _scenes.move_to_end(order.key)
                return answer
        folder = _folder_of(order)
        absent = {name: digest for name, digest in order.files.items() if not (folder / name).exists()}
        lacking = set(absent.values()).difference(files)
        if lacking:
            return answer._replace(missing=tuple(sorted(lacking)))
        try:
            ready = _made(order, folder, {name: files[digest].tobytes() for name, digest in absent.items()})
        except (InputError, OSError, MemoryError, OutputError) as error:
            return answer._replace(failure=str(error) or type(error).__name__)
        with _lock:
            _scenes[order.key] = ready
            while len(_scenes) > _SCENES_KEPT:
                _scenes.popitem(last=False)
    return answer


def dask_setup(worker: object) -> None:
    """Load the program when a worker starts, not with its first scene; Dask calls this for a `--preload`."""
    fingerprint()
    importlib.import_module("raytracer.preparation")


def packed(errand: "Errand") -> bytes:
    """An errand as `fetch` takes it: the scheduler, which reads what passes through it, need not know its classes."""
    return pickle.dumps(errand, pickle.HIGHEST_PROTOCOL)


def fetch(key: str, errand: bytes) -> "tuple[str, Haul | None]":
    """Take samples of a scene: who has, and what came of it, None if the scene is not ready here."""
    from distributed import get_worker

    from raytracer.errands import take
    from raytracer.interior import ranks_of
    from raytracer.paths import workspace

    with _lock:
        ready = _scenes.get(key)
        if ready is not None:
            _scenes.move_to_end(key)
    name = str(get_worker().address)
    if ready is None:
        return name, None
    room = workspace(solids=ranks_of(ready.scene.interior))
    return name, take(ready.scene, ready.scratch(), room, pickle.loads(errand))


def hold(content: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The content of a file, as something that workers hand on to each other."""
    return content


def digest_of(content: bytes) -> str:
    """The name of a file's content."""
    return hashlib.sha256(content).hexdigest()


def _folder_of(order: Order) -> Path:
    """A folder for a scene's files: the same one for all scenes that have the same, so that they are read but once.

    Dask takes it away when the worker ends, or where it could not, when the next one starts.
    """
    from distributed import get_worker

    names = repr(sorted(order.files.items())).encode()
    folders = Path(get_worker().local_directory) / "raytracer"
    folder = folders / hashlib.sha256(names).hexdigest()[:16]
    folder.mkdir(parents=True, exist_ok=True)
    os.utime(folder)
    for old in sorted(folders.iterdir(), key=lambda path: path.stat().st_mtime_ns)[:-_FOLDERS_KEPT]:
        shutil.rmtree(old, ignore_errors=True)
    return folder


def _made(order: Order, folder: Path, files: dict[str, bytes]) -> _Ready:
    """The scene of an order; `files` are those that are not in its folder yet."""
    from raytracer.accumulation import FilmView
    from raytracer.development import recording_of
    from raytracer.preparation import compile_for, film_for, view
    from raytracer.scene.inputs import Bundle, unbundle
    from raytracer.scene.pack import pack
    from raytracer.scheduling import TILE
    from raytracer.stock import Stock

    global _stock  # noqa: PLW0603
    _stock = _stock or Stock()
    spec = unbundle(Bundle(order.text, order.name, files), folder)
    packed = pack(spec, supplies=_stock)
    accel = packed.build(_stock)
    scene = packed.scene._replace(accel=accel.address)

    def scratch() -> FilmView:
        recording = recording_of(packed.spec, packed, TILE, TILE, order.aovs, denoise=order.denoise)
        return view(film_for(scene, TILE, TILE), aovs=None if recording is None else recording.view)

    compile_for(scene, scratch())
    return _Ready(scene, accel, scratch)
