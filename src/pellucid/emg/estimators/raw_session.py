"""Compare raw EMG with that of the fitted recordings: spectrum, mains hum, saturation and cross-talk of channels.

None of these can be seen in envelopes. A spectrum hardly changes with effort, and its median falls by a fifth with
fatigue. An electrode that moved, dried or lost its contact changes the spectrum, the mains hum or the saturation. So
does another filter or another gain.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from ..._errors import IdentificationError
from ...numerics.filters import runs
from .emg_session import ChannelChange


@dataclass(frozen=True)
class RawThresholds:
    """Thresholds by which a channel of raw EMG has changed.

    No measurement is recorded for what is chosen by judgement.
    """

    band_hz: tuple[float, float] = (20.0, 450.0)  # Frequency band of surface EMG [Hz]
    mains_hz: tuple[float, float] = (50.0, 60.0)  # Frequencies of mains electricity around the world [Hz]
    # A median frequency may change by at most this factor, up or down. Fatigue changes it by a factor of 1.3.
    max_median_ratio: float = 1.4
    max_hum_rise: float = 0.15  # The mains' share of the power may rise by at most this. Chosen by judgement.
    # A channel counts as saturated only if more than this share of its samples lies in runs at its extreme values.
    # Chosen by judgement.
    max_saturated_share: float = 5e-4
    # Two electrodes can record one muscle only if their raw signals correlate by more than this. Chosen by judgement.
    min_shared_correlation: float = 0.5
    # Two electrodes count as recording one muscle only if Fisher's z of their correlation rose by more than this.
    # Chosen by judgement.
    min_shared_z_rise: float = 0.35
    spectrum_window_s: float = 0.5  # Duration of the window of one spectrum [s]. Chosen by judgement.
    # A muscle counts as active only if the upper quartile of its power exceeds the lower quartile by this factor.
    # Chosen by judgement.
    min_active_power_ratio: float = 4.0
    min_recording_s: float = 4.0  # Shortest recording that can be compared [s]. Chosen by judgement.


RAW_LIMITS = RawThresholds()


@dataclass(frozen=True, eq=False)
class RawChannels:
    """Properties of raw EMG channels over recordings with the same muscles.

    A change is of the kind ``"spectrum"``, ``"hum"``, ``"saturation"``, or ``"shared"`` by two electrodes.
    """

    muscles: tuple[str, ...]
    median: np.ndarray  # Median frequency, shape (k,) [Hz]; NaN if the muscle was never active
    hum: np.ndarray  # Share of the power at the mains' frequencies, shape (k,)
    rails: np.ndarray  # Share of the samples in runs at extreme values, shape (k,)
    together: np.ndarray  # Correlation of raw signals without the mains' frequencies, shape (k, k)

    @classmethod
    def from_recordings(cls, recordings: Sequence[tuple[Mapping[str, np.ndarray], float]]) -> RawChannels:
        """Describe the channels of recordings: samples by muscle, shape (n,) [V], with their rate [Hz]."""
        muscles = tuple(recordings[0][0])
        if any(set(channels) != set(muscles) for channels, _ in recordings):
            raise IdentificationError("raw channels: found other muscles in some recordings, expected the same in each")
        seconds = [len(next(iter(channels.values()))) / fs for channels, fs in recordings]
        weights = np.array(seconds) / sum(seconds)
        found = [_channel_properties(np.array([channels[m] for m in muscles]), fs) for channels, fs in recordings]
        median = np.array([_weighted_mean(weights, column) for column in np.transpose([each[0] for each in found])])
        return cls(muscles, median, *(np.tensordot(weights, [each[i] for each in found], 1) for i in (1, 2, 3)))

    def changes(self, now: RawChannels) -> tuple[ChannelChange, ...]:
        """Return the channels of `now` that differ from these."""
        return tuple(change for k in range(len(self.muscles)) for change in self._channel_changes(now, k))

    def _channel_changes(self, now: RawChannels, k: int) -> Iterator[ChannelChange]:
        """Yield what changed of channel `k`."""
        muscle, most = self.muscles[k], RAW_LIMITS.max_median_ratio
        ratio = now.median[k] / self.median[k]
        if np.isfinite(ratio) and not 1.0 / most <= ratio <= most:
            found, expected = f"a median frequency of {now.median[k]:.0f} Hz", f"{self.median[k]:.0f} Hz, as fitted"
            yield ChannelChange(muscle, "spectrum", found, f"{expected}, within {most:g} times")
        if now.hum[k] - self.hum[k] > RAW_LIMITS.max_hum_rise:
            found = f"{100.0 * now.hum[k]:.0f} % of the power at the mains' frequencies"
            yield ChannelChange(muscle, "hum", found, f"about {100.0 * self.hum[k]:.0f} %, as fitted")
        if now.rails[k] > RAW_LIMITS.max_saturated_share and now.rails[k] > 5.0 * self.rails[k]:
            found = f"{100.0 * now.rails[k]:.2g} % of the samples in runs at the largest value"
            yield ChannelChange(muscle, "saturation", found, f"{100.0 * self.rails[k]:.2g} %, as fitted")
        z, before = (np.arctanh(np.clip(np.abs(c.together[k]), 0.0, 0.9999)) for c in (now, self))
        close = (z > np.arctanh(RAW_LIMITS.min_shared_correlation)) & (z - before > RAW_LIMITS.min_shared_z_rise)
        close[k] = False
        if close.any():
            i = int(np.argmax(np.where(close, z, -1.0)))
            found = f"a raw signal like that of {self.muscles[i]} (correlation {now.together[i, k]:.2f})"
            expected = f"{self.together[i, k]:.2f}, as fitted; probably cross-talk, or one electrode for both channels"
            # The data cannot tell which of the two channels is the copy.
            yield ChannelChange(muscle, "shared", found, expected, self.muscles[i])


def _channel_properties(x: np.ndarray, fs: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return median frequencies, hum, saturation and correlations of channels `x`, shape (k, n) [V], at `fs` [Hz]."""
    k, n = x.shape
    if n < RAW_LIMITS.min_recording_s * fs:
        raise IdentificationError(
            f"raw channels: found {n / fs:.2g} s of raw EMG, expected at least {RAW_LIMITS.min_recording_s:g} s of each"
        )
    x = x - x.mean(axis=1, keepdims=True)
    rails = np.array([_saturated_share(each) for each in x])
    size = min(n, round(fs))
    # Hum is that of the mains frequency with more power. Both frequencies are left out of spectra.
    f, own = scipy.signal.welch(x, fs, nperseg=size, axis=-1)
    line = np.min([np.abs(f - m * h) for m in RAW_LIMITS.mains_hz for h in range(1, 10)], axis=0) <= 1.5
    band = (f >= RAW_LIMITS.band_hz[0]) & (f <= min(RAW_LIMITS.band_hz[1], 0.45 * fs))
    total = own[:, band].sum(axis=1)
    hum = np.zeros(k)
    for m in RAW_LIMITS.mains_hz:
        near = np.min([np.abs(f - m * h) for h in range(1, 6)], axis=0) <= 1.5
        # The muscle's own power at the mains' frequencies is taken to be its mean power elsewhere in the band.
        beside = own[:, band & ~line].mean(axis=1, keepdims=True)
        above = np.maximum(own[:, band & near] - beside, 0.0).sum(axis=1)
        hum = np.maximum(hum, above / np.maximum(total, 1e-300))
    kept = band & ~line
    median = np.array([_median_frequency(each, fs) for each in x])
    together = np.eye(k)
    for i in range(k):
        for j in range(i):
            _, both = scipy.signal.csd(x[i], x[j], fs, nperseg=size)
            scale = np.sqrt(own[i, kept].sum() * own[j, kept].sum())
            together[i, j] = together[j, i] = float(both[kept].real.sum() / scale) if scale > 0.0 else 0.0
    return median, hum, rails, together


