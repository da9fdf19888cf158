"""All muscles of several joints calibrated at once: one set of numbers, one excitation, a moment arm for each joint.

A muscle that crosses two joints pulls with one force at both. From an envelope to the force no more than 100 ms pass
and no fewer than 10, for every muscle. A recording whose muscles want another time has a stream of EMG that runs ahead
or behind: with ``offset`` that is found beside the muscles, and is the recording's, not the person's.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import ndtri, stdtrit

from .._errors import IdentificationError
from ..fit.muscles.coupled_priors import MAX_TOTAL_DELAY_S, MIN_TOTAL_DELAY_S, TIMING_CANDIDATES, Timing, coupled_priors
from ..fit.muscles.muscle_calibration import MuscleFit, MuscleProblem, MuscleSamples, solve_calibration
from ..fit.muscles.muscle_information import covariance, muscle_parameters, recording_information
from ..fit.parameter import Parameter
from ..fit.posterior.calibration_posterior import CalibrationPosterior
from ..models.hill import HillMuscle
from ..models.muscle_card import CalibratedMuscles
from .cross_validation import Score, score
from .hill import WEIGHTS, effort_of, folds_of
from .muscle_trials import driven_across, samples_across
from .torque_trial import TorqueTrial

Across = Mapping[str, TorqueTrial]
"""One recording's trial at each joint."""

FIRST = 0.01
"""Weight of anatomy at which ways to share out the delay are compared."""


@dataclass(frozen=True)
class StreamOffset:
    """How far the EMG's stream runs ahead of the others (behind where negative), with its 95 % interval [s]."""

    value: float
    low: float
    high: float

    @property
    def certain(self) -> bool:
        """Whether it cannot be 0."""
        return self.low > 0.0 or self.high < 0.0


@dataclass(frozen=True)
class TogetherChoice:
    """What cross-validation within what may be fitted chose."""

    weight: float  # Of anatomy
    timing: Timing
    scores: Mapping[str, Score]  # Out of fold, by joint
    tried: Mapping[str, float] = field(repr=False)  # Mean squared error over the reference's variance, by words


@dataclass(frozen=True, eq=False)
class HillTogether:
    """Calibrated muscles that predict the torques of several joints."""

    joints: tuple[str, ...]
    choice: TogetherChoice
    fit: MuscleFit
    driven: Mapping[str, tuple[str, ...]] = field(repr=False)  # EMG channels, by muscle
    effort: float = 1.0  # Share of a maximal contraction that an envelope of 1 stands for

    def samples(self, trial: Across) -> tuple[MuscleSamples, slice]:
        """A recording as these muscles see it, and where its own samples lie."""
        across = {joint: [trial[joint]] for joint in self.joints}
        names, ahead = tuple(self.driven), self.choice.timing.ahead
        samples, own = samples_across(across, muscles=names, effort=self.effort, ahead=ahead)
        return samples, own[0]

    def predict(self, trial: Across) -> dict[str, np.ndarray]:
        """Torque of each joint, shape (n,) [N m]; the recording's own torque is not looked at."""
        samples, own = self.samples(trial)
        return dict(zip(self.joints, self.fit.predict(samples)[:, own], strict=True))

    def half_width(self, trial: Across, level: float = 0.95) -> dict[str, np.ndarray]:
        """Half the interval about each torque predicted, shape (n,) [N m]: what the model missed out of fold, and what
        it does not know, by Student's quantile: a short recording holds few errors that are not copies of others."""
        samples, own = self.samples(trial)
        _, slopes = self.fit.problem.jacobian(self.fit.z, samples)
        unsure = np.einsum("pjn,pq,qjn->jn", slopes, covariance(self.fit), slopes)[:, own]
        return self._half(unsure, level)

    def drawn(
        self, posterior: CalibrationPosterior, trial: Across, level: float = 0.95
    ) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
        """Torque of each joint as the mean of a `posterior`'s draws, and half its interval, each (n,) [N m]: what was
        missed out of fold, and by how much draws differ."""
        samples, own = self.samples(trial)
        torques = posterior.torques(samples)[:, :, own]
        return dict(zip(self.joints, torques.mean(axis=0), strict=True)), self._half(torques.var(axis=0), level)

    def _half(self, unsure: np.ndarray, level: float) -> dict[str, np.ndarray]:
        """With what the muscles do not know, (j, n) [N^2 m^2]."""
        freedom = recording_information(self.fit)[2]
        missed = np.array([[self.choice.scores[joint].rmse] for joint in self.joints])
        half = float(stdtrit(freedom, 0.5 + level / 2.0)) * np.sqrt(missed**2 + unsure)
        return dict(zip(self.joints, half, strict=True))

    @property
    def muscles(self) -> tuple[HillMuscle, ...]:
        """As calibrated, each delay that of the recorded stream."""
        ahead = self.choice.timing.ahead
        return tuple(replace(m, delay=m.delay - ahead) for m in self.fit.muscles) if ahead else self.fit.muscles

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """What was found, each delay that of the recorded stream."""
        ahead = self.choice.timing.ahead
        return tuple(replace(p, value=p.value - ahead * (p.name == "delay")) for p in muscle_parameters(self.fit))

    @property
    def delays(self) -> np.ndarray:
        """How late each muscle's activation follows the recorded envelopes, delay and lags together, shape (m,) [s]."""
        model = self.fit.problem.model
        values = self.fit.problem.values(self.fit.z)[: len(model.free)]
        stream = model.estimator(self.fit.problem.samples.data.period, values)
        return np.asarray(stream.delays) - self.choice.timing.ahead

    @property
    def offset(self) -> StreamOffset | None:
        """Of the EMG's stream: whatever lets every muscle take from 10 to 100 ms, and the error of the delay; None
        where it was not looked for."""
        if not self.choice.timing.offset:
            return None
        delay = next(p for p in self.parameters if p.name == "delay")
        error = 0.0 if np.isnan(delay.standard_error) else delay.standard_error
        low, high = float(self.delays.max()) - MAX_TOTAL_DELAY_S, float(self.delays.min()) - MIN_TOTAL_DELAY_S
        half = float(ndtri(0.975)) * error
        return StreamOffset(0.5 * (low + high), low - half, high + half)

    def kept(self) -> CalibratedMuscles:
        """What a card keeps: the muscles, what drives each, each joint's own tissue."""
        return CalibratedMuscles(self.muscles, self.driven, self.fit.tissue, self.effort)


