"""Warn of a sensor that is full before it has given its largest number."""

import math

from raytracer.analysis.explain.warnings import Photograph, PhotographicWarningKind
from raytracer.report.wording import compact_number
from raytracer.schema.warning_kind import Sentence, Warned


class FullWells(PhotographicWarningKind):
    """Photographs whose highlights end below white (ISO 12232:2019 defines the speed of a sensor)."""

    name = "highlights that end early"
    rank = 60
    full = Sentence(
        "exposure_compensation takes the speed to ISO {speed}, below the sensor's base_iso of {base}: its wells are "
        "full at {part} of white, where highlights end",
        when="a sensor with `noise: true` is used below its `base_iso`",
        remedy="less `exposure_compensation`, or a higher `iso`",
    )

    def find(self, subject: Photograph) -> Warned:
        camera = subject.view.spec.camera
        sensor, speed, push = camera.simulated_sensor(), camera.iso_speed(), camera.exposure_compensation
        if sensor is None or speed is None or not push:
            return
        pulled = speed * math.exp2(push)
        if pulled < sensor.base_iso:
            text = self.full.fill(
                speed=compact_number(pulled),
                base=compact_number(sensor.base_iso),
                part=compact_number(pulled / sensor.base_iso),
            )
            yield self.record(text)
