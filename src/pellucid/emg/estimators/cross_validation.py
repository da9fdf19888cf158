"""Folds that do not leak, made of whole trials or of blocks of time with gaps, and scores of predictions.

Neighbouring samples of one movement are almost copies of each other. A fold of samples drawn at random would therefore
score an estimator on data that it has seen.

Repair only the channels whose change costs an estimator's torque, so that it gets no worse by a repair.

A repair by the first seconds of a recording is itself uncertain: it scales a channel to the range that it had in other
strides. An estimator that hardly uses the channel has nothing to gain by it. A channel is therefore repaired for an
estimator only if its repair moves the estimated torque by more than `WATCH_DEFAULTS.max_loss` of the fitted torque's
variance, the same share at which a running estimator replaces a channel. The measured torque of the recording is not
used.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ..._errors import IdentificationError
from ..models.emg_estimator import WATCH_DEFAULTS
from .torque_trial import TorqueTrial

TIE_SHARE = 1e-9
"""Errors that differ by less than this share are equal: processors sum in other orders, which moves the last digits."""

Fold = tuple[np.ndarray, np.ndarray]
"""Indices of the fitted samples, then indices of the scored samples."""


def grouped_folds(groups: Sequence[str] | np.ndarray) -> list[Fold]:
    """Return one cross-validation fold for each group. `groups` has shape (n,)."""
    groups = np.asarray(groups)
    names = list(dict.fromkeys(groups.tolist()))
    if len(names) < 2:
        raise IdentificationError(f"found {len(names)} group of samples, expected at least two to leave one out")
    return [(np.flatnonzero(groups != name), np.flatnonzero(groups == name)) for name in names]


def block_folds(time: np.ndarray, blocks: int, gap: float) -> list[Fold]:
    """Return folds of consecutive blocks of one recording, each held out with a gap on either side.

    `time` has shape (n,) [s]; `gap` is in seconds.
    """
    time = np.asarray(time, float)
    edges = np.linspace(0, len(time), blocks + 1).astype(int)
    folds = []
    for a, b in pairwise(edges):
        scored = np.arange(a, b)
        if len(scored):
            far = (time < time[a] - gap) | (time > time[b - 1] + gap)
            folds.append((np.flatnonzero(far), scored))
    if blocks < 2 or len(folds) < blocks or any(len(fitted) == 0 for fitted, _ in folds):
        raise IdentificationError(
            f"found {len(time)} samples over {np.ptp(time) if len(time) else 0.0:.3g} s, expected more than {blocks} "
            f"blocks with gaps of {gap:g} s can hold"
        )
    return folds


@dataclass(frozen=True)
class Score:
    """Errors of predictions against a reference."""

    rmse: float  # Root mean square error, in the reference's unit
    r2: float  # Share of the reference's variance that predictions explain


def score(reference: np.ndarray, predicted: np.ndarray) -> Score:
    """Score predictions against a reference, both of shape (n,).

    R² is 1 - (sum of squared errors) / (sum of squares about the reference's own mean).
    """
    reference, error = np.asarray(reference, float), np.asarray(reference, float) - np.asarray(predicted, float)
    spread = float(np.sum((reference - reference.mean()) ** 2))
    r2 = 1.0 - float(error @ error) / spread if spread > 0.0 else float("nan")
    return Score(float(np.sqrt(np.mean(error**2))), r2)


def covered_share(reference: np.ndarray, predicted: np.ndarray, half_width: float | np.ndarray) -> float:
    """Return the share of a reference within a band about its prediction, both of shape (n,)."""
    return float(np.mean(np.abs(reference - predicted) <= half_width))


def weighted_rmse(reference: np.ndarray, predicted: np.ndarray, weight: np.ndarray | None) -> float:
    """Return the root mean square error, all of shape (n,); `weight` None: every sample counts the same."""
    error = np.asarray(reference, float) - np.asarray(predicted, float)
    return float(np.sqrt(np.average(error**2, weights=weight)))


def first_best(errors: Sequence[float]) -> int:
    """Return the index of the least error, of errors equal within `TIE_SHARE` the first. NaN is never the least."""
    known = np.nan_to_num(np.asarray(errors, float), nan=np.inf)
    return int(np.argmax(known <= known.min() * (1.0 + TIE_SHARE)))


def apply_useful_repairs(
    predict: Callable[[TorqueTrial], np.ndarray],
    fitted: Sequence[TorqueTrial],
    recorded: TorqueTrial,
    repaired: TorqueTrial,
) -> tuple[TorqueTrial, tuple[str, ...]]:
    """Return the trial with those channels repaired that matter to an estimator, and their names.

    Parameters
    ----------
    predict : callable
        Estimated torque of a trial, shape (n,) [N m].
    fitted : sequence of TorqueTrial
        Trials that the estimator was fitted to.
    recorded, repaired : TorqueTrial
        The trial as it was recorded, and with all its changed channels repaired.

    Returns
    -------
    trial : TorqueTrial
        The recorded trial itself if no repair matters.
    muscles : tuple of str
        Muscles whose channels are repaired in it.
    """
    moved = [m for m, x in recorded.envelopes.items() if not np.array_equal(x, repaired.envelopes[m])]
    if not moved:
        return recorded, ()
    variance = float(np.var(np.concatenate([t.torque for t in fitted])))
    usual, kept = predict(replace(recorded, lead={})), []
    for muscle in moved:
        one = replace(recorded, envelopes={**recorded.envelopes, muscle: repaired.envelopes[muscle]}, lead={})
        if float(np.mean((predict(one) - usual) ** 2)) > WATCH_DEFAULTS.max_loss * variance:
            kept.append(muscle)
    if not kept:
        return recorded, ()
    envelopes = {m: (repaired if m in kept else recorded).envelopes[m] for m in recorded.envelopes}
    return replace(recorded, envelopes=envelopes, lead={}), tuple(kept)
