"""`rt render`: from a scene file to images."""

import contextlib
import json
import shlex
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from raytracer.cli import options
from raytracer.errors import InputError, Interrupted, OutputError
from raytracer.scene.preview import EDGE, SPP, smaller
from raytracer.units import parse_duration, parse_share

if TYPE_CHECKING:
    from raytracer.film.image import Image
    from raytracer.rendering import Rendered
    from raytracer.scene.spec import SceneSpec

EXAMPLE = """\b
Examples:
  rt render scenes/cover.yaml
  rt render scenes/cover.yaml -o cover.png -o cover.exr --spp 1000
  rt render scenes/cover.yaml -D camera.defocus_angle=2 --preview
  rt render scenes/cornell.yaml --noise 2% -o cornell.exr --aov samples
  rt render scenes/cornell.yaml --crop 200,200,400,400 --time-limit 30s --stats stats.json
  rt render scenes/cornell.yaml -o cornell.exr --aov depth,normal,albedo --denoise
  rt render scenes/cornell.yaml --pixel 212,140 --sample 3 --debug
  rt render scenes/cover.yaml --spp 4096 --cluster tcp://head:8786
"""

# What the interpreter takes to end.
_EXIT_SECONDS = 0.05


def render(
    context: typer.Context,
    scene: Annotated[str, typer.Argument(metavar="SCENE", help="Scene file.")],
    output: Annotated[
        list[Path] | None,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE",
            help="Image to write, .png .jpg for display, .exr .hdr .npy linear; .lf holds a light field; may repeat.  "
            "Default: outputs/<scene>.png",
            show_default=False,
        ),
    ] = None,
    define: options.Define = None,
    spp: options.Spp = None,
    seed: options.Seed = None,
    threads: options.Threads = None,
    crop: options.Crop = None,
    noise: Annotated[
        str | None,
        typer.Option(
            metavar="PERCENT",
            help="Stop when the picture's relative error is down to this: 1%, 0.01.  Samples go where they are needed; "
            "--spp is then the most that a pixel may get.  Default: no limit.",
            show_default=False,
        ),
    ] = None,
    time_limit: Annotated[
        str | None,
        typer.Option(
            metavar="TIME",
            help="Be done after this time, from start to written files: 30s, 5 min.  Samples go where they are needed, "
            "unless --spp says how many a pixel gets at most.",
        ),
    ] = None,
    aov: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME,...",
            help="What else to record, as layers of an .exr or .lf file: depth, distance, normal, geometric_normal, "
            "albedo, position, motion, object_id, material_id, direct, indirect, coverage, samples, variance, rays.  "
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
        typer.Option("--preview", help=f"A quick look: at most {EDGE} pixels wide or high, {SPP} spp."),
    ] = False,
    cluster: Annotated[
        str | None,
        typer.Option(
            metavar="URL",
            help="Have the samples taken by the workers of this Dask scheduler, tcp://host:8786 "
            "(pip install 'raytracer[cluster]').  The picture has the bits that it has here, if their instruction sets "
            "are alike; see docs/cluster.md.",
        ),
    ] = None,
    stats: Annotated[Path | None, typer.Option(metavar="FILE.json", help="Write what the render took as JSON.")] = None,
    strict: Annotated[
        bool, typer.Option("--strict", help="Take warnings for errors, and fail if a sample is not finite.")
    ] = False,
    pixel: Annotated[
        str | None, typer.Option(metavar="X,Y", help="With --debug: the pixel, from 0,0 in the top left corner.")
    ] = None,
    sample: Annotated[
        int | None,
        typer.Option(
            help="With --debug: the sample of the pixel, from 0.  Default: the first that is not finite, or else the "
            "brightest.",
            min=0,
            max=2**31 - 1,
            show_default=False,
        ),
    ] = None,
    debug: Annotated[
        bool,
        typer.Option(
            "--debug",
            help="Write no picture: print the path of one sample, vertex by vertex, as it is in the picture that these "
            "options make.",
        ),
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="With --debug: print JSON.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress and no summary.")] = False,
) -> None:
    """Render a scene.

    Ctrl-C ends the render early and writes the picture so far.
    """
    outputs = output or [Path("outputs") / f"{Path(scene).stem}.png"]
    window = options.crop(crop)
    target = None if noise is None else options.number("--noise", noise, parse_share)
    limit = None if time_limit is None else options.number("--time-limit", time_limit, parse_duration)
    place = _parse_pixel(pixel)
    _check_debug(place, sample, is_on=debug, as_json=as_json)
    has_layers = any(path.suffix.lower() in (".exr", ".lf") for path in outputs)
    layers = options.aovs(aov or [], None if has_layers else "-o NAME.exr")

    # Find out what cannot be written before the work, not after.
    from raytracer.film.output import check_file, check_writable
    from raytracer.scene.load import load, parse_overrides

    spec = load(scene, parse_overrides(define or []))
    if not debug:
        for path in outputs:
            check_writable(path)
            if path.suffix.lower() == ".lf":
                _check_views(path, spec, layers, is_whole=window is None)
        if stats is not None:
            check_file(stats)
    again = _Again(scene, define or [], preview, spp, seed, noise, time_limit)
    if preview:
        spec = smaller(spec)
        if target is None:
            spp = min(spp or spec.render.spp, SPP)
    if place is not None:
        is_whole = spp is None and (target is not None or limit is not None)
        _show_path(spec, place, sample, spp, seed, is_whole=is_whole, as_json=as_json)
        return
    from raytracer.rendering import SampleBar
    from raytracer.rendering import render as render_scene

    with SampleBar(quiet=quiet) as bar, options.machines(cluster) as machines:
        load_seconds = time.perf_counter() - context.obj
        rendered = render_scene(
            spec,
            spp=spp,
            seed=seed,
            threads=threads,
            crop=window,
            noise=target,
            time_limit=None if limit is None else max(limit - _EXIT_SECONDS, 0.5 * limit),
            aovs=layers,
            denoise=denoise,
            progress=bar.show,
            load_seconds=load_seconds,
            rehearse=lambda image: _rehearse(image, outputs),
            warn=lambda sentence: print(f"rt: warning: {sentence}", file=sys.stderr),
            strict=strict,
            cluster=machines,
        )
    _write(rendered, outputs, stats)
    wanted = spp or (None if target or limit else spec.render.spp)
    _report(rendered, outputs, wanted, target, again, quiet, strict, is_crop=window is not None)
    seconds = time.perf_counter() - context.obj
    if limit is not None and not rendered.interrupted and seconds > 1.05 * limit:
        print(f"rt: {_delay(rendered, limit, seconds)}", file=sys.stderr)
    if rendered.interrupted:
        raise Interrupted


