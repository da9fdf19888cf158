"""Muscles of Hill's type as an estimator of torque: calibrated on trials, with an interval on what it predicts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import ndtri

from ... import _core
from ..._errors import IdentificationError
from ..fit.muscle_calibration import MuscleFit, MuscleProblem, MuscleSamples, solve_calibration
from ..fit.muscle_freedom import DEFAULT_QUANTITIES
from ..models.hill import HillModel, HillMuscle
from .cross_validation import Fold, Score, block_folds, grouped_folds, score, weighted_rmse
from .muscle_trials import find_driven_muscles, make_muscle_samples
from .torque_trial import TorqueTrial

ANATOMY_WEIGHT_CANDIDATES = (0.05, 0.02, 0.01, 0.005)
"""Candidate weights of the anatomical prior. Cross-validation within the fitted trials chooses among them."""

BLOCK_COUNT = 5
"""Number of blocks into which a single trial is divided for cross-validation.

Chosen by judgement; no measurement is recorded.
"""

EFFORT_CANDIDATES = np.geomspace(0.02, 1.0, 18)
"""Candidates for the largest effort, as a share of a maximal contraction, if no maximal contraction was recorded."""

FOLD_GAP_S = 0.15
"""Gap between fitted and scored samples in cross-validation [s]. Chosen by judgement; no measurement is recorded."""


@dataclass(frozen=True)
class HillChoice:
    """Result of cross-validation over the weight of the anatomical prior."""

    weight: float  # Chosen weight of the anatomical prior
    words: str  # Description of the muscles and the choice
    score: Score | None  # Score out of fold; None if there was only one candidate
    tried: Mapping[float, float] = field(repr=False)  # RMSE out of fold by weight [N m]


@dataclass(frozen=True, eq=False)
class HillMap:
    """Calibrated muscles that predict a joint's torque."""

    name: str  # Name of the estimator
    muscles: tuple[str, ...]  # Names of the muscles
    choice: HillChoice
    fit: MuscleFit
    # RMSE of predictions out of fold; RMSE of the fit if there was no choice [N m]
    residual_sd: float
    effort: float = 1.0  # Share of a maximal contraction that an envelope of 1 stands for
    causal: bool = False  # Whether angles are filtered from the past alone
    joint: str = ""
    driven: Mapping[str, tuple[str, ...]] = field(default_factory=dict, repr=False)  # EMG channels by muscle

    def predict(self, trial: TorqueTrial) -> np.ndarray:
        """Predict the torque of a trial, shape (n,) [N m]; its measured torque is not used."""
        samples, own = self.samples(trial)
        return self.fit.predict(samples)[own]

    def samples(self, trial: TorqueTrial) -> tuple[MuscleSamples, slice]:
        """Return a trial's samples for these muscles, and the slice in which the trial itself lies."""
        samples, own = make_muscle_samples([trial], muscles=self.muscles, effort=self.effort, causal=self.causal)
        return samples, own[0]

    def half_width(self, trial: TorqueTrial, level: float = 0.95) -> np.ndarray:
        """Return half the interval about the predicted torque, shape (n,) [N m].

        The interval combines the residual's variance and the variance that the parameters' covariance implies.
        """
        from ..fit.muscle_information import covariance

        samples, own = self.samples(trial)
        _, slopes = self.fit.problem.jacobian(self.fit.z, samples)
        unsure = np.einsum("pn,pq,qn->n", slopes, covariance(self.fit), slopes)[own]
        return float(ndtri(0.5 + level / 2.0)) * np.sqrt(self.residual_sd**2 + unsure)

    def stream(self, period: float) -> tuple[_core.HillTorque, tuple[float, float, float]]:
        """Return the core's muscles, which are stepped every `period` [s], and the joint's own tissue.

        The tissue's torque is to be added: offset - stiffness * angle - damping * speed, in this order.
        """
        return _core.HillTorque(np.array([m.vector() for m in self.fit.muscles]), period=period), self.fit.passive


