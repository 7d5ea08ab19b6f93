"""The functions that run on workers: check that they render the same picture, prepare scenes, and take samples of them.

Dask's scheduler imports this module too, so it loads nothing heavy by itself.
"""

import hashlib
import importlib
import os
import pickle
import platform
import shutil
import threading
from collections import OrderedDict
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

import raytracer
from raytracer.scene.bundle import Bundle, unbundle
from raytracer.util.errors import InputError, OutputError

if TYPE_CHECKING:
    from raytracer.core.embree import Accel
    from raytracer.kernel.packed_scene import Scene
    from raytracer.kernel.pixel_accumulator import FilmView
    from raytracer.rendering.tile_job import TileResult
    from raytracer.scene.cache import RenderCache

_MAX_SCENES = 4
_MAX_FOLDERS = 8


# ---- The same program and versions, and the same instruction set


class Fingerprint(NamedTuple):
    """The versions and the hardware that the bits of a picture depend on, besides the scene.

    versions : of rt, Python and the libraries, by name.
    program : `scene.digest.program_hash`.
    processor : with its instruction set, as the compiler names it.
    """

    versions: dict[str, str]
    program: str
    processor: str


@cache
def fingerprint() -> Fingerprint:
    """Return the fingerprint of this process."""
    from raytracer.core.compiler.cache import processor
    from raytracer.scene.digest import libraries, program_hash

    versions = {"rt": raytracer.__version__, "Python": platform.python_version(), **libraries()}
    return Fingerprint(versions, program_hash(), processor())


def find_mismatch(here: Fingerprint, there: Fingerprint) -> str | None:
    """Describe why a machine cannot take part, as the end of a sentence about it; None if it can."""
    for name, own in here.versions.items():
        other = there.versions.get(name, "none")
        if other != own:
            return f"has {name} {other}, and here it is {own}; install the same versions on all machines"
    if there.program != here.program:
        return f"has other sources of rt {here.versions['rt']} than there are here; install the same, and restart it"
    return None


# ---- Scenes and jobs


class PrepareRequest(NamedTuple):
    """A request to prepare a scene.

    key : by which jobs name the scene.
    text, name, files : of its bundle (`scene.bundle.Bundle`), but of each file only the sha256.
    aovs, denoise : what is recorded besides radiance.
    sender : fingerprint of the machine that merges the results.
    """

    key: str
    text: str
    name: str
    files: dict[str, str]
    aovs: tuple[str, ...]
    denoise: bool
    sender: Fingerprint


class PrepareReply(NamedTuple):
    """A worker's reply to a request; it is ready if the first three fields are empty.

    missing : sha256 of the files that it lacks.
    mismatch : reason why it cannot take part (`find_mismatch`).
    failure : error with which it failed to prepare the scene.
    processor : of the worker.
    """

    missing: tuple[str, ...] = ()
    mismatch: str | None = None
    failure: str | None = None
    processor: str = ""


class _WorkerScene(NamedTuple):
    """A prepared scene, the structure that it points into, and a function that makes a film of one tile for it."""

    scene: "Scene"
    accel: "Accel"
    scratch: "Callable[[], FilmView]"


_lock = threading.Lock()
_scenes: OrderedDict[str, _WorkerScene] = OrderedDict()
_prepare_lock = threading.Lock()
_cache: "RenderCache | None" = None


def prepare(request: PrepareRequest, files: Mapping[str, NDArray[np.uint8]]) -> PrepareReply:
    """Prepare a scene, unless that is done; `files` are those that were reported missing, by sha256."""
    reason = find_mismatch(request.sender, fingerprint())
    if reason is not None:
        return PrepareReply(mismatch=reason)
    reply = PrepareReply(processor=fingerprint().processor)
    # Jobs for other scenes go on meanwhile.
    with _prepare_lock:
        with _lock:
            if request.key in _scenes:
                _scenes.move_to_end(request.key)
                return reply
        folder = _scene_folder(request)
        absent = {name: digest for name, digest in request.files.items() if not (folder / name).exists()}
        lacking = set(absent.values()).difference(files)
        if lacking:
            return reply._replace(missing=tuple(sorted(lacking)))
        try:
            prepared = _build_scene(request, folder, {name: files[digest].tobytes() for name, digest in absent.items()})
        except (InputError, OSError, MemoryError, OutputError) as error:
            return reply._replace(failure=str(error) or type(error).__name__)
        with _lock:
            _scenes[request.key] = prepared
            while len(_scenes) > _MAX_SCENES:
                _scenes.popitem(last=False)
    return reply


def dask_setup(worker: object) -> None:
    """Load the program when a worker starts, not with its first scene; Dask calls this for a `--preload`."""
    fingerprint()
    importlib.import_module("raytracer.rendering.compilation")


def run_job(key: str, pickled_job: bytes) -> "tuple[str, TileResult | None]":
    """Run a job, and return the worker's address and the result; None if the scene is not prepared here."""
    from distributed import get_worker

    from raytracer.kernel.path_state import workspace as make_workspace
    from raytracer.rendering.tile_job import run_tile_job

    with _lock:
        prepared = _scenes.get(key)
        if prepared is not None:
            _scenes.move_to_end(key)
    name = str(get_worker().address)
    if prepared is None:
        return name, None
    workspace = make_workspace(prepared.scene)
    return name, run_tile_job(prepared.scene, prepared.scratch(), workspace, pickle.loads(pickled_job))


def publish_file(content: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return the content of a file, as a Dask result that workers hand on to each other."""
    return content


def _scene_folder(request: PrepareRequest) -> Path:
    """Make a folder for a scene's files: one for all scenes that have the same files, so that these are read only once.

    Dask removes it when the worker ends, or where it could not, when the next one starts.
    """
    from distributed import get_worker

    names = repr(sorted(request.files.items())).encode()
    folders = Path(get_worker().local_directory) / "raytracer"
    folder = folders / hashlib.sha256(names).hexdigest()[:16]
    folder.mkdir(parents=True, exist_ok=True)
    os.utime(folder)
    for old in sorted(folders.iterdir(), key=lambda path: path.stat().st_mtime_ns)[:-_MAX_FOLDERS]:
        shutil.rmtree(old, ignore_errors=True)
    return folder


def _build_scene(request: PrepareRequest, folder: Path, files: dict[str, bytes]) -> _WorkerScene:
    """Pack, build and compile a scene; `files` are those that are not in its folder yet."""
    from raytracer.kernel.pixel_accumulator import FilmView
    from raytracer.rendering.compilation import compile_kernel
    from raytracer.rendering.film_region import empty_tile
    from raytracer.scene.cache import RenderCache
    from raytracer.scene.pack.scene import pack

    global _cache  # noqa: PLW0603
    _cache = _cache or RenderCache()
    spec = unbundle(Bundle(request.text, request.name, files), folder)
    packed = pack(spec, provider=_cache)
    accel = packed.build(_cache)
    scene = packed.scene._replace(accel=accel.address)

    def scratch() -> FilmView:
        return empty_tile(packed, request.aovs, denoise=request.denoise)

    compile_kernel(scene, scratch())
    return _WorkerScene(scene, accel, scratch)
