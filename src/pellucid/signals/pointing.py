"""A recording of somebody who points to one target after another: its angle, and the stretches between targets.

The angle is a channel, or that of a segment with two markers. Markers have a clock of their own; where an encoder was
recorded too, how far it is from the recording's is found from the motion, and otherwise both are taken to start
together.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from .._errors import RecordingError
from ..recordings.quality import Fault
from ..recordings.recording import Recording
from ..recordings.study_procedures import Assessment
from .alignment import align
from .movements import (
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
from .segment_angle import segment_angle

LEAST = 0.05
"""Travel [rad] that makes a movement where no target says so: three degrees."""

LONGEST_DELAY = 0.5
"""Delay between markers and encoder that is looked for [s]."""

COMPARED_AT = 50.0
"""Rate at which markers and encoder are compared [Hz]: ten times what people's joints move at."""

SCALE = (0.75, 1.35)
"""Measured over labelled amplitudes, in the median, beyond which labels or angle have another unit or zero."""

MISTAKEN = 0.1
"""Share of a recording's movements that may end nearer to another label than to their own."""

OWN = 0.01
"""A label is a movement's own within this [rad]: it may have been rounded."""

LEFT_OUT = 0.2
"""Share of a recording's movements that may be left out before it is told."""


@dataclass(frozen=True, eq=False)
class PointingRecord:
    """One recording, divided.

    Attributes
    ----------
    recording : Recording
    time, angle : ndarray, shape (n,)
        As measured, on the recording's clock [s], [rad]; NaN where a marker was lost.
    stretches : tuple of Stretch
    delay : float or None
        By which the markers' clock is late, where that could be found [s].
    """

    recording: Recording
    time: np.ndarray
    angle: np.ndarray
    stretches: tuple[Stretch, ...]
    delay: float | None = None

    @property
    def where(self) -> str:
        """File and recording, for messages."""
        return f"{self.recording.path.name} (recording {self.recording.name})"

    def motion(self, rule: MovementRule) -> Kinematics:
        """The angle filtered by a rule, with its derivatives."""
        return kinematics(self.time, self.angle, rule, where=self.where)

    def movements(self, rule: MovementRule) -> tuple[Kinematics, list[Movement], list[NoMovement]]:
        """Motion, movements, and stretches without one, by a rule."""
        motion = self.motion(rule)
        return motion, *movements(motion, self.stretches, rule)


def assessed(recordings: Sequence[Recording]) -> list[Recording]:
    """Those that name a condition.

    Raises
    ------
    RecordingError
        If one of them names no participant.
    """
    found = [recording for recording in recordings if recording.condition is not None]
    for recording in found:
        if recording.participant is None:
            raise RecordingError(
                f"{recording.path.name} (recording {recording.name}): found a condition, expected a participant too"
            )
    return found


def pointing_record(recording: Recording, spec: Assessment) -> PointingRecord:
    """Read angle and targets from a recording.

    Parameters
    ----------
    recording : Recording
    spec : Assessment
        What study.toml says of it.

    Returns
    -------
    PointingRecord

    Raises
    ------
    RecordingError
        If there is no angle, or markers and encoder are not of one motion.
    """
    where = f"{recording.path.name} (recording {recording.name})"
    delay = None
    if spec.segment and recording.optical is not None:
        angle = segment_angle(recording.optical, *spec.segment)
        time = recording.optical.time
        if "position" in recording:
            delay = _markers_delay(recording, time, angle, where)
            time = time - delay
    elif spec.angle in recording:
        time, angle = recording.time, recording[spec.angle]
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
        motion = kinematics(time, angle, rule, where=where)
        stretches = rest_stretches(motion, rule, least=LEAST, amplitude=recording.amplitude)
        if recording.amplitude is not None:
            stretches = [stretch for stretch in stretches if stretch.amplitude is not None]
        what = "no movement, expected some with rests in between"
    if not stretches:
        raise RecordingError(f"{where}: found {what}")
    return PointingRecord(recording, time, angle, tuple(stretches), delay)


def _markers_delay(recording: Recording, time: np.ndarray, angle: np.ndarray, where: str) -> float:
    rates = []
    rule = MovementRule(lowpass=6.0)
    for at, samples in ((recording.time, recording["position"]), (time, angle)):
        motion = kinematics(at, samples, rule, where=where)
        even = np.arange(motion.time[0], motion.time[-1], 1.0 / COMPARED_AT)
        rates.append((even, np.interp(even, motion.time, motion.velocity)))
    try:
        return align(*rates[0], *rates[1], longest=LONGEST_DELAY).delay
    except RecordingError as error:
        raise RecordingError(f"{where}: markers against position: {error}") from None


