"""One subject of the virtual shank exoskeleton: recordings prepared for the paper's three steps, and the truth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from pellucid.emg.estimators.torque_trial import TorqueTrial
from pellucid.emg.signals.emg_chain import emg_chain
from pellucid.files.recording import Recording
from pellucid.orthosis.study.loaded_swing.identify_loaded_swing import prepared
from pellucid.orthosis.study.loaded_swing.seated_swings import WearerSwings
from pellucid.orthosis.swing.loaded_swing import Swing, SwingFit

from ...seated.muscles import DriveMap
from ...seated.protocol import SeatedTrial
from ...seated.rig import SeatedRig
from ...seated.subject import SeatedSubject
from ...seated.trial import SeatedTruth
from ...study import record_in_memory

DRIVEN_LOWPASS_HZ = 4.0
"""Swings that the motor makes pass this zero-phase low-pass."""


@dataclass(frozen=True, eq=False)
class SubjectSession:
    """A subject's session."""

    subject: SeatedSubject
    # Recordings by trial: two_sines, rich, mvc, swing_1, swing_2
    recordings: Mapping[str, Recording] = field(repr=False)
    truth: Mapping[str, SeatedTruth] = field(repr=False)  # Simulated truth by trial
    knee: float  # Angle of the knee as noted in the session [rad]
    hip: float  # Angle of the hip as noted in the session [rad]

    def driven(self, what: str) -> Swing:
        """Return a swing that the motor made, "two_sines" or "rich"."""
        return driven_swing(self.recordings[what])


def take_subject(rig: SeatedRig, made: list[SeatedTrial], subject: SeatedSubject, seed: int) -> SubjectSession:
    """Simulate and record a subject's trials."""
    own = [t for t in made if t.subject is not None and t.subject.name == subject.name]
    recordings, truth, knee, hip = {}, {}, 0.0, 0.0
    _, recorded, taken = record_in_memory(rig, own, seed=seed)
    for recording, one in zip(recorded, taken, strict=True):
        what = recording.name.removeprefix(f"{subject.name}_")
        recordings[what], truth[what] = recording, one.inside.truth
        knee, hip = one.inside.knee, one.inside.hip
    return SubjectSession(subject, recordings, truth, knee, hip)


def driven_swing(recording: Recording) -> Swing:
    """Return the low-passed swing of a recording in which the motor moved, with a leg or without."""
    return prepared(recording, DRIVEN_LOWPASS_HZ)


def tissue_torque(subject: SeatedSubject, position: np.ndarray) -> np.ndarray:
    """Return the torque of a subject's relaxed muscles, shape (n,) [N m], at positions from hanging [rad]."""
    knee = subject.rest + position
    extending, bending = (DriveMap(g, subject.hip, subject.rest) for g in (subject.extensors, subject.flexors))
    return extending.passive(knee) - bending.passive(knee)


@dataclass(frozen=True, eq=False)
class ActiveSwing:
    """A swing that the subject made, with its true torques."""

    trial: TorqueTrial  # Its torque is that of leg and exoskeleton by their equation of motion, less the motor's
    motion: Swing
    active: np.ndarray = field(repr=False)  # (n,) True torque of the muscles less their torque at rest [N m]
    muscles: np.ndarray = field(repr=False)  # (n,) True torque of the muscles [N m]


def active_swing(taken: SubjectSession, what: str, loaded: SwingFit, *, flexors: bool) -> ActiveSwing:
    """Return a swing with envelopes, angle and reference torque; `flexors` adds the flexors' by balance."""
    emg = {name: taken.recordings[name].streams["emg"] for name in ("mvc", "rich")}
    session = WearerSwings(loaded, emg["mvc"], emg["rich"], emg_chain("hill"), taken.hip)
    recording, truth = taken.recordings[what], taken.truth[what]
    motion = session.motion(recording)
    active = truth.muscle_torque - tissue_torque(taken.subject, truth.position)
    return ActiveSwing(
        session.trial(recording, flexors=flexors),
        motion,
        np.interp(motion.time, recording.time, active),
        np.interp(motion.time, recording.time, truth.muscle_torque),
    )