def _check_views(path: Path, spec: "SceneSpec", layers: Sequence[str], *, is_whole: bool) -> None:
    """Make sure that the picture of a scene holds a light field."""
    from raytracer.film.output import NO_LIGHT_FIELD

    layout = spec.camera.layout(spec.film.width, spec.film.height)
    has_views = layout is not None and (layout.views.rows * layout.views.columns > 1 or "rays" in layers)
    if not (has_views and is_whole):
        raise InputError(f"{path}: {NO_LIGHT_FIELD}")


def _parse_pixel(text: str | None) -> tuple[int, int] | None:
    if text is None:
        return None
    try:
        x, y = map(int, text.split(","))
    except ValueError:
        raise InputError(f"--pixel {text}: must be two whole numbers, X,Y") from None
    return x, y


def _check_debug(pixel: tuple[int, int] | None, sample: int | None, *, is_on: bool, as_json: bool) -> None:
    """Refuse options that only mean something together."""
    if is_on and pixel is None:
        raise InputError("--debug needs --pixel X,Y, the pixel whose path it is to print")
    for name, given in (("--pixel", pixel is not None), ("--sample", sample is not None), ("--json", as_json)):
        if given and not is_on:
            raise InputError(f"{name} needs --debug, which prints the path of one sample")


def _show_path(
    spec: "SceneSpec",
    pixel: tuple[int, int],
    sample: int | None,
    spp: int | None,
    seed: int | None,
    *,
    is_whole: bool,
    as_json: bool,
) -> None:
    """Print the path of one sample."""
    from raytracer.debugging import text, trace

    found = trace(spec, pixel, sample, spp=spp, seed=seed, whole=is_whole)
    print(json.dumps(found.json(), indent=2, allow_nan=False) if as_json else text(found), end="\n" if as_json else "")