def pointing_faults(record: PointingRecord, spec: Assessment, labels: Sequence[float]) -> list[Fault]:
    """What is wrong with the movements of a recording.

    Parameters
    ----------
    record : PointingRecord
    spec : Assessment
    labels : sequence of float
        All amplitudes that the study labels, without sign [rad].

    Returns
    -------
    list of Fault
        Of the kinds ``"amplitude"`` and ``"movements"`` (refused), ``"left_out"`` and ``"lost_marker"`` (noted).
    """
    _, found, left_out = record.movements(MovementRule(spec.lowpass, spec.order, spec.threshold))
    faults = []
    total = len(found) + len(left_out)

    def add(severity: str, kind: str, what: str, expected: str) -> None:
        message = f"{record.where}: found {what}, expected {expected}"
        faults.append(Fault(severity, kind, record.recording.path.name, spec.angle, what, expected, message))

    reasons = Counter(each.kind for each in left_out)
    if len(left_out) > 0.5 * total:
        kind, _ = reasons.most_common(1)[0]
        one = next(each for each in left_out if each.kind == kind)
        what = f"{len(found)} movements in {total} stretches, most often {one.found} ({one.stretch.begin:.4g} s)"
        add("refuse", "movements", what, one.expected)
    elif len(left_out) > LEFT_OUT * total:
        said = ", ".join(f"{count} {REASONS[kind]}" for kind, count in reasons.most_common())
        add("note", "left_out", f"{len(left_out)} of {total} movements that had to be left out ({said})", "hardly any")
    missing = ~np.isfinite(record.angle)
    if missing.any():
        share = 100.0 * float(missing.mean())
        add("note", "lost_marker", f"an angle that is missing in {share:.2g} % of the samples", "all of them")
    named = [m for m in found if m.amplitude is not None]
    if named:
        faults += _label_faults(record, spec, named, np.asarray(labels))
    return faults


REASONS = {
    "lost": "with a marker lost",
    "still": "that did not reach half-way",
    "direction": "the other way",
    "no_peak": "without a clear peak of the speed",
    "too_few_samples": "with too few samples",
    "unfinished": "not finished when the next target came",
}
"""What `NoMovement.kind` says, after a number."""


def _label_faults(
    record: PointingRecord, spec: Assessment, named: Sequence[Movement], labels: np.ndarray
) -> list[Fault]:
    reach = np.array([m.reach for m in named])
    label = np.array([m.amplitude for m in named])
    name = record.recording.path.name

    def refuse(what: str, expected: str) -> list[Fault]:
        message = f"{record.where}: found {what}, expected {expected}"
        return [Fault("refuse", "amplitude", name, spec.target, what, expected, message)]

    scale = float(np.median(reach / label))
    if not SCALE[0] <= scale <= SCALE[1]:
        return refuse(
            f"movements {scale:.3g} times as large as their labels say",
            "amplitudes as labelled: look at the units of angle and target, and at what the angle is an angle of",
        )
    nearest = labels[np.argmin(np.abs(reach[:, None] - labels[None, :]), axis=1)]
    wrong = np.abs(nearest - label) > OWN
    if wrong.mean() > MISTAKEN:
        (own, other), count = Counter(
            zip(np.round(np.degrees(label[wrong]), 1), np.round(np.degrees(nearest[wrong]), 1), strict=True)
        ).most_common(1)[0]
        return refuse(
            f"{int(wrong.sum())} of {len(named)} movements nearer to another amplitude than to their label ({count} "
            f"labelled {own:g} deg go {other:g} deg)",
            "movements that go as far as their labels say",
        )
    return []


def drop_mistaken(found: Sequence[Movement], labels: Sequence[float]) -> tuple[list[Movement], int]:
    """Movements that went as far as they are labelled, and how many did not.

    Parameters
    ----------
    found : sequence of Movement
    labels : sequence of float
        All amplitudes that the study labels, without sign [rad].

    Returns
    -------
    kept : list of Movement
        Those nearest to their own label; unlabelled ones are kept.
    dropped : int
    """
    levels = np.asarray(labels)
    kept = [
        m for m in found if m.amplitude is None or abs(levels[np.argmin(np.abs(levels - m.reach))] - m.amplitude) <= OWN
    ]
    return kept, len(found) - len(kept)


def with_rule(spec: Assessment, **changes) -> MovementRule:
    """The study's rule for movements, with changes such as ``lowpass=6.0``."""
    return replace(MovementRule(spec.lowpass, spec.order, spec.threshold), **changes)
