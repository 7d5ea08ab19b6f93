"""Warn of flashes of which the shutter keeps light from the film, or from a part of it."""

from raytracer.analysis.explain.warnings import Photograph, PhotographicWarningKind
from raytracer.core.shutter.table import TICK
from raytracer.core.shutter.timing import Timing
from raytracer.report.wording import compact_number, exposure_time
from raytracer.scene.pack.lights import lights_of
from raytracer.schema.warning_kind import Sentence, Warned

# Edge at which the readout begins, and the side along which it goes.
_EDGES = {"down": "top", "up": "bottom", "right": "left", "left": "right"}
_SIDES = {"down": "height", "up": "height", "right": "width", "left": "width"}


class ClippedFlash(PhotographicWarningKind):
    """Flashes that do not light all of the picture in full."""

    name = "flashes that the shutter clips"
    rank = 70
    missed = Sentence(
        "{flash} shines for {duration}, but while the shutter is closed: none of its light is in the picture",
        when="a flash is over before the shutter opens, or begins when it has closed",
        remedy="another `time` of the flash",
    )
    dimmed = Sentence(
        "{flash} shines for {duration}, of which the shutter is fully open for {open}: {percent} % of its light is "
        "lost",
        when="a global shutter is not fully open for the whole duration of a flash",
        remedy="a shutter that is open longer, or a shorter flash",
    )
    banded = Sentence(
        "{flash} shines for {duration}, while the shutter is not open everywhere: it lights {lit}{hint}",
        when="a flash fires while a rolling shutter, or the slit of a focal-plane shutter, exposes only a part of "
        "the film",
        remedy="a shutter that is fully open for as long as is said",
    )

    def find(self, subject: Photograph) -> Warned:
        spec = subject.view.spec
        timing = spec.camera.timing()
        pulses = {f"lights[{number}]": light.pulse(timing) for number, light in enumerate(lights_of(spec))}
        shining = {name: pulse for name, pulse in pulses.items() if pulse is not None}
        for name, (begin, end) in shining.items():
            flash = "the flash" if len(shining) == 1 else f"the flash {name}"
            text = self._clipping(timing, begin, end, flash)
            if text is not None:
                yield self.record(text)

    def _clipping(self, timing: Timing, begin: float, end: float, flash: str) -> str | None:
        """Say how the shutter clips a flash that shines between two times of the scene (s), if it does."""
        span, (opened, closing) = timing.span(), timing.full()
        tick, duration = TICK * (span.close - span.open), exposure_time(end - begin)
        if end <= span.open or begin >= span.close:
            return self.missed.fill(flash=flash, duration=duration)

        # Lines begin to open from 0 to `readout` after the first, and are lit in full or in part if they do between
        # these.
        full = max(0.0, end - closing), min(timing.readout, begin - opened)
        part = max(0.0, begin - timing.closes), min(timing.readout, end - timing.opens)
        if full[0] <= tick and full[1] >= timing.readout - tick:
            return None
        if timing.readout == 0.0:
            most = 1.0 if timing.profile is None else max(transmission for _, transmission in timing.profile)
            lost = 1.0 - timing.transmitted(begin, end) / (most * (end - begin))
            shown = exposure_time(max(0.0, min(end, closing) - max(begin, opened)))
            percent = compact_number(round(100.0 * lost, 1))
            return self.dimmed.fill(flash=flash, duration=duration, open=shown, percent=percent)
        lit, hint = _lit_band(timing, part, full, tick), _sync_hint(timing, begin, end)
        return self.banded.fill(flash=flash, duration=duration, lit=lit, hint=hint)


def _lit_band(timing: Timing, part: tuple[float, float], full: tuple[float, float], tick: float) -> str:
    """Say which lines are lit, and which in full."""
    lit, whole = (f"{_percent(first, timing)} to {_percent(last, timing)} %" for first, last in (part, full))
    side, edge = _SIDES[timing.direction], _EDGES[timing.direction]
    where = f"{lit} of the {side} from the {edge}"
    if full[1] - full[0] <= tick:
        return f"{where}, none of it in full"
    return where if lit == whole else f"{where}, and {whole} in full"


def _percent(delay: float, timing: Timing) -> str:
    return f"{100.0 * delay / timing.readout:.0f}"


def _sync_hint(timing: Timing, begin: float, end: float) -> str:
    """Say for how long the shutter must be open to light all of the picture; "" if it is long enough."""
    opened, closing = timing.full()
    needed = timing.readout + (end - begin)
    if closing - opened >= needed:
        return ""
    return f"; all of it can be lit by a shutter that is fully open for {exposure_time(needed)} or longer"
