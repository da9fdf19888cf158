"""Find every movement of a study and compute its indices, from which the statistics are made.

Bring all instruments of a recording onto one clock: drifting EMG, and markers without an encoder.

EMG's clock is compared with the motion's through the muscle activity before a limb moves (`people.emg_index`). A
significant drift is corrected from the start of the recording, which both are assumed to share. An offset cannot be
told from a muscle's own delay, and is refused if no muscle has such a delay.

The delay between markers and an encoder is estimated if there is an encoder. The control condition has none. Its
markers are assumed to be as late as those of the participant's other recordings; their span bounds the error.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..._errors import RecordingError
from ...files.fault import Fault
from ...files.stored_channels import ChannelStore
from ...numerics.resampling import linear
from ...units import Coordinate
from ..design_columns import DIRECTION_DOWN, DIRECTION_UP, MeasuredMovement, MovementDuration
from ..emg_index import (
    EMG_CLOCK,
    LABEL_TOLERANCE_RAD,
    MAX_AMPLITUDE_COUNT,
    Activity,
    emg_and_motion,
    emg_drift,
    emg_lead,
    emg_per_acceleration,
    maxima,
)
from ..indices import (
    EMG_LEVEL,
    EMG_PER_ACCELERATION,
    INDICES,
    PEAK_INTERACTION_TORQUE,
    RMS_INTERACTION_TORQUE,
    WORK_AGAINST_ROBOT,
    end_error,
    interaction,
    smoothness,
    target_zero,
)
from ..movements import Kinematics, Movement, MovementRule, NoMovement
from .assessment_table import AssessmentTable
from .pointing import PointingRecord, drop_mistaken, labelled_amplitudes, rectified_emg

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
        return [f"{note}; their clock is assumed to start with the recording."]
    return [
        f"{note}; their markers are assumed to have the same delay as in the participant's other recordings "
        f"({1e3 * delays.assumed:.1f} ms on average). The effect of another {1e3 * delays.span:.0f} ms is listed with "
        "the filters."
    ]


def emg_on_motions_clock(
    record: PointingRecord,
    made: Activity,
    rectified: Mapping[str, np.ndarray],
    spec: AssessmentTable,
    rule: MovementRule,
) -> tuple[Activity, list[Fault]]:
    """Return the activity `made` of a recording's rectified EMG without drift, and the faults of its clock."""
    name = record.recording.stream_or_self(spec.emg).path.name

    def fault(severity: str, kind: str, what: str, expected: str) -> list[Fault]:
        message = f"{record.where}, EMG ({name}): found {what}, expected {expected}"
        return [Fault(severity, kind, name, "emg", what, expected, message)]

    begin, end = record.stretches[0].begin, record.stretches[-1].end
    low, high = made.time[0], made.time[-1]
    if min(end, high) - max(begin, low) < 0.5 * (end - begin):
        what = f"EMG from {low:.4g} s to {high:.4g} s, movements from {begin:.4g} s to {end:.4g} s"
        return made, fault("refuse", "overlap", what, "both at the same time; check that their clocks agree")
    groups = [
        sum(rectified[m] / made.largest[m] for m in group if made.largest[m] > 0.0)
        for group in (spec.agonists, spec.antagonists)
        if any(made.largest[m] > 0.0 for m in group)
    ]
    if not groups:
        return made, []
    total, motion = np.array(groups).T, record.motion(rule)
    faults: list[Fault] = []
    # The test uses the time of muscle activity itself, without the advance of the index.
    compared = emg_and_motion(made.time - spec.advance, total, motion)
    drift = emg_drift(*compared) if compared is not None else None
    if drift is not None and drift.clear:
        what = (
            f"EMG whose lead over the motion changes by {drift.total:.2g} s in {drift.seconds:.3g} s: the clocks drift "
            f"by {1e6 * drift.drift:.0f} ± {1e6 * drift.error:.0f} ppm"
        )
        if abs(drift.drift) > MAX_DRIFT:
            return made, fault("refuse", "drift", what, "the same rate; check for lost samples or a wrong rate")
        faults += fault("note", "drift", what, "one clock; that of the EMG was corrected")
        made = replace(made, time=made.time + drift.drift * (made.time - made.time[0]))
        compared = emg_and_motion(made.time - spec.advance, total, motion)
    seen = emg_lead(*compared) if compared is not None else None
    if seen is not None and not seen.plausible:
        what = (
            f"EMG that fits the motion best {abs(seen.lead):.2g} s {'before' if seen.lead > 0 else 'after'} it "
            f"(correlation {seen.correlation:.2f})"
        )
        late, early = -EMG_CLOCK.plausible_lead_s[0], EMG_CLOCK.plausible_lead_s[1]
        expected = f"{late:g} s after to {early:g} s before it: EMG and angle are on different clocks"
        return made, faults + fault("refuse", "clock", what, expected)
    return made, faults


