"""A recording of somebody who points to one target after another: its angle, and the stretches between targets.

The angle is a channel, or that of a segment with two markers. Markers have a clock of their own; where an encoder was
recorded too, how far it is from the recording's is found from the motion, and otherwise both are taken to start
together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from .._errors import RecordingError
from ..recordings.recording import Recording
from ..recordings.study_procedures import Assessment
from .alignment import align
from .amplitude_check import OWN
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

SAME = 0.005
"""Labels closer than this [rad] are one that was rounded."""


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
    source : str
        Channel or markers of the angle, for messages.
    """

    recording: Recording
    time: np.ndarray
    angle: np.ndarray
    stretches: tuple[Stretch, ...]
    delay: float | None = None
    source: str = "angle"

    @property
    def where(self) -> str:
        """File and recording, for messages."""
        return f"{self.recording.path.name} (recording {self.recording.name})"

    @property
    def of_markers(self) -> bool:
        """Whether the angle is one of markers, whose clock is the motion capture's."""
        return self.source.startswith("markers ")

    def later(self, seconds: float) -> PointingRecord:
        """The same with an angle that is measured later; stretches that its rests divide move with it."""
        stretches = self.stretches
        if all(stretch.goal is None for stretch in stretches):
            stretches = tuple(replace(s, begin=s.begin + seconds, end=s.end + seconds) for s in stretches)
        return replace(self, time=self.time + seconds, stretches=stretches)

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
        source = f"markers {' and '.join(spec.segment)}"
        angle = segment_angle(recording.optical, *spec.segment)
        time = recording.optical.time
        if "position" in recording:
            delay = _markers_delay(recording, time, angle, where)
            time = time - delay
    elif spec.angle in recording:
        source, time, angle = spec.angle, recording.time, recording[spec.angle]
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
    return PointingRecord(recording, time, angle, tuple(stretches), delay, source)


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


def labels(records: Sequence[PointingRecord]) -> list[float]:
    """All amplitudes that are labelled, without sign [rad], each once."""
    named = sorted(abs(s.amplitude) for record in records for s in record.stretches if s.amplitude is not None)
    groups = np.split(named, np.flatnonzero(np.diff(named) > SAME) + 1) if named else []
    return [float(group.mean()) for group in groups]


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
