"""`rt render`: from a scene file to images."""

import json
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from raytracer.errors import InputError, OutputError

if TYPE_CHECKING:
    from raytracer.rendering import Progress, Rendered
    from raytracer.scene.spec import SceneSpec

EXAMPLE = """\b
Examples:
  rt render scenes/cover.yaml
  rt render scenes/cover.yaml -o cover.png -o cover.exr --spp 1000
  rt render scenes/cover.yaml -D camera.defocus_angle=2 --preview
  rt render scenes/cornell.yaml --crop 200,200,400,400 --time-limit 30s --stats stats.json
  rt render scenes/cornell.yaml -o cornell.exr --aov depth,normal,albedo --denoise
"""

_INTERRUPTED = 130
_PREVIEW_EDGE = 480
_PREVIEW_SPP = 16


def render(
    scene: Annotated[str, typer.Argument(metavar="SCENE", help="Scene file.")],
    output: Annotated[
        list[Path] | None,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE",
            help="Image to write, .png .jpg for display, .exr .hdr .npy linear; may repeat.  "
            "Default: outputs/<scene>.png",
            show_default=False,
        ),
    ] = None,
    define: Annotated[
        list[str] | None,
        typer.Option("--define", "-D", metavar="KEY=VALUE", help="Override a key of the scene: camera.vfov=40."),
    ] = None,
    spp: Annotated[int | None, typer.Option(help="Samples per pixel.", min=1, max=2**31 - 1)] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of all random numbers.", min=0, max=2**32 - 1)] = None,
    threads: Annotated[int | None, typer.Option(help="Threads that work.  Default: all.", min=1, max=1024)] = None,
    crop: Annotated[
        str | None, typer.Option(metavar="X0,Y0,X1,Y1", help="Render only the pixels X0 <= x < X1, Y0 <= y < Y1.")
    ] = None,
    time_limit: Annotated[
        str | None, typer.Option(metavar="TIME", help="Start no more samples after this time: 30s, 5 min.")
    ] = None,
    aov: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME,...",
            help="What else to record, as layers of an .exr file: depth, distance, normal, geometric_normal, albedo, "
            "position, motion, object_id, material_id, direct, indirect, coverage, samples, variance.  "
            "May repeat; see docs/aovs.md.",
        ),
    ] = None,
    denoise: Annotated[
        bool,
        typer.Option(
            "--denoise",
            help="Take out the noise with Intel Open Image Denoise (pip install 'raytracer[denoise]').  The picture is "
            "then biased, and its header says so; an .exr file keeps the layer `noisy`.",
        ),
    ] = False,
    preview: Annotated[
        bool,
        typer.Option(
            "--preview", help=f"A quick look: at most {_PREVIEW_EDGE} pixels wide or high, {_PREVIEW_SPP} spp."
        ),
    ] = False,
    stats: Annotated[Path | None, typer.Option(metavar="FILE.json", help="Write what the render took as JSON.")] = None,
    strict: Annotated[bool, typer.Option("--strict", help="Fail if a sample is not finite.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress and no summary.")] = False,
) -> None:
    """Render a scene.

    Ctrl-C ends the render early and writes the picture so far.
    """
    start = time.perf_counter()
    outputs = output or [Path("outputs") / f"{Path(scene).stem}.png"]
    window = _parse_crop(crop)
    limit = _parse_time(time_limit)
    layers = _parse_aovs(aov or [], outputs)

    # Find out what cannot be written before the work, not after.
    from raytracer.film.output import check_file, check_writable
    from raytracer.scene.load import load, parse_overrides

    spec = load(scene, parse_overrides(define or []))
    for path in outputs:
        check_writable(path)
    if stats is not None:
        check_file(stats)
    if preview:
        spec = _small(spec)
        spp = min(spp or spec.render.spp, _PREVIEW_SPP)
    load_seconds = time.perf_counter() - start

    from raytracer.rendering import render as render_scene

    bar = _Bar(quiet)
    try:
        rendered = render_scene(
            spec,
            spp=spp,
            seed=seed,
            threads=threads,
            crop=window,
            time_limit=limit,
            aovs=layers,
            denoise=denoise,
            progress=bar.update,
            load_seconds=load_seconds,
        )
    finally:
        bar.close()
    _write(rendered, outputs, stats)
    _report(rendered, outputs, spp or spec.render.spp, quiet, strict, is_crop=window is not None)
    if rendered.interrupted:
        raise typer.Exit(_INTERRUPTED)


