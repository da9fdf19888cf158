"""What the virtual knee orthosis and its wearers are asked to do: the five experiments of the thesis, one longer.

Holds last 5 s and the brief sines 5 s, as printed [1]_. The orthosis alone rings for 12 s (its time constant at the
thesis's own values), so that its response is recorded again over 40 s per frequency, at two amplitudes.

.. [1] "Optimising human-robot interaction using electromyography and zero-impedance mode", master's thesis,
   section 2.3.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from ..rig import Trial
from .machine import KneeMachine
from .subject import KneeSubject
from .wearer import Wearer, contracting, counteracting, following, relaxed, swinging

ANGLES = (0, 15, 30, 45, 60, 90)
"""Of the holds [deg]."""

HOLD_TIME, MOVE_TIME = 5.0, 1.0
"""How long an angle or a torque is held, and how long the way to the next angle takes [s]."""

FREQUENCIES = (0.3, 0.5, 0.7, 1.0)
"""Of the sines [Hz]."""

AMPLITUDE, CHECK_AMPLITUDE = 1.0, 0.6
"""Of the sines that are fitted, and of those that are held out [rad]."""

RESPONSE_TIME, BRIEF_TIME = 40.0, 5.0
"""How long a sine lasts [s]."""

TORQUES = (0.0, 5.0, 10.0, 0.0, -5.0, -10.0)
"""That a wearer counteracts, one after another [N*m]: the thesis's, and the same the other way."""

STEP_TIME = 2.0
"""In which one torque becomes the next, of the time it is held [s]: a slider on a screen is pushed."""

TRIALS = 3
"""Of everything that a wearer repeats."""

SWING_TIME, MVC_TIME = 40.0, 20.0
"""[s]"""


@dataclass(frozen=True)
class Faults:
    """What goes wrong in a trial; nothing, as it stands."""

    imu_dropout: tuple[float, float] | None = None  # When the IMU falls silent, and for how long [s]
    slip: tuple[float, float] | None = None  # When the strap slips, and how far [rad]
    # Added to the orthosis's angle before its encoder rolls over at half a turn either way [rad]
    encoder_turn: float | None = None
    emg_rate: float | None = None  # At which the amplifier ran instead of its own [Hz]
    emg_detached: dict[int, float] = field(default_factory=dict)  # By channel, from when its electrode is off [s]
    emg_clipped: dict[int, float] = field(default_factory=dict)  # By channel, a range too small [V]


NO_FAULTS = Faults()


@dataclass(frozen=True)
class KneeTrial(Trial):
    """One recording to be made. `name`, `protocol`, `use`, `participant`, `condition`, `reference` [rad], [N*m]."""

    # What the orthosis does on its own: follow angles, or give torques at the spring
    mode: Literal["position", "torque"] = "position"
    wearer: Wearer | None = None  # Nobody: the orthosis alone
    start: float = 0.0  # Where the orthosis is at first [rad]
    link: Literal["strap", "plate"] = "strap"  # What couples a wearer
    locked: bool = False  # Whether the wearer's limb is clamped to a frame
    imu: Literal["ankle", "orthosis"] | None = None  # Where it is fixed, if it runs
    faults: Faults = NO_FAULTS

    def __post_init__(self):
        if self.wearer is not None:
            object.__setattr__(self, "participant", self.wearer.subject.name)


def holds(rig: KneeMachine, angles: tuple[float, ...], hold_time: float = HOLD_TIME) -> np.ndarray:
    """Angles [rad] held one after another, for `hold_time` [s] each, with smooth ways between, shape (n,)."""
    fs = rig.constants.encoders.rate
    s = np.arange(round(MOVE_TIME * fs)) / (MOVE_TIME * fs)
    ease = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    parts, at = [], angles[0]
    for angle in angles:
        parts += [at + (angle - at) * ease, np.full(round(hold_time * fs), angle)]
        at = angle
    return np.concatenate(parts)


def sine(rig: KneeMachine, frequency: float, amplitude: float, duration: float) -> np.ndarray:
    """A sine from its own zero, of [Hz], [rad] and [s], one sample a period, shape (n,) [rad]."""
    t = np.arange(round(duration * rig.constants.encoders.rate)) * rig.period
    return amplitude * np.sin(2.0 * np.pi * frequency * t)


def torque_steps(rig: KneeMachine, torques: tuple[float, ...] = TORQUES) -> np.ndarray:
    """Torques held for 5 s each, ways to them included; shape (n,) [N*m]."""
    fs = rig.constants.encoders.rate
    n = round(HOLD_TIME * fs)
    way = np.minimum(np.arange(n) / (STEP_TIME * fs), 1.0)
    parts, at = [], torques[0]
    for torque in torques:
        parts.append(at + (torque - at) * way)
        at = torque
    return np.concatenate(parts)


