"""Findings on calibrated muscles: parameters with intervals, cards, verdicts, and errors in parts of a torque."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version

import numpy as np

from ....models.parameter import Verdict
from ....models.parameter_card import ParameterCard
from ....study.procedures.result import ParameterTable
from ....study.study import Study
from ...estimators.families import ESTIMATOR_FAMILIES
from ...estimators.hill import HillMap
from ...estimators.torque_trial import TorqueTrial
from ...fit.coupled_priors import MAX_TOTAL_DELAY_S, MIN_TOTAL_DELAY_S
from ...fit.muscle_information import (
    covariance,
    muscle_parameters,
    muscle_verdicts,
    reported_covariance,
)
from ...models.muscle_card import CARD_KIND, CalibratedMuscles
from .calibration_findings import CalibrationFindings

DRAWN_STRETCH_S = 3.0
"""Duration of the stretch of a trial in figures of muscles [s]."""

DELAY_TOLERANCE_S = 5e-3
"""An electromechanical delay counts as longer than a person's only if it exceeds the longest by more than this [s]."""



@dataclass(frozen=True)
class MuscleSummary:
    """Calibrated muscles of a joint or person, with the data for their figures."""

    what: str  # Joint or participant
    parameters: tuple[str, ...]  # Names of the parameters
    deviation: tuple[float, ...]  # Departure of each parameter from anatomy, in standard deviations among people
    half_width: tuple[float, ...]  # Half of each parameter's 95 % interval, in standard deviations among people
    at_bound: tuple[bool, ...]  # Whether each parameter ended on a bound
    muscles: tuple[str, ...]  # Names of the muscles
    recording: str  # Recording of the drawn stretch
    time: tuple[float, ...]  # Time in the stretch [s]
    activation: tuple[tuple[float, ...], ...]  # Activation in the stretch, a row per muscle [1]
    torque: tuple[tuple[float, ...], ...]  # Torque of each muscle on the joint, a row per muscle [N m]


def partial_errors(reference: np.ndarray, predicted: np.ndarray) -> tuple[float, float]:
    """Return RMSE where the reference pulls along its main direction, and RMSE of both torques cut off at 0 [N m].

    In half of a movement both cut torques are 0 and have no error. The second is therefore up to sqrt(2) times smaller
    than the first. `reference` and `predicted` have shape (n,) [N m].
    """
    main = 1.0 if reference.max() >= -reference.min() else -1.0
    a, b = main * reference, main * predicted
    positive = float(np.sqrt(np.mean((a - b)[a > 0.0] ** 2)))
    return positive, float(np.sqrt(np.mean((np.maximum(a, 0.0) - np.maximum(b, 0.0)) ** 2)))


def muscle_tables(muscles: Mapping[str, HillMap]) -> tuple[ParameterTable, ...]:
    """Return a table of the muscles' parameters for each joint or person."""
    return tuple(
        ParameterTable(f"Muscles: {what}", muscle_parameters(found.fit), max_brief_rows=0)
        for what, found in muscles.items()
    )


def muscle_cards(
    study: Study, muscles: Mapping[str, HillMap], trials: Sequence[TorqueTrial]
) -> dict[str, ParameterCard]:
    """Return cards of calibrated muscles, with their covariance in the parameters' units."""
    cards = {}
    for what, found in muscles.items():
        name, tissue = f"muscles_{what}", {found.joint: found.fit.passive}
        whole = CalibratedMuscles(found.fit.muscles, found.driven, tissue, found.effort)
        cards[name] = ParameterCard(
            kind=CARD_KIND,
            study=study.name,
            name=name,
            parameters=tuple(p.on_card(0.95) for p in muscle_parameters(found.fit)),
            covariance=tuple(map(tuple, reported_covariance(found.fit).tolist())),
            settings={
                **whole.settings(),
                "weight": found.choice.weight,
                "residual_sd": found.residual_sd,
                **{f"delay.{m}": float(late) for m, late in zip(found.muscles, activation_delays(found), strict=True)},
            },
            processing="factors of the anatomical model's strength, tendon slack length and optimal fibre length; "
            + found.choice.words,
            checksums={trial.name: trial.checksum for trial in trials if not trial.heldout},
            pellucid=version("pellucid"),
        )
    return cards