FAILED_KINDS = ("still", "direction", "no_peak")
"""Kinds of stretches that count as failed, because a slow, hesitant or stuck person causes them."""


@dataclass(frozen=True, eq=False)
class MeasuredStudy:
    """All movements of a study, by one rule."""

    rule: MovementRule
    movements: tuple[MeasuredMovement, ...]
    left_out: Mapping[str, Mapping[str, int]]  # number of stretches without a movement, by recording and reason
    motions: Mapping[str, Kinematics] = field(repr=False)  # motion by recording; empty if not requested
    lasted: tuple[MovementDuration, ...] = ()  # duration of each movement, unfinished ones included
    failed: tuple[MovementDuration, ...] = ()  # targets without a movement
    recorded: Mapping[str, tuple[str, str]] = field(default_factory=dict)  # participant and condition by recording


def activities(
    records: Sequence[PointingRecord], spec: AssessmentTable, rule: MovementRule
) -> tuple[dict[str, Activity], dict[str, dict[str, float]], list[Fault]]:
    """Return the EMG of every recording, each muscle's largest activity, and the faults of clocks."""
    found: dict[str, Activity] = {}
    faults: list[Fault] = []
    store = ChannelStore()
    for record in records if spec.agonists or spec.antagonists else ():
        rectified = rectified_emg(record.recording, spec)
        if rectified is not None:
            time = record.recording.stream_or_self(spec.emg).time
            made = Activity.of_rectified(time, rectified)
            made = replace(made, sums=store.store_all(made.sums))
            found[record.recording.name], own = emg_on_motions_clock(record, made, rectified, spec, rule)
            faults += own
    people: dict[str, list[Activity]] = {}
    for record in records:
        if record.recording.name in found:
            people.setdefault(record.recording.participant, []).append(found[record.recording.name])
    return found, {person: maxima(own) for person, own in people.items()}, faults


def measure(
    records: Sequence[PointingRecord],
    spec: AssessmentTable,
    rule: MovementRule,
    emg: Mapping[str, Activity],
    largest: Mapping[str, Mapping[str, float]],
    *,
    named: Sequence[float] | None = None,
    detailed: bool = True,
) -> MeasuredStudy:
    """Find every movement and compute its indices; `named` are the labelled amplitudes [rad].

    A study that is not `detailed` has only what other rules are tried on, and no motions.
    """
    named = labelled_amplitudes(records) if named is None else named
    pooled = len(named) > MAX_AMPLITUDE_COUNT
    made: list[MeasuredMovement] = []
    left_out: dict[str, dict[str, int]] = {}
    motions: dict[str, Kinematics] = {}
    movements: dict[str, list[Movement]] = {}
    lasted: list[MovementDuration] = []
    failed: list[MovementDuration] = []
    for record in records:
        name = record.recording.name
        motions[name], found, without = record.movements(rule)
        reasons = Counter(each.kind for each in without)
        # A movement that misses its target is kept; without a target a wrong label may belong to another movement.
        if named and not pooled and spec.target not in record.recording:
            found, mistaken = drop_mistaken(found, named, LABEL_TOLERANCE_RAD * record.along.radian)
            if mistaken:
                reasons["amplitude"] = mistaken
        left_out[name] = dict(reasons)
        movements[name] = found
        lasted += _movement_durations(record, found, without, None if pooled else named)
        failed += _failed_targets(record, without, None if pooled else named)
    zeros = _target_zeros(records, motions, movements, spec.control)
    for record in records:
        recording = record.recording
        motion, found = motions[recording.name], movements[recording.name]
        of_emg = _emg_indices(found, spec, emg.get(recording.name), largest.get(recording.participant, {}))
        # No other rule is tried on the torque, which takes longer than all the others.
        felt = (recording.time, recording[spec.interaction]) if detailed and spec.interaction in recording else None
        for movement, activity in zip(found, of_emg, strict=True):
            cell = (
                None if pooled else _shown(movement.amplitude, named, record.along),
                DIRECTION_UP if movement.direction > 0 else DIRECTION_DOWN,
            )
            values = _indices(motion, movement, tried=not detailed)
            if felt is not None:
                values |= _interaction_indices(*felt, motion, movement)
            values |= activity
            if detailed:
                values |= end_error(motion, movement, zeros[recording.participant]) | smoothness(motion, movement)
            made.append(
                MeasuredMovement(recording.participant, recording.condition, recording.name, movement, cell, values)
            )
    recorded = {r.recording.name: (r.recording.participant, r.recording.condition) for r in records}
    return MeasuredStudy(
        rule, tuple(made), left_out, motions if detailed else {}, tuple(lasted), tuple(failed), recorded
    )


