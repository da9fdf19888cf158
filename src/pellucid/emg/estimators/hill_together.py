"""Calibrate all muscles of several joints at once: each has one set of parameters and a moment arm for each joint.

A muscle that crosses two joints pulls with the same force at both. The force of every muscle follows its envelope by 10
to 100 ms. If the muscles of a recording need another delay, its EMG stream runs ahead or behind. With ``offset`` this
shift is estimated beside the muscles; it belongs to the recording, not to the person.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import ndtri, stdtrit

from ..._errors import IdentificationError
from ...models.parameter import Parameter
from ..fit.calibration_posterior import CalibrationPosterior
from ..fit.coupled_priors import MAX_TOTAL_DELAY_S, MIN_TOTAL_DELAY_S, TIMING_CANDIDATES, Timing, coupled_priors
from ..fit.muscle_calibration import MuscleFit, MuscleProblem, MuscleSamples, solve_calibration
from ..fit.muscle_information import covariance, muscle_parameters, recording_information
from ..models.hill import HillMuscle
from ..models.muscle_card import CalibratedMuscles
from .cross_validation import Score, score
from .hill import ANATOMY_WEIGHT_CANDIDATES, estimate_effort, make_folds
from .muscle_trials import find_driven_muscles_across, make_muscle_samples_across
from .torque_trial import TorqueTrial

TrialByJoint = Mapping[str, TorqueTrial]
"""Trials of one recording, by joint."""

TIMING_COMPARISON_WEIGHT = 0.01
"""Weight of the anatomical prior at which the candidates for the muscles' delays are compared."""


@dataclass(frozen=True)
class StreamOffset:
    """Time by which the EMG stream runs ahead of the others, with its 95 % interval [s]; negative if it is behind."""

    value: float  # Estimate [s]
    low: float  # Lower end of the interval [s]
    high: float  # Upper end of the interval [s]

    @property
    def certain(self) -> bool:
        """Whether the interval excludes 0."""
        return self.low > 0.0 or self.high < 0.0


@dataclass(frozen=True)
class TogetherChoice:
    """Result of cross-validation within the fitted trials."""

    weight: float  # Weight of the anatomical prior
    timing: Timing  # Form of the muscles' delays
    scores: Mapping[str, Score]  # Score out of fold, by joint
    tried: Mapping[str, float] = field(repr=False)  # Mean squared error over the reference's variance, by candidate