def fit_hill(
    trials: Sequence[TorqueTrial],
    *,
    name: str = "hill",
    causal: bool = False,
    weights: Sequence[float] = ANATOMY_WEIGHT_CANDIDATES,
    quantities: Sequence[str] = DEFAULT_QUANTITIES,
    method: str = "least_squares",
    weighs_trials: bool = True,
) -> HillMap:
    """Calibrate muscles on trials. Cross-validation within them chooses the weight of the anatomical prior.

    Trials are weighed by `find_trial_weights` if `weighs_trials`.
    """
    if not trials or any(trial.heldout for trial in trials):
        found = "no trial" if not trials else f"the held-out trial {next(t.name for t in trials if t.heldout)}"
        raise IdentificationError(f"muscles: found {found}, expected trials to fit")
    muscles = find_driven_muscles(trials)
    names = tuple(m.name for m in muscles)
    samples, own = make_muscle_samples(trials, muscles=names, causal=causal, weighs_trials=weighs_trials)
    effort = 1.0 if trials[0].known_muscles.maximal else estimate_effort(muscles, samples)
    if effort < 1.0:
        samples, own = make_muscle_samples(
            trials, muscles=names, effort=effort, causal=causal, weighs_trials=weighs_trials
        )
    counted = np.flatnonzero(samples.weight > 0.0)
    folds = make_folds(trials, own, samples, counted)
    best: tuple[Score | None, float, float] = (None, weights[0], np.inf)
    tried = {}
    for weight in weights if len(weights) > 1 else ():
        predicted = np.full(len(samples.torque), np.nan)
        for fitted, scored in folds:
            problem = MuscleProblem(muscles, samples.only(fitted), quantities=quantities, weight=weight)
            # One start suffices to see which weight is better.
            predicted[scored] = solve_calibration(problem, starts=1).predict(samples)[scored]
        of_weight = score(samples.torque[counted], predicted[counted])
        tried[weight] = weighted_rmse(samples.torque[counted], predicted[counted], samples.weight[counted])
        if best[0] is None or tried[weight] < best[2]:
            best = of_weight, weight, tried[weight]
    reached, weight, _ = best
    problem = MuscleProblem(muscles, samples, quantities=quantities, weight=weight)
    fit = solve_calibration(problem, method=method)
    words = f"{len(muscles)} muscles, {len(problem.names)} parameters; weight of anatomy {weight:g}"
    missed = reached or score(samples.torque[counted], fit.predict(samples)[counted])
    first = trials[0]
    driven = first.known_muscles.driven(first.joint, first.envelopes)
    choice = HillChoice(weight, words, reached, tried)
    return HillMap(name, names, choice, fit, missed.rmse, effort, causal, first.joint, driven)


def estimate_effort(muscles: Sequence[HillMuscle], samples: MuscleSamples) -> float:
    """Estimate the share of a maximal contraction that an envelope of 1 stands for.

    The best of `EFFORT_CANDIDATES` makes the active torque of the muscles, without passive forces, most like the
    reference.
    """
    model, counted = HillModel([replace(m, passive_scale=0.0) for m in muscles]), samples.weight > 0.0
    spread = np.std(samples.torque, axis=-1, keepdims=True)
    errors = [
        float(np.sum((samples.weight * ((model.torque(scaled) - samples.torque) / spread) ** 2)[counted]))
        for scaled in (replace(samples.data, excitation=e * samples.data.excitation) for e in EFFORT_CANDIDATES)
    ]
    return float(EFFORT_CANDIDATES[int(np.argmin(errors))])


def make_folds(
    trials: Sequence[TorqueTrial], own: Sequence[slice], samples: MuscleSamples, counted: np.ndarray
) -> list[Fold]:
    """Return folds of the `counted` samples: by group, by trial if there is one group, or by blocks of a single trial.

    `own` is the slice of each trial in `samples`.
    """
    member = np.full(samples.torque.shape[-1], -1)
    for i, part in enumerate(own):
        member[part] = i
    groups = np.array([trial.group for trial in trials])[member[counted]]
    if len(set(groups.tolist())) > 1:
        folds = grouped_folds(groups)
    elif len(trials) > 1:
        folds = grouped_folds(member[counted])
    else:
        folds = block_folds(trials[0].time[counted - own[0].start], BLOCK_COUNT, FOLD_GAP_S)
    return [(counted[fitted], counted[scored]) for fitted, scored in folds]
