"""Options of a sweep, and preparation of its points for rendering, where it takes long in a thread of its own."""

import math
import os
from collections.abc import Callable, Generator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import KW_ONLY, dataclass, replace
from typing import Any, NamedTuple

from raytracer.analysis.explain.camera_numbers import CameraView, depth_of_field, exposure
from raytracer.analysis.sweep.animation import FPS
from raytracer.analysis.sweep.plan import MAX_POINTS
from raytracer.analysis.sweep.results import PointResult, SweepPoint
from raytracer.rendering.compilation import PreparedScene
from raytracer.rendering.options import RenderOptions
from raytracer.rendering.render import prepare_scene
from raytracer.rendering.tile_scheduler import now
from raytracer.rendering.worker_pool import ClusterClient
from raytracer.scene.cache import RenderCache
from raytracer.scene.digest import digest
from raytracer.scene.overrides import apply_overrides
from raytracer.scene.pack.scene import PackedScene
from raytracer.scene.preview import SPP, preview_scene
from raytracer.scene.spec import SceneSpec
from raytracer.util.path_sandbox import AllowFiles
from raytracer.util.progress import BatchProgress

# Keys of a scene that set the number of samples of an image.
_SIZE_KEYS = ("film.width", "film.height", "render.spp")


@dataclass(frozen=True)
class SweepOptions(RenderOptions):
    """Options of `run.sweep`; see there."""

    scene: SceneSpec | str | os.PathLike[str]
    values: Mapping[str, Any] | None = None
    _: KW_ONLY
    folder: str | os.PathLike[str] | None = None
    allow_files: AllowFiles = ()
    zipped: bool = False
    preview: bool = False
    formats: Sequence[str] = ("png",)
    animate: Sequence[str] = ()
    fps: float = FPS
    max_points: int = MAX_POINTS
    cluster: ClusterClient | None = None
    cache: RenderCache | None = None
    stock: RenderCache | None = None
    progress: Callable[[BatchProgress], object] | bool | None = None
    report: Callable[[PointResult], object] | None = None
    warn: Callable[[str], object] | None = None


class PreparedPoint(NamedTuple):
    """A point that is ready to be rendered, or has failed.

    made : the prepared scene, or the error.
    camera : derived numbers of the camera.
    warnings : of its scene, a sentence each.
    is_repacked : True if more of it had to be packed than its camera, film and settings.
    """

    point: SweepPoint
    made: PreparedScene | Exception
    camera: Mapping[str, float]
    warnings: tuple[str, ...]
    is_repacked: bool = False


class PointPreparer:
    """Preparation of points.

    points : all points, with their digests once these are known.
    """

    def __init__(
        self, spec: SceneSpec, points: Sequence[SweepPoint], options: SweepOptions, *, keeps_files: bool
    ) -> None:
        self.points = list(points)
        self._spec, self._options, self._keeps_files = spec, options, keeps_files
        # What points share.
        self._cache = options.cache or options.stock or RenderCache()
        self._specs: dict[int, SceneSpec] = {}

    def note_digest(self, number: int) -> None:
        """Store the digest of all that a point's image depends on, files as they are now."""
        self.points[number] = replace(self.points[number], digest=self._digest(self._scene(number)))

    def prepare_all(self, numbers: Sequence[int]) -> Generator[tuple[int, PreparedPoint], None, None]:
        """Prepare points in their order: between renders, or, where that takes long, while another is rendered.

        Python beside threads that render keeps the interpreter's lock from them.  A point of the cover, 25 ms of Python
        once the scene is packed, took 40 to 100 ms of its neighbour's render, at any switch interval.
        """
        takes_long = self._options.cluster is not None
        with ExitStack() as stack:
            preparer = ThreadPoolExecutor(1, "preparer")
            # After an interrupt its work, which may be the compiler's, is abandoned.
            stack.callback(preparer.shutdown, wait=False, cancel_futures=True)
            following: Future[PreparedPoint] | None = None
            for place, number in enumerate(numbers):
                # Here, where an interrupt ends what may take long.
                prepared = self._prepare(number) if following is None else following.result()
                following = None
                takes_long |= place > 0 and prepared.is_repacked
                if takes_long and place + 1 < len(numbers):
                    following = preparer.submit(self._prepare, numbers[place + 1])
                yield number, prepared

    def _prepare(self, number: int) -> PreparedPoint:
        """Prepare a point; an error is stored in what is returned."""
        sentences: list[str] = []
        began, packed = now(), self._cache.counts.worlds_packed
        try:
            spec = self._scene(number)
            self.note_digest(number)
            made = prepare_scene(
                spec,
                self._render_options(spec),
                load_seconds=now() - began,
                warn=sentences.append,
                cache=self._cache,
                cluster=self._options.cluster,
                with_checkpoints=self._keeps_files,
            )
            camera = camera_numbers(made.packed)
            if self._digest(spec) != self.points[number].digest:
                # Nobody knows whether the image is of the file before or after; no record is of "".
                self.points[number] = replace(self.points[number], digest="")
                name = self.points[number].name
                sentences.append(f"{name}: a file changed while it was read, so that it is rendered again next time")
        except Exception as error:  # noqa: BLE001
            return PreparedPoint(self.points[number], error, {}, tuple(sentences))
        finally:
            self._specs.pop(number, None)
        is_repacked = self._cache.counts.worlds_packed > packed
        return PreparedPoint(self.points[number], made, camera, tuple(sentences), is_repacked)

    def _scene(self, number: int) -> SceneSpec:
        """Return the scene of a point."""
        if number not in self._specs:
            spec = apply_overrides(self._spec, self.points[number].values)
            self._specs[number] = preview_scene(spec) if self._options.preview else spec
        return self._specs[number]

    def _digest(self, spec: SceneSpec) -> str:
        options = self._render_options(spec)
        given = {name: getattr(options, name) for name in ("spp", "seed", "crop", "noise", "time_limit")}
        return digest(spec, **given, aovs=sorted(options.aovs) or None, denoise=options.denoise or None)

    def _render_options(self, spec: SceneSpec) -> RenderOptions:
        """Return the options of the render of a point's scene."""
        options = self._options
        if options.preview and options.noise is None:
            return replace(options, spp=min(options.spp or spec.render.spp, SPP))
        return options


def point_weight(point: SweepPoint, options: RenderOptions) -> float:
    """Estimate the work of a point relative to others, as far as its values tell."""
    weight = 1.0
    for key in _SIZE_KEYS:
        value = point.values.get(key, 1)
        counts = isinstance(value, (int, float)) and 0 < value < math.inf
        if counts and not (key == "render.spp" and options.spp is not None):
            weight *= value
    return weight


def camera_numbers(packed: PackedScene) -> dict[str, float]:
    """Return numbers of a packed scene's camera, as in `rt explain`."""
    view = CameraView(packed.spec, packed.scene.camera, packed.shift)
    return view.numbers | depth_of_field(view, None) | exposure(packed.spec)
