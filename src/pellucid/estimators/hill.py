"""Muscles of Hill's type as an estimator of torque: calibrated on trials, with an interval on what it predicts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import ndtri

from .. import _core
from .._errors import IdentificationError
from ..fit.muscles.muscle_calibration import MuscleFit, MuscleProblem, MuscleSamples, solve_calibration
from ..fit.muscles.muscle_freedom import DEFAULT_QUANTITIES
from ..models.hill import HillModel, HillMuscle
from .cross_validation import Fold, Score, block_folds, grouped_folds, score
from .muscle_trials import driven_muscles, muscle_samples
from .torque_trial import TorqueTrial

WEIGHTS = (0.05, 0.02, 0.01, 0.005)
"""Of anatomy: what cross-validation within what is fitted chooses from."""

BLOCKS = 5
"""Blocks of a single trial."""

EFFORTS = np.geomspace(0.02, 1.0, 18)
"""Shares of a maximal contraction that the largest effort may have been, where no maximal one was recorded."""

GAP = 0.15
"""Between what is fitted and what is scored while choosing [s]."""


@dataclass(frozen=True)
class HillChoice:
    """What cross-validation chose."""

    weight: float  # Of anatomy
    words: str
    score: Score | None  # Out of fold; None where nothing was to be chosen
    tried: Mapping[float, float] = field(repr=False)  # RMSE [N m] by weight


@dataclass(frozen=True, eq=False)
class HillMap:
    """Calibrated muscles that predict a joint's torque."""

    name: str  # Of the estimator
    muscles: tuple[str, ...]
    choice: HillChoice
    fit: MuscleFit
    # Of predictions on samples that were not fitted, while choosing; of the fit where nothing was chosen [N m]
    residual_sd: float
    effort: float = 1.0  # Share of a maximal contraction that an envelope of 1 stands for
    causal: bool = False
    joint: str = ""
    driven: Mapping[str, tuple[str, ...]] = field(default_factory=dict, repr=False)  # EMG channels, by muscle

    def predict(self, trial: TorqueTrial) -> np.ndarray:
        """Torque of a trial, shape (n,) [N m]; its own torque is not looked at."""
        samples, own = self.samples(trial)
        return self.fit.predict(samples)[own]

    def samples(self, trial: TorqueTrial) -> tuple[MuscleSamples, slice]:
        """A trial as these muscles see it, and where its own samples lie."""
        samples, own = muscle_samples([trial], muscles=self.muscles, effort=self.effort, causal=self.causal)
        return samples, own[0]

    def half_width(self, trial: TorqueTrial, level: float = 0.95) -> np.ndarray:
        """Half the interval about the torque predicted, shape (n,) [N m]: what the model misses, and what it does not
        know.
        """
        from ..fit.muscles.muscle_information import covariance

        samples, own = self.samples(trial)
        _, slopes = self.fit.problem.jacobian(self.fit.z, samples)
        unsure = np.einsum("pn,pq,qn->n", slopes, covariance(self.fit), slopes)[own]
        return float(ndtri(0.5 + level / 2.0)) * np.sqrt(self.residual_sd**2 + unsure)

    def stream(self, period: float) -> tuple[_core.HillTorque, tuple[float, float, float]]:
        """The same muscles sample by sample, in the core, every `period` [s]; and offset, stiffness, damping of the
        joint's own tissue, to be added: offset - stiffness * angle - damping * speed.
        """
        return _core.HillTorque(np.array([m.vector() for m in self.fit.muscles]), period=period), self.fit.passive


def fit_hill(
    trials: Sequence[TorqueTrial],
    *,
    name: str = "hill",
    causal: bool = False,
    weights: Sequence[float] = WEIGHTS,
    quantities: Sequence[str] = DEFAULT_QUANTITIES,
    method: str = "least_squares",
) -> HillMap:
    """Calibrate muscles on trials; the weight of anatomy is chosen by cross-validation within them."""
    if not trials or any(trial.heldout for trial in trials):
        found = "no trial" if not trials else f"the held-out trial {next(t.name for t in trials if t.heldout)}"
        raise IdentificationError(f"muscles: found {found}, expected trials to fit")
    muscles = driven_muscles(trials)
    names = tuple(m.name for m in muscles)
    samples, own = muscle_samples(trials, muscles=names, causal=causal)
    effort = 1.0 if trials[0].muscles.maximal else effort_of(muscles, samples)
    if effort < 1.0:
        samples, own = muscle_samples(trials, muscles=names, effort=effort, causal=causal)
    counted = np.flatnonzero(samples.weight > 0.0)
    folds = folds_of(trials, own, samples, counted)
    best: tuple[Score | None, float] = (None, weights[0])
    tried = {}
    for weight in weights if len(weights) > 1 else ():
        predicted = np.full(len(samples.torque), np.nan)
        for fitted, scored in folds:
            problem = MuscleProblem(muscles, samples.only(fitted), quantities=quantities, weight=weight)
            # Choosing asks only which weight is better: one start.
            predicted[scored] = solve_calibration(problem, starts=1).predict(samples)[scored]
        reached = score(samples.torque[counted], predicted[counted])
        tried[weight] = reached.rmse
        if best[0] is None or reached.rmse < best[0].rmse:
            best = reached, weight
    reached, weight = best
    problem = MuscleProblem(muscles, samples, quantities=quantities, weight=weight)
    fit = solve_calibration(problem, method=method)
    words = f"{len(muscles)} muscles, {len(problem.names)} parameters; weight of anatomy {weight:g}"
    missed = reached or score(samples.torque[counted], fit.predict(samples)[counted])
    first = trials[0]
    driven = first.muscles.driven(first.joint, first.envelopes)
    choice = HillChoice(weight, words, reached, tried)
    return HillMap(name, names, choice, fit, missed.rmse, effort, causal, first.joint, driven)


def effort_of(muscles: Sequence[HillMuscle], samples: MuscleSamples) -> float:
    """Share of a maximal contraction that makes the torque of activity alone most like the reference."""
    model, counted = HillModel([replace(m, passive_scale=0.0) for m in muscles]), samples.weight > 0.0
    spread = np.std(samples.torque, axis=-1, keepdims=True)
    errors = [
        float(np.sum((((model.torque(scaled) - samples.torque) / spread)[counted]) ** 2))
        for scaled in (replace(samples.data, excitation=e * samples.data.excitation) for e in EFFORTS)
    ]
    return float(EFFORTS[int(np.argmin(errors))])


def folds_of(
    trials: Sequence[TorqueTrial], own: Sequence[slice], samples: MuscleSamples, counted: np.ndarray
) -> list[Fold]:
    """Group by group, trial by trial, or in blocks of a single one; of samples that count."""
    member = np.full(samples.torque.shape[-1], -1)
    for i, part in enumerate(own):
        member[part] = i
    groups = np.array([trial.group for trial in trials])[member[counted]]
    if len(set(groups.tolist())) > 1:
        folds = grouped_folds(groups)
    elif len(trials) > 1:
        folds = grouped_folds(member[counted])
    else:
        folds = block_folds(trials[0].time[counted - own[0].start], BLOCKS, GAP)
    return [(counted[fitted], counted[scored]) for fitted, scored in folds]
