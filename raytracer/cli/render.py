"""`rt render`: from a scene file to images."""

import contextlib
import json
import shlex
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from raytracer.cli import options
from raytracer.errors import InputError, Interrupted, OutputError
from raytracer.interrupts import WATCH, on_hangup, unfinished, wait
from raytracer.scene.preview import EDGE, SPP, smaller
from raytracer.units import parse_duration, parse_share

if TYPE_CHECKING:
    from raytracer.checkpoints import Held, Keeper
    from raytracer.film.image import Image
    from raytracer.rendering import Progress, Rendered, SampleBar, Stats
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
  rt render scenes/cover.yaml --spp 4096 --checkpoint 5min
  rt render scenes/cover.yaml --spp 4096 --resume
"""

_MEGABYTE = 1e6

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
    allow_files: options.AllowFiles = None,
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
    checkpoint: Annotated[
        str | None,
        typer.Option(
            metavar="TIME|off",
            help="How often to write all samples so far to a file beside the first output, FILE.checkpoint, from which "
            "--resume goes on: 30s, 5min.  If given, it is kept after the render, too.  Default: 60s, and kept "
            "after renders that take longer.",
            show_default=False,
        ),
    ] = None,
    resume: Annotated[
        bool,
        typer.Option(
            "--resume",
            help="Go on from the samples in FILE.checkpoint: after an interrupt, a crash, or with a larger --spp.  The "
            "picture has the bits of one that was rendered at once.",
        ),
    ] = False,
    max_memory: options.MaxMemory = None,
    stats: Annotated[Path | None, typer.Option(metavar="FILE.json", help="Write what the render took as JSON.")] = None,
    strict: Annotated[
        bool,
        typer.Option(
            "--strict",
            help="Take warnings for errors, and fail if a sample is not finite, or a pixel below zero without a "
            "reason.",
        ),
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

    Ctrl-C or SIGTERM ends the render early and writes the picture so far, and what --resume goes on from; a second one
    ends it at once.  SIGHUP writes the picture so far, and the render goes on.
    """
    outputs = output or [Path("outputs") / f"{Path(scene).stem}.png"]
    window = options.crop(crop)
    target = None if noise is None else options.number("--noise", noise, parse_share)
    limit = None if time_limit is None else options.number("--time-limit", time_limit, parse_duration)
    most = options.size("--max-memory", max_memory)
    place = _parse_pixel(pixel)
    _check_debug(place, sample, is_on=debug, as_json=as_json)
    if debug and (resume or checkpoint is not None):
        raise InputError(f"--{'resume' if resume else 'checkpoint'} is for pictures, and --debug makes none")
    every = options.checkpoint(checkpoint)
    if resume and every is None:
        raise InputError("--resume goes on from a checkpoint, and with --checkpoint off there is none")
    has_layers = any(path.suffix.lower() in (".exr", ".lf") for path in outputs)
    layers = options.aovs(aov or [], None if has_layers else "-o NAME.exr")

    # Find out what cannot be written before the work, not after.
    from raytracer.film.output import check_file, check_writable
    from raytracer.scene.load import load, parse_overrides

    spec = load(scene, parse_overrides(define or []), allow_files=allow_files or [])
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
    from raytracer.checkpoints import EVERY, Keeper
    from raytracer.rendering import SampleBar, ready

    with SampleBar(quiet=quiet) as bar:

        def say(sentence: str) -> None:
            bar.say(f"rt: {sentence}")

        def warn(sentence: str) -> None:
            say(f"warning: {sentence}")

        beside = None if every is None else _checkpoint(outputs, is_needed=resume or checkpoint is not None, warn=warn)
        keeper = Keeper(
            beside,
            every=every or EVERY,
            resume=resume,
            always=checkpoint is not None,
            say=warn,
            show=lambda image: _show(image, outputs, say),
        )
        if beside is not None and not (resume or quiet) and beside.exists():
            say(
                f"{beside} has the samples of an earlier render, from which --resume would go on; "
                "without it they may be replaced"
            )
        with on_hangup(keeper.ask), options.machines(cluster) as machines:
            prepared = ready(
                spec,
                spp=spp,
                seed=seed,
                threads=threads,
                crop=window,
                noise=target,
                time_limit=None if limit is None else max(limit - _EXIT_SECONDS, 0.5 * limit),
                aovs=layers,
                denoise=denoise,
                load_seconds=time.perf_counter() - context.obj.began,
                warn=warn,
                strict=strict,
                cluster=machines,
                max_memory=most,
                keeps=keeper.path is not None,
            )
            # From here on there is something to lose.
            with WATCH.on_first(wait):
                rendered = prepared.render(
                    progress=lambda progress: _show_progress(progress, bar),
                    rehearse=lambda image: _rehearse(image, outputs),
                    keeper=keeper,
                )
                bar.close()
                wanted = spp or (None if target or limit else spec.render.spp)
                kept = _Kept(keeper, context.obj.words)
                _write(rendered, outputs, stats, kept, warn)
                _report(rendered, outputs, wanted, target, again, kept, quiet, strict, is_crop=window is not None)
    seconds = time.perf_counter() - context.obj.began
    is_interrupted = rendered.interrupted or WATCH.asked is not None
    if limit is not None and not is_interrupted and seconds > 1.05 * limit:
        print(f"rt: {_delay(rendered, limit, seconds)}", file=sys.stderr)
    if is_interrupted:
        raise Interrupted


