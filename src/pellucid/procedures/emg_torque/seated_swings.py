"""Swings of a seated wearer in a passive exoskeleton: envelopes above rest, torque by balance, unrecorded flexors.

The torque is that of the balance of leg and exoskeleton, as swings that the motor made tell it. What a relaxed leg's
electrodes show is taken off envelopes in squares, as noise adds to a muscle's signal. Nobody records what bends the
knee: as in other hybrid models flexors are excited so that the balance can be, wherever it asks for bending.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from .procedure import EmgTorqueTable
from ..._errors import IdentificationError
from ...estimators.cross_validation import score
from ...estimators.families import ESTIMATOR_FAMILIES
from ...estimators.hill import HillMap
from ...estimators.muscle_source import FIBRE_DAMPING, SEATED_POSTURE_RAD, MuscleSource
from ...estimators.torque_map import fit_torque_map
from ...estimators.torque_trial import TorqueTrial
from ...fit.parameter import Verdict
from ...fit.swing.leg_balance import worn_exoskeleton_torque
from ...fit.swing.loaded_swing import Swing, SwingFit, swing
from ...models.muscle_geometry import muscle_table
from ...recordings.recording import Recording
from ...recordings.study import Study
from ...signals.emg_chain import EmgChain, emg_chain
from ..loaded_swing.identify_loaded_swing import LOADED, identify_swings
from .chosen import examined_if_candidate
from .evaluated import Calibrated, Evaluated, TorqueTrace, estimators_for
from .muscle_findings import partial_errors

SWINGS = "seated_swing"
"""Protocol in which a seated wearer swings the leg, and the motor gives nothing."""

LOWPASS, KEPT_RATE = 6.0, 50.0
"""Of position and torque, and the rate of samples that are kept [Hz]."""

FLEXORS = "biceps_femoris"
"""What stands for the muscles behind the thigh."""

FLEXOR_TORQUE = 60.0
"""That they pull at most [N m]: only a scale, their strength is calibrated."""

FITTED = ("hill", "nmco", "nmcoa", "nmnc", "mbp", "ridge", "boost", "motion")
"""Estimators that `calibrate` reports of such a study."""


@dataclass(frozen=True, eq=False)
class WearerSwings:
    """What a wearer's swings are made ready with."""

    loaded: SwingFit  # Of leg and exoskeleton
    maximal: Recording  # maximal, relaxed: EMG of a maximal contraction, and of a leg that the motor swings
    relaxed: Recording
    chain: EmgChain
    hip: float = SEATED_POSTURE_RAD["hip"]  # Angle of the hip [rad]

    def motion(self, recording: Recording) -> Swing:
        """A swing's position and torque, low-passed alike and thinned."""
        every = max(1, round(recording.fs / KEPT_RATE))
        r = recording
        return swing(r.time, r["position"], r["torque"], lowpass=LOWPASS, every=every, recording=r.name)

    def trial(self, recording: Recording, *, flexors: bool = True) -> TorqueTrial:
        """A swing as estimators see it."""
        motion = self.motion(recording)
        torque = worn_exoskeleton_torque(self.loaded, motion).torque
        envelopes = {n: np.interp(motion.time, *e) for n, e in self._envelopes(recording.streams["emg"]).items()}
        if flexors:
            envelopes[FLEXORS] = np.maximum(-torque, 0.0) / FLEXOR_TORQUE
        constants = {n: replace(m, damping=FIBRE_DAMPING) for n, m in muscle_table().constants.items()}
        return TorqueTrial(
            name=recording.name,
            joint="knee",
            time=motion.time,
            envelopes=envelopes,
            angles={"knee": np.interp(motion.time, recording.time, recording["angle.knee"])},
            torque=torque,
            group=recording.name,
            heldout=recording.use != "fit",
            participant=recording.participant,
            checksum=recording.checksum,
            muscles=MuscleSource(constants, posture={**SEATED_POSTURE_RAD, "hip": self.hip}),
        )

    def _envelopes(self, emg: Recording) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """Time and envelope of every muscle, relative to the maximal contraction."""
        made = {}
        for channel in emg.channels:
            if not channel.startswith("emg."):
                continue
            top, rest, shown = (
                self.chain.zero_phase(x[channel], x.fs, maximum=1.0) for x in (self.maximal, self.relaxed, emg)
            )
            above = np.maximum(np.maximum(shown, 0.0) ** 2 - np.median(rest) ** 2, 0.0)
            made[channel.removeprefix("emg.")] = emg.time, np.sqrt(above) / top.max()
        return made