class _Again(NamedTuple):
    """What of a command line decides what a sample of the picture is."""

    scene: str
    define: list[str]
    preview: bool
    spp: int | None
    seed: int | None
    noise: str | None
    time_limit: str | None

    def command(self, pixel: Sequence[int], sample: int | None = None) -> str:
        """The command line that prints the path of a sample."""
        words = ["rt", "render", self.scene]
        for text in self.define:
            words += ["-D", text]
        words += ["--preview"] if self.preview else []
        for name in ("spp", "seed", "noise", "time_limit"):
            value = getattr(self, name)
            words += [] if value is None else [f"--{name.replace('_', '-')}", str(value)]
        words += ["--pixel", ",".join(map(str, pixel))]
        words += [] if sample is None else ["--sample", str(sample)]
        return shlex.join([*words, "--debug"])


def _rehearse(image: "Image", outputs: list[Path]) -> None:
    """Write files as those asked for, and forget them; where there is no room for that, it is not practised."""
    with contextlib.suppress(OSError, OutputError), tempfile.TemporaryDirectory() as folder:
        for number, path in enumerate(outputs):
            image.save(Path(folder) / f"{number}{path.suffix}")


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


def _report(
    rendered: "Rendered",
    outputs: list[Path],
    wanted: int | None,
    target: float | None,
    again: _Again,
    quiet: bool,
    strict: bool,
    *,
    is_crop: bool,
) -> None:
    """Say on stderr what was made; what is wrong with it also when quiet.

    wanted : samples a pixel, or the most of them; None for no limit.
    target : the relative error that was asked for.
    again : how to take a sample of the picture once more.
    """
    result = rendered.stats
    names = ", ".join(map(str, outputs))
    if rendered.interrupted:
        print(f"rt: interrupted; {names} has {_samples(rendered, wanted)}", file=sys.stderr)
    elif not rendered.complete and rendered.failure is None:
        print(f"rt: {_shortfall(rendered, names, wanted, target)}", file=sys.stderr)
    elif target is not None and not rendered.image.radiance.any():
        print(f"rt: {names} is black, so its relative error says nothing", file=sys.stderr)
    if not quiet:
        print(_summary(rendered, names), file=sys.stderr)
    if not quiet and rendered.setting is not None and rendered.setting.exposure.metering is not None:
        part = " in the crop" if is_crop else ""
        print(f"exposure: {rendered.setting.sentence()}{part}", file=sys.stderr)
    if result.fireflies:
        print(f"rt: {_fireflies(result.fireflies, again)}", file=sys.stderr)
    if result.nan_samples:
        sentence = f"{_not_finite(result.nan_samples)} and {'was' if result.nan_samples == 1 else 'were'} dropped"
        if result.first_nan is not None:
            first = "it" if result.nan_samples == 1 else "the first one"
            sentence += f"; this shows {first}: {again.command(result.first_nan['pixel'], result.first_nan['sample'])}"
        if strict:
            raise OutputError(sentence)
        print(f"rt: {sentence}", file=sys.stderr)
    if rendered.failure is not None:
        raise OutputError(f"{rendered.failure}; {names} has {_samples(rendered, wanted)}")


