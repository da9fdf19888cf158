"""Protocol of the virtual knee orthosis and its wearers: the five experiments of the thesis, one of them longer.

Holds last 5 s and the brief sines 5 s, as printed [1]_. The orthosis alone rings for 12 s (its time constant at the
thesis's own values), so that its response is recorded again over 40 s per frequency, at two amplitudes.

.. [1] "Optimising human-robot interaction using electromyography and zero-impedance mode", master's thesis,
   section 2.3.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal, Protocol

import numpy as np

from ..rig import Trial
from .machine import KneeMachine
from .subject import KneeSubject
from .wearer import Wearer, contracting, counteracting, following, relaxed, swinging

HOLD_ANGLES_DEG = (0, 15, 30, 45, 60, 90)
"""Angles that are held [degrees]."""

HOLD_DURATION_S = 5.0
"""Time for which an angle or a torque is held [s]."""

MOVE_DURATION_S = 1.0
"""Time in which the orthosis moves to the next angle [s]."""

SINE_FREQUENCIES_HZ = (0.3, 0.5, 0.7, 1.0)
"""Frequencies of the sines [Hz]."""

SINE_AMPLITUDE_RAD = 1.0
"""Amplitude of the sines that are fitted [rad]."""

HELD_OUT_AMPLITUDE_RAD = 0.6
"""Amplitude of the sines that are held out [rad]."""

LONG_SINE_DURATION_S = 40.0
"""Duration of a sine from which a response is identified [s]."""

BRIEF_SINE_DURATION_S = 5.0
"""Duration of a sine as printed in the thesis [s]."""

TORQUE_STEPS_NM = (0.0, 5.0, 10.0, 0.0, -5.0, -10.0)
"""Torques that a wearer counteracts one after another [N*m]: the thesis's, then the same in the other direction."""

TORQUE_RAMP_DURATION_S = 2.0
"""Part of the time of a torque in which it rises from the one before [s], as when a slider on a screen is moved."""

REPETITION_COUNT = 3
"""Number of repetitions of each of a wearer's trials."""

SWING_DURATION_S = 40.0
"""Duration of a free swing [s]."""

MVC_DURATION_S = 20.0
"""Duration of a recording of maximal voluntary contractions [s]."""


@dataclass(frozen=True)
class Faults:
    """Faults of a trial; by default there is none."""

    imu_dropout: tuple[float, float] | None = None  # begin and duration of a gap in the IMU's recording [s]
    slip: tuple[float, float] | None = None  # time [s] and size [rad] of a slip of the strap
    # angle added before the encoder rolls over at half a turn in either direction [rad]
    encoder_turn: float | None = None
    emg_rate: float | None = None  # actual rate of the EMG amplifier, in place of the stated one [Hz]
    emg_detached: dict[int, float] = field(default_factory=dict)  # time at which a channel's electrode comes off [s]
    emg_clipped: dict[int, float] = field(default_factory=dict)  # range of a channel that clips early [V]


NO_FAULTS = Faults()


class Base(Protocol):
    """What a thigh that moves, and the ground, do to orthosis and limb."""

    def torques(self, k: int, orthosis: float, limb: float, velocity: float) -> tuple[float, float]:
        """Return the torques on orthosis and limb in period `k` [N*m].

        `orthosis` and `limb` are their angles [rad], and `velocity` is the limb's [rad/s].
        """


@dataclass(frozen=True)
class KneeTrial(Trial):
    """One recording; its `reference` is an angle [rad] or a torque of the spring [N*m], as `mode` says."""

    # what the orthosis controls: its angle, or the torque of its spring
    mode: Literal["position", "torque"] = "position"
    wearer: Wearer | None = None  # person and task; None means that nobody wears the orthosis
    start: float = 0.0  # first angle of the orthosis [rad]
    link: Literal["strap", "plate"] = "strap"  # coupling between orthosis and limb
    locked: bool = False  # whether the wearer's limb is clamped to a frame
    imu: Literal["ankle", "orthosis"] | None = None  # place of the IMU; None means that it does not record
    faults: Faults = NO_FAULTS
    base: Base | None = None  # thigh that moves, and ground under the foot; None means that the thigh rests

    def __post_init__(self):
        if self.wearer is not None:
            object.__setattr__(self, "participant", self.wearer.subject.name)


