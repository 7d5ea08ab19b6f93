"""Capture of all views of a camera array, rendered a band at a time and written to a file band by band.

The scene is loaded, packed, built and compiled once.  The pixels of a band have the bits that they have in the picture
of all views.
"""

from collections.abc import Callable, Sequence
from dataclasses import KW_ONLY, dataclass
from pathlib import Path
from typing import NamedTuple, cast

import numpy as np

from raytracer.film.image_file import check_writable
from raytracer.film.light_field import lf
from raytracer.film.light_field.layout import NO_LIGHT_FIELD_MESSAGE, Layout, ViewLayout
from raytracer.film.light_field.posed_views import PosedViews
from raytracer.film.light_field.views import Views
from raytracer.film.window import Window
from raytracer.kernel.aovs.base.interface import per_sample_aovs, unique_aovs
from raytracer.lightfield.capturing.bands import (
    BandStats,
    band_stats,
    bytes_per_pixel,
    choose_bands,
    merge_stats,
    replace_error_settings,
)
from raytracer.rendering.checkpoint import CheckpointWriter, checkpoint_path
from raytracer.rendering.compilation import PreparedScene
from raytracer.rendering.develop import light_field_layout
from raytracer.rendering.options import RenderOptions, called_with
from raytracer.rendering.progress import Progress
from raytracer.rendering.render import prepare_scene, render_prepared
from raytracer.rendering.session import Rendered
from raytracer.rendering.statistics import Stats
from raytracer.rendering.tile_scheduler import now
from raytracer.rendering.worker_pool import ClusterClient
from raytracer.scene.spec import SceneSpec
from raytracer.util.array_snapshot import previous_path
from raytracer.util.errors import InputError, OutputError

MEMORY = 2 * 10**9
"""Default of the bytes that a band may take."""


class Captured(NamedTuple):
    """Result of a capture.

    views : geometry of the views.
    stats : of all bands together.
    bands : number of the bands.
    band_bytes : most bytes of a band, besides the scene.
    """

    views: Views | PosedViews
    stats: Stats
    bands: int
    band_bytes: int


@dataclass(frozen=True)
class CaptureOptions(RenderOptions):
    """Options of `capture`; see there."""

    spec: SceneSpec
    path: str | Path
    _: KW_ONLY
    memory: int = MEMORY
    dtype: str = "float32"
    compress: bool = False
    every: float | None = None
    resume: bool = False
    say: Callable[[str], object] = lambda sentence: None
    progress: Callable[[Progress], None] | None = None
    load_seconds: float = 0.0
    warn: Callable[[str], object] | None = None
    cluster: ClusterClient | None = None


@called_with(CaptureOptions, without=("crop", "noise", "time_limit"))
def capture(options: CaptureOptions) -> Captured:
    """Render all views of a scene's camera into an `.lf` file, within a given memory.

    The radiance has the bits that it has in the file which `rendering.render` and `Image.save` make.

    Parameters
    ----------
    path : of the file, which appears when all views are there; a KeyboardInterrupt leaves checkpoints alone.
    memory : bytes that films and pictures may take, besides the scene and its ray caster.
    dtype, compress : see `film.light_field.lf.Writer`.
    every : seconds between checkpoints, one file for each band, which are removed once all views are written; none if
        None.
    resume : True to go on from such files.
    say : called with sentences on the checkpoints; see `rendering.checkpoint.CheckpointWriter`.
    max_memory : bytes that this process may take, the scene included; a view must fit, or the picture where it cannot
        be rendered in parts.

    The others are those of `rendering.render`.

    Raises
    ------
    InputError : the camera has one view only; not even a view fits into the memory, or the picture has to be seen as a
        whole and does not; or as `rendering.render` does.
    OutputError : the file cannot be written, or a cluster was lost.
    """
    path, aovs, memory = Path(options.path), options.aovs, options.memory
    dtype, compress, keeps = options.dtype, options.compress, options.every is not None
    check_writable(path)
    layout = _light_field_layout(options.spec, aovs, path)
    views = layout.views
    prepared = prepare_scene(
        options.spec,
        options,
        load_seconds=options.load_seconds,
        warn=options.warn,
        cluster=options.cluster,
        max_pixels=views.width * views.height if layout.is_by_view else None,
        with_checkpoints=keeps,
    )
    spec = prepared.packed.spec
    # Where the camera is focused on an object, the geometry is known only now.
    layout = _light_field_layout(spec, aovs, path)
    pixel_bytes = bytes_per_pixel(prepared, keeps=keeps)
    width, height = spec.picture()
    renderer = _BandRenderer(prepared, path, options)
    bands = choose_bands(spec, layout, pixel_bytes, memory, aovs)
    if bands is None:
        window = Window(0, 0, width, height)
        rendered = renderer.render(window)
        begin = now()
        lf.write(path, layout.light_field(rendered.image), dtype=dtype, compress=compress)
        renderer.delete_checkpoints()
        stats = merge_stats([band_stats(rendered, window.pixels)], prepared.seconds, now() - begin)
        return Captured(layout.views, stats, 1, pixel_bytes * window.pixels)

    done: list[BandStats] = []
    writing = 0.0
    views = layout.views
    with lf.Writer(path, views, dtype=dtype, compress=compress) as writer:
        for band in bands:
            window = band.window(views)
            rendered = renderer.render(window)
            begin = now()
            # Only a picture in which each view has a part to itself is rendered in bands.
            field = band.layout(cast("ViewLayout", layout)).light_field(rendered.image)
            for r, c in np.ndindex(field.views.rows, field.views.columns):
                layers = {name: layer[r, c] for name, layer in field.layers.items()}
                writer.put_view(band.row + r, band.column + c, field.radiance[r, c], layers)
            if field.rays is not None:
                writer.write_rays(field.rays)
            done.append(band_stats(rendered, window.pixels))
            writer.settings |= rendered.image.settings
            writer.settings["samples"] = rendered.image.samples
            del rendered, field
            writing += now() - begin
        stats = merge_stats(done, prepared.seconds, writing)
        replace_error_settings(writer.settings, stats)
    renderer.delete_checkpoints()
    most = max(band.window(views).pixels for band in bands)
    return Captured(views, stats, len(bands), pixel_bytes * most)


