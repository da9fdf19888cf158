"""Read a recording of a person who points to one target after another: the angle, and the stretches between targets.

The angle is a channel, or that of a segment with two markers. Markers have a clock of their own. If an encoder was
recorded too, the offset and drift of that clock are estimated from the motion; otherwise both are assumed to start
together.

`assessment_faults` reports whether recordings are suitable, and the faults of their movements.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..._errors import RecordingError, StudyError
from ...emg.signals.emg_chain import EmgChain, emg_chain
from ...emg.signals.emg_quality import inspect_emg
from ...files.fault import Fault
from ...files.recording import Recording
from ...numerics.clocks import align, clock_drift
from ...study.study import Study
from ...units import COORDINATES_BY_UNIT, Coordinate
from ..emg_index import LABEL_TOLERANCE_RAD, LABELS_RULE, strays
from ..movements import (
    Kinematics,
    Movement,
    MovementRule,
    NoAngle,
    NoMovement,
    Stretch,
    kinematics,
    movements,
    rest_stretches,
    segment_angle,
    target_stretches,
    with_filter,
)
from ..session_periods import SessionPeriods
from .assessment_table import AssessmentTable

MIN_TRAVEL_RAD = 0.05
"""Smallest travel of a movement without a target [rad], about three degrees."""


@dataclass(frozen=True)
class MarkerClockBounds:
    """Thresholds by which the clocks of markers and encoder are compared."""

    max_delay_s: float = 0.5  # Largest delay between markers and encoder in the search [s]
    # Largest distance of the delay of either half of a record from that of the whole [s]
    max_half_delay_difference_s: float = 0.1
    min_drift_record_s: float = 60.0  # A drift between the two clocks is estimated only in records longer than this [s]
    # A drift is corrected only if the clocks differ by at least this at the end of the record [s]
    min_corrected_drift_s: float = 0.005
    # Rate at which markers and encoder are compared [Hz], four times the cut-off of the filter that both have passed
    comparison_rate_hz: float = 25.0
    # A drift between two clocks is reported if they differ by more than this [s]; smaller ones are corrected silently
    min_reported_drift_s: float = 0.02


MARKER_CLOCK = MarkerClockBounds()


LABEL_ROUNDING_RAD = 0.005
"""Labels closer than this count as one label that was rounded [rad]."""


@dataclass(frozen=True, eq=False)
class PointingRecord:
    """One recording, divided into stretches between targets."""

    recording: Recording
    time: np.ndarray  # time on the recording's clock, (n,) [s]
    angle: np.ndarray  # measured angle, (n,) [rad]; NaN where a marker was lost
    stretches: tuple[Stretch, ...]
    delay: float | None = None  # delay of the markers' clock [s]; None if it is unknown
    source: str = "angle"  # channel or markers of the angle, for messages
    drift: float = 0.0  # estimated drift of the markers' clock, which is corrected [s/s]
    _kept: dict[tuple[float, int], Kinematics] = field(default_factory=dict, init=False, repr=False)
    _found: dict[MovementRule, tuple] = field(default_factory=dict, init=False, repr=False)

    @property
    def where(self) -> str:
        """File and recording, for messages."""
        return f"{self.recording.path.name} (recording {self.recording.name})"

    @property
    def along(self) -> Coordinate:
        """Coordinate of the movement: an angle, or a displacement, for which [rad] here means [m]."""
        return COORDINATES_BY_UNIT[_unit(self.recording, self.source)]

    @property
    def of_markers(self) -> bool:
        """Whether the angle comes from markers, on the clock of the motion capture."""
        return self.source.startswith("markers ")

    def later(self, seconds: float) -> PointingRecord:
        """Return the record with its angle shifted to later times, and with it stretches that its rests divide."""
        stretches = self.stretches
        if all(stretch.goal is None for stretch in stretches):
            stretches = tuple(replace(s, begin=s.begin + seconds, end=s.end + seconds) for s in stretches)
        return replace(self, time=self.time + seconds, stretches=stretches)

    def motion(self, rule: MovementRule) -> Kinematics:
        """Return the angle filtered by a rule, with its derivatives; the last filter's result is cached."""
        wanted = rule.lowpass, rule.order
        if wanted not in self._kept:
            before = self._kept.popitem()[1] if self._kept else None
            self._kept[wanted] = (
                kinematics(self.time, self.angle, rule, where=self.where, unit=self.along.unit)
                if before is None
                else with_filter(before, rule, where=self.where)
            )
        return self._kept[wanted]

    def movements(self, rule: MovementRule) -> tuple[Kinematics, list[Movement], list[NoMovement]]:
        """Return the motion, the movements, and the stretches without a movement, by a rule."""
        return self.motion(rule), *self.found(rule)

    def found(self, rule: MovementRule) -> tuple[list[Movement], list[NoMovement]]:
        """Return the movements, and the stretches without a movement, by a rule; the last rule's are cached."""
        if rule not in self._found:
            self._found.clear()
            self._found[rule] = movements(self.motion(rule), self.stretches, rule)
        found, without = self._found[rule]
        return list(found), list(without)

    def forget(self) -> None:
        """Release the cached motion, which needs the memory of several channels."""
        self._kept.clear()