def _show_progress(progress: "Progress", bar: "SampleBar") -> None:
    """Show how far a render is, if it is to go on."""
    WATCH.heed()
    bar.show(progress)


def _checkpoint(outputs: list[Path], *, is_needed: bool, warn: Callable[[str], object]) -> Path | None:
    """Where the checkpoint lies: beside the first output that has a place among files; None where there is none."""
    from raytracer.checkpoints import checkpoint_of
    from raytracer.film.output import check_file
    from raytracer.wholefiles import is_special

    files = [path for path in outputs if not is_special(path)]
    if not files:
        if is_needed:
            raise InputError(f"a checkpoint lies beside the picture, and {outputs[0]} is no file: add -o NAME.png")
        return None
    path = checkpoint_of(files[0])
    try:
        check_file(path)
    except InputError as error:
        if is_needed:
            raise
        warn(f"{error}; the render's samples are not kept")
        return None
    return path


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


class _Kept(NamedTuple):
    """What there is of a render besides its picture; and the command line, after `rt`, that it came from."""

    keeper: "Keeper"
    words: Sequence[str]

    @property
    def held(self) -> "Held | None":
        """What is in the checkpoint, if there is one, and it has not gone with its folder."""
        held = self.keeper.held
        return held if held is not None and held.path.is_file() else None

    def resume(self) -> str:
        """The command line that goes on from the checkpoint."""
        return options.resuming(self.words)


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
    with contextlib.suppress(OSError, OutputError), unfinished(Path(tempfile.mkdtemp())) as folder:
        for number, path in enumerate(outputs):
            image.save(folder / f"{number}{path.suffix}")


def _show(image: "Image", outputs: list[Path], say: Callable[[str], object]) -> None:
    """Write the picture so far to all outputs that are files."""
    from raytracer.wholefiles import is_special

    files = [path for path in outputs if not is_special(path)]
    for path in files:
        image.save(path)
    if files:
        say(f"{_listed(files)} has the picture so far, of {image.samples} samples per pixel; the render goes on")


def _write(
    rendered: "Rendered", outputs: list[Path], stats: Path | None, kept: _Kept, warn: Callable[[str], object]
) -> None:
    """Write every file that can be written, then report those that could not."""
    from concurrent.futures import ThreadPoolExecutor

    from raytracer.embree import PACKET
    from raytracer.film.output import write_bytes
    from raytracer.wholefiles import persist

    tasks: dict[Path, Callable[[], object]] = {path: partial(rendered.image.save, path) for path in outputs}
    if stats is not None:
        text = json.dumps(rendered.stats.json(), indent=2) + "\n"
        tasks[stats] = partial(write_bytes, stats, text.encode())
    # What encodes a picture mostly leaves the interpreter to others.
    with ThreadPoolExecutor(len(tasks), "writer") as pool:
        failures = persist(tasks, warn, lambda: WATCH.asked is not None, pool)
    if not failures:
        return
    sentence = str(next(iter(failures.values())))
    if len(failures) > 1:
        sentence += f"; nor can {_listed(list(failures)[1:])}"
    held = kept.held
    is_whole = held is not None and held.samples > rendered.fewest_samples - PACKET
    if held is not None:
        has = "the samples" if is_whole else f"{held.samples} samples per pixel"
        sentence += f"; {held.path} has {has}, and this writes the rest: {kept.resume()}"
    if not is_whole and (found := _rescued(rendered.image, [path for path in outputs if path in failures])):
        sentence += f"; instead, there is {_listed(found)}"
    raise OutputError(sentence)


