r"""A Gaussian process that learns an estimator's errors from a measured torque and corrects the next samples.

The process remembers features x and errors e of the last samples within a sliding window. With

.. math::  k(x, x') = \sigma^2 e^{-|x - x'|^2 / 2 \ell^2}, \qquad
   \hat\tau(x) = \tau^{model}(x) + k_x^T (K + \nu\sigma^2 I)^{-1} e

a torque is corrected before it is measured: the correction sees only the features of the present sample. It needs a
torque that is measured all the time, and is useless once the measurement ends. It works on top of any estimator.

Reconstructions of published EMG-driven estimators, for comparison on the same folds.

The names are the paper's [1]_; its settings were not published, so these are reconstructions:

NM-CO
    Muscles of Hill's type whose geometry depends on the neighbouring joints, all parameters calibrated together by a
    stochastic particle swarm with conjugate gradients, with bounds and a very weak anatomical prior.
NM-COA
    NM-CO with errors learnt online by a Gaussian process, which sees the torque measured so far.
NM-NC
    Muscles without coupling to neighbouring joints, whose angles are taken as constant; one stage of conjugate
    gradients alone.

.. [1] Wang et al., "sEMG-torque model with subject adjustment", 2021.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.linalg import solve_triangular
from scipy.linalg.lapack import dposv

from ..._errors import IdentificationError
from .feature_scale import mean_and_scale
from .hill import HillChoice, HillMap, fit_hill
from .torque_trial import FeatureSet, TorqueTrial, compute_features


@dataclass(frozen=True)
class CorrectionSettings:
    """How long errors are remembered, and the candidates for the kernel.

    No measurement is recorded for what is chosen by judgement.
    """

    window_s: float = 6.0  # Errors are remembered for this long [s]: some repetitions of a movement
    spacing_s: float = 0.04  # Interval between remembered errors [s]. Chosen by judgement.
    # Candidate length scales of the kernel, in standard deviations of a feature. Each is multiplied by the root of the
    # number of features. The likelihood chooses among them. Chosen by judgement.
    length_scales: tuple[float, ...] = (1.0, 2.0, 4.0)
    # Candidate shares of the errors' variance that features do not explain. The likelihood chooses among them. Chosen
    # by judgement.
    noise_shares: tuple[float, ...] = (0.03, 0.1, 0.3, 1.0)


ERROR_MEMORY = CorrectionSettings()

BATCH_COUNT = 256
"""Number of blocks that share one kernel of all samples that they remember."""


@dataclass(frozen=True, eq=False)
class AdaptiveCorrection:
    """Settings of the correction: scaling of the features, kernel and memory."""

    centre: np.ndarray  # Mean of each feature, shape (k,)
    scale: np.ndarray  # Standard deviation of each feature, shape (k,)
    length: float  # Length scale of the kernel, in standardised features
    noise: float  # Noise share nu of the kernel's diagonal
    window: float = ERROR_MEMORY.window_s  # Duration for which errors are remembered [s]
    spacing: float = ERROR_MEMORY.spacing_s  # Interval between remembered errors [s]

    def correct(self, x: np.ndarray, predicted: np.ndarray, reference: np.ndarray, fs: float) -> np.ndarray:
        """Return the torque `predicted` along a trial, corrected sample by sample as a robot would.

        Each sample uses only those values of `reference` that were measured before it. `x` holds features, shape
        (n, k); `predicted`, `reference` and the result have shape (n,) [N m]; `fs` [Hz].
        """
        z = (np.asarray(x, float) - self.centre) / self.scale
        error = np.asarray(reference, float) - np.asarray(predicted, float)
        every, kept = max(1, round(self.spacing * fs)), max(2, round(self.window / self.spacing))
        corrected = np.array(predicted, float)
        # The remembered samples end one sample before the block that they correct. The next block remembers nearly the
        # same ones, so that the kernel is computed once for many blocks.
        last = np.arange(every - 1, len(z) - 1, every)
        for begin in range(0, len(last), BATCH_COUNT):
            known = last[max(0, begin + 1 - kept) : begin + BATCH_COUNT][::-1]
            gram = _kernel(z[known], z[known], self.length) + self.noise * np.eye(len(known))
            for i, newest in enumerate(known):
                if newest < last[begin]:
                    break
                own = slice(i, i + kept)
                _, weights, _ = dposv(gram[own, own], error[known[own]], lower=1)
                here = slice(newest + 1, newest + 1 + every)
                corrected[here] += _kernel(z[here], z[known[own]], self.length) @ weights
        return corrected


def fit_adaptive_correction(parts: Sequence[tuple[np.ndarray, np.ndarray]], *, most: int = 400) -> AdaptiveCorrection:
    """Choose length and noise by the likelihood of an estimator's errors on its fitted trials.

    `parts` holds features, shape (n, k), and errors, shape (n,) [N m], of each trial. At most `most` samples are used.
    """
    x, error = np.concatenate([p[0] for p in parts]), np.concatenate([p[1] for p in parts])
    if len(x) < 10:
        raise IdentificationError(f"adaptive correction: found {len(x)} samples, expected at least 10")
    centre, scale = mean_and_scale(x)
    thinned = np.linspace(0, len(x) - 1, min(most, len(x))).astype(int)
    z, e = (x[thinned] - centre) / scale, error[thinned]
    reach = np.sqrt(x.shape[1])
    choices = [(_log_likelihood(z, e, length * reach, noise), length * reach, noise)
               for length in ERROR_MEMORY.length_scales for noise in ERROR_MEMORY.noise_shares]  # fmt: skip
    _, length, noise = max(choices)
    return AdaptiveCorrection(centre, scale, float(length), noise)


def _kernel(a: np.ndarray, b: np.ndarray, length: float) -> np.ndarray:
    squared = np.sum(a**2, axis=1)[:, None] + np.sum(b**2, axis=1) - 2.0 * a @ b.T
    return np.exp(-np.maximum(squared, 0.0) / (2.0 * length**2))


def _log_likelihood(z: np.ndarray, error: np.ndarray, length: float, noise: float) -> float:
    """Return the log-likelihood of errors at their best variance, without its constant terms."""
    lower = np.linalg.cholesky(_kernel(z, z, length) + noise * np.eye(len(z)))
    whitened = solve_triangular(lower, error, lower=True)
    return -0.5 * len(error) * float(np.log(np.mean(whitened**2))) - float(np.sum(np.log(np.diag(lower))))


CORRECTION_FEATURES = FeatureSet(velocities=True)
"""Features of the correction: EMG, the joint's angle and its velocity."""

