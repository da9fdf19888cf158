"""Check whether recordings of pointing are suitable, and report the faults of their movements."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np

from ..._errors import RecordingError
from ...emg.signals.emg_quality import inspect_emg
from ...files.fault import Fault
from ...files.recording import Recording
from ...study.study import Study
from ..emg_index import MAX_MISTAKEN_SHARE, strays
from ..movements import Movement, MovementRule, NoAngle
from .assessment_table import AssessmentTable
from .pointing import (
    PointingRecord,
    labelled_amplitudes,
    pointing_record,
    recordings_with_condition,
    with_rule,
)

AMPLITUDE_RATIO_BOUNDS = (0.75, 1.35)
"""Range of the median ratio of measured to labelled amplitudes. Outside it, labels or angle have a wrong unit or
zero."""

ASSISTED_AMPLITUDE_RATIO_BOUNDS = (0.5, 2.0)
"""The same range for people who aim at targets with a robot, which may keep them from reaching the targets."""

MIN_REPORTED_DRIFT_S = 0.02
"""A drift between two clocks is reported if they differ by more than this [s]; smaller ones are corrected silently."""

MAX_SILENT_LEFT_OUT_SHARE = 0.2
"""Largest share of a recording's movements that may be left out without a report."""


def assessment_faults(study: Study) -> list[Fault]:
    """Return what is wrong with the recordings that are to be assessed."""
    spec = study.table(AssessmentTable)
    faults: list[Fault] = []
    records: list[PointingRecord] = []
    for recording in recordings_with_condition(study.recordings()):
        try:
            own, gaps = usable_records((recording,), spec)
            records, faults = [*records, *own], [*faults, *gaps]
        except RecordingError as error:
            faults.append(_refused(recording, spec, str(error)))
        if spec.agonists or spec.antagonists:
            faults += inspect_emg(recording.stream_or_self(spec.emg))
    named = labelled_amplitudes(records)
    for record in records:
        faults += pointing_faults(record, spec, named)
    faults += _missing_conditions(
        recordings_with_condition(study.recordings()), [record.recording for record in records]
    )
    return faults


def usable_records(recordings: Sequence[Recording], spec: AssessmentTable) -> tuple[list[PointingRecord], list[Fault]]:
    """Return the records of usable recordings, and a fault for each other one; one bad file does not stop a study."""
    records, faults = [], []
    for recording in recordings:
        try:
            record = pointing_record(recording, spec)
            reason = _gaps(record, spec)
        except NoAngle as error:
            reason = str(error)
        if not reason:
            records.append(record)
            continue
        message = f"{reason}: the recording {recording.name} is left out"
        faults.append(Fault("cut", "gap", recording.path.name, spec.angle, reason, "an angle throughout", message))
    return records, faults


def _gaps(record: PointingRecord, spec: AssessmentTable) -> str:
    """Return the reason why most movements cannot be used if it is missing samples; otherwise an empty text."""
    _, found, left_out = record.movements(with_rule(spec))
    lost = sum(each.kind == "lost" for each in left_out)
    total = len(found) + len(left_out)
    if len(left_out) <= 0.5 * total or lost < max(Counter(each.kind for each in left_out).values()):
        return ""
    one = next(each for each in left_out if each.kind == "lost")
    return (
        f"{record.where}, {record.source}: found missing samples in {lost} of {total} movements (the first at "
        f"{one.stretch.begin:.4g} s){_which_marker(record, spec)}, expected an angle throughout"
    )


def _refused(recording: Recording, spec: AssessmentTable, message: str) -> Fault:
    return Fault("refuse", "movements", recording.path.name, spec.angle, message, "movements", message)


def _missing_conditions(recordings: Sequence[Recording], usable: Sequence[Recording]) -> list[Fault]:
    conditions = list(dict.fromkeys(recording.condition for recording in recordings))
    faults = []
    for person in dict.fromkeys(recording.participant for recording in recordings):
        own = {recording.condition for recording in usable if recording.participant == person}
        absent = ", ".join(condition for condition in conditions if condition not in own)
        if absent:
            message = f"participant {person}: found no usable recording in {absent}: left out of every comparison"
            faults.append(Fault("note", "condition", "study.toml", "", absent, "every condition", message))
    return faults