def _rescued(image: "Image", outputs: list[Path]) -> list[Path]:
    """Where a picture lies now that cannot be where it should: in a new folder of the system's, if there is room."""
    found: list[Path] = []
    with contextlib.suppress(OSError, OutputError):
        folder = Path(tempfile.mkdtemp(prefix="rt-"))
        for path in outputs:
            # A device may have no suffix, and gets a .png file's bytes.
            file = folder / (path.name if path.suffix else f"{path.name}.png")
            image.save(file)
            found.append(file)
    return found


def _report(
    rendered: "Rendered",
    outputs: list[Path],
    wanted: int | None,
    target: float | None,
    again: _Again,
    kept: _Kept,
    quiet: bool,
    strict: bool,
    *,
    is_crop: bool,
) -> None:
    """Say on stderr what was made; what is wrong with it also when quiet.

    wanted : samples a pixel, or the most of them; None for no limit.
    target : the relative error that was asked for.
    again : how to take a sample of the picture once more.
    kept : what there is to go on from.
    """
    result, held = rendered.stats, kept.held
    names = _listed(outputs)
    if rendered.interrupted:
        further = "" if held is None else f"; this goes on: {kept.resume()}"
        print(f"rt: interrupted; {names} has {_samples(rendered, wanted)}{further}", file=sys.stderr)
    elif not rendered.complete and rendered.failure is None:
        print(f"rt: {_shortfall(rendered, names, wanted, target)}", file=sys.stderr)
    elif target is not None and not rendered.image.radiance.any():
        print(f"rt: {names} is black, so its relative error says nothing", file=sys.stderr)
    if not quiet:
        print(_summary(rendered, names), file=sys.stderr)
    if not quiet and held is not None and not rendered.interrupted:
        size = f"{held.bytes / _MEGABYTE:.3g} MB"
        print(f"{held.path}: all samples ({size}), to which --resume --spp N adds", file=sys.stderr)
    if not quiet and rendered.setting is not None and rendered.setting.exposure.metering is not None:
        part = " in the crop" if is_crop else ""
        print(f"exposure: {rendered.setting.sentence()}{part}", file=sys.stderr)
    _report_faults(result, again, strict=strict)
    if rendered.failure is not None:
        raise OutputError(f"{rendered.failure}; {names} has {_samples(rendered, wanted)}")


def _report_faults(result: "Stats", again: _Again, *, strict: bool) -> None:
    """Say on stderr what of the picture looks wrong.

    Raises
    ------
    OutputError : samples were not finite, or pixels are below zero without a reason, and `strict`.
    """
    from raytracer.film.negative import describe_negatives

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
    if result.negative_pixels and not result.negative["causes"]:
        sentence = f"{describe_negatives(result.negative_pixels, result.negative)}; this shows a sample of the lowest: "
        sentence += again.command(result.negative["pixel"])
        if strict:
            raise OutputError(sentence)
        print(f"rt: {sentence}", file=sys.stderr)


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
    from raytracer.film.negative import describe_negatives
    from raytracer.noise import Interval
    from raytracer.noise.wording import percent, percent_interval

    result = rendered.stats
    height, width, _ = rendered.image.radiance.shape
    fewest, mean, most = (result.spp[key] for key in ("fewest", "mean", "most"))
    spp = f"{most} spp" if fewest == most else f"{mean:.1f} ({fewest} to {most}) spp"
    seconds = result.seconds["render"]
    before = result.resumed.get("samples", 0)
    samples, rays = result.samples + result.pilot_samples - before, result.rays - result.resumed.get("rays", 0)
    rates = f"{samples / seconds / 1e6:.3g} M samples/s, {rays / seconds / 1e6:.3g} M rays/s"
    if before:
        spp += f", {before / (height * width):.4g} of them before,"
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
    if result.negative_pixels and result.negative["causes"]:
        parts.append(describe_negatives(result.negative_pixels, result.negative))
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


def _listed(paths: Sequence[Path]) -> str:
    return ", ".join(map(str, paths))


def _samples(rendered: "Rendered", wanted: int | None) -> str:
    low, high = rendered.fewest_samples, rendered.stats.spp["most"]
    of = "" if wanted is None else f" of {wanted}"
    return f"{low}{of} samples per pixel" if low == high else f"{low} to {high}{of} samples per pixel"


def register(app: typer.Typer) -> None:
    """Add the command to `app`."""
    app.command(epilog=EXAMPLE)(render)
