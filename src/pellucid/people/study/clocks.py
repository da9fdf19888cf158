"""Bring all instruments of a recording onto one clock: drifting EMG, and markers without an encoder.

EMG's clock is compared with the motion's through the muscle activity before a limb moves (`signals.emg_timing`). A
significant drift is corrected from the start of the recording, which both are assumed to share. An offset cannot be
told from a muscle's own delay, and is refused if no muscle has such a delay.

The delay between markers and an encoder is estimated if there is an encoder. The control condition has none. Its
markers are assumed to be as late as those of the participant's other recordings; their span bounds the error.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...files.fault import Fault
from ..emg_index import Activity
from ..emg_timing import PLAUSIBLE_LEAD_S, emg_drift, emg_lead
from ..movements import MovementRule
from .pointing import PointingRecord, PointingSettings

MAX_DRIFT = 0.01
"""Largest plausible drift between two clocks [s/s]. A larger one means lost samples or a wrong rate in the file."""

MIN_SPAN_S = 0.01
"""Smallest shift of unknown delays in the sensitivity analysis [s]."""


@dataclass(frozen=True)
class MarkerDelays:
    """Delays of markers in recordings without an encoder."""

    assumed: float | None  # mean assumed delay over participants [s]; None if all were found, or none could be
    span: float  # bound of the error of the assumed delay [s]
    recordings: tuple[str, ...]  # recordings without an encoder


def with_assumed_delays(records: Sequence[PointingRecord]) -> tuple[list[PointingRecord], MarkerDelays]:
    """Return the records with markers on the robot's clock, with assumed delays where none was found."""
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
    return made, MarkerDelays(float(np.mean(taken)) if taken else None, max(span, MIN_SPAN_S), names)


def delay_notes(delays: MarkerDelays) -> list[str]:
    """State the assumed delays of markers in words."""
    if not delays.recordings:
        return []
    note = f"{len(delays.recordings)} recordings have markers and no encoder to compare them with"
    if delays.assumed is None:
        return [f"{note}: their clock is taken to start with the recording."]
    return [
        f"{note}: their markers are taken to be as late as in the participant's other recordings "
        f"({1e3 * delays.assumed:.1f} ms in the mean). What {1e3 * delays.span:.0f} ms more would change is among the "
        "filters."
    ]


def emg_on_motions_clock(
    record: PointingRecord, made: Activity, spec: PointingSettings, rule: MovementRule
) -> tuple[Activity, list[Fault]]:
    """Return a recording's EMG with its drift corrected, and the faults of its clock."""
    name = record.recording.stream_or_self(spec.emg).path.name

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
    # The test uses the time of muscle activity itself, without the advance of the index.
    drift = emg_drift(made.time - spec.advance, total, motion)
    if drift is not None and drift.clear:
        what = (
            f"activity whose lead over the motion changes by {drift.total:.2g} s in {drift.seconds:.3g} s: clocks that "
            f"part by {1e6 * drift.drift:.0f} ± {1e6 * drift.error:.0f} millionths"
        )
        if abs(drift.drift) > MAX_DRIFT:
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
