r"""Muscles of Hill's type as an estimator of torque: calibrated on trials, with an interval on what it predicts.

Calibrate all muscles of several joints at once: each has one set of parameters and a moment arm for each joint.

A muscle that crosses two joints pulls with the same force at both. The force of every muscle follows its envelope by 10
to 100 ms. If the muscles of a recording need another delay, its EMG stream runs ahead or behind. With ``offset`` this
shift is estimated together with the muscles; it belongs to the recording, not to the person.

EMG-assisted muscles: activations near the recorded ones that reproduce a measured torque.

At every sample, with F_m(a) the force of a calibrated muscle at the length and speed that it has, r its moment arms, E
the muscles with EMG and U those without,

.. math::
   \min_{0 \le a \le 1} \; \sum_j \frac{(\tau_j - \tau^0_j - \sum_m r_{jm} F_m(a_m))^2}{s_j^2}
   + \kappa \sum_{m \in E} (a_m - a^{emg}_m)^2 + \varepsilon \sum_{m \in U} a_m^2

with :math:`\tau^0` the joint's own tissue and s the standard deviation of the torque that was fitted. :math:`\kappa` is
the trust in EMG. Infinite trust makes the method EMG-driven; with no trust and every muscle in U it is static
optimisation [1]_; between them it is EMG-assisted [2]_. The activations are found from the measured torque. That they
reproduce this torque is therefore no evidence for them.

A muscle's force is linear in its activation, except that its optimal length moves. The problem is therefore linearised
a few times, and each linear problem is solved exactly. Its dual has one unknown for each joint, :math:`\lambda_j`, with
:math:`a_m = \mathrm{clip}(c_m + \sum_j G_{jm}\lambda_j/w_m, 0, 1)`. The dual is convex, and Newton's method solves it.

.. [1] R. D. Crowninshield, R. A. Brand, "A physiologically based criterion of muscle force prediction in locomotion",
   J. Biomechanics 14, 1981.
.. [2] C. Pizzolato et al., "CEINMS: a toolbox to investigate the influence of different neural control solutions on the
   prediction of muscle excitation and joint moments during dynamic motor tasks", J. Biomechanics 48, 2015.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import ndtri, stdtrit

from ... import _core
from ..._errors import IdentificationError
from ...models.estimates import Parameter
from ..fit.muscle_calibration import (
    DEFAULT_QUANTITIES,
    DELAY_BOUNDS,
    TIMING_CANDIDATES,
    MuscleFit,
    MuscleProblem,
    MuscleSamples,
    Timing,
    coupled_priors,
    solve_calibration,
)
from ..fit.muscle_posterior import CalibrationPosterior, covariance, muscle_parameters, recording_information
from ..models.hill import MUSCLE_QUANTITIES, HillModel, HillMuscle
from ..models.muscle import CalibratedMuscles
from .cross_validation import Fold, Score, block_folds, grouped_folds, score, weighted_rmse
from .muscle_trials import (
    find_driven_muscles,
    find_driven_muscles_across,
    make_muscle_samples,
    make_muscle_samples_across,
)
from .torque_trial import TorqueTrial


@dataclass(frozen=True)
class HillChoices:
    """Candidates of a calibration, and the folds that choose among them.

    No measurement is recorded for what is chosen by judgement.
    """

    # Candidate weights of the anatomical prior. Cross-validation within the fitted trials chooses among them.
    anatomy_weights: tuple[float, ...] = (0.05, 0.02, 0.01, 0.005)
    # Number of blocks into which a single trial is divided for cross-validation. Chosen by judgement.
    block_count: int = 5
    fold_gap_s: float = 0.15  # Gap between fitted and scored samples in cross-validation [s]. Chosen by judgement.
    # Weight of the anatomical prior at which the candidates for the muscles' delays are compared
    timing_weight: float = 0.01


HILL_CHOICES = HillChoices()


EFFORT_CANDIDATES = np.geomspace(0.02, 1.0, 18)
"""Candidates for the largest effort, as a share of a maximal contraction, if no maximal contraction was recorded."""


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
    weights: Sequence[float] = HILL_CHOICES.anatomy_weights,
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
        folds = block_folds(trials[0].time[counted - own[0].start], HILL_CHOICES.block_count, HILL_CHOICES.fold_gap_s)
    return [(counted[fitted], counted[scored]) for fitted, scored in folds]


TrialByJoint = Mapping[str, TorqueTrial]
"""Trials of one recording, by joint."""


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
        low, high = (
            float(self.delays.max()) - DELAY_BOUNDS.max_total_s,
            float(self.delays.min()) - DELAY_BOUNDS.min_total_s,
        )
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
    weights: Sequence[float] = HILL_CHOICES.anatomy_weights,
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
        tried[replace(each, offset=offset), HILL_CHOICES.timing_weight] = left_out(
            replace(each, offset=offset), HILL_CHOICES.timing_weight
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


@dataclass(frozen=True)
class AssistanceSearch:
    """How activations that reproduce a torque are found.

    No measurement is recorded for what is chosen by judgement.
    """

    # Number of times that forces are linearised about the activations found so far. Chosen by judgement.
    linearisation_count: int = 4
    max_newton_steps: int = 60  # Largest number of Newton steps on the dual problem. Chosen by judgement.
    # Difference of activations by which the slope of a muscle's force is computed [1]. Chosen by judgement.
    activation_step: float = 1e-4


ASSISTED_SEARCH = AssistanceSearch()


INSTANT_ACTIVATION_DYNAMICS = {"delay": 0.0, "time_constant_1": 1e-9, "time_constant_2": 1e-9, "shape": 0.0}
"""Activation dynamics of a muscle whose activation equals its excitation."""


@dataclass(frozen=True, eq=False)
class AssistedMuscles:
    """Calibrated muscles over one recording, and the torque of the joints' own tissue there."""

    muscles: tuple[HillMuscle, ...]
    samples: MuscleSamples = field(repr=False)
    tissue: np.ndarray = field(repr=False)  # Torque of the joints' own tissue, shape (j, n) [N m]
    scale: np.ndarray  # Standard deviation of each joint's fitted torque, shape (j,) [N m]

    @property
    def arms(self) -> np.ndarray:
        """Moment arms, shape (j, m, n) [m]."""
        return self.samples.data.moment_arm.reshape(-1, len(self.muscles), self.tissue.shape[1])

    @property
    def recorded(self) -> np.ndarray:
        """Activation of each muscle by its own EMG, shape (m, n)."""
        table = np.array([muscle.vector() for muscle in self.muscles])
        data = self.samples.data
        return _core.hill_states(table, *data.arrays[:3], period=data.period, starts=data.starts)[0]

    def force(self, activation: np.ndarray) -> np.ndarray:
        """Return the force of each muscle at activations of shape (m, n), same shape [N]."""
        table = np.array([muscle.vector() for muscle in self.muscles])
        for quantity, value in INSTANT_ACTIVATION_DYNAMICS.items():
            table[:, MUSCLE_QUANTITIES.index(quantity)] = value
        data = self.samples.data
        held = np.ascontiguousarray(activation)
        return _core.hill_states(table, held, data.length, data.rate, period=data.period, starts=data.starts)[1]

    def torque(self, activation: np.ndarray) -> np.ndarray:
        """Return the torque of each joint at activations of shape (m, n), shape (j, n) [N m]."""
        return self.tissue + np.einsum("jmn,mn->jn", self.arms, self.force(activation))

    def find_activations(self, unrecorded: Sequence[int] = (), *, trust: float, effort: float) -> np.ndarray:
        """Return activations that reproduce the measured torque, shape (m, n).

        The EMG of muscles in `unrecorded` is ignored. `trust` weighs deviations from EMG, `effort` the activity of
        muscles without EMG.
        """
        own = np.ones(len(self.muscles), bool)
        own[list(unrecorded)] = False
        centre = np.where(own[:, None], self.recorded, 0.0)
        weight = np.where(own, trust, effort)
        wanted = self.samples.torque.reshape(self.tissue.shape)
        a = centre
        for _ in range(ASSISTED_SEARCH.linearisation_count):
            here = np.clip(a, 0.0, 1.0 - ASSISTED_SEARCH.activation_step)
            force = self.force(here)
            slope = (self.force(here + ASSISTED_SEARCH.activation_step) - force) / ASSISTED_SEARCH.activation_step
            gain = self.arms * slope
            rest = self.tissue + np.einsum("jmn,mn->jn", self.arms, force - slope * here)
            a = minimise_bounded_quadratic(gain, wanted - rest, centre, weight, self.scale)
        return a