def _shortfall(rendered: "Rendered", names: str, wanted: int | None, target: float | None) -> str:
    """Why a render ended before it had what was asked for."""
    from raytracer.noise.wording import plain_percent

    spp = f"{wanted} sample{'' if wanted == 1 else 's'} per pixel"
    if wanted is None or target is None or rendered.fewest_samples < wanted:
        if target is not None and not rendered.stats.error and rendered.fewest_samples >= 16:
            return f"the error of {names} cannot be told: its values are beyond all bounds"
        return f"out of time; {names} has {_samples(rendered, wanted)}"
    if not rendered.stats.error:
        return f"{spp} tell too little of the error of {names}: it takes 16"
    return f"{spp} do not bring {names} to a relative error of {plain_percent(target)}"


def _delay(rendered: "Rendered", limit: float, seconds: float) -> str:
    """Why a command took so many seconds for a time limit."""
    spent = rendered.stats.seconds
    names = {"load": "loading", "pack": "packing", "build": "building", "compile": "compiling", "render": "rendering"}
    longest = max(names, key=lambda name: spent[name])
    least = "every pixel gets at least 8 samples"
    return f"{seconds:.1f} s for a time limit of {limit:g} s: {names[longest]} took {spent[longest]:.1f} s; {least}"


def _summary(rendered: "Rendered", names: str) -> str:
    """What every render tells: samples, seconds, rates, error, and what was not finite."""
    from raytracer.noise import Interval
    from raytracer.noise.wording import percent, percent_interval

    result = rendered.stats
    height, width, _ = rendered.image.radiance.shape
    fewest, mean, most = (result.spp[key] for key in ("fewest", "mean", "most"))
    spp = f"{most} spp" if fewest == most else f"{mean:.1f} ({fewest} to {most}) spp"
    seconds = result.seconds["render"]
    samples = result.samples + result.pilot_samples
    rates = f"{samples / seconds / 1e6:.3g} M samples/s, {result.rays / seconds / 1e6:.3g} M rays/s"
    error = "relative error unknown"
    if rendered.fewest_samples < 16:
        error += " from fewer than 16 spp"
    elif not result.error and not rendered.interrupted:
        error += ", as values are beyond all bounds"
    if result.error:
        where = " before denoising" if "denoise" in result.seconds else ""
        interval = Interval(*(result.error[key] for key in ("relative", "low", "high")))
        error = f"relative error{where} {percent_interval(interval)}"
    finite = _not_finite(result.nan_samples)
    parts = [f"{names}: {width} x {height}, {spp} in {seconds:.2f} s ({rates})", error, finite]
    if result.clamp:
        light, clamped = (percent(result.clamp[key]) for key in ("light", "samples"))
        parts.append(f"clamp took {light} of the light, in {clamped} of the samples")
    return ", ".join(parts)


def _fireflies(found: Mapping[str, Any], again: _Again) -> str:
    """What is to be known of fireflies."""
    from raytracer.noise.wording import percent

    count, by, which = "1 pixel is a firefly", "one sample makes it", "this shows it"
    if found["pixels"] != 1:
        count, by = f"{found['pixels']} pixels are fireflies", "one sample each makes them"
        which = "this shows the brightest one"
    clamp = "" if found["clamp"] is None else f", and -D render.clamp={found['clamp']:g} would cut it off"
    return (
        f"{count}: {by} far brighter than what is around, by {percent(found['light'])} of the picture's light; "
        f"more samples even that out{clamp}; {which}: {again.command(found['brightest'], found['sample'])}"
    )


def _not_finite(samples: int) -> str:
    if samples == 0:
        return "all samples finite"
    return "1 sample was not finite" if samples == 1 else f"{samples} samples were not finite"


def _samples(rendered: "Rendered", wanted: int | None) -> str:
    low, high = rendered.fewest_samples, rendered.stats.spp["most"]
    of = "" if wanted is None else f" of {wanted}"
    return f"{low}{of} samples per pixel" if low == high else f"{low} to {high}{of} samples per pixel"


def register(app: typer.Typer) -> None:
    """Add the command to `app`."""
    app.command(epilog=EXAMPLE)(render)