def pointing_faults(record: PointingRecord, spec: AssessmentTable, labels: Sequence[float]) -> list[Fault]:
    """Return the faults of the movements of a recording; `labelled_amplitudes` are the labelled amplitudes [rad]."""
    _, found, left_out = record.movements(MovementRule(spec.lowpass, spec.order, spec.threshold))
    faults = []
    total = len(found) + len(left_out)

    def add(severity: str, kind: str, what: str, expected: str) -> None:
        message = f"{record.where}, {record.source}: found {what}, expected {expected}"
        faults.append(Fault(severity, kind, record.recording.path.name, record.source, what, expected, message))

    reasons = Counter(each.kind for each in left_out)
    # A person who cannot hold a robot still is not at rest at the next target; this is an effect of the robot.
    restless = reasons["unfinished"] if spec.target in record.recording and _worn(record, spec) else 0
    if len(left_out) - restless > 0.5 * total:
        kind, _ = reasons.most_common(1)[0]
        one = next(each for each in left_out if each.kind == kind)
        what = f"{len(found)} movements in {total} stretches, most often {one.found} ({one.stretch.begin:.4g} s)"
        add("refuse", "movements", what, one.expected)
    elif len(left_out) > MAX_SILENT_LEFT_OUT_SHARE * total:
        reasons_text = ", ".join(f"{count} {REASON_WORDS[kind]}" for kind, count in reasons.most_common())
        add(
            "note",
            "left_out",
            f"{len(left_out)} of {total} movements that had to be left out ({reasons_text})",
            "hardly any",
        )
    missing = ~np.isfinite(record.angle)
    if missing.any():
        share = 100.0 * float(missing.mean())
        what = f"an angle that is missing in {share:.2g} % of the samples{_which_marker(record, spec)}"
        add("note", "lost_marker", what, "all of them")
    if abs(record.drift) * (record.time[-1] - record.time[0]) > MIN_REPORTED_DRIFT_S:
        what = f"a clock that runs {1e6 * record.drift:+.0f} millionths fast against the channel position's"
        add("note", "drift", what, "one clock; it was corrected")
    named = [m for m in found if m.amplitude is not None]
    if named:
        faults += _label_faults(record, spec, named, np.asarray(labels))
    return faults


def _worn(record: PointingRecord, spec: AssessmentTable) -> bool:
    return record.recording.condition != spec.control


def _which_marker(record: PointingRecord, spec: AssessmentTable) -> str:
    """State how often each marker of the segment was lost, if the angle comes from markers."""
    optical = record.recording.optical
    if not spec.segment or optical is None:
        return ""
    gone = {name: float(np.mean(~np.isfinite(optical.markers[name][:, 0]))) for name in spec.segment}
    return " (" + ", ".join(f"{name} lost in {100.0 * each:.2g} %" for name, each in gone.items() if each) + ")"


REASON_WORDS = {
    "lost": "with a marker lost",
    "still": "that did not reach half-way",
    "direction": "the other way",
    "no_peak": "without a clear peak of the speed",
    "too_few_samples": "with too few samples",
    "unfinished": "not finished when the next target came",
}
"""Words for `NoMovement.kind`, to follow a number."""


def _label_faults(
    record: PointingRecord, spec: AssessmentTable, named: Sequence[Movement], labels: np.ndarray
) -> list[Fault]:
    reach = np.array([m.reach for m in named])
    label = np.array([m.amplitude for m in named])
    name = record.recording.path.name
    aimed = spec.target in record.recording

    def fault(severity: str, kind: str, what: str, expected: str) -> list[Fault]:
        channel = spec.target if aimed else "amplitude"
        message = f"{record.where}, {channel}: found {what}, expected {expected}"
        return [Fault(severity, kind, name, channel, what, expected, message)]

    scale = float(np.median(reach / label))
    allowed = ASSISTED_AMPLITUDE_RATIO_BOUNDS if aimed and _worn(record, spec) else AMPLITUDE_RATIO_BOUNDS
    if not allowed[0] <= scale <= allowed[1]:
        return fault(
            "refuse",
            "amplitude",
            f"movements {scale:.3g} times as large as their labels say",
            "amplitudes as labelled: look at the units of angle and target, and at what the angle is an angle of",
        )
    found = strays(reach, label, labels, record.along)
    share = float(found.wrong.mean())
    if found.mislabelled or (share > MAX_MISTAKEN_SHARE and not aimed):
        mismatch_text = (
            found.mislabelled or f"{int(found.wrong.sum())} of {len(named)} movements {found.commonest(label)}"
        )
        return fault("refuse", "amplitude", mismatch_text, "movements that go as far as their labels say")
    if share > MAX_MISTAKEN_SHARE:
        miss = record.along.factor * float(np.median(np.abs(reach - label)[found.wrong]))
        what = (
            f"{int(found.wrong.sum())} of {len(named)} movements that missed by {miss:.2g} {record.along.shown} in the "
            "median"
        )
        return fault("note", "missed", f"{what}, nearer to another target", "targets that are reached; they are used")
    return []
