r"""Gain from EMG over joint angles alone: the increase of explained torque on held-out recordings or trials.

Let :math:`e_{0,t}` be the error of angles alone and :math:`e_{1,t}` that of the map with EMG, on the same samples of
the reference :math:`\tau_t`. The gain is the difference of both R²,

.. math:: g = \frac{\overline{e_0^2 - e_1^2}}{\overline{(\tau - \bar\tau)^2}} .

Neighbouring samples are alike, and errors of one stride belong together. The interval of one recording is therefore
Student's, of the mean gain in blocks of whole strides, each at least two correlation lengths of :math:`e_0^2 - e_1^2`
[1]_. In cross-validation over trials, the trials are the blocks.

The maps with and without EMG are both the best of their kind in tests within the fitted recordings. Another set of
tests might have chosen others. The interval therefore includes the jackknife variance of the gain, computed by omitting
each of these tests in turn.

EMG is worth recording if the whole interval lies above 0 and the gain reaches a required margin. It is not worth
recording if the whole interval lies below that margin. Otherwise these recordings do not decide.

.. [1] F. X. Diebold, R. S. Mariano, "Comparing predictive accuracy", J. Business & Economic Statistics 13, 1995.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..._errors import IdentificationError
from ...numerics.uncertainty import correlation_length

DEFAULT_WORTHWHILE_GAIN = 0.05
"""Gain in R² that makes electrodes worth their trouble unless a study says otherwise.

It is a convention: a twentieth of the torque's variance.
"""


@dataclass(frozen=True)
class WorthSettings:
    """Least numbers of trials and blocks for an interval."""

    min_trials: int = 3  # Smallest number of trials whose mean gain gets an interval
    # Shortest block of a recording in correlation lengths of the difference of squared errors
    correlation_lengths: float = 2.0
    # Smallest number of blocks into which a recording is divided, however long its correlations last
    min_block_count: int = 6


WORTH_BLOCKS = WorthSettings()

NORMAL_QUANTILE = 1.96
"""Half width of a 95 % interval in standard deviations."""


Answer = Literal["worth it", "not worth it", "cannot say"]
"""The three answers to whether EMG is worth it."""


@dataclass(frozen=True)
class EmgWorth:
    """Gain of EMG over angles alone, with its interval and the answer that follows."""

    gain: float  # R² with EMG minus R² of angles alone
    low: float  # Lower end of the 95 % interval of the gain
    high: float  # Upper end of the 95 % interval of the gain
    margin: float  # Gain that counts as worthwhile, stated beforehand
    blocks: int  # Number of trials, or of blocks of one recording, behind the interval
    is_founded: bool = True  # Whether enough trials were left to fit the map for any answer

    @property
    def answer(self) -> Answer:
        """Answer for the stated margin."""
        if not self.is_founded:
            return "cannot say"
        if self.low > 0.0 and self.gain >= self.margin:
            return "worth it"
        return "not worth it" if self.high < self.margin else "cannot say"


def worth_on_recording(
    torque: np.ndarray,
    with_emg: np.ndarray,
    angles_alone: np.ndarray,
    fs: float,
    margin: float = DEFAULT_WORTHWHILE_GAIN,
    other_choices: Sequence[tuple[np.ndarray, np.ndarray]] = (),
) -> EmgWorth:
    """Return the gain of EMG on one recording that was not fitted.

    Parameters
    ----------
    torque : ndarray, shape (n,)
        Reference torque [N m].
    with_emg, angles_alone : ndarray, shape (n,)
        Torque predicted with EMG, and from angles alone [N m].
    fs : float
        Sampling rate of all three [Hz].
    margin : float
        Gain in R² that counts as worthwhile.
    other_choices : sequence of pairs of ndarray, shape (n,)
        Both predictions, chosen without one of the tests within the fitted recordings [N m], for each test in turn.

    Returns
    -------
    EmgWorth

    Raises
    ------
    IdentificationError
        If the reference does not change, so that there is nothing to explain.

    Examples
    --------
    >>> time = np.arange(0.0, 20.0, 0.01)
    >>> torque, rng = np.sin(time), np.random.default_rng(1)
    >>> guess = torque + 0.1 * rng.standard_normal(len(time))
    >>> worth_on_recording(torque, guess, 0.5 * torque, fs=100.0).answer
    'worth it'
    """
    torque = np.asarray(torque, float)
    variance = float(np.var(torque))
    if not variance > 0.0:
        raise IdentificationError("what EMG is worth: found a reference torque that does not change, expected a change")
    apart = (np.square(torque - angles_alone) - np.square(torque - with_emg)) / variance
    from .causal_map import find_period  # imported late: every study's tables read a constant above

    means = _block_means(apart, find_period(torque, fs))
    gain = float(apart.mean())
    gains = [
        float(np.mean(np.square(torque - alone) - np.square(torque - told)) / variance) for told, alone in other_choices
    ]
    choice = (len(gains) - 1) * float(np.var(gains)) if len(gains) > 1 else 0.0
    half = float(np.hypot(_student_half_width(means), NORMAL_QUANTILE * np.sqrt(choice)))
    return EmgWorth(gain, gain - half, gain + half, margin, len(means))


def _block_means(apart: np.ndarray, period: int) -> np.ndarray:
    """Return the means of blocks of whole periods, or of the correlation's length if there is no period."""
    wanted = WORTH_BLOCKS.correlation_lengths * correlation_length(apart)
    length = period * max(1.0, np.ceil(wanted / period)) if period else wanted
    count = max(WORTH_BLOCKS.min_block_count, int(len(apart) // max(length, 1.0)))
    return np.array([part.mean() for part in np.array_split(apart, min(count, len(apart)))])


def _student_half_width(values: np.ndarray) -> float:
    """Return half of Student's 95 % interval of the mean of independent values, shape (n,)."""
    from scipy.special import stdtrit

    return float(stdtrit(len(values) - 1, 0.975) * values.std(ddof=1) / np.sqrt(len(values)))


def worth_over_trials(
    with_emg: Sequence[float], angles_alone: Sequence[float], margin: float = DEFAULT_WORTHWHILE_GAIN
) -> EmgWorth:
    """Return the mean gain of EMG in cross-validation over trials, from R² by trial, in the same order."""
    gains = np.asarray(with_emg, float) - np.asarray(angles_alone, float)
    gain, count = float(gains.mean()), len(gains)
    if count < WORTH_BLOCKS.min_trials:
        return EmgWorth(gain, float("-inf"), float("inf"), margin, count)
    half = _student_half_width(gains)
    return EmgWorth(gain, gain - half, gain + half, margin, count)
