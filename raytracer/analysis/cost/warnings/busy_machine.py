"""Warn of a machine that does other work as well."""

import math

from raytracer.analysis.cost.warnings import StudyConditions, StudyWarningKind
from raytracer.schema.warning_kind import Sentence, Warned

_BUSY = 0.5
"""Load for each processor from which on a machine is busy: with half at work, others share caches and clock."""


class BusyMachine(StudyWarningKind):
    """Times that may be longer than on a quiet machine."""

    name = "machines that are busy"
    rank = 90
    loaded = Sentence(
        "the machine was busy before, with a load of {load:.1f} on {processors} processors: times may be "
        "longer than on a quiet one",
        when="before the study, more than half of the processors were busy",
        remedy="end what else is running",
    )
    shared = Sentence(
        "{threads} threads share {processors} processors",
        when="`--threads` is larger than the number of processors",
        remedy="fewer `--threads`",
    )

    def find(self, subject: StudyConditions) -> Warned:
        load, threads, processors = (subject.study.machine[name] for name in ("load_before", "threads", "processors"))
        if load is not None and math.isfinite(load) and load > _BUSY * processors:
            yield self.record(self.loaded.fill(load=load, processors=processors))
        if threads > processors:
            yield self.record(self.shared.fill(threads=threads, processors=processors))