def seated_swings(study: Study, tell: Callable[[str, float], None]) -> Calibrated:
    """Estimators fitted to each person's swings and judged on those held out. `study` [emg_torque], [loaded_swing]."""
    found, recordings = Calibrated(), study.recordings()
    tell("legs and exoskeleton", 0.0)
    legs = identify_swings(study.config, recordings).legs
    for i, (who, leg) in enumerate(legs.items()):
        own: Mapping[str, list[Recording]] = {
            protocol: [r for r in recordings if r.participant == who and r.protocol == protocol]
            for protocol in ("mvc", LOADED, SWINGS)
        }
        lacking = [protocol for protocol, there in own.items() if not there]
        if lacking:
            raise IdentificationError(
                f"{who}: found no recording of protocol {', '.join(lacking)}, expected one of each: envelopes are "
                "relative to a maximal contraction and to rest"
            )
        session = WearerSwings(
            leg.loaded, own["mvc"][0].streams["emg"], own[LOADED][-1].streams["emg"],
            emg_chain(study.table(EmgTorqueTable).chain, study.table(EmgTorqueTable).mains),
        )  # fmt: skip
        trials = [session.trial(r) for r in own[SWINGS]]
        _judge(found, trials, who, lambda text, s, i=i: tell(text, (i + s) / len(legs)))
    found.verdicts.append(
        Verdict(
            "note",
            "The torque is computed from motion: who sees acceleration finds it again without any EMG. Flexors have no "
            "electrode and are excited as the balance asks.",
        )
    )
    return found


def _judge(found: Calibrated, trials: list[TorqueTrial], who: str, tell: Callable[[str, float], None]) -> None:
    fitted, held = ([t for t in trials if t.heldout == out] for out in (False, True))
    if not fitted or not held:
        raise IdentificationError(
            f"{who}: found {len(fitted)} swings to fit and {len(held)} to judge, expected at least one of each"
        )
    made, half = {t.name: {} for t in held}, {}
    names = estimators_for(trials, who, found, FITTED)
    for j, name in enumerate(names):
        tell(f"{who}, {ESTIMATOR_FAMILIES[name].description}", j / len(names))
        fit = fit_torque_map(fitted, name)
        muscles, away = isinstance(fit, HillMap), examined_if_candidate(fit, fitted)
        if name == "hill":
            found.muscles[who], found.shown[who] = fit, held[0]
        for trial in held:
            torque = made[trial.name][name] = fit.predict(trial)
            if name == "hill":
                half[trial.name] = fit.half_width(trial)
            inside = np.abs(trial.torque - torque) <= half[trial.name] if name == "hill" else None
            found.evaluated.append(
                Evaluated(
                    who, name, False, trial.name, score(trial.torque, torque), fit.choice.score, fit.choice.words,
                    examined=away,
                    seconds=fit.fit.seconds if muscles else None,
                    coverage=None if inside is None else float(np.mean(inside)),
                    held=None if away is None else float(np.mean(np.abs(trial.torque - torque) <= away.half_width)),
                    partial=partial_errors(trial.torque, torque) if muscles else (),
                )
            )  # fmt: skip
    for trial in held:
        widths = {"hill": half[trial.name]} if trial.name in half else {}
        found.traces.append(TorqueTrace(who, trial.name, trial.time, trial.torque, made[trial.name], widths))
    found.trials.extend(trials)