def muscle_summaries(found: CalibrationFindings) -> tuple[MuscleSummary, ...]:
    """Return the data for figures of calibrated muscles."""
    made = []
    for what, fitted in found.muscles.items():
        trial = found.shown[what]
        samples, own = fitted.samples(trial)
        states = fitted.fit.problem.model.states(
            samples.data, fitted.fit.problem.values(fitted.fit.z)[: len(fitted.fit.problem.priors)]
        )
        shown = slice(own.start, min(own.stop, own.start + round(DRAWN_STRETCH_S * trial.fs)))
        pull = samples.data.moment_arm * states["force"]
        half = 1.96 * np.sqrt(np.diag(covariance(fitted.fit)))
        made.append(
            MuscleSummary(
                what,
                fitted.fit.problem.names,
                tuple(map(float, fitted.fit.z)),
                tuple(map(float, half)),
                tuple(map(bool, fitted.fit.at_bound)),
                fitted.muscles,
                trial.name,
                tuple(np.round(trial.time[: shown.stop - shown.start], 4).tolist()),
                tuple(map(tuple, np.round(states["activation"][:, shown], 4).tolist())),
                tuple(map(tuple, np.round(pull[:, shown], 3).tolist())),
            )
        )
    return tuple(made)


def activation_delays(found: HillMap) -> np.ndarray:
    """Return the time by which each muscle's activation follows a slow envelope, with all lags, shape (m,) [s]."""
    estimator, _ = found.stream(found.fit.problem.samples.data.period)
    return np.asarray(estimator.delays)


def electromechanical_delay_verdict(what: str, delays: np.ndarray) -> Verdict:
    """Return what the electromechanical delays of a calibration mean.

    A person's lie between 10 and 100 ms. A longer one is not the person's: the EMG's stream runs ahead of the torque.
    `delays` has shape (m,) [s]: from each envelope to its activation, with all lags.
    """
    found = (
        f"{what}, muscles: the electromechanical delay, from envelope to activation with all lags, is "
        f"{1e3 * delays.min():.0f} to {1e3 * delays.max():.0f} ms"
    )
    if delays.max() <= MAX_TOTAL_DELAY_S + DELAY_TOLERANCE_S:
        return Verdict("note", f"{found}; run causally, the angles' rates come 19 ms late on top.")
    return Verdict(
        "warning",
        f"{found}, more than the {1e3 * MIN_TOTAL_DELAY_S:.0f} to {1e3 * MAX_TOTAL_DELAY_S:.0f} ms of people: the "
        "EMG's stream runs ahead of the torque, and these muscles take its offset for a delay of theirs.",
        "Look for a torque that was filtered one way, and for clocks that were joined. Several joints in "
        "[emg_torque] give muscles whose delay is a person's, and the offset beside it.",
    )


def calibrated_muscle_verdicts(found: CalibrationFindings) -> tuple[Verdict, ...]:
    """Return verdicts on calibrated muscles: their delays, the coverage of intervals, and why some were not fitted."""
    verdicts: list[Verdict] = list(found.verdicts)
    for what, fitted in found.muscles.items():
        verdicts += muscle_verdicts(fitted.fit, what)
        verdicts.append(electromechanical_delay_verdict(what, activation_delays(fitted)))
        verdicts += _compare_with_regression(found, what)
    for each in found.evaluated:
        if each.coverage is not None and not each.causal:
            kind = "good" if each.coverage >= 0.9 else "warning"
            where = each.recording.replace("_", " ") or "each trial left out in turn"
            verdicts.append(
                Verdict(
                    kind,
                    f"{each.what}, muscles: {100.0 * each.coverage:.0f} % of the torque in {where} lies within the "
                    "95 % interval that was stated beforehand.",
                )
            )
    verdicts += [Verdict("note", f"{what}: muscles were not fitted: {why}.") for what, why in found.passed_over.items()]
    return tuple(verdicts)


def _compare_with_regression(found: CalibrationFindings, what: str) -> list[Verdict]:
    """Return a verdict that compares muscles with regressions of the same inputs, on the first test recording."""
    own = [e for e in found.evaluated if e.what == what and not e.causal]
    own = [e for e in own if e.recording == own[0].recording] if own else []
    by = {e.estimator: e for e in own}
    muscles = next((by[n] for n, family in ESTIMATOR_FAMILIES.items() if family.shows_muscles and n in by), None)
    rivals = [by[n] for n, family in ESTIMATOR_FAMILIES.items() if family.rivals_muscles and n in by]
    if muscles is None or not rivals or muscles.kind == "normalised":
        return []
    best = min(rivals, key=lambda e: e.score.rmse)
    ahead = muscles.score.rmse < best.score.rmse
    end = (
        "the muscle model helps here."
        if ahead
        else "regression is tested on the fitted kind of movement; in other movements it may not hold."
    )
    return [
        Verdict(
            "good" if ahead else "note",
            f"{what}: muscles err by {muscles.score.rmse:.3g} {muscles.unit}, regression by {best.score.rmse:.3g}: "
            + end,
        )
    ]
