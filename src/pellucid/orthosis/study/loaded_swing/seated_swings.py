"""Swings of a seated wearer in a passive exoskeleton: envelopes above rest, torque by balance, unrecorded flexors.

The torque follows from the balance of leg and exoskeleton, which was identified in swings that the motor made. The
envelope of a relaxed leg is subtracted in squares, since noise adds to a muscle's signal in squares. The knee's flexors
have no electrode. As in other hybrid models, they are excited in proportion to the flexing torque of the balance.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from ...._errors import IdentificationError
from ....emg.estimators.condition_choice import run_tests_if_candidate
from ....emg.estimators.families import ESTIMATOR_FAMILIES
from ....emg.estimators.torque_map import fit_torque_map
from ....emg.estimators.torque_trial import FIBRE_DAMPING, SEATED_POSTURE_RAD, MuscleSource, TorqueTrial
from ....emg.models.muscle_geometry import muscle_table
from ....emg.signals.emg_chain import EmgChain, emg_chain
from ....emg.study.emg_torque.emg_torque_table import EmgTorqueTable
from ....emg.study.emg_torque.torque_findings import (
    CalibrationFindings,
    TorqueTrace,
    evaluate_on_recording,
    find_applicable_estimators,
)
from ....emg.study.emg_torque.trial_sources import TorqueEvaluation
from ....emg.study.muscle_channels import study_chain
from ....files.recording import Recording
from ....models.estimates import Verdict
from ....study.study import Study
from ...swing.loaded_swing import Swing, SwingFit, swing, worn_exoskeleton_torque
from .identify_loaded_swing import LOADED_PROTOCOL, identify_swings

SWING_PROTOCOL = "seated_swing"
"""Protocol in which a seated wearer swings the leg without torque by the motor."""

MOTION_LOWPASS_HZ = 6.0
"""Cut-off of the low-pass on position and torque [Hz]. Chosen by judgement; no measurement is recorded."""

KEPT_RATE_HZ = 50.0
"""Rate of the samples that are kept [Hz]. Chosen by judgement; no measurement is recorded."""

FLEXOR_MUSCLE = "biceps_femoris"
"""Muscle that stands for all knee flexors behind the thigh."""

FLEXOR_TORQUE_SCALE_NM = 60.0
"""Flexing torque at which their envelope is 1 [N m]. It is only a scale, since their strength is calibrated."""

FITTED_ESTIMATORS = ("hill", "nmco", "nmcoa", "nmnc", "mbp", "ridge", "boost", "motion")
"""Estimators that `calibrate` reports for a study of seated swings."""


@dataclass(frozen=True, eq=False)
class WearerSwings:
    """Converter of a wearer's swings to trials."""

    loaded: SwingFit  # Fitted balance of leg and exoskeleton
    maximal: Recording  # EMG of a maximal contraction
    relaxed: Recording  # EMG of a relaxed leg that the motor swings
    chain: EmgChain
    hip: float = SEATED_POSTURE_RAD["hip"]  # Angle of the hip [rad]

    def motion(self, recording: Recording) -> Swing:
        """Return a swing's position and torque with the same low-pass, thinned."""
        every = max(1, round(recording.fs / KEPT_RATE_HZ))
        r = recording
        return swing(r.time, r["position"], r["torque"], lowpass=MOTION_LOWPASS_HZ, every=every, recording=r.name)

    def trial(self, recording: Recording, *, flexors: bool = True) -> TorqueTrial:
        """Return a swing as a trial for estimators."""
        motion = self.motion(recording)
        torque = worn_exoskeleton_torque(self.loaded, motion).torque
        envelopes = {n: np.interp(motion.time, *e) for n, e in self._envelopes(recording.streams["emg"]).items()}
        if flexors:
            envelopes[FLEXOR_MUSCLE] = np.maximum(-torque, 0.0) / FLEXOR_TORQUE_SCALE_NM
        constants = {n: replace(m, damping=FIBRE_DAMPING) for n, m in muscle_table().constants.items()}
        return TorqueTrial(
            name=recording.name,
            joint="knee",
            time=motion.time,
            envelopes=envelopes,
            angles={"knee": np.interp(motion.time, recording.time, recording["angle.knee"])},
            torque=torque,
            group=recording.trial,
            heldout=recording.use != "fit",
            participant=recording.participant,
            checksum=recording.checksum,
            muscles=MuscleSource(constants, posture={**SEATED_POSTURE_RAD, "hip": self.hip}),
        )

    def _envelopes(self, emg: Recording) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """Return time and envelope of every muscle, relative to the maximal contraction."""
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