def holds(rig: KneeMachine, angles: tuple[float, ...], hold_time: float = HOLD_DURATION_S) -> np.ndarray:
    """Return `angles` held for `hold_time` [s] each, with smooth movements between them, shape (n,) [rad]."""
    fs = rig.constants.encoders.rate
    s = np.arange(round(MOVE_DURATION_S * fs)) / (MOVE_DURATION_S * fs)
    ease = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    parts, at = [], angles[0]
    for angle in angles:
        parts += [at + (angle - at) * ease, np.full(round(hold_time * fs), angle)]
        at = angle
    return np.concatenate(parts)


def sine(rig: KneeMachine, frequency: float, amplitude: float, duration: float) -> np.ndarray:
    """Return a sine that begins at 0, shape (n,) [rad]; `frequency` [Hz], `amplitude` [rad], `duration` [s]."""
    t = np.arange(round(duration * rig.constants.encoders.rate)) * rig.period
    return amplitude * np.sin(2.0 * np.pi * frequency * t)


def torque_steps(rig: KneeMachine, torques: tuple[float, ...] = TORQUE_STEPS_NM) -> np.ndarray:
    """Return `torques` [N*m] held one after another, each with its ramp, shape (n,)."""
    fs = rig.constants.encoders.rate
    n = round(HOLD_DURATION_S * fs)
    way = np.minimum(np.arange(n) / (TORQUE_RAMP_DURATION_S * fs), 1.0)
    parts, at = [], torques[0]
    for torque in torques:
        parts.append(at + (torque - at) * way)
        at = torque
    return np.concatenate(parts)


def bench_trials(rig: KneeMachine) -> list[KneeTrial]:
    """Return the trials of the orthosis alone: static holds under gravity, and long and brief sines."""
    angles = tuple(np.radians([*HOLD_ANGLES_DEG, *HOLD_ANGLES_DEG[-2::-1]]).tolist())
    made = [KneeTrial("gravity", "gravity_holds", reference=holds(rig, angles))]
    for f in SINE_FREQUENCIES_HZ:
        tag = f"{round(10 * f):02d}"
        long, check = (
            sine(rig, f, SINE_AMPLITUDE_RAD, LONG_SINE_DURATION_S),
            sine(rig, f, HELD_OUT_AMPLITUDE_RAD, LONG_SINE_DURATION_S),
        )
        made += [
            KneeTrial(f"response_{tag}", "sine_tracking", reference=long),
            KneeTrial(f"response_check_{tag}", "sine_tracking", "validate", reference=check),
            KneeTrial(f"brief_{tag}", "sine_brief", reference=sine(rig, f, SINE_AMPLITUDE_RAD, BRIEF_SINE_DURATION_S)),
        ]
    return made


def imu_trial(rig: KneeMachine, name: str, participant: str | None = None, faults: Faults = NO_FAULTS) -> KneeTrial:
    """The IMU fixed to the orthosis, which goes through its range: holds, and sines that show the clocks.

    Nobody is in it, but its calibration is a participant's: the IMU stays as it is when it moves to their ankle.
    """
    angles = tuple(np.radians(HOLD_ANGLES_DEG).tolist())
    middle = np.radians(45.0)
    t = np.arange(round(12.0 / rig.period)) * rig.period
    fade = np.clip(np.minimum(t, t[-1] - t) / 2.0, 0.0, 1.0)
    waves = [middle + 0.7 * fade * np.sin(2.0 * np.pi * f * t) for f in (0.3, 0.7)]
    reference = np.concatenate([holds(rig, angles, 4.0), holds(rig, (angles[-1], middle), 1.0), *waves])
    whose: dict[str, Any] = {"participant": participant, "reference": reference}
    return KneeTrial(name, "imu_on_orthosis", **whose, imu="orthosis", faults=faults)