@dataclass(frozen=True, eq=False)
class HillTogether:
    """Calibrated muscles that predict the torques of several joints."""

    joints: tuple[str, ...]
    choice: TogetherChoice
    fit: MuscleFit
    driven: Mapping[str, tuple[str, ...]] = field(repr=False)  # EMG channels by muscle
    effort: float = 1.0  # Share of a maximal contraction that an envelope of 1 stands for

    def samples(self, trial: TrialByJoint) -> tuple[MuscleSamples, slice]:
        """Return a recording's samples for these muscles, and the slice in which the recording itself lies."""
        across = {joint: [trial[joint]] for joint in self.joints}
        names, ahead = tuple(self.driven), self.choice.timing.ahead
        samples, own = make_muscle_samples_across(across, muscles=names, effort=self.effort, ahead=ahead)
        return samples, own[0]

    def predict(self, trial: TrialByJoint) -> dict[str, np.ndarray]:
        """Predict the torque of each joint, shape (n,) [N m]; the measured torque is not used."""
        samples, own = self.samples(trial)
        return dict(zip(self.joints, self.fit.predict(samples)[:, own], strict=True))

    def half_width(self, trial: TrialByJoint, level: float = 0.95) -> dict[str, np.ndarray]:
        """Return half the interval about each predicted torque, shape (n,) [N m].

        The interval combines the errors out of fold and the variance that the parameters' covariance implies. It uses
        Student's quantile, because a short recording holds few independent errors.
        """
        samples, own = self.samples(trial)
        _, slopes = self.fit.problem.jacobian(self.fit.z, samples)
        unsure = np.einsum("pjn,pq,qjn->jn", slopes, covariance(self.fit), slopes)[:, own]
        return self._interval_half_width(unsure, level)

    def predict_with_posterior(
        self, posterior: CalibrationPosterior, trial: TrialByJoint, level: float = 0.95
    ) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
        """Return each joint's mean torque over posterior draws, and half its interval, each of shape (n,) [N m].

        The interval combines the errors out of fold and the variance of the draws.
        """
        samples, own = self.samples(trial)
        torques = posterior.torques(samples)[:, :, own]
        return dict(zip(self.joints, torques.mean(axis=0), strict=True)), self._interval_half_width(
            torques.var(axis=0), level
        )

    def _interval_half_width(self, unsure: np.ndarray, level: float) -> dict[str, np.ndarray]:
        """Return half the interval of each joint's torque, given the variance `unsure` of the predicted torque.

        `unsure` has shape (j, n) [N^2 m^2].
        """
        freedom = recording_information(self.fit)[2]
        missed = np.array([[self.choice.scores[joint].rmse] for joint in self.joints])
        half = float(stdtrit(freedom, 0.5 + level / 2.0)) * np.sqrt(missed**2 + unsure)
        return dict(zip(self.joints, half, strict=True))

    @property
    def muscles(self) -> tuple[HillMuscle, ...]:
        """Calibrated muscles. Each delay counts from the recorded EMG stream."""
        ahead = self.choice.timing.ahead
        return tuple(replace(m, delay=m.delay - ahead) for m in self.fit.muscles) if ahead else self.fit.muscles

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Calibrated parameters. Each delay counts from the recorded EMG stream."""
        ahead = self.choice.timing.ahead
        return tuple(replace(p, value=p.value - ahead * (p.name == "delay")) for p in muscle_parameters(self.fit))

    @property
    def delays(self) -> np.ndarray:
        """Time by which each muscle's activation follows the recorded envelopes, with all lags, shape (m,) [s]."""
        model = self.fit.problem.model
        values = self.fit.problem.values(self.fit.z)[: len(model.free)]
        stream = model.estimator(self.fit.problem.samples.data.period, values)
        return np.asarray(stream.delays) - self.choice.timing.ahead

    @property
    def offset(self) -> StreamOffset | None:
        """Offset of the EMG stream; None if it was not estimated.

        It is the middle of all offsets with which every muscle follows its EMG by 10 to 100 ms. Its interval covers
        these offsets and the standard error of the delay.
        """
        if not self.choice.timing.offset:
            return None
        delay = next(p for p in self.parameters if p.name == "delay")
        error = 0.0 if np.isnan(delay.standard_error) else delay.standard_error
        low, high = float(self.delays.max()) - MAX_TOTAL_DELAY_S, float(self.delays.min()) - MIN_TOTAL_DELAY_S
        half = float(ndtri(0.975)) * error
        return StreamOffset(0.5 * (low + high), low - half, high + half)

    def card_content(self) -> CalibratedMuscles:
        """Return the content of a card: the muscles, the channels that drive each, and each joint's own tissue."""
        return CalibratedMuscles(self.muscles, self.driven, self.fit.tissue, self.effort)


@dataclass(frozen=True, eq=False)
class _CandidateErrors:
    """Cross-validation of one candidate. Errors are squared, over the reference's variance, averaged over joints."""

    scores: Mapping[str, Score]  # Score out of fold, by joint
    folds: np.ndarray  # Error in each fold, shape (f,)
    missed: float  # Error over all samples


def _choose_simplest_timing(tried: Sequence[tuple[Timing, _CandidateErrors]]) -> Timing:
    """Return the simplest candidate that is not clearly worse, given candidates from simple to complex.

    A later candidate replaces it only if its errors are smaller by more than one standard error of the differences
    over folds.
    """
    chosen, best = tried[0]
    for timing, each in tried[1:]:
        gain = best.folds - each.folds
        if np.mean(gain) > np.std(gain, ddof=1) / np.sqrt(len(gain)):
            chosen, best = timing, each
    return chosen