def minimise_bounded_quadratic(
    gain: np.ndarray, wanted: np.ndarray, centre: np.ndarray, weight: np.ndarray, scale: np.ndarray
) -> np.ndarray:
    """Return the minimiser a of a bounded quadratic cost, for every sample at once, shape (m, n).

    The cost is sum_j ((wanted - gain a)_j / scale_j)^2 + sum_m weight_m (a_m - centre_m)^2 with 0 <= a <= 1. Shapes:
    `gain` (j, m, n), `wanted` (j, n), `centre` (m, n), `weight` (m,) above 0, `scale` (j,).
    """
    g = gain * (1.0 / scale)[:, None, None]
    y = wanted / scale[:, None]
    w = weight[:, None]
    joints, count = y.shape

    def activation(dual: np.ndarray) -> np.ndarray:
        return np.clip(centre + np.einsum("jmn,jn->mn", g, dual) / w, 0.0, 1.0)

    def cost(dual: np.ndarray, a: np.ndarray) -> np.ndarray:
        pulled = np.sum(a * np.einsum("jmn,jn->mn", g, dual) - 0.5 * w * (a - centre) ** 2, axis=0)
        return 0.5 * np.sum(dual**2, axis=0) - np.sum(dual * y, axis=0) + pulled

    dual = np.zeros((joints, count))
    a = activation(dual)
    for _ in range(ASSISTED_SEARCH.max_newton_steps):
        slope = dual - y + np.einsum("jmn,mn->jn", g, a)
        if np.max(np.abs(slope), initial=0.0) < 1e-10:
            break
        free = ((a > 0.0) & (a < 1.0)) / w
        curve = np.eye(joints)[:, :, None] + np.einsum("jmn,mn,kmn->jkn", g, free, g)
        step = -np.linalg.solve(curve.transpose(2, 0, 1), slope.T[:, :, None])[:, :, 0].T
        now, falls = cost(dual, a), np.sum(slope * step, axis=0)
        size = np.ones(count)
        for _ in range(40):
            tried = activation(dual + size * step)
            worse = cost(dual + size * step, tried) > now + 1e-4 * size * falls + 1e-14 * (1.0 + np.abs(now))
            if not worse.any():
                break
            size = np.where(worse, 0.5 * size, size)
        dual = dual + size * step
        a = activation(dual)
    return a