def _light_field_layout(spec: SceneSpec, aovs: Sequence[str], path: Path) -> Layout:
    """Return the layout of a light field in the whole picture; raise an InputError if it holds none."""
    layout = light_field_layout(spec)
    if layout is None or (layout.views.rows * layout.views.columns == 1 and not per_sample_aovs(unique_aovs(aovs))):
        reason = spec.camera.why_no_views(spec.film.width, spec.film.height) or NO_LIGHT_FIELD_MESSAGE
        raise InputError(f"{path}: {reason}")
    return layout


class _BandRenderer:
    """Renderer of the bands of a capture, one after the other; each has a checkpoint file beside the light field."""

    def __init__(self, prepared: PreparedScene, path: Path, options: CaptureOptions) -> None:
        self._prepared, self._path, self._options = prepared, path, options
        self._start, self._pixels = now(), 0
        self._writers: list[CheckpointWriter] = []

    def render(self, window: Window) -> Rendered:
        """Render a window of the picture.

        Raises KeyboardInterrupt: the render was interrupted.
        Raises OutputError: a cluster was lost.
        """
        spec = self._prepared.packed.spec
        width, height = spec.picture()

        def report(seen: Progress) -> None:
            if self._options.progress is not None:
                done, wanted = seen.done + self._pixels * spec.render.spp, width * height * spec.render.spp
                self._options.progress(seen._replace(done=done, wanted=wanted, seconds=now() - self._start))

        prepared = self._prepared.for_window(window)
        rendered = render_prepared(prepared, progress=report, checkpoint_writer=self._next_checkpoint())
        if rendered.failure is not None:
            raise OutputError(f"{rendered.failure}; {self._path} is not written")
        if rendered.interrupted:
            raise KeyboardInterrupt
        self._pixels += window.pixels
        return rendered

    def _next_checkpoint(self) -> CheckpointWriter | None:
        """Make the checkpoint writer of the next band; None without checkpoints."""
        every = self._options.every
        if every is None:
            return None
        # A shorter capture, bands before included, is soon rendered again.
        always = now() - self._start >= every
        file = checkpoint_path(self._path.with_name(f"{self._path.name}.{len(self._writers) + 1}"))
        # Bands that were not begun have no checkpoint.
        resume = self._options.resume and (file.exists() or previous_path(file).exists() or not self._writers)
        self._writers.append(CheckpointWriter(file, every=every, resume=resume, always=always, say=self._options.say))
        return self._writers[-1]

    def delete_checkpoints(self) -> None:
        """Remove the files, once the light field is written."""
        for writer in self._writers:
            if writer.info is not None or writer.resumed:
                writer.delete()
