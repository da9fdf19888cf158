"""Score estimators on trials left out in turn: recordings with moments, or repetitions of leg extensions."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...._errors import IdentificationError
from ....models.estimates import Verdict
from ....study.study import Study
from ...estimators.condition_choice import ERROR_BAND
from ...estimators.cross_validation import Score
from ...estimators.families import ESTIMATOR_FAMILIES
from ...estimators.torque_map import cross_validate_torque_maps, fit_torque_map
from ...estimators.torque_trial import TorqueTrial
from ..muscle_channels import mains_verdicts
from .emg_torque_table import EmgTorqueTable
from .relative_envelopes import normalisation_words
from .study_muscles import ignored_channel_verdicts
from .torque_findings import (
    CalibrationFindings,
    EstimatorEvaluation,
    TorqueTrace,
    find_applicable_estimators,
    recommend_by_fold,
    run_tests_if_candidate,
)
from .trial_sources import EXTENSION_PROTOCOL, leg_extension_trials, moment_trials

Progress = Callable[[str, float], None]
"""Function that is told what is done now and the share of all work that is done."""


def leave_out_recordings(study: Study, tell: Progress) -> CalibrationFindings:
    """Predict each recording with moments by estimators fitted to the others. `study` [emg_torque]."""
    found, joints = CalibrationFindings(), study.table(EmgTorqueTable).joints
    found.verdicts.append(Verdict("note", normalisation_words(study)))
    found.verdicts.extend((*ignored_channel_verdicts(study), *mains_verdicts(study, study.table(EmgTorqueTable))))
    for i, joint in enumerate(joints):
        found.across[joint] = moment_trials(study, joint)
        _evaluate_trials(found, found.across[joint], joint, "trials", 1.0, _part_progress(tell, i, len(joints)))
    return found


def leave_out_repetitions(study: Study, tell: Progress) -> CalibrationFindings:
    """Predict each repetition of leg extensions by estimators fitted to the same person's others.

    `study` [emg_torque].
    """
    found = CalibrationFindings()
    people = list(dict.fromkeys(r.participant for r in study.recordings() if r.protocol == EXTENSION_PROTOCOL))
    for i, person in enumerate(people):
        trials, weight = leg_extension_trials(study, person)
        _evaluate_trials(found, trials, person or "knee", "normalised", weight, _part_progress(tell, i, len(people)))
    found.verdicts.append(
        Verdict(
            "warning",
            "No torque was recorded: the reference is a formula in the angle and its acceleration, most of it the sine "
            "of the angle. Any regression on the angle reproduces that formula, without EMG too; its small error is no "
            "evidence about EMG. Compare estimators with muscles among each other.",
        )
    )
    if any(t.muscles is not None and not t.muscles.maximal for t in found.trials):
        found.verdicts.append(
            Verdict(
                "warning",
                "No maximal contraction was recorded (protocol mvc): envelopes are relative to the largest effort "
                "seen, whose share of a maximal one is estimated together with the muscles. Strengths are then not "
                "strengths of muscles.",
            )
        )
    return found


def _evaluate_trials(
    found: CalibrationFindings, trials: list[TorqueTrial], what: str, kind: str, unit: float, tell: Progress
) -> None:
    """Score every estimator on trials left out in turn; `unit` [N m] divides RMSE. Findings are added to `found`."""
    if len(trials) < 3:
        raise IdentificationError(
            f"{what}: found {len(trials)} trials ({', '.join(t.name for t in trials)}), expected at least three, each "
            "to be left out in turn"
        )
    names = find_applicable_estimators(trials, what, found)
    results = cross_validate_torque_maps(
        trials, names, on_progress=lambda text, share: tell(f"{what}, {text}", share), examine=run_tests_if_candidate
    )
    own = []
    for name, result in results.items():
        # Trials have equal weight, however long they are.
        every = {t: Score(s.rmse / unit, s.r2) for t, s in result.by_trial.items()}
        score = Score(float(np.mean([s.rmse for s in every.values()])), result.score.r2)
        words = " / ".join(dict.fromkeys(choice.words for choice in result.choices))
        own.append(
            EstimatorEvaluation(
                what, name, False, "", score, None, words, kind=kind, by_trial=every, torque_unit=trials[0].unit
            )
        )  # fmt: skip
    found.evaluated.extend(own)
    found.chosen[what] = recommend_by_fold(trials, results, own)
    # The recommended estimator's worst trial is drawn with its band.
    chosen = found.chosen[what]
    worst = max(trials, key=lambda t: chosen.judged[0].by_trial[t.name].rmse)
    made = {name: result.predicted[worst.name] for name, result in results.items()}
    band = {chosen.by[worst.name]: np.full(len(worst), chosen.half_width[worst.name])}
    found.traces.append(TorqueTrace(what, worst.name, worst.time, worst.torque, made, band, ERROR_BAND.share))
    found.trials.extend(trials)
    if any(ESTIMATOR_FAMILIES[name].fit_trials is not None for name in names):
        found.muscles[what], found.shown[what] = fit_torque_map(trials, "hill"), worst


def _part_progress(tell: Progress, i: int, count: int) -> Progress:
    """Return a progress function for part `i` of `count`."""
    return lambda text, share: tell(text, (i + share) / count)