def _movement_durations(
    record: PointingRecord,
    found: Sequence[Movement],
    without: Sequence[NoMovement],
    named: Sequence[float] | None,
) -> list[MovementDuration]:
    """Return the durations of movements; `named` are amplitudes [rad], None if they are not distinguished."""
    recording = record.recording
    seen = [(m.amplitude, m.direction, m.lasted, m.settled) for m in found]
    # Without a target a stretch ends at rest, so no movement was cut off.
    seen += [
        (abs(n.stretch.amplitude), np.sign(n.stretch.amplitude), n.lasted, False)
        for n in without
        if n.kind == "unfinished" and n.stretch.amplitude is not None
    ]
    return [
        MovementDuration(
            recording.participant, recording.condition, _cell(record, a, way, named), float(seconds), bool(settled)
        )
        for a, way, seconds, settled in seen
    ]


def _failed_targets(
    record: PointingRecord, without: Sequence[NoMovement], named: Sequence[float] | None
) -> list[MovementDuration]:
    """Return the targets without a movement; targets with a lost marker are not counted."""
    recording = record.recording
    return [
        MovementDuration(
            recording.participant, recording.condition, _cell(record, abs(a), a, named), float("inf"), False
        )
        for each in without
        if each.kind in FAILED_KINDS and each.stretch.goal is not None and (a := each.stretch.amplitude) is not None
    ]


def _cell(
    record: PointingRecord, amplitude: float | None, way: float, named: Sequence[float] | None
) -> tuple[float | None, str]:
    return None if named is None else _shown(
        amplitude, named, record.along
    ), DIRECTION_UP if way > 0 else DIRECTION_DOWN


def _target_zeros(records, motions, movements, control: str) -> dict[str, float]:
    """Return the angle at which control movements to target 0 end, by participant."""
    people: dict[str, list[tuple[Kinematics, Movement]]] = {}
    for record in records:
        own = people.setdefault(record.recording.participant, [])
        if record.recording.condition == control:
            name = record.recording.name
            own += [(motions[name], movement) for movement in movements[name]]
    return {person: target_zero(own) for person, own in people.items()}


def join_studies(parts: Sequence[MeasuredStudy]) -> MeasuredStudy:
    """Join the sessions of several participants."""
    movements = tuple(m for part in parts for m in part.movements)
    if not movements:
        raise RecordingError("assess: found no movement in any recording, expected some")
    left_out = {name: reasons for part in parts for name, reasons in part.left_out.items()}
    motions = {name: motion for part in parts for name, motion in part.motions.items()}
    lasted, failed = (tuple(x for part in parts for x in getattr(part, kind)) for kind in ("lasted", "failed"))
    recorded = {name: whose for part in parts for name, whose in part.recorded.items()}
    return MeasuredStudy(parts[0].rule, movements, left_out, motions, lasted, failed, recorded)


def _shown(amplitude: float | None, named: Sequence[float], along: Coordinate) -> float | None:
    if amplitude is None:
        return None
    return round(along.factor * min(named, key=lambda each: abs(each - amplitude)), 1)


def _indices(motion: Kinematics, movement: Movement, *, tried: bool) -> dict[str, float]:
    """Return the indices that the catalogue computes from a movement; with `tried`, of those that try rules."""
    return {
        index.of: index.of_movement(motion, movement)
        for index in INDICES.values()
        if index.of_movement is not None and (index.tries_rules or not tried)
    }


def _interaction_indices(
    time: np.ndarray, torque: np.ndarray, motion: Kinematics, movement: Movement
) -> dict[str, float]:
    """Return the indices of the interaction torque (n,) at times (n,) [s] over one movement."""
    part = slice(movement.first, movement.last + 1)
    felt = interaction(linear(time, torque, motion.time[part]), motion.velocity[part], motion.fs)
    return {
        RMS_INTERACTION_TORQUE.of: felt.rms,
        PEAK_INTERACTION_TORQUE.of: felt.peak,
        WORK_AGAINST_ROBOT.of: felt.resisted,
    }


def _emg_indices(
    found: Sequence[Movement], spec: AssessmentTable, made: Activity | None, top: Mapping[str, float]
) -> list[dict[str, float]]:
    """Return the indices of EMG of each movement of a recording, from its activity and each muscle's largest one."""
    if made is None or not found:
        return [{} for _ in found]
    start = np.array([movement.start for movement in found])
    end = start + np.array([movement.duration for movement in found])
    levels = made.levels((*spec.agonists, *spec.antagonists), top, start, end)
    values = [{EMG_LEVEL.of: level} for level in levels.mean(axis=0).tolist()]
    if spec.agonists:
        of_agonists = levels[: len(spec.agonists)].mean(axis=0)
        for movement, own, level in zip(found, values, of_agonists, strict=True):
            if movement.direction > 0:
                own[EMG_PER_ACCELERATION.of] = emg_per_acceleration(float(level), movement.peak_acceleration)
    return values