def recordings_with_condition(recordings: Sequence[Recording]) -> list[Recording]:
    """Return the recordings that name a condition."""
    found = [recording for recording in recordings if recording.condition is not None]
    for recording in found:
        if recording.participant is None:
            raise RecordingError(
                f"{recording.path.name} (recording {recording.name}): found a condition, expected a participant too"
            )
    return found


def pointing_record(recording: Recording, spec: AssessmentTable) -> PointingRecord:
    """Read angle and targets from a recording."""
    where = f"{recording.path.name} (recording {recording.name})"
    delay, drift = None, 0.0
    if spec.segment and recording.optical is not None:
        source = f"markers {' and '.join(spec.segment)}"
        angle = segment_angle(recording.optical, *spec.segment)
        time = recording.optical.time
        if "position" in recording:
            time, delay, drift = _on_recordings_clock(recording, time, angle, where)
    elif spec.angle in recording:
        source, time = spec.angle, recording.time
        angle = (
            recording[spec.angle] if recording.sound.all() else np.where(recording.sound, recording[spec.angle], np.nan)
        )
    else:
        wanted = f"optical with the markers {', '.join(spec.segment)}, or " if spec.segment else ""
        raise RecordingError(
            f"{where}: found {', '.join(recording.channels)}, expected {wanted}a channel {spec.angle} with the angle"
        )
    rule = MovementRule(spec.lowpass, spec.order, spec.threshold)
    if spec.target in recording:
        stretches = target_stretches(recording.time, recording[spec.target])
        what = f"no step of the channel {spec.target}, expected one before each movement"
    else:
        unit = _unit(recording, source)
        motion = kinematics(time, angle, rule, where=where, unit=unit)
        least = MIN_TRAVEL_RAD * COORDINATES_BY_UNIT[unit].radian
        stretches = rest_stretches(motion, rule, least=least, amplitude=recording.amplitude)
        if recording.amplitude is not None:
            stretches = [stretch for stretch in stretches if stretch.amplitude is not None]
        what = "no movement, expected some with rests in between"
    if not stretches:
        raise RecordingError(f"{where}: found {what}")
    return PointingRecord(recording, time, angle, tuple(stretches), delay, source, drift)


def _unit(recording: Recording, source: str) -> str:
    channel = recording.channels.get(source)
    return "m" if channel is not None and channel.unit == "m" else "rad"


def _on_recordings_clock(
    recording: Recording, time: np.ndarray, angle: np.ndarray, where: str
) -> tuple[np.ndarray, float, float]:
    """Return the markers' time on the recording's clock, their mean delay [s], and their clock's drift [s/s]."""
    rates = []
    rule = MovementRule(lowpass=6.0)
    position = np.where(recording.sound, recording["position"], np.nan)
    for at, samples in ((recording.time, position), (time, angle)):
        motion = kinematics(at, samples, rule, where=where)
        even = np.arange(motion.time[0], motion.time[-1], 1.0 / MARKER_CLOCK.comparison_rate_hz)
        rates.append((even, np.interp(even, motion.time, motion.velocity)))
    (at, rate), other = rates
    try:
        delay = align(at, rate, *other, longest=MARKER_CLOCK.max_delay_s).delay
        drift, middle = 0.0, 0.5 * (at[0] + at[-1])
        seconds = at[-1] - at[0]
        if seconds > MARKER_CLOCK.min_drift_record_s:
            early = at < middle
            there = other[0] - delay, other[1]
            longest = MARKER_CLOCK.max_half_delay_difference_s
            halves = (align(at[h], rate[h], *there, longest=longest) for h in (early, ~early))
            drift, error = clock_drift(*halves)
            if abs(drift) * seconds < MARKER_CLOCK.min_corrected_drift_s or abs(drift) < 4.0 * error:
                drift = 0.0
    except RecordingError as error:
        raise RecordingError(f"{where}: markers against position: {error}") from None
    return time - delay - drift * (time - middle), delay, drift


def labelled_amplitudes(records: Sequence[PointingRecord]) -> list[float]:
    """Return all labelled amplitudes without sign, each once [rad]."""
    named = sorted(abs(s.amplitude) for record in records for s in record.stretches if s.amplitude is not None)
    same = LABEL_ROUNDING_RAD * records[0].along.radian if records else LABEL_ROUNDING_RAD
    groups = np.split(named, np.flatnonzero(np.diff(named) > same) + 1) if named else []
    return [float(group.mean()) for group in groups]


