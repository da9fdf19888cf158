r"""Weights of trials by a model of an estimator's errors, so that the trial with the largest torques does not decide.

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
