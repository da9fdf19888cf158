r"""A Gaussian process that learns an estimator's errors from a measured torque and corrects the next samples.

The process remembers features x and errors e of the last samples within a sliding window. With

.. math::  k(x, x') = \sigma^2 e^{-|x - x'|^2 / 2 \ell^2}, \qquad
   \hat\tau(x) = \tau^{model}(x) + k_x^T (K + \nu\sigma^2 I)^{-1} e

a torque is corrected before it is measured: the correction sees only the features of the present sample. It needs a
torque that is measured all the time, and is useless once the measurement ends. It works on top of any estimator.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve, solve_triangular

from ..._errors import IdentificationError
from .torque_regressor import mean_and_scale


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


CORRECTION = CorrectionSettings()


@dataclass(frozen=True, eq=False)
class AdaptiveCorrection:
    """Settings of the correction: scaling of the features, kernel and memory."""

    centre: np.ndarray  # Mean of each feature, shape (k,)
    scale: np.ndarray  # Standard deviation of each feature, shape (k,)
    length: float  # Length scale of the kernel, in standardised features
    noise: float  # Noise share nu of the kernel's diagonal
    window: float = CORRECTION.window_s  # Duration for which errors are remembered [s]
    spacing: float = CORRECTION.spacing_s  # Interval between remembered errors [s]

    def correct(self, x: np.ndarray, predicted: np.ndarray, reference: np.ndarray, fs: float) -> np.ndarray:
        """Return the torque `predicted` along a trial, corrected sample by sample as a robot would.

        Each sample uses only those values of `reference` that were measured before it. `x` holds features, shape
        (n, k); `predicted`, `reference` and the result have shape (n,) [N m]; `fs` [Hz].
        """
        z = (np.asarray(x, float) - self.centre) / self.scale
        error = np.asarray(reference, float) - np.asarray(predicted, float)
        every, kept = max(1, round(self.spacing * fs)), max(2, round(self.window / self.spacing))
        corrected = np.array(predicted, float)
        for block in range(every, len(z), every):
            # The remembered samples end one sample before the block that they correct.
            known = np.arange(block - 1, -1, -every)[:kept]
            weights = self._solve_weights(z[known], error[known])
            here = slice(block, block + every)
            corrected[here] += _kernel(z[here], z[known], self.length) @ weights
        return corrected

    def _solve_weights(self, z: np.ndarray, error: np.ndarray) -> np.ndarray:
        gram = _kernel(z, z, self.length) + self.noise * np.eye(len(z))
        return cho_solve(cho_factor(gram, lower=True, check_finite=False), error, check_finite=False)


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
               for length in CORRECTION.length_scales for noise in CORRECTION.noise_shares]  # fmt: skip
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