def bench_trials(rig: KneeMachine) -> list[KneeTrial]:
    """The orthosis alone: gravity, and its response to sines, long and brief."""
    angles = tuple(np.radians([*ANGLES, *ANGLES[-2::-1]]).tolist())
    made = [KneeTrial("gravity", "gravity_holds", reference=holds(rig, angles))]
    for f in FREQUENCIES:
        tag = f"{round(10 * f):02d}"
        long, check = sine(rig, f, AMPLITUDE, RESPONSE_TIME), sine(rig, f, CHECK_AMPLITUDE, RESPONSE_TIME)
        made += [
            KneeTrial(f"response_{tag}", "sine_tracking", reference=long),
            KneeTrial(f"response_check_{tag}", "sine_tracking", "validate", reference=check),
            KneeTrial(f"brief_{tag}", "sine_brief", reference=sine(rig, f, AMPLITUDE, BRIEF_TIME)),
        ]
    return made


def imu_trial(rig: KneeMachine, name: str, participant: str | None = None, faults: Faults = NO_FAULTS) -> KneeTrial:
    """The IMU fixed to the orthosis, which goes through its range: holds, and sines that show the clocks.

    Nobody is in it, but its calibration is a participant's: the IMU stays as it is when it moves to their ankle.
    """
    angles = tuple(np.radians(ANGLES).tolist())
    middle = np.radians(45.0)
    t = np.arange(round(12.0 / rig.period)) * rig.period
    fade = np.clip(np.minimum(t, t[-1] - t) / 2.0, 0.0, 1.0)
    waves = [middle + 0.7 * fade * np.sin(2.0 * np.pi * f * t) for f in (0.3, 0.7)]
    reference = np.concatenate([holds(rig, angles, 4.0), holds(rig, (angles[-1], middle), 1.0), *waves])
    whose = {"participant": participant, "reference": reference}
    return KneeTrial(name, "imu_on_orthosis", **whose, imu="orthosis", faults=faults)


def relaxed_trial(
    rig: KneeMachine, name: str, subject: KneeSubject, *, helps: bool = False, faults: Faults = NO_FAULTS
) -> KneeTrial:
    """A relaxed leg on a rigid plate, held at the angles."""
    reference, wearer = holds(rig, tuple(np.radians(ANGLES).tolist())), relaxed(subject, helps=helps)
    how = {"link": "plate", "imu": "ankle", "faults": faults}
    return KneeTrial(name, "relaxed_holds", reference=reference, wearer=wearer, **how)


def mvc_trial(rig: KneeMachine, name: str, subject: KneeSubject, faults: Faults = NO_FAULTS) -> KneeTrial:
    """Both muscles as hard as they can, against a frame."""
    reference, wearer = np.full(round(MVC_TIME / rig.period), np.radians(60.0)), contracting(subject)
    how = {"start": float(reference[0]), "locked": True, "faults": faults}
    return KneeTrial(name, "mvc", reference=reference, wearer=wearer, **how)


def torque_trial(
    rig: KneeMachine, name: str, subject: KneeSubject, angle: float, *, use: str = "fit", faults: Faults = NO_FAULTS
) -> KneeTrial:
    """An angle [rad] held against torques."""
    wearer, how = counteracting(subject, angle), {"start": angle, "imu": "ankle", "faults": faults}
    return KneeTrial(name, "torque_steps", use, reference=torque_steps(rig), mode="torque", wearer=wearer, **how)


def swing_trial(
    rig: KneeMachine,
    name: str,
    subject: KneeSubject,
    *,
    use: str = "fit",
    duration: float = SWING_TIME,
    frequency: tuple[float, float] | None = None,
    amplitude: tuple[float, float] | None = None,
    faults: Faults = NO_FAULTS,
) -> KneeTrial:
    """A shank that swings freely in zero-impedance mode for a duration [s], as `swinging` says."""
    reference = np.zeros(round(duration / rig.period))
    wearer = swinging(subject, frequency=frequency, amplitude=amplitude)
    how = {"start": rig.constants.swing.centre, "imu": "ankle", "faults": faults}
    return KneeTrial(name, "free_swing", use, reference=reference, mode="torque", wearer=wearer, **how)


def walking_trial(rig: KneeMachine, name: str, subject: KneeSubject, path: np.ndarray) -> KneeTrial:
    """A shank that goes through a path, shape (n,) [rad], a sample a period, in zero-impedance mode."""
    how = {"start": float(path[0]), "imu": "ankle"}
    wearer = following(subject, path)
    return KneeTrial(name, "walking", reference=np.zeros(len(path)), mode="torque", wearer=wearer, **how)


def subject_trials(rig: KneeMachine, subject: KneeSubject) -> list[KneeTrial]:
    """Everything that one subject does."""
    who = subject.name
    made = [imu_trial(rig, f"{who}_imu", who)]
    made += [relaxed_trial(rig, f"{who}_relaxed_{i + 1}", subject) for i in range(TRIALS)]
    made.append(mvc_trial(rig, f"{who}_mvc", subject))
    for angle in ANGLES:
        made += [
            torque_trial(rig, f"{who}_torque_{angle}_{i + 1}", subject, float(np.radians(angle))) for i in range(TRIALS)
        ]
    for i in range(TRIALS):
        use = "validate" if i == TRIALS - 1 else "fit"
        made.append(swing_trial(rig, f"{who}_swing_{i + 1}", subject, use=use))
    return made


def knee_trials(rig: KneeMachine) -> tuple[KneeTrial, ...]:
    """The full protocol: the orthosis alone, then every subject."""
    subjects = rig.subjects.values()
    return (*bench_trials(rig), *(trial for subject in subjects for trial in subject_trials(rig, subject)))
