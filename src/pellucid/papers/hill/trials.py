"""One subject of the virtual shank exoskeleton: recordings made ready for the paper's three steps, and the truth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from ...estimators.torque_trial import TorqueTrial
from ...fit.swing.loaded_swing import Swing, SwingFit
from ...lab.seated.muscles import DriveMap
from ...lab.seated.protocol import SeatedTrial
from ...lab.seated.rig import SeatedRig
from ...lab.seated.subject import SeatedSubject
from ...lab.seated.trial import SeatedTruth
from ...lab.study import record_in_memory
from ...procedures.emg_torque.seated_swings import WearerSwings
from ...procedures.loaded_swing.identify_loaded_swing import prepared
from ...recordings.recording import Recording
from ...signals.emg_chain import emg_chain

DRIVEN_LOWPASS = 4.0
"""Of swings that the motor makes [Hz]."""


@dataclass(frozen=True, eq=False)
class SubjectTaken:
    """A subject's session."""

    subject: SeatedSubject
    recordings: Mapping[str, Recording] = field(repr=False)  # By what was done: two_sines, rich, mvc, swing_1, swing_2
    truth: Mapping[str, SeatedTruth] = field(repr=False)
    knee: float  # knee, hip: As written down [rad].
    hip: float

    def driven(self, what: str) -> Swing:
        """A swing that the motor made."""
        return driven_swing(self.recordings[what])


def take_subject(rig: SeatedRig, made: list[SeatedTrial], subject: SeatedSubject, seed: int) -> SubjectTaken:
    """Do a subject's trials."""
    own = [t for t in made if t.subject is not None and t.subject.name == subject.name]
    recordings, truth, knee, hip = {}, {}, 0.0, 0.0
    _, recorded, taken = record_in_memory(rig, own, seed=seed)
    for recording, one in zip(recorded, taken, strict=True):
        what = recording.name.removeprefix(f"{subject.name}_")
        recordings[what], truth[what] = recording, one.inside.truth
        knee, hip = one.inside.knee, one.inside.hip
    return SubjectTaken(subject, recordings, truth, knee, hip)


def driven_swing(recording: Recording) -> Swing:
    """A swing that the motor made, with a leg in it or without."""
    return prepared(recording, DRIVEN_LOWPASS)


def tissue_torque(subject: SeatedSubject, position: np.ndarray) -> np.ndarray:
    """What a subject's muscles pull at no excitation, shape (n,) [N m], at positions from hanging [rad]."""
    knee = subject.rest + position
    extending, bending = (DriveMap(g, subject.hip, subject.rest) for g in (subject.extensors, subject.flexors))
    return extending.passive(knee) - bending.passive(knee)


@dataclass(frozen=True, eq=False)
class ActiveSwing:
    """A swing that the subject made, and what is true of it."""

    trial: TorqueTrial  # Its torque is what balance says: leg and exoskeleton, less the motor
    motion: Swing
    # active, muscles: (n,) True torque of muscles beyond what they pull relaxed, and of all that they pull [N m].
    active: np.ndarray = field(repr=False)
    muscles: np.ndarray = field(repr=False)


def active_swing(taken: SubjectTaken, what: str, loaded: SwingFit, *, flexors: bool) -> ActiveSwing:
    """Envelopes, angle and reference torque of a swing."""
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