def fit_together(
    trials: Mapping[str, Sequence[TorqueTrial]],
    *,
    offset: bool = False,
    weights: Sequence[float] = ANATOMY_WEIGHT_CANDIDATES,
    timings: Sequence[Timing] = TIMING_CANDIDATES,
) -> HillTogether:
    """Calibrate the muscles of several joints on the same recordings, given as trials by joint.

    Cross-validation within the trials chooses the form of the delays among `timings` and the weight of the anatomical
    prior among `weights`. `offset`: whether a shift of the EMG stream is estimated.
    """
    held = next((t.name for own in trials.values() for t in own if t.heldout), None)
    if len(trials) < 2 or held is not None:
        found = f"the held-out trial {held}" if held else f"the torque of {', '.join(trials) or 'no joint'}"
        raise IdentificationError(f"muscles together: found {found}, expected trials to fit of two joints or more")
    muscles = find_driven_muscles_across(trials)
    names, first = tuple(m.name for m in muscles), next(iter(trials.values()))
    ahead = replace(timings[0], offset=offset).ahead
    samples, own = make_muscle_samples_across(trials, muscles=names, ahead=ahead)
    effort = 1.0 if first[0].known_muscles.maximal else estimate_effort(muscles, samples)
    if effort < 1.0:
        samples, own = make_muscle_samples_across(trials, muscles=names, effort=effort, ahead=ahead)
    counted = np.flatnonzero(samples.weight[0] > 0.0)
    folds = make_folds(first, own, samples, counted)
    last: dict[int, np.ndarray] = {}

    def left_out(timing: Timing, weight: float) -> _CandidateErrors:
        priors, hold = coupled_priors(muscles, timing, samples.data.period)
        made = np.full(samples.torque.shape, np.nan)
        for i, (fitted, scored) in enumerate(folds):
            problem = MuscleProblem(muscles, samples.only(fitted), priors=priors, hold=hold, weight=weight)
            found = solve_calibration(problem, starts=1, near=last.get(i))
            last[i] = found.z
            made[:, scored] = found.predict(samples)[:, scored]
        off = (made - samples.torque) / np.std(samples.torque[:, counted], axis=1, keepdims=True)
        return _CandidateErrors(
            {joint: score(samples.torque[j, counted], made[j, counted]) for j, joint in enumerate(samples.joints)},
            np.array([np.mean(samples.weight[:, scored] * off[:, scored] ** 2) for _, scored in folds]),
            float(np.mean(samples.weight[:, counted] * off[:, counted] ** 2)),
        )

    tried: dict[tuple[Timing, float], _CandidateErrors] = {}
    for each in timings:
        last.clear()
        tried[replace(each, offset=offset), TIMING_COMPARISON_WEIGHT] = left_out(
            replace(each, offset=offset), TIMING_COMPARISON_WEIGHT
        )
    timing = _choose_simplest_timing([(t, each) for (t, _), each in tried.items()])
    last.clear()
    for weight in weights:
        if (timing, weight) not in tried:
            tried[timing, weight] = left_out(timing, weight)
    weight = min(weights, key=lambda w: tried[timing, w].missed)
    priors, hold = coupled_priors(muscles, timing, samples.data.period)
    fit = solve_calibration(MuscleProblem(muscles, samples, priors=priors, hold=hold, weight=weight))
    choice = TogetherChoice(
        weight, timing, tried[timing, weight].scores,
        {f"{t.words}, weight {w:g}": each.missed for (t, w), each in tried.items()},
    )  # fmt: skip
    # A muscle belongs to one or several joints; its channels are the same at all of them.
    driven = {
        m: channels for t in (own[0] for own in trials.values())
        for m, channels in t.known_muscles.driven(t.joint, t.envelopes).items()
    }  # fmt: skip
    return HillTogether(tuple(trials), choice, fit, {name: driven[name] for name in names}, effort)
