r"""A Gaussian process that learns an estimator's errors while a reference torque is measured, and takes them off ahead.

Of the last samples within a sliding window it knows features x and errors e; with

.. math::  k(x, x') = \sigma^2 e^{-|x - x'|^2 / 2 \ell^2}, \qquad
   \hat\tau(x) = \tau^{model}(x) + k_x^T (K + \nu\sigma^2 I)^{-1} e

a torque is corrected before it is measured: of the present sample nothing but its features is seen. It needs a torque
that is measured all the time; where that ends, so does the correction's use. It works on top of any estimator.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve, solve_triangular

from .._errors import IdentificationError
from .standardise import mean_and_scale

WINDOW = 6.0
"""Of errors that are remembered [s]: some repetitions of a movement."""

SPACING = 0.04
"""Between errors that are remembered [s]."""

LENGTHS = (1.0, 2.0, 4.0)
"""Of the kernel, in standard deviations of each feature, times the root of their number."""

NOISES = (0.03, 0.1, 0.3, 1.0)
"""Share of the errors' variance that features do not explain."""


@dataclass(frozen=True, eq=False)
class AdaptiveCorrection:
    """What the correction knows before it begins."""

    centre: np.ndarray  # centre, scale: (k,) Of the features
    scale: np.ndarray
    length: float  # Of the kernel, in standardised features
    noise: float  # nu
    window: float = WINDOW  # window, spacing: [s]
    spacing: float = SPACING

    def correct(self, x: np.ndarray, predicted: np.ndarray, reference: np.ndarray, fs: float) -> np.ndarray:
        """The torque `predicted` along a trial, corrected as a robot would: of `reference` each sample uses what came
        before.

        `x`, shape (n, k), are features; `predicted` and `reference`, shape (n,) [N m], as is what is returned; `fs`
        [Hz].
        """
        z = (np.asarray(x, float) - self.centre) / self.scale
        error = np.asarray(reference, float) - np.asarray(predicted, float)
        every, kept = max(1, round(self.spacing * fs)), max(2, round(self.window / self.spacing))
        corrected = np.array(predicted, float)
        for block in range(every, len(z), every):
            # What is remembered ends one sample before the block that it corrects.
            known = np.arange(block - 1, -1, -every)[:kept]
            weights = self._weights(z[known], error[known])
            here = slice(block, block + every)
            corrected[here] += _kernel(z[here], z[known], self.length) @ weights
        return corrected

    def _weights(self, z: np.ndarray, error: np.ndarray) -> np.ndarray:
        gram = _kernel(z, z, self.length) + self.noise * np.eye(len(z))
        return cho_solve(cho_factor(gram, lower=True, check_finite=False), error, check_finite=False)


def adaptive_correction(parts: Sequence[tuple[np.ndarray, np.ndarray]], *, most: int = 400) -> AdaptiveCorrection:
    """Choose length and noise by the likelihood of errors made on what was fitted. `parts` (n, k) [N m]."""
    x, error = np.concatenate([p[0] for p in parts]), np.concatenate([p[1] for p in parts])
    if len(x) < 10:
        raise IdentificationError(f"adaptive correction: found {len(x)} samples, expected at least 10")
    centre, scale = mean_and_scale(x)
    thinned = np.linspace(0, len(x) - 1, min(most, len(x))).astype(int)
    z, e = (x[thinned] - centre) / scale, error[thinned]
    reach = np.sqrt(x.shape[1])
    choices = [(_likelihood(z, e, length * reach, noise), length * reach, noise)
               for length in LENGTHS for noise in NOISES]  # fmt: skip
    _, length, noise = max(choices)
    return AdaptiveCorrection(centre, scale, float(length), noise)


def _kernel(a: np.ndarray, b: np.ndarray, length: float) -> np.ndarray:
    squared = np.sum(a**2, axis=1)[:, None] + np.sum(b**2, axis=1) - 2.0 * a @ b.T
    return np.exp(-np.maximum(squared, 0.0) / (2.0 * length**2))


def _likelihood(z: np.ndarray, error: np.ndarray, length: float, noise: float) -> float:
    """Logarithm, the errors' variance at its best; constants left out."""
    lower = np.linalg.cholesky(_kernel(z, z, length) + noise * np.eye(len(z)))
    whitened = solve_triangular(lower, error, lower=True)
    return -0.5 * len(error) * float(np.log(np.mean(whitened**2))) - float(np.sum(np.log(np.diag(lower))))
