"""Detect EMG channels that are exchanged relative to another recording of the same electrodes.

A channel is compared by features of its electrode's place: amplitude at rest and in activity, spectrum, and the timing
of its activity relative to the other channels. Two channels count as exchanged if each fits the other's place as well
as channels of one session fit their own, and fits its own place poorly.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise

import numpy as np
import scipy


@dataclass(frozen=True)
class ExchangeThresholds:
    """Thresholds of the comparison of electrode places."""

    piece_s: float = 2.0  # Features are of pieces of this length, whose spread says how sure they are
    min_pieces: int = 3
    envelope_hz: float = 5.0  # Low-pass of the envelopes whose timing is compared
    lags_s: tuple[float, ...] = (-0.4, -0.3, -0.2, -0.1, 0.0, 0.1, 0.2, 0.3, 0.4)  # Lags of that timing
    # Edges of the bands whose shares of the power are compared [Hz]
    bands_hz: tuple[float, ...] = (20.0, 40.0, 60.0, 80.0, 100.0, 130.0, 170.0, 220.0, 300.0, 400.0)
    # Differences between recordings of one session beyond those of their pieces: of the logarithm of sizes, of that of
    # shares of the power, and of the transformed correlations of envelopes. Chosen by judgement.
    size_drift: float = 0.2
    band_drift: float = 0.15
    timing_drift: float = 0.15
    # Mean squared difference, in standard deviations, up to which a channel fits a place
    max_fitting: float = 1.5
    # By how much that of its own place is larger, and how many times as large
    min_excess: float = 0.8
    min_ratio: float = 2.0


EXCHANGE_LIMITS = ExchangeThresholds()


@dataclass(frozen=True, eq=False)
class ElectrodePlaces:
    """What the channels of a recording show of their electrodes' places."""

    features: np.ndarray  # (channels, features)
    spread: np.ndarray  # (channels, features): standard deviation of each feature
    timing: np.ndarray  # (channels, channels, lags): transformed correlations of envelopes
    timing_spread: np.ndarray  # the same shape


def electrode_places(emg: np.ndarray, rate: float) -> ElectrodePlaces | None:
    """Return the places that raw EMG, (n, channels), shows; None if it is too short, too slow or lacks samples."""
    size = round(EXCHANGE_LIMITS.piece_s * rate)
    count = len(emg) // size if size else 0
    edges = [edge for edge in EXCHANGE_LIMITS.bands_hz if edge < 0.45 * rate]
    if count < EXCHANGE_LIMITS.min_pieces or len(edges) < 4 or emg.shape[1] < 2:
        return None
    known = np.isfinite(emg)
    if known.mean() < 0.8 or not known.any(axis=0).all():
        return None
    centred = np.where(known, emg - np.nanmean(emg, axis=0), 0.0)
    passed = scipy.signal.sosfiltfilt(scipy.signal.butter(2, 20.0, "highpass", fs=rate, output="sos"), centred, axis=0)
    if not (passed.std(axis=0) > 0.0).all():
        return None
    low = scipy.signal.butter(2, EXCHANGE_LIMITS.envelope_hz, fs=rate, output="sos")
    envelope = np.maximum(scipy.signal.sosfiltfilt(low, np.abs(passed), axis=0), 1e-3 * np.abs(passed).mean(axis=0))
    features, timing = [], []
    for k in range(count):
        part = slice(k * size, (k + 1) * size)
        sizes = np.log(np.quantile(envelope[part], (0.1, 0.5, 0.9), axis=0))
        frequency, density = scipy.signal.welch(passed[part], rate, nperseg=min(size, 512), axis=0)
        shares = [density[(frequency >= a) & (frequency < b)].sum(axis=0) for a, b in pairwise(edges)]
        shares = np.log(np.maximum(np.array(shares) / np.sum(shares, axis=0), 1e-4))
        features.append(np.vstack([sizes, shares]).T)
        timing.append(_lagged_correlations(np.log(envelope[part]), rate))
    own, beside = np.array(features), np.array(timing)
    drift = np.concatenate(
        [np.full(3, EXCHANGE_LIMITS.size_drift), np.full(len(edges) - 1, EXCHANGE_LIMITS.band_drift)]
    )
    spread = np.sqrt(np.var(own, axis=0, ddof=1) / count + drift**2)
    timing_spread = np.sqrt(np.var(beside, axis=0, ddof=1) / count + EXCHANGE_LIMITS.timing_drift**2)
    return ElectrodePlaces(own.mean(axis=0), spread, beside.mean(axis=0), timing_spread)