WEAK_ANATOMY_WEIGHT = 1e-3
"""Weight of the anatomical prior. The original has bounds alone; this weight suffices to make parameters unique."""


@dataclass(frozen=True, eq=False)
class CorrectedMap:
    """An estimator whose errors are learnt online."""

    name: str
    base: HillMap
    correction: AdaptiveCorrection = field(repr=False)
    causal: bool = False

    @property
    def choice(self) -> HillChoice:
        """Choice of the corrected estimator."""
        return replace(self.base.choice, words=f"{self.base.choice.words}; errors learnt from the torque so far")

    def predict(self, trial: TorqueTrial) -> np.ndarray:
        """Predict the torque of a trial, shape (n,) [N m]. Each sample uses the torque measured before it."""
        x = compute_features(trial, CORRECTION_FEATURES, causal=self.causal).x
        return self.correction.correct(x, self.base.predict(trial), trial.torque, trial.fs)


@dataclass(frozen=True, eq=False)
class UncoupledMap:
    """Muscles that do not see the angles of neighbouring joints."""

    name: str
    base: HillMap

    @property
    def choice(self) -> HillChoice:
        """Choice of the muscles."""
        return self.base.choice

    def predict(self, trial: TorqueTrial) -> np.ndarray:
        """Predict the torque of a trial, shape (n,) [N m]."""
        return self.base.predict(uncouple_trial(trial))


def uncouple_trial(trial: TorqueTrial) -> TorqueTrial:
    """Return the trial with the joint's own angle alone, and with lengths and moment arms of the model."""
    muscles = None if trial.muscles is None else replace(trial.muscles, recorded={})
    return replace(trial, angles={trial.joint: trial.angles[trial.joint]}, muscles=muscles)


def fit_nmco(trials: Sequence[TorqueTrial], name: str, causal: bool) -> HillMap:
    """Fit NM-CO to `trials`, under `name`; `causal` filters use the past alone."""
    return fit_hill(
        trials, name=name, causal=causal, weights=(WEAK_ANATOMY_WEIGHT,), method="swarm", weighs_trials=False
    )


def fit_nmcoa(trials: Sequence[TorqueTrial], name: str, causal: bool) -> CorrectedMap:
    """Fit NM-COA to `trials`, under `name`; `causal` filters use the past alone."""
    return correct_nmco(fit_nmco(trials, name, causal), trials, name, causal)


def correct_nmco(base: HillMap, trials: Sequence[TorqueTrial], name: str, causal: bool) -> CorrectedMap:
    """Fit NM-COA, under `name`, on NM-CO that was fitted to the same `trials`."""
    parts = [(compute_features(t, CORRECTION_FEATURES, causal=causal).x, t.torque - base.predict(t)) for t in trials]
    return CorrectedMap(name, base, fit_adaptive_correction(parts), causal)


def fit_nmnc(trials: Sequence[TorqueTrial], name: str, causal: bool) -> UncoupledMap:
    """Fit NM-NC to `trials`, under `name`; `causal` filters use the past alone."""
    alone = [uncouple_trial(t) for t in trials]
    return UncoupledMap(
        name,
        fit_hill(
            alone, name=name, causal=causal, weights=(WEAK_ANATOMY_WEIGHT,), method="descent", weighs_trials=False
        ),
    )
