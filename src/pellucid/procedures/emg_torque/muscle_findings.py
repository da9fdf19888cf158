"""What calibration says of muscles: parameters with intervals, cards, verdicts, and errors in parts of a torque."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version

import numpy as np

from ...estimators.hill import HillMap
from ...estimators.torque_trial import TorqueTrial
from ...fit.muscles.muscle_information import (
    covariance,
    muscle_parameters,
    muscle_verdicts,
    reported_covariance,
)
from ...fit.parameter import Verdict
from ...models.muscle_card import CARD_KIND, CalibratedMuscles
from ...models.parameter_card import ParameterCard
from ...recordings.study import Study
from ..result import ParameterTable
from .evaluated import Calibrated

SHOWN = 3.0
"""Of a trial in figures of muscles [s]."""


@dataclass(frozen=True)
class MuscleSummary:
    """Calibrated muscles of a joint or person, as figures draw them."""

    what: str  # Joint, or participant
    parameters: tuple[str, ...]
    # deviation, half_width: From anatomy, and half of the 95 % interval, in standard deviations among people
    deviation: tuple[float, ...]
    half_width: tuple[float, ...]
    at_bound: tuple[bool, ...]
    muscles: tuple[str, ...]
    recording: str  # Of which a stretch follows
    time: tuple[float, ...]  # [s]
    activation: tuple[tuple[float, ...], ...]  # A row per muscle [1]
    torque: tuple[tuple[float, ...], ...]  # What each muscle gives the joint, a row per muscle [N m]


def partial_errors(reference: np.ndarray, predicted: np.ndarray) -> tuple[float, float]:
    """RMSE where the reference pulls along its main direction, and of both torques cut off at 0.

    Cut off, half of a movement is 0 on both sides and errs by nothing: the second is up to sqrt(2) below the first.

    `reference`, `predicted` (n,) [N m]; gives `positive`, `truncated` [N m].
    """
    main = 1.0 if reference.max() >= -reference.min() else -1.0
    a, b = main * reference, main * predicted
    positive = float(np.sqrt(np.mean((a - b)[a > 0.0] ** 2)))
    return positive, float(np.sqrt(np.mean((np.maximum(a, 0.0) - np.maximum(b, 0.0)) ** 2)))


def muscle_tables(muscles: Mapping[str, HillMap]) -> tuple[ParameterTable, ...]:
    """Parameters of each joint's or person's muscles."""
    return tuple(ParameterTable(f"Muscles: {what}", muscle_parameters(found.fit)) for what, found in muscles.items())


def muscle_cards(
    study: Study, muscles: Mapping[str, HillMap], trials: Sequence[TorqueTrial]
) -> dict[str, ParameterCard]:
    """Cards of calibrated muscles, with their covariance in the parameters' units."""
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
                **{f"delay.{m}": float(late) for m, late in zip(found.muscles, delays(found), strict=True)},
            },
            processing="factors of the anatomical model's strength, tendon slack length and optimal fibre length; "
            + found.choice.words,
            checksums={trial.name: trial.checksum for trial in trials if not trial.heldout},
            pellucid=version("pellucid"),
        )
    return cards


def muscle_summaries(found: Calibrated) -> tuple[MuscleSummary, ...]:
    """What figures of calibrated muscles need."""
    made = []
    for what, fitted in found.muscles.items():
        trial = found.shown[what]
        samples, own = fitted.samples(trial)
        states = fitted.fit.problem.model.states(
            samples.data, fitted.fit.problem.values(fitted.fit.z)[: len(fitted.fit.problem.priors)]
        )
        shown = slice(own.start, min(own.stop, own.start + round(SHOWN * trial.fs)))
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


def delays(found: HillMap) -> np.ndarray:
    """How late each muscle's activation follows slow envelopes, delay and lags together, shape (m,) [s]."""
    estimator, _ = found.stream(found.fit.problem.samples.data.period)
    return np.asarray(estimator.delays)


def muscle_verdicts_of(found: Calibrated) -> tuple[Verdict, ...]:
    """What recordings say of muscles, how late they run, whether intervals hold, and why some were passed over."""
    said: list[Verdict] = list(found.verdicts)
    for what, fitted in found.muscles.items():
        said += muscle_verdicts(fitted.fit, what)
        late = 1e3 * delays(fitted)
        said.append(
            Verdict(
                "note",
                f"{what}, muscles: activation follows its envelope by {late.min():.0f} to {late.max():.0f} ms, delay "
                "and lags together; run causally, the angles' rates come 19 ms late on top.",
            )
        )
        said += _against_regression(found, what)
    for each in found.evaluated:
        if each.coverage is not None and not each.causal:
            kind = "good" if each.coverage >= 0.9 else "warning"
            where = each.recording.replace("_", " ") or "each trial left out in turn"
            said.append(
                Verdict(
                    kind,
                    f"{each.what}, muscles: {100.0 * each.coverage:.0f} % of the torque in {where} lies within the "
                    "95 % interval that was stated beforehand.",
                )
            )
    said += [Verdict("note", f"{what}: muscles were passed over: {why}.") for what, why in found.passed_over.items()]
    return tuple(said)


def _against_regression(found: Calibrated, what: str) -> list[Verdict]:
    """Muscles beside the regressions that see the same, on what was judged first."""
    own = [e for e in found.evaluated if e.what == what and not e.causal]
    own = [e for e in own if e.recording == own[0].recording] if own else []
    by = {e.estimator: e for e in own}
    if "hill" not in by or "ridge" not in by or by["hill"].kind == "normalised":
        return []
    muscles = by["hill"]
    best = min((by[n] for n in ("ridge", "ridge_lags") if n in by), key=lambda e: e.score.rmse)
    ahead = muscles.score.rmse < best.score.rmse
    end = (
        "physics helps here."
        if ahead
        else "it sees the same movement again; in movements unlike those fitted it may not hold."
    )
    return [
        Verdict(
            "good" if ahead else "note",
            f"{what}: muscles err by {muscles.score.rmse:.3g} {muscles.unit}, regression by {best.score.rmse:.3g}: "
            + end,
        )
    ]