@dataclass(frozen=True, eq=False)
class _Tried:
    """What cross-validation said of one choice."""

    scores: Mapping[str, Score]  # By joint, out of fold
    folds: np.ndarray  # (f,) Squared error over the reference's variance, the mean of all joints, of each fold
    missed: float  # The same of all


def _simplest(tried: Sequence[tuple[Timing, _Tried]]) -> Timing:
    """The first that no later one betters by more than the standard error of the difference over folds."""
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
    weights: Sequence[float] = WEIGHTS,
    timings: Sequence[Timing] = TIMING_CANDIDATES,
) -> HillTogether:
    """Calibrate the muscles of all joints on the same recordings' trials at each; how the delay is shared out, and the
    weight of anatomy, are chosen by cross-validation within them."""
    held = next((t.name for own in trials.values() for t in own if t.heldout), None)
    if len(trials) < 2 or held is not None:
        found = f"the held-out trial {held}" if held else f"the torque of {', '.join(trials) or 'no joint'}"
        raise IdentificationError(f"muscles together: found {found}, expected trials to fit of two joints or more")
    muscles = driven_across(trials)
    names, first = tuple(m.name for m in muscles), next(iter(trials.values()))
    ahead = replace(timings[0], offset=offset).ahead
    samples, own = samples_across(trials, muscles=names, ahead=ahead)
    effort = 1.0 if first[0].muscles.maximal else effort_of(muscles, samples)
    if effort < 1.0:
        samples, own = samples_across(trials, muscles=names, effort=effort, ahead=ahead)
    counted = np.flatnonzero(samples.weight[0] > 0.0)
    folds = folds_of(first, own, samples, counted)
    last: dict[int, np.ndarray] = {}

    def left_out(timing: Timing, weight: float) -> _Tried:
        priors, hold = coupled_priors(muscles, timing, samples.data.period)
        made = np.full(samples.torque.shape, np.nan)
        for i, (fitted, scored) in enumerate(folds):
            problem = MuscleProblem(muscles, samples.only(fitted), priors=priors, hold=hold, weight=weight)
            found = solve_calibration(problem, starts=1, near=last.get(i))
            last[i] = found.z
            made[:, scored] = found.predict(samples)[:, scored]
        off = (made - samples.torque) / np.std(samples.torque[:, counted], axis=1, keepdims=True)
        return _Tried(
            {joint: score(samples.torque[j, counted], made[j, counted]) for j, joint in enumerate(samples.joints)},
            np.array([np.mean(off[:, scored] ** 2) for _, scored in folds]),
            float(np.mean(off[:, counted] ** 2)),
        )

    tried: dict[tuple[Timing, float], _Tried] = {}
    for each in timings:
        last.clear()
        tried[replace(each, offset=offset), FIRST] = left_out(replace(each, offset=offset), FIRST)
    timing = _simplest([(t, each) for (t, _), each in tried.items()])
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
    # Lengths and arms of a muscle are one joint's or another's; its channels are the same for all.
    driven = {
        m: channels for t in (own[0] for own in trials.values())
        for m, channels in t.muscles.driven(t.joint, t.envelopes).items()
    }  # fmt: skip
    return HillTogether(tuple(trials), choice, fit, {name: driven[name] for name in names}, effort)
