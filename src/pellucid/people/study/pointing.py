"""Read a recording of a person who points to one target after another: the angle, and the stretches between targets.

The angle is a channel, or that of a segment with two markers. Markers have a clock of their own. If an encoder was
recorded too, the offset and drift of that clock are estimated from the motion; otherwise both are assumed to start
together.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..._errors import RecordingError, StudyError
from ...emg.signals.emg_chain import EmgChain, emg_chain
from ...files.recording import Recording
from ...numerics.clocks import align, clock_drift
from ...units import COORDINATES_BY_UNIT, Coordinate
from ..emg_index import LABEL_TOLERANCE_RAD, Activity
from ..movements import (
    Kinematics,
    Movement,
    MovementRule,
    NoMovement,
    Stretch,
    kinematics,
    movements,
    rest_stretches,
    target_stretches,
)
from ..segment_angle import segment_angle
from .assessment_table import AssessmentTable

MIN_TRAVEL_RAD = 0.05
"""Smallest travel of a movement without a target [rad], about three degrees."""

MAX_DELAY_S = 0.5
"""Largest delay between markers and encoder in the search [s]."""

MAX_HALF_DELAY_DIFFERENCE_S = 0.1
"""Largest distance of the delay of either half of a record from that of the whole [s]."""

MIN_DRIFT_RECORD_S = 60.0
"""A drift between the two clocks is estimated only in records longer than this [s]."""

MIN_CORRECTED_DRIFT_S = 0.005
"""A drift is corrected only if the clocks differ by at least this at the end of the record [s]."""

COMPARISON_RATE_HZ = 25.0
"""Rate at which markers and encoder are compared [Hz], four times the cut-off of the filter that both have passed."""

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
            self._kept.clear()
            self._kept[wanted] = kinematics(self.time, self.angle, rule, where=self.where, unit=self.along.unit)
        return self._kept[wanted]

    def movements(self, rule: MovementRule) -> tuple[Kinematics, list[Movement], list[NoMovement]]:
        """Return the motion, the movements, and the stretches without a movement, by a rule."""
        motion = self.motion(rule)
        return motion, *movements(motion, self.stretches, rule)


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
        even = np.arange(motion.time[0], motion.time[-1], 1.0 / COMPARISON_RATE_HZ)
        rates.append((even, np.interp(even, motion.time, motion.velocity)))
    (at, rate), other = rates
    try:
        delay = align(at, rate, *other, longest=MAX_DELAY_S).delay
        drift, middle = 0.0, 0.5 * (at[0] + at[-1])
        seconds = at[-1] - at[0]
        if seconds > MIN_DRIFT_RECORD_S:
            early = at < middle
            there = other[0] - delay, other[1]
            halves = (align(at[h], rate[h], *there, longest=MAX_HALF_DELAY_DIFFERENCE_S) for h in (early, ~early))
            drift, error = clock_drift(*halves)
            if abs(drift) * seconds < MIN_CORRECTED_DRIFT_S or abs(drift) < 4.0 * error:
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

    def later(self, participants: Sequence[str], condition: str, control: str | None) -> np.ndarray:
        """Return the number of periods by which the condition followed control, or its own mean, (n,)."""
        own = np.array([self.by_condition[person, condition] for person in participants])
        if control is None:
            return own - own.mean()
        return own - np.array([self.by_condition[person, control] for person in participants])


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


def activity(recording: Recording, spec: AssessmentTable) -> Activity | None:
    """Return the EMG of a recording, processed as published except for normalisation, which needs all recordings."""
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
    whole = source.uncut or source
    half = 0.5 / source.fs
    inside = slice(*map(int, np.searchsorted(whole.time, (source.time[0] - half, source.time[-1] + half))))
    rectified = {}
    for muscle, name in zip(muscles, names, strict=True):
        channel = whole.channels[name]
        try:
            if channel.unit == "1":
                rectified[muscle] = _later(channel.samples, round(spec.advance * source.fs))[inside]
            else:
                rectified[muscle] = chain.zero_phase(channel.samples, source.fs, inside=inside)
        except RecordingError as error:
            raise RecordingError(f"{source.path.name} (recording {recording.name}), {name}: {error}") from None
    return Activity(source.time, rectified, {muscle: float(samples.max()) for muscle, samples in rectified.items()})


def _chain(advance: float) -> EmgChain:
    """Return the published chain without normalisation, with this advance."""
    published = emg_chain("able")
    stages = [stage for stage in published.stages if stage.kind != "normalise"]
    return replace(published, stages=tuple(replace(s, seconds=advance) if s.kind == "advance" else s for s in stages))


def _later(samples: np.ndarray, count: int) -> np.ndarray:
    return np.concatenate((np.full(count, samples[0]), samples[: len(samples) - count]))