def _parse_crop(text: str | None) -> tuple[int, int, int, int] | None:
    if text is None:
        return None
    try:
        left, top, right, bottom = map(int, text.split(","))
    except ValueError:
        raise InputError(f"--crop {text}: must be four whole numbers, X0,Y0,X1,Y1") from None
    return left, top, right, bottom


def _parse_aovs(lists: list[str], outputs: list[Path]) -> tuple[str, ...]:
    """The AOVs named in comma-separated lists."""
    if not lists:
        return ()
    if not any(path.suffix.lower() == ".exr" for path in outputs):
        raise InputError(f"--aov {lists[0]}: only .exr files hold layers: add -o NAME.exr")
    from raytracer.aovs.recording import known_aovs

    try:
        return known_aovs([name.strip() for text in lists for name in text.split(",")])
    except InputError as error:
        raise InputError(f"--aov {','.join(lists)}: {error}") from None


def _parse_time(text: str | None) -> float | None:
    if text is None:
        return None
    from raytracer.units import parse_quantity

    try:
        seconds = parse_quantity(text, "time")
    except ValueError as error:
        raise InputError(f"--time-limit {text}: {error}") from None
    if not seconds > 0.0:
        raise InputError(f"--time-limit {text}: must be greater than 0")
    return seconds


def _small(spec: "SceneSpec") -> "SceneSpec":
    """The scene with a film of at most _PREVIEW_EDGE pixels a side, of the same shape."""
    factor = min(1.0, _PREVIEW_EDGE / max(spec.film.width, spec.film.height))
    size = {edge: max(1, round(factor * getattr(spec.film, edge))) for edge in ("width", "height")}
    return spec.model_copy(update={"film": spec.film.model_copy(update=size)})


class _Bar:
    """A tqdm bar in samples, from the first progress on."""

    def __init__(self, quiet: bool) -> None:
        self._quiet = quiet
        self._bar: Any = None

    def update(self, progress: "Progress") -> None:
        """Show how far the render is."""
        if self._quiet:
            return
        if self._bar is None:
            from tqdm import tqdm

            # None: only on a terminal.
            self._bar = tqdm(total=progress.wanted, unit=" samples", unit_scale=True, leave=False, disable=None)
        self._bar.update(progress.done - self._bar.n)

    def close(self) -> None:
        """Take the bar away."""
        if self._bar is not None:
            self._bar.close()


def _write(rendered: "Rendered", outputs: list[Path], stats: Path | None) -> None:
    """Write every file that can be written, then report the first that could not."""
    from raytracer.film.output import write_bytes

    failures: list[OutputError] = []
    for path in outputs:
        try:
            rendered.image.save(path)
        except OutputError as error:
            failures.append(error)
    if stats is not None:
        write_bytes(stats, (json.dumps(rendered.stats.json(), indent=2) + "\n").encode())
    if failures:
        raise failures[0]


def _report(rendered: "Rendered", outputs: list[Path], spp: int, quiet: bool, strict: bool, *, is_crop: bool) -> None:
    """Say on stderr what was made; what is wrong with it also when quiet."""
    result = rendered.stats
    seconds = result.seconds["render"]
    height, width, _ = rendered.image.radiance.shape
    names = ", ".join(map(str, outputs))
    if rendered.interrupted:
        print(f"rt: interrupted; {names} has {_samples(rendered, spp)}", file=sys.stderr)
    elif not rendered.complete:
        print(f"rt: out of time; {names} has {_samples(rendered, spp)}", file=sys.stderr)
    elif not quiet:
        rates = f"{result.samples / seconds / 1e6:.3g} M samples/s, {result.rays / seconds / 1e6:.3g} M rays/s"
        print(f"{names}: {width} x {height}, {spp} spp in {seconds:.2f} s ({rates})", file=sys.stderr)
    if not quiet and rendered.setting is not None and rendered.setting.exposure.metering is not None:
        part = " in the crop" if is_crop else ""
        print(f"exposure: {rendered.setting.sentence()}{part}", file=sys.stderr)
    if result.nan_samples:
        sentence = f"{result.nan_samples} samples were not finite and were dropped"
        if strict:
            raise OutputError(sentence)
        print(f"rt: {sentence}", file=sys.stderr)


def _samples(rendered: "Rendered", spp: int) -> str:
    low, high = rendered.fewest_samples, rendered.image.samples
    return f"{low} of {spp} samples per pixel" if low == high else f"{low} to {high} of {spp} samples per pixel"


def register(app: typer.Typer) -> None:
    """Add the command to `app`."""
    app.command(epilog=EXAMPLE)(render)