def relaxed_trial(
    rig: KneeMachine, name: str, subject: KneeSubject, *, helps: bool = False, faults: Faults = NO_FAULTS
) -> KneeTrial:
    """Return a trial of a relaxed leg on a rigid plate that is held at each angle."""
    reference, wearer = holds(rig, tuple(np.radians(HOLD_ANGLES_DEG).tolist())), relaxed(subject, helps=helps)
    how: dict[str, Any] = {"link": "plate", "imu": "ankle", "faults": faults}
    return KneeTrial(name, "relaxed_holds", reference=reference, wearer=wearer, **how)


def mvc_trial(rig: KneeMachine, name: str, subject: KneeSubject, faults: Faults = NO_FAULTS) -> KneeTrial:
    """Return a trial of maximal contractions of both muscles against a frame."""
    reference, wearer = np.full(round(MVC_DURATION_S / rig.period), np.radians(60.0)), contracting(subject)
    how: dict[str, Any] = {"start": float(reference[0]), "locked": True, "faults": faults}
    return KneeTrial(name, "mvc", reference=reference, wearer=wearer, **how)


def torque_trial(
    rig: KneeMachine, name: str, subject: KneeSubject, angle: float, *, use: str = "fit", faults: Faults = NO_FAULTS
) -> KneeTrial:
    """Return a trial in which a subject holds an angle [rad] against torques."""
    wearer = counteracting(subject, angle)
    how: dict[str, Any] = {"start": angle, "imu": "ankle", "faults": faults}
    return KneeTrial(name, "torque_steps", use, reference=torque_steps(rig), mode="torque", wearer=wearer, **how)


def swing_trial(
    rig: KneeMachine,
    name: str,
    subject: KneeSubject,
    *,
    use: str = "fit",
    duration: float = SWING_DURATION_S,
    frequency: tuple[float, float] | None = None,
    amplitude: tuple[float, float] | None = None,
    faults: Faults = NO_FAULTS,
) -> KneeTrial:
    """Return a trial in which the shank swings freely in zero-impedance mode for a duration [s]; see `swinging`."""
    reference = np.zeros(round(duration / rig.period))
    wearer = swinging(subject, frequency=frequency, amplitude=amplitude)
    how: dict[str, Any] = {"start": rig.constants.swing.centre, "imu": "ankle", "faults": faults}
    return KneeTrial(name, "free_swing", use, reference=reference, mode="torque", wearer=wearer, **how)


def walking_trial(rig: KneeMachine, name: str, subject: KneeSubject, path: np.ndarray) -> KneeTrial:
    """Return a trial in which the shank follows a path, shape (n,) [rad], in zero-impedance mode."""
    how: dict[str, Any] = {"start": float(path[0]), "imu": "ankle"}
    wearer = following(subject, path)
    return KneeTrial(name, "walking", reference=np.zeros(len(path)), mode="torque", wearer=wearer, **how)


def subject_trials(rig: KneeMachine, subject: KneeSubject) -> list[KneeTrial]:
    """Return all trials of one subject."""
    who = subject.name
    made = [imu_trial(rig, f"{who}_imu", who)]
    made += [relaxed_trial(rig, f"{who}_relaxed_{i + 1}", subject) for i in range(REPETITION_COUNT)]
    made.append(mvc_trial(rig, f"{who}_mvc", subject))
    for angle in HOLD_ANGLES_DEG:
        made += [
            torque_trial(rig, f"{who}_torque_{angle}_{i + 1}", subject, float(np.radians(angle)))
            for i in range(REPETITION_COUNT)
        ]
    for i in range(REPETITION_COUNT):
        use = "validate" if i == REPETITION_COUNT - 1 else "fit"
        made.append(swing_trial(rig, f"{who}_swing_{i + 1}", subject, use=use))
    return made


def knee_trials(rig: KneeMachine) -> tuple[KneeTrial, ...]:
    """Return the full protocol: the orthosis alone, then every subject."""
    subjects = rig.subjects.values()
    return (*bench_trials(rig), *(trial for subject in subjects for trial in subject_trials(rig, subject)))
