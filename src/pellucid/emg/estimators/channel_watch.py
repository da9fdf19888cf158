r"""Give an estimator's card a watch: what each channel was in the fitted recordings, and what its change would cost.

The core steps the watch with the estimator (``include/pellucid/emg_watch.hpp``). Its numbers come from the fitted
recordings alone:

pattern
    Ridge regression of the envelope on angles and their rates, with squares and products.
usual
    Largest mean square of what the pattern leaves, with the memory of the watch, in and out of fold. Fitted recordings
    therefore pass their own watch.
consequence
    Mean square change of the torque when the channel is doubled, over the mean square of its envelope and the variance
    of the torque: the share of the torque's variance that a squared error of the envelope costs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from scipy.signal import lfilter

from ..models.emg_estimator import (
    WATCH_MEMORY_S,
    EmgEstimatorCard,
    EstimatorTerm,
    EstimatorWatch,
    WatchedAngle,
    WatchedChannel,
)
from .emg_session import FITTED_RANGE_MARGIN_SHARE, MIN_MOTION_MARGINS, PATTERN_PENALTY
from .features import filter_and_differentiate
from .ridge import Ridge
from .torque_trial import TorqueTrial

WATCH_BLOCK_COUNT = 5
"""Number of blocks of each trial that are left out in turn to see how far a pattern holds."""

BLOCK_GAP_S = 0.2
"""Gap between the samples of a pattern's fit and the block that is left out [s], longer than an envelope's memory."""

MIN_WATCHED_SAMPLES = 100
"""Smallest number of fitted samples of which patterns are made. A quadratic pattern of three joints has 28 terms."""

MIN_SQUARE = 1e-12
"""Least mean square of a pattern by which the core divides."""


def add_channel_watch(card: EmgEstimatorCard, trials: Mapping[str, Sequence[TorqueTrial]]) -> EmgEstimatorCard:
    """Return the card with a watch of its channels.

    Parameters
    ----------
    card : EmgEstimatorCard
        Estimator that was calibrated on the trials.
    trials : mapping of str to sequence of TorqueTrial
        Fitted trials of each of its joints: the same recordings in the same order.

    Returns
    -------
    EmgEstimatorCard
        The card itself if there are too few samples, or a torque that does not change.
    """
    first = list(next(iter(trials.values())))
    names = [channel.name for channel in card.channels]
    if sum(map(len, first)) < MIN_WATCHED_SAMPLES or not names:
        return card
    x = [np.column_stack([t.envelopes[name] for name in names]) for t in first]
    moved = [_motion(t, card.angles) for t in first]
    ceiling = np.array([channel.ceiling for channel in card.channels])
    patterns = _fit_patterns(moved, x)
    within = [_predict(patterns, m, ceiling) for m in moved]
    left_out = [_predict_left_out(i, first, moved, x, ceiling) for i in range(len(first))]
    means = tuple(
        np.mean(np.vstack([a * b for a, b in zip(u, v, strict=True)]), axis=0)
        for u, v in ((x, x), (x, left_out), (left_out, left_out))
    )
    usual = np.max(
        [
            _remembered_error(envelope, p, t.fs, WATCH_MEMORY_S, means).max(axis=0)
            for made in (within, left_out)
            for envelope, p, t in zip(x, made, first, strict=True)
        ],
        axis=0,
    )
    consequence = _consequences(card, trials, x)
    if not np.isfinite(consequence).all():
        return card
    features = [f"{what}.{angle}" for angle in card.angles for what in ("angle", "velocity")]
    channels = tuple(
        WatchedChannel(
            float(consequence[k]),
            float(usual[k]),
            float(means[0][k]),
            float(means[1][k]),
            float(means[2][k]),
            tuple(_term(name, w) for name, w in patterns[k].unscaled_coefficients(features).items()),
        )
        for k in range(len(names))
    )
    low, high = np.vstack(moved).min(axis=0), np.vstack(moved).max(axis=0)
    margin = np.maximum(FITTED_RANGE_MARGIN_SHARE * (high - low), np.tile(MIN_MOTION_MARGINS, len(card.angles)))
    low, high = low - margin, high + margin
    angles = tuple(
        WatchedAngle(float(low[2 * a]), float(high[2 * a]), float(low[2 * a + 1]), float(high[2 * a + 1]))
        for a in range(len(card.angles))
    )
    return replace(card, watch=EstimatorWatch(channels, angles))


def _motion(trial: TorqueTrial, angles: Sequence[str]) -> np.ndarray:
    """Return angles and their rates as the core filters them, shape (n, 2 angles)."""
    pairs = [filter_and_differentiate(np.asarray(trial.angles[a], float), trial.fs, causal=True)[:2] for a in angles]
    return np.column_stack([column for pair in pairs for column in pair])


def _fit_patterns(moved: Sequence[np.ndarray], x: Sequence[np.ndarray]) -> list[Ridge]:
    """Return the pattern of each channel from motion, shape (n, 2 angles) each, and envelopes, shape (n, k) each."""
    motion, envelopes = np.vstack(moved), np.vstack(x)
    everything = tuple(range(motion.shape[1]))
    return [Ridge(PATTERN_PENALTY, everything).fit(motion, envelopes[:, k]) for k in range(envelopes.shape[1])]


def _predict(patterns: Sequence[Ridge], moved: np.ndarray, ceiling: np.ndarray) -> np.ndarray:
    """Return the envelopes by their patterns, within 0 and the channels' ceilings, shape (n, k)."""
    return np.clip(np.column_stack([pattern.predict(moved) for pattern in patterns]), 0.0, ceiling)


