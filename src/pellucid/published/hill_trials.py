"""One subject of the virtual shank exoskeleton: recordings made ready for the paper's three steps, and the truth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from ..estimators.muscle_source import FIBRE_DAMPING, MuscleSource
from ..estimators.torque_trial import TorqueTrial
from ..identification.leg_balance import torque_in_a_worn_exoskeleton
from ..identification.loaded_swing import Swing, SwingFit, swing
from ..lab.seated_muscles import DriveMap
from ..lab.seated_protocol import SeatedTrial
from ..lab.seated_rig import SeatedRig
from ..lab.seated_study import record_seated, seated_recording
from ..lab.seated_subject import SeatedSubject
from ..lab.seated_trial import SeatedTruth
from ..models.muscle_geometry import muscle_table
from ..recordings.recording import Recording
from ..signals.emg_chain import emg_chain

DRIVEN_LOWPASS, DRIVEN_EVERY = 4.0, 20
"""Of swings that the motor makes [Hz], and one kept sample in so many."""

ACTIVE_LOWPASS, ACTIVE_EVERY = 6.0, 10
"""Of swings that the subject makes [Hz], and one kept sample in so many: 50 a second."""

FLEXORS = "biceps_femoris"
"""What stands for the muscles behind the thigh that no electrode is on."""

FLEXOR_TORQUE = 60.0
"""That they pull at most [N m]: only a scale, their strength is calibrated."""


@dataclass(frozen=True, eq=False)
class SubjectTaken:
    """A subject's session.

    Attributes
    ----------
    subject : SeatedSubject
    recordings : mapping of str to Recording
        By what was done: two_sines, rich, mvc, swing_1, swing_2.
    truth : mapping of str to SeatedTruth
    knee, hip : float
        As written down [rad].
    """

    subject: SeatedSubject
    recordings: Mapping[str, Recording] = field(repr=False)
    truth: Mapping[str, SeatedTruth] = field(repr=False)
    knee: float
    hip: float

    def driven(self, what: str) -> Swing:
        """A swing that the motor made."""
        return driven_swing(self.recordings[what])

    def active(self, what: str) -> Swing:
        """A swing that the subject made."""
        return _swing(self.recordings[what], ACTIVE_LOWPASS, ACTIVE_EVERY)


def take_subject(rig: SeatedRig, made: list[SeatedTrial], subject: SeatedSubject, seed: int) -> SubjectTaken:
    """Do a subject's trials.

    Parameters
    ----------
    rig : SeatedRig
    made : list of SeatedTrial
        Of everybody.
    subject : SeatedSubject
    seed : int

    Returns
    -------
    SubjectTaken
    """
    own = [t for t in made if t.subject is not None and t.subject.name == subject.name]
    recordings, truth, knee, hip = {}, {}, 0.0, 0.0
    for taken in record_seated(rig, own, seed):
        what = taken.trial.name.removeprefix(f"{subject.name}_")
        recordings[what], truth[what] = seated_recording(rig, taken), taken.truth
        knee, hip = taken.knee, taken.hip
    return SubjectTaken(subject, recordings, truth, knee, hip)


def driven_swing(recording: Recording) -> Swing:
    """A swing that the motor made, with a leg in it or without."""
    return _swing(recording, DRIVEN_LOWPASS, DRIVEN_EVERY)


def _swing(recording: Recording, lowpass: float, every: int) -> Swing:
    r = recording
    return swing(r.time, r["position"], r["torque"], lowpass=lowpass, every=every, recording=r.name)


def tissue_torque(subject: SeatedSubject, position: np.ndarray) -> np.ndarray:
    """What a subject's muscles pull at no excitation, shape (n,) [N m], at positions from hanging [rad]."""
    knee = subject.rest + position
    extending, bending = (DriveMap(g, subject.hip, subject.rest) for g in (subject.extensors, subject.flexors))
    return extending.passive(knee) - bending.passive(knee)


@dataclass(frozen=True, eq=False)
class ActiveSwing:
    """A swing that the subject made, and what is true of it.

    Attributes
    ----------
    trial : TorqueTrial
        Its torque is what balance says: leg and exoskeleton, less the motor.
    motion : Swing
    active, muscles : ndarray, shape (n,)
        True torque of muscles beyond what they pull relaxed, and of all that they pull [N m].
    """

    trial: TorqueTrial
    motion: Swing
    active: np.ndarray = field(repr=False)
    muscles: np.ndarray = field(repr=False)


def active_swing(taken: SubjectTaken, what: str, loaded: SwingFit, *, flexors: bool) -> ActiveSwing:
    """Envelopes, angle and reference torque of a swing.

    Envelopes pass the paper's chain; what a relaxed leg's electrodes show is taken off in squares, as noise adds to a
    muscle's signal. Flexors have no electrode: as in other hybrid models they are excited so that the leg's balance can
    be, wherever it asks for bending.

    Parameters
    ----------
    taken : SubjectTaken
    what : str
        swing_1 or swing_2.
    loaded : SwingFit
        Of leg and exoskeleton.
    flexors : bool
        Whether there are flexors.

    Returns
    -------
    ActiveSwing
    """
    recording, motion, chain = taken.recordings[what], taken.active(what), emg_chain("hill")
    time, torque = motion.time, torque_in_a_worn_exoskeleton(loaded, motion).torque
    mvc, rest, own = (taken.recordings[name].streams["emg"] for name in ("mvc", "rich", what))
    envelopes = {}
    for channel in own.channels:
        if not channel.startswith("emg."):
            continue
        top, quiet = (chain.zero_phase(x[channel], x.fs, maximum=1.0) for x in (mvc, rest))
        floor, shown = np.median(quiet), chain.zero_phase(own[channel], own.fs, maximum=1.0)
        above = np.sqrt(np.maximum(np.maximum(shown, 0.0) ** 2 - floor**2, 0.0)) / top.max()
        envelopes[channel.removeprefix("emg.")] = np.interp(time, own.time, above)
    if flexors:
        envelopes[FLEXORS] = np.maximum(-torque, 0.0) / FLEXOR_TORQUE
    constants = {n: replace(m, damping=FIBRE_DAMPING) for n, m in muscle_table().constants.items()}
    knee = np.interp(time, recording.time, recording["angle.knee"])
    trial = TorqueTrial(
        name=recording.name, joint="knee", time=time, envelopes=envelopes, angles={"knee": knee}, torque=torque,
        group=recording.name, heldout=recording.use != "fit", participant=taken.subject.name,
        checksum=recording.checksum, muscles=MuscleSource(constants, posture={"hip": taken.hip, "ankle": 0.0}),
    )  # fmt: skip
    truth = taken.truth[what]
    active = truth.muscle_torque - tissue_torque(taken.subject, truth.position)
    return ActiveSwing(
        trial, motion, np.interp(time, recording.time, active), np.interp(time, recording.time, truth.muscle_torque)
    )
