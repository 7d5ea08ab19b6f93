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

from raytracer.errors import InputError, Interrupted, OutputError

if TYPE_CHECKING:
    from raytracer.film.image import Image
    from raytracer.rendering import Progress, Rendered
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
"""

# What the interpreter takes to end.
_EXIT_SECONDS = 0.05

_PREVIEW_EDGE = 480
_PREVIEW_SPP = 16


def render(
    context: typer.Context,
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
    window = _parse_crop(crop)
    target = _parse_noise(noise)
    limit = _parse_time(time_limit)
    place = _parse_pixel(pixel)
    _check_debug(place, sample, is_on=debug, as_json=as_json)
    layers = _parse_aovs(aov or [], outputs)

    # Find out what cannot be written before the work, not after.
    from raytracer.film.output import check_file, check_writable
    from raytracer.scene.load import load, parse_overrides

    spec = load(scene, parse_overrides(define or []))
    if not debug:
        for path in outputs:
            check_writable(path)
        if stats is not None:
            check_file(stats)
    again = _Again(scene, define or [], preview, spp, seed, noise, time_limit)
    if preview:
        spec = _small(spec)
        if target is None:
            spp = min(spp or spec.render.spp, _PREVIEW_SPP)
    if place is not None:
        is_whole = spp is None and (target is not None or limit is not None)
        _show_path(spec, place, sample, spp, seed, is_whole=is_whole, as_json=as_json)
        return
    from raytracer.rendering import render as render_scene

    load_seconds = time.perf_counter() - context.obj
    bar = _Bar(quiet)
    try:
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
            progress=bar.update,
            load_seconds=load_seconds,
            rehearse=lambda image: _rehearse(image, outputs),
            warn=lambda sentence: print(f"rt: warning: {sentence}", file=sys.stderr),
            strict=strict,
        )
    finally:
        bar.close()
    _write(rendered, outputs, stats)
    wanted = spp or (None if target or limit else spec.render.spp)
    _report(rendered, outputs, wanted, target, again, quiet, strict, is_crop=window is not None)
    seconds = time.perf_counter() - context.obj
    if limit is not None and not rendered.interrupted and seconds > 1.05 * limit:
        print(f"rt: {_delay(rendered, limit, seconds)}", file=sys.stderr)
    if rendered.interrupted:
        raise Interrupted


def _parse_crop(text: str | None) -> tuple[int, int, int, int] | None:
    if text is None:
        return None
    try:
        left, top, right, bottom = map(int, text.split(","))
    except ValueError:
        raise InputError(f"--crop {text}: must be four whole numbers, X0,Y0,X1,Y1") from None
    return left, top, right, bottom


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


def _parse_noise(text: str | None) -> float | None:
    if text is None:
        return None
    from raytracer.units import parse_share

    try:
        return parse_share(text)
    except ValueError as error:
        raise InputError(f"--noise {text}: {error}") from None


def _parse_time(text: str | None) -> float | None:
    if text is None:
        return None
    from raytracer.units import parse_duration

    try:
        return parse_duration(text)
    except ValueError as error:
        raise InputError(f"--time-limit {text}: {error}") from None


def _small(spec: "SceneSpec") -> "SceneSpec":
    """The scene with a film of at most _PREVIEW_EDGE pixels a side, of the same shape."""
    factor = min(1.0, _PREVIEW_EDGE / max(spec.film.width, spec.film.height))
    size = {edge: max(1, round(factor * getattr(spec.film, edge))) for edge in ("width", "height")}
    return spec.model_copy(update={"film": spec.film.model_copy(update=size)})


class _Bar:
    """A tqdm bar in samples, from the first progress on, with the error where one is aimed at."""

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
        self._bar.total = progress.wanted
        if progress.error is not None:
            self._bar.set_postfix_str(f"error {_percent(progress.error)}", refresh=False)
        self._bar.update(progress.done - self._bar.n)

    def close(self) -> None:
        """Take the bar away."""
        if self._bar is not None:
            self._bar.close()


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
    elif not rendered.complete:
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


def _shortfall(rendered: "Rendered", names: str, wanted: int | None, target: float | None) -> str:
    """Why a render ended before it had what was asked for."""
    spp = f"{wanted} sample{'' if wanted == 1 else 's'} per pixel"
    if wanted is None or target is None or rendered.fewest_samples < wanted:
        if target is not None and not rendered.stats.error and rendered.fewest_samples >= 16:
            return f"the error of {names} cannot be told: its values are beyond all bounds"
        return f"out of time; {names} has {_samples(rendered, wanted)}"
    if not rendered.stats.error:
        return f"{spp} tell too little of the error of {names}: it takes 16"
    return f"{spp} do not bring {names} to a relative error of {100.0 * target:g} %"


def _delay(rendered: "Rendered", limit: float, seconds: float) -> str:
    """Why a command took so many seconds for a time limit."""
    spent = rendered.stats.seconds
    names = {"load": "loading", "pack": "packing", "build": "building", "compile": "compiling", "render": "rendering"}
    longest = max(names, key=lambda name: spent[name])
    least = "every pixel gets at least 8 samples"
    return f"{seconds:.1f} s for a time limit of {limit:g} s: {names[longest]} took {spent[longest]:.1f} s; {least}"


def _summary(rendered: "Rendered", names: str) -> str:
    """What every render tells: samples, seconds, rates, error, and what was not finite."""
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
        value, low, high = (result.error[key] for key in ("relative", "low", "high"))
        where = " before denoising" if "denoise" in result.seconds else ""
        error = f"relative error{where} {_percent(value, low, high)}"
    finite = _not_finite(result.nan_samples)
    parts = [f"{names}: {width} x {height}, {spp} in {seconds:.2f} s ({rates})", error, finite]
    if result.clamp:
        light, clamped = (_percent(result.clamp[key]) for key in ("light", "samples"))
        parts.append(f"clamp took {light} of the light, in {clamped} of the samples")
    return ", ".join(parts)


def _fireflies(found: Mapping[str, Any], again: _Again) -> str:
    """What is to be known of fireflies."""
    count, by, which = "1 pixel is a firefly", "one sample makes it", "this shows it"
    if found["pixels"] != 1:
        count, by = f"{found['pixels']} pixels are fireflies", "one sample each makes them"
        which = "this shows the brightest one"
    clamp = "" if found["clamp"] is None else f", and -D render.clamp={found['clamp']:g} would cut it off"
    return (
        f"{count}: {by} far brighter than what is around, by {_percent(found['light'])} of the picture's light; "
        f"more samples even that out{clamp}; {which}: {again.command(found['brightest'], found['sample'])}"
    )


def _percent(value: float, *interval: float) -> str:
    """A fraction in percent to three digits, and its interval to as many places: "1.23 % (1.20 .. 1.26)"."""
    # Floor of the decimal logarithm, after rounding to three digits.
    exponent = int(f"{100.0 * value:.2e}".partition("e")[2]) if value else 0
    places = min(max(2 - exponent, 0), 6)
    text = f"{100.0 * value:.{places}f} %"
    return text + f" ({' .. '.join(f'{100.0 * end:.{places}f}' for end in interval)})" if interval else text


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