def _predict_left_out(
    index: int,
    trials: Sequence[TorqueTrial],
    moved: Sequence[np.ndarray],
    x: Sequence[np.ndarray],
    ceiling: np.ndarray,
) -> np.ndarray:
    """Return a trial's envelopes by patterns of all trials without the block that is predicted, shape (n, k)."""
    n, gap = len(trials[index]), round(BLOCK_GAP_S * trials[index].fs)
    edges, made = np.linspace(0, n, WATCH_BLOCK_COUNT + 1).astype(int), np.empty_like(x[index])
    for a, b in pairwise(edges):
        kept = np.ones(n, bool)
        kept[max(0, a - gap) : b + gap] = False
        rows = [np.full(len(each), True) if i != index else kept for i, each in enumerate(x)]
        patterns = _fit_patterns(
            [m[r] for m, r in zip(moved, rows, strict=True)], [e[r] for e, r in zip(x, rows, strict=True)]
        )
        made[a:b] = _predict(patterns, moved[index][a:b], ceiling)
    return made


def _remembered_error(
    x: np.ndarray, pattern: np.ndarray, fs: float, seconds: float, means: Sequence[np.ndarray]
) -> np.ndarray:
    """Return the mean square of x - s p over max(1, s^2), with the memory of the watch, shape (n, k).

    `means` are <x x>, <x p> and <p p> with which the memory begins, shape (k,) each.
    """
    share = min(1.0, 1.0 / (seconds * fs))
    square, product, pattern_square = (
        lfilter([share], [1.0, share - 1.0], y, axis=0, zi=((1.0 - share) * mean)[None, :])[0]
        for y, mean in zip((x * x, x * pattern, pattern * pattern), means, strict=True)
    )
    common = _common_factor(np.sqrt(square / np.maximum(pattern_square, MIN_SQUARE)))[:, None]
    missed = square - 2.0 * common * product + common**2 * pattern_square
    return np.maximum(missed, 0.0) / np.maximum(1.0, common**2)


def _common_factor(factors: np.ndarray) -> np.ndarray:
    """Return the median of each row, or with up to three channels the factor nearest to 1, shape (n,)."""
    if factors.shape[1] > 3:
        return np.median(factors, axis=1)
    nearest = np.argmin(np.maximum(factors, 1.0 / np.maximum(factors, 1e-6)), axis=1)
    return np.take_along_axis(factors, nearest[:, None], axis=1)[:, 0]


def _consequences(
    card: EmgEstimatorCard, trials: Mapping[str, Sequence[TorqueTrial]], x: Sequence[np.ndarray]
) -> np.ndarray:
    """Return the share of the torque's variance that a squared error of each channel costs, shape (k,).

    Of several joints the one that loses most counts.
    """
    bare = replace(card, watch=None, chain="none", channels=tuple(replace(c, scale=1.0) for c in card.channels))
    first = list(next(iter(trials.values())))

    def torques(envelopes: Sequence[np.ndarray]) -> np.ndarray:
        made = []
        for trial, own in zip(first, envelopes, strict=True):
            time = np.round(1e6 * (1.0 + card.period * np.arange(len(trial))))
            angles = np.array([trial.angles[a] for a in card.angles])
            made.append(bare.build().run(time, np.ascontiguousarray(own.T), angles)[0])
        return np.concatenate(made, axis=1)

    variance = np.array([np.var(np.concatenate([t.torque for t in trials[j.name]])) for j in card.joints])
    usual, square = torques(x), np.mean(np.vstack(x) ** 2, axis=0)
    found = np.zeros(len(card.channels))
    for k in range(len(found)):
        doubled = [np.where(np.arange(e.shape[1]) == k, 2.0 * e, e) for e in x]
        with np.errstate(divide="ignore", invalid="ignore"):
            cost = np.mean((torques(doubled) - usual) ** 2, axis=1) / variance / square[k]
        found[k] = 0.0 if square[k] == 0.0 else cost.max()
    return found


def _term(name: str, weight: float) -> EstimatorTerm:
    """Return one term of a pattern, given its name among the coefficients of a ridge regression."""
    first, _, second = ("", "", "") if name == "offset" else name.partition(" * ")
    return EstimatorTerm(float(weight), first, second)
