"""One clock for all instruments of a recording: EMG that runs apart from the motion, and cameras nobody could compare.

EMG's clock is compared with the motion's through what muscles do before a limb moves (`signals.emg_timing`). A drift
that is clear is taken back, from the start of the recording on, which both are taken to share; an offset cannot be told
from a muscle's own delay and is refused once no muscle has it.

The delay between markers and an encoder is found where there is an encoder. The control condition has none. Its markers
are taken to be as late as those of the participant's other recordings; the span of those says how wrong that may be.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...assessment.emg_index import Activity
from ...recordings.fault import Fault
from ...signals.emg_timing import PLAUSIBLE_LEAD_S, emg_drift, emg_lead
from ...signals.movements import MovementRule
from .pointing import PointingRecord, PointingSettings

FASTEST = 0.01
"""Drift that no two clocks have [s/s]: samples were lost, or the rate in the file is not the recorded one."""

LEAST_SPAN = 0.01
"""By how much [s] unknown delays are shifted at least, to see what hangs on them."""


@dataclass(frozen=True)
class MarkerDelays:
    """Delays of markers in recordings without an encoder."""

    # Mean over participants of what was taken [s]; None where every delay was found, or none could be
    assumed: float | None
    span: float  # By how much it may be wrong [s]
    recordings: tuple[str, ...]  # Those without an encoder


def with_assumed_delays(records: Sequence[PointingRecord]) -> tuple[list[PointingRecord], MarkerDelays]:
    """Records whose markers are all on the robot's clock, as well as can be known."""
    people: dict[str, list[float]] = {}
    for record in records:
        if record.delay is not None:
            people.setdefault(record.recording.participant, []).append(record.delay)
    unknown = [r for r in records if r.delay is None and r.recording.optical is not None and r.of_markers]
    span = max((max(own) - min(own) for own in people.values()), default=0.0)
    made, taken = [], []
    for record in records:
        own = people.get(record.recording.participant)
        if own and any(record is other for other in unknown):
            taken.append(float(np.median(own)))
            record = record.later(-taken[-1])
        made.append(record)
    names = tuple(record.recording.name for record in unknown)
    return made, MarkerDelays(float(np.mean(taken)) if taken else None, max(span, LEAST_SPAN), names)


def delay_notes(delays: MarkerDelays) -> list[str]:
    """What was taken of markers that nothing could be compared with, in words."""
    if not delays.recordings:
        return []
    said = f"{len(delays.recordings)} recordings have markers and no encoder to compare them with"
    if delays.assumed is None:
        return [f"{said}: their clock is taken to start with the recording."]
    return [
        f"{said}: their markers are taken to be as late as in the participant's other recordings "
        f"({1e3 * delays.assumed:.1f} ms in the mean). What {1e3 * delays.span:.0f} ms more would change is among the "
        "filters."
    ]


def emg_on_motions_clock(
    record: PointingRecord, made: Activity, spec: PointingSettings, rule: MovementRule
) -> tuple[Activity, list[Fault]]:
    """A recording's EMG, its drift taken back, and what is wrong with its clock."""
    name = record.recording.streams.get(spec.emg, record.recording).path.name

    def fault(severity: str, kind: str, what: str, expected: str) -> list[Fault]:
        message = f"{record.where}, EMG ({name}): found {what}, expected {expected}"
        return [Fault(severity, kind, name, "emg", what, expected, message)]

    begin, end = record.stretches[0].begin, record.stretches[-1].end
    low, high = made.time[0], made.time[-1]
    if min(end, high) - max(begin, low) < 0.5 * (end - begin):
        what = f"EMG from {low:.4g} s to {high:.4g} s, movements from {begin:.4g} s to {end:.4g} s"
        return made, fault("refuse", "overlap", what, "both of the same time: are their clocks started together?")
    groups = [
        np.sum([made.rectified[m] / made.largest[m] for m in group if made.largest[m] > 0.0], axis=0)
        for group in (spec.agonists, spec.antagonists)
        if any(made.largest[m] > 0.0 for m in group)
    ]
    if not groups:
        return made, []
    total, motion = np.column_stack(groups), record.motion(rule)
    faults: list[Fault] = []
    # What is tested is when muscles were active, not when their activity is counted.
    drift = emg_drift(made.time - spec.advance, total, motion)
    if drift is not None and drift.clear:
        what = (
            f"activity whose lead over the motion changes by {drift.total:.2g} s in {drift.seconds:.3g} s: clocks that "
            f"part by {1e6 * drift.drift:.0f} ± {1e6 * drift.error:.0f} millionths"
        )
        if abs(drift.drift) > FASTEST:
            return made, fault("refuse", "drift", what, "one rate: were samples lost, or is the file's rate another?")
        faults += fault("note", "drift", what, "one clock; EMG's was corrected, from the start of the recording on")
        made = replace(made, time=made.time + drift.drift * (made.time - made.time[0]))
    seen = emg_lead(made.time - spec.advance, total, motion)
    if seen is not None and not seen.plausible:
        what = (
            f"activity that fits the motion best {abs(seen.lead):.2g} s {'before' if seen.lead > 0 else 'after'} it "
            f"(correlation {seen.correlation:.2f})"
        )
        late, early = -PLAUSIBLE_LEAD_S[0], PLAUSIBLE_LEAD_S[1]
        expected = f"{late:g} s after to {early:g} s before it: EMG and angle are on different clocks"
        return made, faults + fault("refuse", "clock", what, expected)
    return made, faults
