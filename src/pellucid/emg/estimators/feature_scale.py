r"""Standardised features: mean 0 and variance 1, and 0 everywhere for a feature that does not vary.

Moving average of an estimator's output. Trees need it, since their output changes in steps.

Weights of trials by a model of an estimator's errors, so that the trial with the largest torques does not decide.

Strengths, moment arms and inverse dynamics err by a share of the torque. Marker noise and passive tissue add an error
that is there at any torque. The variance of the error in trial i is therefore taken as

.. math:: \sigma_i^2 \propto s_i^2 + (b \, \max_k s_k)^2 ,

with :math:`s_i` the standard deviation of the trial's reference torque. A sample of trial i has the weight
:math:`1/\sigma_i^2`, as in weighted least squares. Weights are scaled to a mean of 1 over all samples, so that a
penalty or a prior means the same with and without them. Fitting and choosing by the weighted error is then close to the
mean of the trials' own unexplained shares of variance. The floor keeps a trial in which nothing moves from deciding.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import uniform_filter1d

CONSTANT_SHARE = 1e-9
"""A feature is constant if its standard deviation is below this share of its largest magnitude. Sums of n equal numbers
leave a deviation of some 1e-16 of them; divided by that, a joint's angle in another recording would be any number.
"""


def mean_and_scale(x: np.ndarray, weight: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Return mean and standard deviation of each column of `x` (n, k), both (k,).

    `weight` (n,) weighs the rows; None: every row counts the same.

    A constant column has the scale infinity: divided by it, whatever it is later counts as its mean. What such a
    feature does to the torque is not in what was fitted.
    """
    if weight is None:
        mean, deviation = x.mean(axis=0), x.std(axis=0)
    else:
        mean = np.average(x, axis=0, weights=weight)
        deviation = np.sqrt(np.average((x - mean) ** 2, axis=0, weights=weight))
    varies = deviation > CONSTANT_SHARE * np.abs(x).max(axis=0)
    return mean, np.where(varies, deviation, np.inf)


def count_window_samples(seconds: float, fs: float) -> int:
    """Return the number of samples in a window of `seconds` [s] at a rate of `fs` [Hz]. It is odd, for a middle."""
    return 2 * round((seconds * fs - 1.0) / 2.0) + 1 if seconds * fs > 1.0 else 1


def smooth(samples: np.ndarray, seconds: float, fs: float, *, causal: bool = False) -> np.ndarray:
    """Return the moving average of `samples`, shape (n,), over `seconds` [s] at `fs` [Hz].

    The window is centred, or if `causal`, covers the past alone and is late by `smoothing_delay`. Beyond the ends, the
    first and last sample are repeated. The thesis averages 25 samples at 500 Hz, which are 0.05 s.
    """
    n = count_window_samples(seconds, fs)
    return uniform_filter1d(np.asarray(samples, float), n, mode="nearest", origin=(n - 1) // 2 if causal else 0)


def smoothing_delay(seconds: float, fs: float) -> float:
    """Return the delay of the causal average [s], at a rate of `fs` [Hz]."""
    return (count_window_samples(seconds, fs) - 1) / (2.0 * fs)


ERROR_FLOOR_SHARE = 0.2
"""Floor of the error's standard deviation, as a share of the largest trial's: b in the equation.

Chosen by judgement. Weights hardly depend on it unless trials differ by more than a factor of five.
"""


def find_trial_weights(torques: Sequence[np.ndarray]) -> np.ndarray | None:
    """Return the weight of each trial's samples, shape (trials,), or None if all weights are equal.

    `torques` holds the reference torque of each trial, shape (n,) each, in one unit.
    """
    if len(torques) < 2:
        return None
    deviations = np.array([float(np.std(torque)) for torque in torques])
    lengths = np.array([len(torque) for torque in torques], float)
    variance = deviations**2 + (ERROR_FLOOR_SHARE * deviations.max()) ** 2
    if not variance.min() > 0.0 or np.ptp(variance) == 0.0:
        return None
    weights = 1.0 / variance
    return weights * lengths.sum() / float(lengths @ weights)


def find_row_weights(torques: Sequence[np.ndarray]) -> np.ndarray | None:
    """Return the weight of every sample of trials that are joined one after another, shape (n,), or None if equal."""
    weights = find_trial_weights(torques)
    return None if weights is None else np.repeat(weights, [len(torque) for torque in torques])