def drop_mistaken(
    found: Sequence[Movement], labels: Sequence[float], own: float = LABEL_TOLERANCE_RAD
) -> tuple[list[Movement], int]:
    """Return the movements whose amplitude agrees with their label, and the number of the others.

    `labelled_amplitudes` are in [rad]; a label counts as a movement's `own` within this distance [rad].
    """
    levels = np.asarray(labels)
    kept = [
        m for m in found if m.amplitude is None or abs(levels[np.argmin(np.abs(levels - m.reach))] - m.amplitude) <= own
    ]
    return kept, len(found) - len(kept)


def with_rule(spec: AssessmentTable, **changes) -> MovementRule:
    """Return the study's rule for movements, with changes such as ``lowpass=6.0``."""
    return replace(MovementRule(spec.lowpass, spec.order, spec.threshold), **changes)


@dataclass(frozen=True)
class SessionOrder:
    """Order of the recordings."""

    period: Mapping[str, int]  # period by recording, from 1; empty if it is not stated for all
    by_condition: Mapping[tuple[str, str], float]  # mean period by participant and condition
    within: Mapping[str, int]  # rank of a recording in its participant and condition; -1 if unknown
    unknown: str = ""  # reason why the order cannot be used

    def sessions(
        self, participants: Sequence[str], conditions: Sequence[str], control: str | None, condition: str
    ) -> SessionPeriods | None:
        """Return when participants had a condition and its control; None if that is not stated, or without control."""
        names = [control, *(c for c in conditions if c != control)]
        if control is None or not all((person, c) in self.by_condition for person in participants for c in names):
            return None
        places = np.array([[self.by_condition[person, c] for c in names] for person in participants])
        return SessionPeriods.of_conditions(places, 0, names.index(condition))


def session_order(recordings: Sequence[Recording]) -> SessionOrder:
    """Return the order of `recordings`; refuse two conditions of a participant in one period."""
    seen: dict[tuple[str, int], Recording] = {}
    for each in recordings:
        if each.period is not None:
            other = seen.setdefault((each.participant, each.period), each)
            if other.condition != each.condition:
                raise StudyError(
                    f"[[recordings]] {each.name}: found period = {each.period} of {each.participant} in "
                    f"{each.condition}, which {other.name} has in {other.condition}; expected another number"
                )
    lacking = [each.name for each in recordings if each.period is None]
    within = _within(recordings)
    if lacking:
        some = f" of {lacking[0]}" + (f" and {len(lacking) - 1} more" if len(lacking) > 1 else "")
        some = some if len(lacking) < len(recordings) else ""
        return SessionOrder({}, {}, within, f"study.toml does not say in which order conditions came (period{some})")
    by: dict[tuple[str, str], list[int]] = {}
    for each in recordings:
        by.setdefault((each.participant, each.condition), []).append(each.period)
    means = {key: float(np.mean(own)) for key, own in by.items()}
    return SessionOrder({each.name: each.period for each in recordings}, means, within)


def _within(recordings: Sequence[Recording]) -> dict[str, int]:
    groups: dict[tuple[str, str], list[Recording]] = {}
    for each in recordings:
        groups.setdefault((each.participant, each.condition), []).append(each)
    places: dict[str, int] = {}
    for own in groups.values():
        for key in ("period", "repetition"):
            numbers = [getattr(each, key) for each in own]
            if len(own) == 1 or (None not in numbers and len(set(numbers)) == len(own)):
                order = sorted(own, key=lambda each: getattr(each, key) or 0)
                places |= {each.name: i for i, each in enumerate(order)}
                break
        else:
            places |= dict.fromkeys((each.name for each in own), -1)
    return places


def rectified_emg(recording: Recording, spec: AssessmentTable) -> dict[str, np.ndarray] | None:
    """Return the rectified EMG of a recording by muscle, (m,), at the times of its source; None without EMG.

    It is processed as published except for normalisation, which needs all recordings.
    """
    muscles = (*spec.agonists, *spec.antagonists)
    names = [f"emg.{muscle}" for muscle in muscles]
    source = recording.stream_or_self(spec.emg)
    present = [name for name in names if name in source]
    if not present:
        return None
    if len(present) < len(names):
        absent = ", ".join(name for name in names if name not in present)
        raise RecordingError(
            f"{source.path.name} (recording {recording.name}): found {', '.join(present)}, expected {absent} too"
        )
    chain = _chain(spec.advance)
    whole, inside = source.uncut or source, slice(0, len(source))
    if whole is not source:
        half, ends = 0.5 / source.fs, source.time[[0, -1]]
        inside = slice(*map(int, np.searchsorted(whole.time, (ends[0] - half, ends[1] + half))))
    raw = {name: whole[name] for name in names if whole.channels[name].unit != "1"}
    try:
        made = chain.zero_phase_each(raw, source.fs, inside)
    except RecordingError as error:
        raise RecordingError(f"{source.path.name} (recording {recording.name}), {error}") from None
    del raw
    late = round(spec.advance * source.fs)
    return {m: made[n] if n in made else _later(whole[n], late)[inside] for m, n in zip(muscles, names, strict=True)}