def evaluate_seated_swings(study: Study, tell: Callable[[str, float], None]) -> CalibrationFindings:
    """Fit estimators to each person's swings and score them on held-out ones. `study` [emg_torque], [loaded_swing]."""
    found, recordings = CalibrationFindings(), study.recordings()
    tell("legs and exoskeleton", 0.0)
    legs = identify_swings(study.config, recordings).legs
    for i, (who, leg) in enumerate(legs.items()):
        own: Mapping[str, list[Recording]] = {
            protocol: [r for r in recordings if r.participant == who and r.protocol == protocol]
            for protocol in ("mvc", LOADED_PROTOCOL, SWING_PROTOCOL)
        }
        lacking = [protocol for protocol, there in own.items() if not there]
        if lacking:
            raise IdentificationError(
                f"{who}: found no recording of protocol {', '.join(lacking)}, expected one of each: envelopes are "
                "relative to a maximal contraction and to rest"
            )
        table = study.table(EmgTorqueTable)
        session = WearerSwings(
            leg.loaded, own["mvc"][0].streams["emg"], own[LOADED_PROTOCOL][-1].streams["emg"],
            study_chain(study, table) or emg_chain(table.chain),
        )  # fmt: skip
        trials = [session.trial(r) for r in own[SWING_PROTOCOL]]
        _evaluate_person(found, trials, who, lambda text, s, i=i: tell(text, (i + s) / len(legs)))
    found.verdicts.append(
        Verdict(
            "note",
            "The torque is computed from motion: an estimator that sees acceleration can reproduce it without any EMG. "
            "Flexors have no electrode: their excitation follows from the flexing part of that torque.",
        )
    )
    return found


def _evaluate_person(
    found: CalibrationFindings, trials: list[TorqueTrial], who: str, tell: Callable[[str, float], None]
) -> None:
    """Score every estimator on a person's held-out swings and add the findings to `found`."""
    fitted, held = ([t for t in trials if t.heldout == out] for out in (False, True))
    if not fitted or not held:
        raise IdentificationError(
            f"{who}: found {len(fitted)} swings to fit and {len(held)} to validate, expected at least one of each"
        )
    made: dict[str, dict[str, np.ndarray]] = {t.name: {} for t in held}
    half: dict[str, dict[str, np.ndarray]] = {}
    names = find_applicable_estimators(trials, who, found, FITTED_ESTIMATORS)
    for j, name in enumerate(names):
        tell(f"{who}, {ESTIMATOR_FAMILIES[name].description}", j / len(names))
        fit = fit_torque_map(fitted, name)
        shown = ESTIMATOR_FAMILIES[name].shows_muscles
        away = run_tests_if_candidate(fit, fitted)
        if shown:
            found.muscles[who], found.shown[who] = fit, held[0]
        for trial in held:
            torque = made[trial.name][name] = fit.predict(trial)
            width = fit.half_width(trial) if shown else None
            if shown:
                half.setdefault(trial.name, {})[name] = width
            found.evaluated.append(
                evaluate_on_recording(who, name, False, trial.name, trial.torque, torque, fit, away, width)
            )
    for trial in held:
        widths = half.get(trial.name, {})
        found.traces.append(TorqueTrace(who, trial.name, trial.time, trial.torque, made[trial.name], widths))
    found.trials.extend(trials)


SEATED_SWINGS = TorqueEvaluation(SWING_PROTOCOL, "loaded_swing", evaluate_seated_swings)
"""What `calibrate` runs for a study of seated swings."""
