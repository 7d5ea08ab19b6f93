"""The sentences on stderr about a finished render: what was made, what it took, and what looks wrong."""

import shlex
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from raytracer.cli.base.options import GivenOptions, Sizing
from raytracer.cli.base.outputs import ResumeInfo, join_paths, report_faults, say
from raytracer.rendering.options import RenderOptions
from raytracer.report.wording import (
    count,
    format_given_percent,
    format_percent,
    format_percent_interval,
    megabytes,
    plural,
)
from raytracer.util.errors import OutputError

if TYPE_CHECKING:
    from raytracer.rendering.session import Rendered
    from raytracer.rendering.statistics import Stats

# Fewer samples per pixel tell too little of the error.
_SPP_FOR_ERROR = 16


class DebugCommand(NamedTuple):
    """The options of a render that decide what a sample of its picture is, as they were given."""

    scene: str
    define: list[str]
    sizing: Sizing
    preview: bool
    given: GivenOptions

    def line(self, pixel: Sequence[int], sample: int | None = None) -> str:
        """Return the command line that prints the path of a sample."""
        words = ["rt", "render", self.scene]
        for text in self.define:
            words += ["-D", text]
        if self.sizing.size is not None:
            words += ["--size", "{}x{}".format(*self.sizing.size)]
        words += [] if self.sizing.factor is None else ["--scale", f"{self.sizing.factor:g}"]
        words += ["--preview"] if self.preview else []
        for name in ("spp", "seed", "noise", "time_limit"):
            value = self.given.words[name]
            words += [] if value is None else [f"--{name.replace('_', '-')}", str(value)]
        words += ["--pixel", ",".join(map(str, pixel))]
        words += [] if sample is None else ["--sample", str(sample)]
        return shlex.join([*words, "--debug"])


class RenderReport(NamedTuple):
    """A finished render, and what was asked of it.

    rendered : the picture and what it took.
    outputs : the files that hold the picture.
    options : those that were asked for.
    spp : samples per pixel that were asked for, or the most of them; None for no limit.
    resume : its checkpoint.
    debug : makes command lines that print the path of a sample.
    began : the time of `time.perf_counter` when the command began.
    """

    rendered: "Rendered"
    outputs: Sequence[Path]
    options: RenderOptions
    spp: int | None
    resume: ResumeInfo
    debug: DebugCommand
    began: float

    def show(self, *, quiet: bool) -> None:
        """Print the report; what is wrong with the picture also when quiet.

        Raises OutputError: the cluster failed; or samples or pixels are wrong, and `strict`.
        """
        rendered, checkpoint = self.rendered, self.resume.checkpoint
        names = join_paths(self.outputs)
        if rendered.interrupted:
            further = "" if checkpoint is None else f"; this goes on: {self.resume.command()}"
            say(f"interrupted; {names} has {self._samples()}{further}")
        elif not rendered.complete and rendered.failure is None:
            say(f"{self._describe_shortfall(names)}")
        elif self.options.noise is not None and not rendered.image.radiance.any():
            say(f"{names} is black, so its relative error says nothing")
        if not quiet:
            print(*self._summaries(names), sep="\n", file=sys.stderr)
        _show_faults(rendered.stats, self.debug, strict=self.options.strict)
        if rendered.failure is not None:
            raise OutputError(f"{rendered.failure}; {names} has {self._samples()}")

    def _summaries(self, names: str) -> Iterator[str]:
        """Write the lines about what was made: the render, its checkpoint, and its exposure."""
        checkpoint, setting = self.resume.checkpoint, self.rendered.setting
        yield summarize(self.rendered, names, time.perf_counter() - self.began)
        if checkpoint is not None and not self.rendered.interrupted:
            yield f"{checkpoint.path}: all samples ({megabytes(checkpoint.bytes)}), to which --resume --spp N adds"
        if setting is not None and setting.exposure.metering is not None:
            yield f"exposure: {setting.summary()}{'' if self.options.crop is None else ' in the crop'}"

    def _samples(self) -> str:
        """Say how many samples the pixels have, of how many that were asked for."""
        low, high = self.rendered.fewest_samples, self.rendered.stats.spp["most"]
        of = "" if self.spp is None else f" of {self.spp}"
        return f"{low}{of} samples per pixel" if low == high else f"{low} to {high}{of} samples per pixel"

    def _describe_shortfall(self, names: str) -> str:
        """Say why the render ended before it had what was asked for."""
        fewest, has_error = self.rendered.fewest_samples, bool(self.rendered.stats.error)
        spp = f"{self.spp} {plural(self.spp or 0, 'sample')} per pixel"
        if self.spp is None or self.options.noise is None or fewest < self.spp:
            if self.options.noise is not None and not has_error and fewest >= _SPP_FOR_ERROR:
                return f"the error of {names} cannot be told: its values are beyond all bounds"
            return f"out of time; {names} has {self._samples()}"
        if not has_error:
            return f"{spp} tell too little of the error of {names}: it takes {_SPP_FOR_ERROR}"
        return f"{spp} do not bring {names} to a relative error of {format_given_percent(self.options.noise)}"