def _chain(advance: float) -> EmgChain:
    """Return the published chain without normalisation, with this advance."""
    published = emg_chain("able")
    stages = [stage for stage in published.stages if stage.kind != "normalise"]
    return replace(published, stages=tuple(replace(s, seconds=advance) if s.kind == "advance" else s for s in stages))


def _later(samples: np.ndarray, count: int) -> np.ndarray:
    return np.concatenate((np.full(count, samples[0]), samples[: len(samples) - count]))


AMPLITUDE_RATIO_BOUNDS = (0.75, 1.35)
"""Range of the median ratio of measured to labelled amplitudes. Outside it, labels or angle have a wrong unit or
zero."""

ASSISTED_AMPLITUDE_RATIO_BOUNDS = (0.5, 2.0)
"""The same range for people who aim at targets with a robot, which may keep them from reaching the targets."""

MAX_SILENT_LEFT_OUT_SHARE = 0.2
"""Largest share of a recording's movements that may be excluded without a report."""


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
        message = f"{reason}: the recording {recording.name} is excluded"
        faults.append(Fault("cut", "gap", recording.path.name, spec.angle, reason, "a position throughout", message))
    return records, faults


def _gaps(record: PointingRecord, spec: AssessmentTable) -> str:
    """Return the reason why most movements cannot be used if it is missing samples; otherwise an empty text."""
    found, left_out = record.found(with_rule(spec))
    record.forget()
    lost = sum(each.kind == "lost" for each in left_out)
    total = len(found) + len(left_out)
    if len(left_out) <= 0.5 * total or lost < max(Counter(each.kind for each in left_out).values()):
        return ""
    one = next(each for each in left_out if each.kind == "lost")
    return (
        f"{record.where}, {record.source}: found missing samples in {lost} of {total} movements (the first at "
        f"{one.stretch.begin:.4g} s){_which_marker(record, spec)}, expected a position throughout"
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
            message = f"participant {person}: found no usable recording in {absent}: excluded from every comparison"
            faults.append(Fault("note", "condition", "study.toml", "", absent, "every condition", message))
    return faults


def pointing_faults(record: PointingRecord, spec: AssessmentTable, labels: Sequence[float]) -> list[Fault]:
    """Return the faults of the movements of a recording; `labelled_amplitudes` are the labelled amplitudes [rad]."""
    found, left_out = record.found(MovementRule(spec.lowpass, spec.order, spec.threshold))
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
            f"{len(left_out)} of {total} movements excluded ({reasons_text})",
            "hardly any",
        )
    missing = ~np.isfinite(record.angle)
    if missing.any():
        share = 100.0 * float(missing.mean())
        what = f"an angle that is missing in {share:.2g} % of the samples{_which_marker(record, spec)}"
        add("note", "lost_marker", what, "all of them")
    if abs(record.drift) * (record.time[-1] - record.time[0]) > MARKER_CLOCK.min_reported_drift_s:
        what = f"a clock that runs {1e6 * record.drift:+.0f} ppm fast relative to that of the channel position"
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
    "lost": "with gaps in the recorded position",
    "still": "that did not reach half-way",
    "direction": "the other way",
    "no_peak": "without a clear peak of the speed",
    "too_few_samples": "with too few samples",
    "unfinished": "too fast at their last sample to have an end point",
}
"""Words for `NoMovement.kind`, to follow a number."""


def reason_words(kind: str) -> str:
    """Return why stretches have no movement, to follow their number."""
    return REASON_WORDS.get(kind, "that went as far as another label")


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
            f"movements {scale:.3g} times as large as their labels",
            "amplitudes as labelled: check the units of angle and target, and which joint the angle belongs to",
        )
    found = strays(reach, label, labels, record.along)
    share = float(found.wrong.mean())
    if found.mislabelled or (share > LABELS_RULE.max_mistaken_share and not aimed):
        mismatch_text = (
            found.mislabelled or f"{int(found.wrong.sum())} of {len(named)} movements {found.commonest(label)}"
        )
        return fault("refuse", "amplitude", mismatch_text, "movements with the labelled amplitudes")
    if share > LABELS_RULE.max_mistaken_share:
        miss = record.along.factor * float(np.median(np.abs(reach - label)[found.wrong]))
        what = (
            f"{int(found.wrong.sum())} of {len(named)} movements that missed by {miss:.2g} {record.along.shown} in the "
            "median"
        )
        return fault("note", "missed", f"{what}, nearer to another target", "targets that are reached; they are used")
    return []