def _lagged_correlations(x: np.ndarray, rate: float) -> np.ndarray:
    """Return the transformed correlations of channels, (n, channels), with each other, (channels, channels, lags)."""
    z = (x - x.mean(axis=0)) / np.maximum(x.std(axis=0), 1e-12)
    made = []
    for lag in np.round(np.array(EXCHANGE_LIMITS.lags_s) * rate).astype(int):
        first, second = (z[: len(z) - lag], z[lag:]) if lag >= 0 else (z[-lag:], z[:lag])
        made.append(first.T @ second / len(first))
    return np.arctanh(np.clip(np.moveaxis(np.array(made), 0, -1), -0.95, 0.95))


def exchanged_pairs(one: ElectrodePlaces | None, other: ElectrodePlaces | None) -> list[tuple[int, int]]:
    """Return the pairs of channels of `one` that are exchanged against `other`, of the same channels."""
    if one is None or other is None or one.features.shape != other.features.shape:
        return []
    whole = list(range(len(one.features)))
    stay = _misfits(one, other, whole)
    found = []
    for i, j in combinations(whole, 2):
        places = list(whole)
        places[i], places[j] = j, i
        moved = _misfits(one, other, places)
        rest = [k for k in whole if k not in (i, j)]
        # Where the other channels do not fit their places either, the movement is another one.
        if rest and float(np.median(moved[rest])) > EXCHANGE_LIMITS.max_fitting:
            continue
        own, others = float(np.mean(stay[[i, j]])), float(np.mean(moved[[i, j]]))
        is_other_place = own > others + EXCHANGE_LIMITS.min_excess and own > EXCHANGE_LIMITS.min_ratio * others
        if others < EXCHANGE_LIMITS.max_fitting and is_other_place:
            found.append((own - others, i, j))
    taken: set[int] = set()
    pairs = []
    for _, i, j in sorted(found, reverse=True):
        if not {i, j} & taken:
            taken |= {i, j}
            pairs.append((i, j))
    return sorted(pairs)


@dataclass(frozen=True)
class ExchangedRecording:
    """A recording with exchanged channels, by its place and that of its reference among some recordings."""

    place: int
    reference: int
    pairs: tuple[tuple[int, int], ...]  # Channels that are exchanged


def exchanged_recordings(emg: Sequence[np.ndarray], rate: float) -> list[ExchangedRecording]:
    """Return the recordings of raw EMG (n, channels) with exchanged channels.

    The first recording is the reference, unless most of the others differ from it.
    """
    if len(emg) < 2:
        return []
    places = [electrode_places(x, rate) for x in emg]

    def differing(reference: int) -> list[ExchangedRecording]:
        others = [(k, exchanged_pairs(own, places[reference])) for k, own in enumerate(places) if k != reference]
        return [ExchangedRecording(k, reference, tuple(pairs)) for k, pairs in others if pairs]

    found = differing(0)
    if len(found) > 1 and 2 * len(found) >= len(emg) - 1:
        others = differing(found[0].place)
        if len(others) < len(found):
            return others
    return found


def _misfits(one: ElectrodePlaces, other: ElectrodePlaces, places: Sequence[int]) -> np.ndarray:
    """Return each channel's mean squared difference, in its spread, from its place in `other`, (channels,)."""
    at = np.asarray(places)
    size = (one.features - other.features[at]) ** 2 / (one.spread**2 + other.spread[at] ** 2)
    here, there = one.timing, other.timing[np.ix_(at, at)]
    timing = (here - there) ** 2 / (one.timing_spread**2 + other.timing_spread[np.ix_(at, at)] ** 2)
    beside = timing.mean(axis=2).sum(axis=1) - np.diagonal(timing.mean(axis=2))
    return 0.5 * (size.mean(axis=1) + beside / (len(at) - 1))
