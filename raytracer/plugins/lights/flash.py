"""Flash: light from a single point in a pulse, while the shutter is open.

In a scene:

    - {type: flash, energy: 2}
    - {type: flash, position: [1, 3, 2], energy: [2, 1.9, 1.7], curtain: second, duration: 1/20000 s}

A shutter needs to be open for some time, `camera: {..., shutter: 1/60 s}`, for a flash to shine in.
"""

import math
from collections.abc import Sequence
from typing import Annotated, ClassVar, Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PrivateAttr

from raytracer.core.compiler.dispatch import optional
from raytracer.core.geometry import row3
from raytracer.core.sampling.alias import AliasTable, build_alias
from raytracer.core.shutter.table import Pulses, pulse_interval
from raytracer.core.shutter.timing import Timing
from raytracer.core.vec import Vec3, scale, sub
from raytracer.plugins.lights.base import interface
from raytracer.plugins.lights.base.light_choice import choose_light
from raytracer.plugins.materials.base.interface import BLACK
from raytracer.schema.fields import Point, PositiveTime, Quantity, Time, Triple

Energy: TypeAlias = Annotated[Vec3, Triple(Quantity(low=0.0), "an energy", single=True)]


class _FlashPulse(NamedTuple):
    """Intensity of a flash (W/sr), and its pulse in fractions of the shutter's time; None for the mean over it."""

    intensity: Vec3
    pulse: tuple[float, float] | None


class FlashLight(interface.LightSpec):
    """A point that radiates evenly in all directions for a short time: what moves is frozen in its light.

    A plane at distance d gets the radiant exposure energy cos / d^2 (J/m2).  In the picture, which is a mean over the
    exposure time T, that is as much as a point light of intensity energy / T gives.

    The flash begins when the shutter is fully open everywhere (first curtain), or ends when it begins to close anywhere
    (second curtain).  What the shutter covers at that moment does not see it: where the exposure is shorter than the
    readout, only a band does.  No ray can meet the flash itself.
    """

    power: ClassVar[str] = "energy"

    type: Literal["flash"] = "flash"
    position: Point | None = Field(default=None, description="where it is; default: the camera's place at the moment")
    energy: Energy = Field(description="radiant energy per solid angle (J/sr) by channel, or one number for all")
    curtain: Literal["first", "second"] = Field(
        default="first",
        description="first: it begins when the shutter is fully open; second: it ends when the shutter begins to close",
    )
    duration: PositiveTime = Field(default=1e-4, description="for how long it shines (s), evenly")
    offset: Time = Field(default=0.0, description="by how much later (s) it shines than its curtain says")

    _fired: _FlashPulse | None = PrivateAttr(default=None)

    def pulse(self, timing: Timing) -> tuple[float, float]:
        first, last = timing.full()
        begin = first + timing.readout if self.curtain == "first" else last - self.duration
        return begin + self.offset, begin + self.offset + self.duration

    def at_exposure(self, timing: Timing, place: Vec3, timed: bool) -> "FlashLight":
        begin, end = self.pulse(timing)
        if timed:
            span = timing.span()
            fractions = pulse_interval(span, begin, end)
            share = fractions[1] - fractions[0]
            seconds = share * (span.close - span.open) if math.isfinite(share) else self.duration
            fired = _FlashPulse(scale(1.0 / seconds, self.energy), fractions)
        else:
            share = timing.transmitted(begin, end) / timing.seconds()
            fired = _FlashPulse(scale(share / self.duration, self.energy), None)
        result = self.model_copy(update={"position": place if self.position is None else self.position})
        result._fired = fired
        return result

    def shines(self) -> bool:
        return any(self.energy if self._fired is None else self._fired.intensity)

    @staticmethod
    def pack(specs: Sequence["FlashLight"]) -> "Flashes":
        """Pack flashes that `at_exposure` has placed in a shutter's time."""
        fired = [spec._fired for spec in specs if spec._fired is not None]
        pulses = np.array([item.pulse for item in fired if item.pulse is not None], np.float64)
        energy = np.array([spec.energy for spec in specs], np.float64)
        return Flashes(
            position=np.array([spec.position for spec in specs], np.float64),
            intensity=np.array([item.intensity for item in fired], np.float64),
            pulse=Pulses(*np.ascontiguousarray(pulses.T)) if len(pulses) else None,
            choice=build_alias(energy.sum(axis=1)),
        )


class Flashes(NamedTuple):
    """Packed flashes: position and intensity (n, 3) float64; their Pulses, or None; choice by energy."""

    position: NDArray[np.float64]
    intensity: NDArray[np.float64]
    pulse: Pulses | None
    choice: AliasTable


@optional
def choose_flash(pulse, choice, point, u, time):
    """Choose a flash that shines at a time: its row and probability; (0, 0.0) if none does."""
    chosen, probability, _ = choose_light(choice, point, u)
    return chosen, probability


@choose_flash.register(Pulses)
def choose_flash_pulses(pulse, choice, point, u, time):
    # Of a stroboscope's flashes one shines at a time, so choosing among all would miss it nearly always.
    total = 0.0
    for row in range(len(pulse.begin)):
        if pulse.begin[row] <= time <= pulse.end[row]:
            total += choice.pmf[row]
    chosen, before = 0, 0.0
    for row in range(len(pulse.begin)):
        if pulse.begin[row] <= time <= pulse.end[row] and before <= u * total:
            chosen = row
            before += choice.pmf[row]
    return (chosen, choice.pmf[chosen] / total) if total > 0.0 else (0, 0.0)


@interface.sample_light.register(Flashes)
def sample_light_flashes(table, scene, point, time, u, draws):
    chosen, probability = choose_flash(table.pulse, table.choice, point, u, time)
    position = row3(table.position, chosen)
    if probability == 0.0:
        return interface.LightSample(sub(position, point), BLACK, 0.0, position, 0.0)
    return interface.point_light_sample(point, position, row3(table.intensity, chosen), probability)
