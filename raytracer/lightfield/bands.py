"""All views of a camera array, rendered a band at a time, and written to a file as they come.

The scene is loaded, packed, built and compiled once.  A band is as many rows of views as fit into the memory that is
given, or as many views of one row; its pixels have the bits that they have in the picture of all views.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from raytracer.aovs.recording import by_sample, known_aovs
from raytracer.checkpoints import Keeper, checkpoint_of
from raytracer.development import layout_of
from raytracer.errors import InputError, OutputError
from raytracer.film.output import NO_LIGHT_FIELD, check_writable
from raytracer.film.white_balance import AUTO
from raytracer.memory import TALLY_BYTES, picture_of
from raytracer.plenoptic import lf
from raytracer.plenoptic.layout import Layout
from raytracer.plenoptic.mosaic import Mosaic
from raytracer.plenoptic.views import Views
from raytracer.rendering import Progress, Ready, Rendered, Stats, peak_rss_bytes, ready
from raytracer.scene.spec import SceneSpec
from raytracer.scheduling import Window, Workforce, now
from raytracer.snapshots import previous_of

MEMORY = 2 * 10**9
"""Bytes that a band may take, unless told otherwise."""

_GIGABYTE = 1e9


class Captured(NamedTuple):
    """What a capture made.

    views, their geometry; stats, of all bands together; bands, how many there were; band_bytes, what one takes at most,
    besides the scene.
    """

    views: Views
    stats: Stats
    bands: int
    band_bytes: int


class Band(NamedTuple):
    """Views of the rows `row` <= r < `row_end`, and of the columns `column` <= c < `column_end`."""

    row: int
    row_end: int
    column: int
    column_end: int

    def window(self, views: Views) -> Window:
        """The pixels of these views."""
        width, height = views.width, views.height
        return Window(self.column * width, self.row * height, self.column_end * width, self.row_end * height)

    def layout(self, views: Views) -> Mosaic:
        """How the picture of this band holds its views."""
        return Mosaic(replace(views, position=views.position[self.row : self.row_end, self.column : self.column_end]))


def bands_of(views: Views, most: int) -> list[Band]:
    """All views in bands of at most `most`, 1 or more: of whole rows, as alike as can be, or of parts of one row."""
    rows, columns = views.rows, views.columns
    if most >= columns:
        return [Band(begin, end, 0, columns) for begin, end in _parts(rows, most // columns)]
    return [Band(row, row + 1, begin, end) for row in range(rows) for begin, end in _parts(columns, most)]


def _parts(count: int, most: int) -> list[tuple[int, int]]:
    """Begin and end of as few parts of a row as can be, of at most so many each, and as alike as can be."""
    parts = math.ceil(count / most)
    return list(pairwise(count * part // parts for part in range(parts + 1)))


def bytes_per_pixel(found: Ready, *, keeps: bool = False) -> int:
    """Bytes that a pixel takes at most, from its first sample to the end of its development; a denoiser's not included.

    keeps : whether checkpoints are written, for which the film and what tells its error are copied.

    A picture and its layers are as large as the film that they are made of, if not smaller: measured by the process's
    peak, 158 of 176 bytes for plain radiance, 265 of 336 with three AOVs, 490 of 506 with a simulated sensor.
    """
    picture = picture_of(found.packed, 1, None, found.asked.aovs, denoises=found.asked.denoises)
    return 2 * picture.film + (1 + keeps) * TALLY_BYTES + picture.photograph


def capture(
    spec: SceneSpec,
    path: str | Path,
    *,
    memory: int = MEMORY,
    dtype: str = "float32",
    compress: bool = False,
    spp: int | None = None,
    seed: int | None = None,
    threads: int | None = None,
    aovs: Sequence[str] = (),
    denoise: bool = False,
    progress: Callable[[Progress], None] | None = None,
    load_seconds: float = 0.0,
    warn: Callable[[str], object] | None = None,
    strict: bool = False,
    cluster: Workforce | None = None,
    every: float | None = None,
    resume: bool = False,
    say: Callable[[str], object] = lambda sentence: None,
    max_memory: int | None = None,
) -> Captured:
    """Render all views of a scene's camera into an `.lf` file, in no more memory than is given.

    The radiance has the bits that it has in the file which `rendering.render` and `Image.save` make.

    Parameters
    ----------
    path : of the file, which appears when all views are there; a KeyboardInterrupt leaves checkpoints alone.
    memory : bytes that films and pictures may take, besides the scene and its ray caster.
    dtype, compress : see `plenoptic.lf.Writer`.
    every : seconds between checkpoints, one file for each band, which go once all views are there; none if None.
    resume : whether to go on from what such files hold.
    say : told what becomes of them; see `checkpoints.Keeper`.
    max_memory : bytes that this process may take, the scene included; for which a view must fit, or the picture where
        it has no parts.

    The others are those of `rendering.render`.

    Raises
    ------
    InputError : the camera has one view only; not even a view fits into the memory, or the picture has to be seen as a
        whole and does not; or as `rendering.render` does.
    OutputError : the file cannot be written, or a cluster was lost.
    """
    path = Path(path)
    check_writable(path)
    layout = _layout(spec, aovs, path)
    views = layout.views
    found = ready(
        spec,
        spp=spp,
        seed=seed,
        threads=threads,
        aovs=aovs,
        denoise=denoise,
        load_seconds=load_seconds,
        warn=warn,
        strict=strict,
        cluster=cluster,
        max_memory=max_memory,
        most_pixels=views.width * views.height if layout.is_by_view else None,
        keeps=every is not None,
    )
    spec = found.packed.spec
    # Focused on an object, say, the geometry is known only now.
    layout = _layout(spec, aovs, path)
    each = bytes_per_pixel(found, keeps=every is not None)
    width, height = spec.picture()
    start = now()
    bands = _bands(spec, layout, each, memory, aovs)
    keepers = _Keepers(path, every, start, resume, say)
    if bands is None:
        window = Window(0, 0, width, height)
        rendered = _rendered(found, window, 0, width * height, start, progress, path, keepers.next())
        begin = now()
        lf.write(path, layout.light_field(rendered.image), dtype=dtype, compress=compress)
        keepers.forget()
        stats = _merged([_Part(rendered.stats, window.pixels, _mean(rendered))], found.seconds, now() - begin)
        return Captured(layout.views, stats, 1, each * window.pixels)

    done: list[_Part] = []
    writing = 0.0
    views = layout.views
    with lf.Writer(path, views, dtype=dtype, compress=compress) as writer:
        for band in bands:
            window, before = band.window(views), sum(part.pixels for part in done)
            rendered = _rendered(found, window, before, width * height, start, progress, path, keepers.next())
            begin = now()
            field = band.layout(views).light_field(rendered.image)
            for r, c in np.ndindex(field.views.rows, field.views.columns):
                layers = {name: layer[r, c] for name, layer in field.layers.items()}
                writer.put_view(band.row + r, band.column + c, field.radiance[r, c], layers)
            if field.rays is not None:
                writer.keep(field.rays)
            done.append(_Part(rendered.stats, window.pixels, _mean(rendered)))
            writer.settings |= rendered.image.settings
            writer.settings["samples"] = rendered.image.samples
            del rendered, field
            writing += now() - begin
        stats = _merged(done, found.seconds, writing)
        _settle_error(writer.settings, stats)
    keepers.forget()
    most = max(band.window(views).pixels for band in bands)
    return Captured(views, stats, len(bands), each * most)


def _layout(spec: SceneSpec, aovs: Sequence[str], path: Path) -> Layout:
    """How the whole picture holds a light field.

    Raises
    ------
    InputError : it holds none.
    """
    layout = layout_of(spec)
    if layout is None or (layout.views.rows * layout.views.columns == 1 and not by_sample(known_aovs(aovs))):
        raise InputError(f"{path}: {NO_LIGHT_FIELD}")
    return layout


def _bands(spec: SceneSpec, layout: Layout, each: int, memory: int, aovs: Sequence[str]) -> list[Band] | None:
    """What to render at a time, where a pixel takes so many bytes; None for a picture that is no mosaic of views.

    Raises
    ------
    InputError : not even a view fits into the memory, or the picture has to be seen as a whole and does not.
    """
    views = layout.views
    width, height = spec.picture()
    whole, view = each * width * height, each * views.width * views.height
    if whole <= memory:
        return [Band(0, views.rows, 0, views.columns)] if layout.is_by_view else None
    reason = _needs_all(spec, layout, aovs)
    if reason is not None:
        raise InputError(f"memory: {reason}, for which {_gigabytes(whole)} are needed, and {_gigabytes(memory)} given")
    if view > memory:
        size = f"{views.width} x {views.height}"
        raise InputError(
            f"memory: must be at least what a view of {size} pixels takes, {_gigabytes(view)}, got {_gigabytes(memory)}"
        )
    return bands_of(views, memory // view)


def _needs_all(spec: SceneSpec, layout: Layout, aovs: Sequence[str]) -> str | None:
    """Why a picture cannot be made in parts; None if it can."""
    if not layout.is_by_view:
        return f"the picture of a {spec.camera.type} camera holds all views in all of its parts"
    if spec.camera.exposure is not None:
        return "camera.exposure measures the whole picture"
    if spec.film.white_balance == AUTO:
        return "film.white_balance: auto measures the whole picture"
    kept = by_sample(known_aovs(aovs))
    return f"the AOV {kept[0]} is kept of the whole picture" if kept else None


def _gigabytes(size: float) -> str:
    return f"{size / _GIGABYTE:.3g} GB"


def _rendered(
    found: Ready,
    window: Window,
    before: int,
    pixels: int,
    start: float,
    progress: Callable[[Progress], None] | None,
    path: Path,
    keeper: Keeper | None,
) -> Rendered:
    """A part of the picture, of all of whose `pixels` there were so many `before`, since `start` (s).

    Raises
    ------
    KeyboardInterrupt : the render was interrupted.
    OutputError : a cluster was lost.
    """
    spp = found.packed.spec.render.spp

    def told(seen: Progress) -> None:
        if progress is not None:
            progress(seen._replace(done=seen.done + before * spp, wanted=pixels * spp, seconds=now() - start))

    rendered = found.part(window).render(progress=told, keeper=keeper)
    if rendered.failure is not None:
        raise OutputError(f"{rendered.failure}; {path} is not written")
    if rendered.interrupted:
        raise KeyboardInterrupt
    return rendered


class _Keepers:
    """Who keeps what is gathered of each band, one after the other."""

    def __init__(
        self, path: Path, every: float | None, start: float, resume: bool, say: Callable[[str], object]
    ) -> None:
        self._path, self._every, self._start, self._resume, self._say = path, every, start, resume, say
        self._keepers: list[Keeper] = []

    def next(self) -> Keeper | None:
        """That of the next band."""
        if self._every is None:
            return None
        # What less than that has taken, bands before included, is soon rendered again.
        always = now() - self._start >= self._every
        file = checkpoint_of(self._path.with_name(f"{self._path.name}.{len(self._keepers) + 1}"))
        # Bands that were not begun have none.
        resume = self._resume and (file.exists() or previous_of(file).exists() or not self._keepers)
        self._keepers.append(Keeper(file, every=self._every, resume=resume, always=always, say=self._say))
        return self._keepers[-1]

    def forget(self) -> None:
        """Remove the files, once the light field is there."""
        for keeper in self._keepers:
            if keeper.held is not None or keeper.resumed:
                keeper.forget()


class _Part(NamedTuple):
    """What a band took: its statistics, its pixels, and the mean of its picture."""

    stats: Stats
    pixels: int
    mean: float


def _mean(rendered: Rendered) -> float:
    return float(np.abs(rendered.image.radiance).mean())


def _merged(parts: Sequence[_Part], before: dict[str, float], writing: float) -> Stats:
    """Statistics of all bands together.

    before : seconds by phase up to the first band, which each has counted in.
    """
    first = parts[0].stats
    seconds = dict(before)
    for part in parts:
        for phase, passed in part.stats.seconds.items():
            if phase != "total":
                seconds[phase] = seconds.get(phase, 0.0) + passed - before.get(phase, 0.0)
    seconds["write"] = writing
    seconds["total"] = sum(seconds.values())
    of_light = [part.pixels * part.mean for part in parts]
    light, pixels = sum(of_light), sum(part.pixels for part in parts)
    samples = sum(part.stats.samples for part in parts)
    dropped = [part.stats.first_nan for part in parts if part.stats.first_nan is not None]
    return replace(
        first,
        seconds=seconds,
        rays=sum(part.stats.rays for part in parts),
        samples=samples,
        resumed=_resumed(parts),
        spp={
            "fewest": min(part.stats.spp["fewest"] for part in parts),
            "mean": samples / pixels,
            "most": max(part.stats.spp["most"] for part in parts),
        },
        nan_samples=sum(part.stats.nan_samples for part in parts),
        first_nan=dropped[0] if dropped else None,
        fireflies=_fireflies(parts, of_light),
        negative_pixels=sum(part.stats.negative_pixels for part in parts),
        negative=min((part.stats.negative for part in parts), key=lambda found: found.get("lowest", 0.0)),
        clamp=_clamp(parts, of_light),
        error=_error(parts, light / pixels),
        peak_rss_bytes=peak_rss_bytes(),
    )


def _resumed(parts: Sequence[_Part]) -> dict[str, float]:
    """What all bands have gone on from; empty where none has."""
    taken = [part.stats.resumed for part in parts if part.stats.resumed]
    return {name: sum(each[name] for each in taken) for name in taken[0]} if taken else {}


def _fireflies(parts: Sequence[_Part], of_light: Sequence[float]) -> dict[str, Any]:
    """Those of all bands; the brightest is that of the band in which they have most of the light."""
    found = [(part.stats.fireflies, light) for part, light in zip(parts, of_light, strict=True) if part.stats.fireflies]
    if not found:
        return {}
    brightest, _ = max(found, key=lambda item: item[0]["light"] * item[1])
    taken = sum(each["light"] * light for each, light in found) / sum(of_light)
    return {**brightest, "pixels": sum(each["pixels"] for each, _ in found), "light": taken}


def _clamp(parts: Sequence[_Part], of_light: Sequence[float]) -> dict[str, float]:
    """What a clamp took of all light, and of all samples."""
    limits = parts[0].stats.clamp
    if not limits:
        return {}
    light, samples = sum(of_light), sum(part.stats.samples for part in parts)
    return {
        "limit": limits["limit"],
        "light": sum(p.stats.clamp["light"] * of for p, of in zip(parts, of_light, strict=True)) / light
        if light
        else 0.0,
        "samples": sum(part.stats.clamp["samples"] * part.stats.samples for part in parts) / samples,
    }


def _error(parts: Sequence[_Part], mean: float) -> dict[str, float]:
    """The relative error of all bands together, and the ends of its interval; empty where it is not known of each.

    Errors of pixels are independent, so that their mean squares, weighted by pixels, are those of the whole.
    """
    if mean == 0.0 or not all(part.stats.error for part in parts):
        return {}
    pixels = sum(part.pixels for part in parts)

    def whole(name: str) -> float:
        squares = sum(part.pixels * (part.stats.error[name] * part.mean) ** 2 for part in parts)
        return math.sqrt(squares / pixels) / mean

    found = {name: whole(name) for name in ("relative", "low", "high")}
    of_samples = sum(part.pixels * part.stats.error["exponent"] for part in parts) / pixels
    return {**found, "exponent": of_samples}


def _settle_error(settings: dict[str, str | float | int], stats: Stats) -> None:
    """Tell the error of all views, in place of that of some."""
    names = {"relative": "relative_error", "low": "relative_error_low", "high": "relative_error_high"}
    for key, name in names.items():
        settings.pop(name, None)
        if stats.error:
            settings[name] = stats.error[key]
    if stats.clamp:
        settings["clamp_took"] = stats.clamp["light"]