def describe_delay(rendered: "Rendered", limit: float, seconds: float) -> str:
    """Say why a command took so many seconds for a time limit."""
    spent = rendered.stats.seconds
    names = {"load": "loading", "pack": "packing", "build": "building", "compile": "compiling", "render": "rendering"}
    longest = max(names, key=lambda name: spent[name])
    least = "every pixel gets at least 8 samples"
    return f"{seconds:.1f} s for a time limit of {limit:g} s: {names[longest]} took {spent[longest]:.1f} s; {least}"


def describe_phases(stats: "Stats", compiled: int) -> str:
    """Say what each phase took, what was compiled, and what else tells why it took so long."""
    phases = ", ".join(f"{name} {seconds:.2f} s" for name, seconds in stats.seconds.items() if name != "total")
    kernels = count(compiled, "kernel") + " compiled" if compiled else "no kernel compiled"
    return (
        f"{phases}\n{kernels}; {count(stats.threads, 'thread')}; {megabytes(stats.peak_rss_bytes)} of memory at most\n"
        f"effects: {', '.join(stats.effects)}"
    )


def _show_faults(stats: "Stats", debug: DebugCommand, *, strict: bool) -> None:
    """Warn on stderr of what looks wrong in the picture, and fail if it is no mere firefly, and `strict`."""
    from raytracer.film.negative_pixels import describe_negative_pixels

    if stats.fireflies:
        say(f"{_describe_fireflies(stats.fireflies, debug)}")
    faults = []
    if stats.nan_samples:
        sentence = f"{_count_not_finite(stats.nan_samples)} and {'was' if stats.nan_samples == 1 else 'were'} dropped"
        if stats.first_nan is not None:
            first = "it" if stats.nan_samples == 1 else "the first one"
            sentence += f"; this shows {first}: {debug.line(stats.first_nan['pixel'], stats.first_nan['sample'])}"
        faults.append(sentence)
    if stats.negative_pixels and not stats.negative["causes"]:
        sentence = describe_negative_pixels(stats.negative_pixels, stats.negative)
        faults.append(f"{sentence}; this shows a sample of the lowest: {debug.line(stats.negative['pixel'])}")
    report_faults(faults, strict=strict)


def summarize(rendered: "Rendered", names: str, whole: float) -> str:
    """Return the line about every render: samples, seconds, rates, error, and samples that were not finite.

    whole (s) : time of the whole command.
    """
    from raytracer.film.negative_pixels import describe_negative_pixels

    stats = rendered.stats
    height, width, _ = rendered.image.radiance.shape
    fewest, mean, most = (stats.spp[key] for key in ("fewest", "mean", "most"))
    spp = f"{most} spp" if fewest == most else f"{mean:.1f} ({fewest} to {most}) spp"
    seconds = stats.seconds["render"]
    resumed = stats.resumed.get("samples", 0)
    samples, rays = stats.samples + stats.pilot_samples - resumed, stats.rays - stats.resumed.get("rays", 0)
    rates = f"{samples / seconds / 1e6:.3g} M samples/s, {rays / seconds / 1e6:.3g} M rays/s"
    if resumed:
        spp += f", {resumed / (height * width):.4g} of them before,"
    parts = [
        f"{names}: {width} x {height}, {spp} in {seconds:.2f} s ({rates}), {whole:.2f} s in all",
        _describe_error(rendered),
        _count_not_finite(stats.nan_samples),
    ]
    if stats.clamp:
        light, clamped = (format_percent(stats.clamp[key]) for key in ("light", "samples"))
        parts.append(f"clamp took {light} of the light, in {clamped} of the samples")
    if stats.negative_pixels and stats.negative["causes"]:
        parts.append(describe_negative_pixels(stats.negative_pixels, stats.negative))
    return ", ".join(parts)


def _describe_error(rendered: "Rendered") -> str:
    """Say how large the relative error is, or why it is unknown."""
    from raytracer.core.error_estimate.intervals import Interval

    stats = rendered.stats
    if stats.error:
        stage = " before denoising" if "denoise" in stats.seconds else ""
        interval = Interval(*(stats.error[key] for key in ("relative", "low", "high")))
        return f"relative error{stage} {format_percent_interval(interval)}"
    if rendered.fewest_samples < _SPP_FOR_ERROR:
        return f"relative error unknown from fewer than {_SPP_FOR_ERROR} spp"
    return "relative error unknown" + ("" if rendered.interrupted else ", as values are beyond all bounds")


def _describe_fireflies(fireflies: Mapping[str, Any], debug: DebugCommand) -> str:
    """Say how many fireflies there are, how bright they are, and what helps."""
    count, by, which = "1 pixel is a firefly", "one sample makes it", "this shows it"
    if fireflies["pixels"] != 1:
        count, by = f"{fireflies['pixels']} pixels are fireflies", "one sample each makes them"
        which = "this shows the brightest one"
    clamp = "" if fireflies["clamp"] is None else f", and -D render.clamp={fireflies['clamp']:g} would cut it off"
    light = format_percent(fireflies["light"])
    return (
        f"{count}: {by} far brighter than what is around, by {light} of the picture's light; "
        f"more samples even that out{clamp}; {which}: {debug.line(fireflies['brightest'], fireflies['sample'])}"
    )


def _count_not_finite(samples: int) -> str:
    if samples == 0:
        return "all samples finite"
    return "1 sample was not finite" if samples == 1 else f"{samples} samples were not finite"