def _median_frequency(x: np.ndarray, fs: float) -> float:
    """Return the median frequency of the quarter of the time in which a muscle is most active [Hz].

    It is NaN if the muscle is then hardly more active than in the rest.
    """
    f, _, power = scipy.signal.spectrogram(x, fs, nperseg=round(RAW_LIMITS.spectrum_window_s * fs), detrend="constant")
    line = (
        np.min([np.abs(f - m * h) for m in RAW_LIMITS.mains_hz for h in range(1, 10)], axis=0)
        <= 0.75 / RAW_LIMITS.spectrum_window_s
    )
    kept = (f >= RAW_LIMITS.band_hz[0]) & (f <= min(RAW_LIMITS.band_hz[1], 0.45 * fs))
    loud = power[kept & ~line].sum(axis=0)
    rest, work = np.quantile(loud, (0.25, 0.75))
    if not work > RAW_LIMITS.min_active_power_ratio * rest:
        return np.nan
    mean = power[:, loud >= work].mean(axis=1)
    # The muscle's own power at the mains' frequencies is interpolated from the neighbouring ones.
    mean[line] = np.interp(f[line], f[~line], mean[~line])
    share = np.cumsum(mean[kept])
    return float(np.interp(0.5 * share[-1], share, f[kept]))


def _weighted_mean(weights: np.ndarray, values: np.ndarray) -> float:
    """Return the weighted mean of the finite values; NaN if there are none."""
    known = np.isfinite(values)
    return float(np.average(values[known], weights=weights[known])) if known.any() else np.nan


def _saturated_share(x: np.ndarray) -> float:
    """Return the share of samples in runs of three or more at the largest or the smallest value."""
    ends = runs((x == x.max()) | (x == x.min()))
    return sum(r.stop - r.start for r in ends if r.stop - r.start >= 3) / len(x)
