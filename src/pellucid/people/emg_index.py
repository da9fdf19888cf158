r"""Muscle activity of a movement, and the EMG/Acc index: how much activity an acceleration costs.

EMG is band-passed from 20 to 450 Hz, centred and rectified, divided by the largest value of the muscle in all of a
participant's recordings, and taken 0.1 s earlier than the motion. Over a movement with its agonists,

.. math::  \mathrm{EMG/Acc} = \frac{1}{C} \, \frac{\mathrm{mean}_m\, \mathrm{RMS}(e_m)}{\ddot q_{max}} - 1,

with C the same ratio in the control condition, for the same participant and amplitude [1]_. It is 0 for control by its
definition, and is not computed for movements that gravity helps.

Do EMG and motion run on one clock (`emg_lead`, `emg_drift`)? Muscles become active just before a limb accelerates,
never a second later.

.. [1] D. Verdel, S. Bastide, N. Vignais, O. Bruneau, B. Berret, "An identification-based method improving the
   transparency of a robotic upper limb exoskeleton", Robotica 39, 2021, eq. 9.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy import fft
from scipy.special import stdtrit

from .._errors import RecordingError
from ..files.stored_channels import rows_of
from ..numerics.filters import zero_phase_lowpass
from ..numerics.tied_ranks import tied_ranks
from ..units import COORDINATES_BY_UNIT, Coordinate
from .movements import Kinematics


@dataclass(frozen=True, eq=False)
class Activity:
    """Power of the rectified EMG of one recording, advanced: the sample at t causes the motion at t."""

    time: np.ndarray  # (m,) [s]
    # Cumulative sums of squares by muscle, (m + 1,), so that the RMS of any stretch takes two look-ups
    sums: Mapping[str, np.ndarray]
    largest: Mapping[str, float]  # largest value by muscle, in the amplifier's unit

    @classmethod
    def of_rectified(cls, time: np.ndarray, rectified: Mapping[str, np.ndarray]) -> Activity:
        """Return the activity of rectified EMG by muscle, (m,), at its times (m,) [s]."""
        sums = {m: np.zeros(len(each) + 1) for m, each in rectified.items()}
        for m, each in rectified.items():
            np.cumsum(np.square(each), out=sums[m][1:])
        return cls(time, sums, {m: float(each.max()) for m, each in rectified.items()})

    def later(self, seconds: float) -> Activity:
        """Return the same activity, delayed by `seconds`."""
        return replace(self, time=self.time + seconds)

    def levels(
        self, muscles: Sequence[str], maxima: Mapping[str, float], start: np.ndarray, end: np.ndarray
    ) -> np.ndarray:
        """Return the RMS activity of g `muscles` from `start` to `end` (k,) [s], relative to the `maxima`.

        The values, (g, k), are NaN outside the record.
        """
        first, last = np.searchsorted(self.time, start), np.searchsorted(self.time, end)
        outside = (start < self.time[0]) | (end > self.time[-1]) | (last - first < 2)
        return np.where(outside, np.nan, self._levels_between(muscles, maxima, first, last))

    def envelope(self, muscles: Sequence[str], maxima: Mapping[str, float], at: np.ndarray, width: float) -> np.ndarray:
        """Return the level in a window of a `width` [s] about each time `at`, (k,) [s]; (k,), NaN outside the record.

        The level is the mean of `levels` over the muscles.
        """
        first, last = (np.searchsorted(self.time, at + side * 0.5 * width) for side in (-1.0, 1.0))
        inside = (at - 0.5 * width >= self.time[0]) & (at + 0.5 * width <= self.time[-1]) & (last - first >= 2)
        return np.where(inside, np.mean(self._levels_between(muscles, maxima, first, last), axis=0), np.nan)

    def _levels_between(
        self, muscles: Sequence[str], maxima: Mapping[str, float], first: np.ndarray, last: np.ndarray
    ) -> np.ndarray:
        """Return the levels of stretches from their `first` sample to before their `last` one, (g, k)."""
        count, levels = np.maximum(last - first, 1), []
        for muscle in muscles:
            before, after = rows_of(self.sums, muscle, np.array([first, last]))
            levels.append(np.sqrt(np.maximum((after - before) / count, 0.0)) / maxima[muscle])
        return np.array(levels)


def maxima(activities: Sequence[Activity]) -> dict[str, float]:
    """Return the largest activity of every muscle over all recordings of a participant."""
    found = {m: max(each.largest[m] for each in activities) for m in activities[0].largest} if activities else {}
    silent = [muscle for muscle, top in found.items() if not top > 0.0]
    if silent:
        raise RecordingError(f"EMG: found no activity at all of {', '.join(silent)}, expected some in every recording")
    return found


def emg_per_acceleration(level: float, acceleration: float) -> float:
    """Return the activity `level` divided by the largest `acceleration` [s^2/rad]: eq. 9 without the control's C."""
    return level / acceleration if acceleration > 0.0 else float("nan")


LABEL_TOLERANCE_RAD = 0.01
"""A label matches a movement's amplitude within this tolerance, because labels may be rounded."""

MAX_AMPLITUDE_COUNT = 12
"""With more amplitudes than this they were drawn at random, and lie too close together to tell exchanged labels."""


@dataclass(frozen=True)
class LabelBounds:
    """Thresholds by which labelled amplitudes are compared with measured ones."""

    # Largest share of a recording's movements that may end nearer to another label than to their own
    max_mistaken_share: float = 0.1
    # A movement hit a label if it ends within this share of the distance to the border between two labels
    hit_distance_share: float = 1 / 3
    # Movements nearer to another label were aimed at it if at least this share of them hit it
    min_hit_share: float = 0.6
    # A label was exchanged as a whole if at least this share of its movements went to another label
    min_moved_label_share: float = 0.8
    # Labelled and measured amplitudes are unrelated if their rank correlation is below this
    min_rank_correlation: float = 0.5


LABELS_RULE = LabelBounds()


@dataclass(frozen=True)
class Strays:
    """Movements that end nearer to another label than to their own."""

    wrong: np.ndarray  # (n,)
    nearest: np.ndarray  # (n,) The label that each movement ends nearest to [rad]
    mislabelled: str  # Why they are labelled wrongly; empty where people may just have missed
    along: Coordinate = COORDINATES_BY_UNIT["rad"]  # What they go along: of a length all that is [rad] here is [m]

    def commonest(self, label: np.ndarray) -> str:
        """The commonest mistake of movements with these labels [rad], in words."""
        pairs = zip(label[self.wrong], self.nearest[self.wrong], strict=True)
        shown = (tuple(round(self.along.factor * float(x), 1) for x in p) for p in pairs)
        (own, other), count = Counter(shown).most_common(1)[0]
        unit = self.along.shown
        return f"nearer to another amplitude than to their label ({count} labelled {own:g} {unit} go {other:g} {unit})"


def strays(
    reach: np.ndarray, label: np.ndarray, labels: np.ndarray, along: Coordinate = COORDINATES_BY_UNIT["rad"]
) -> Strays:
    """Movements nearer to another label than to their own, and whether that is the labels' fault. `reach`, `label`
    (n,) [rad]; `labels` (k,) [rad]."""
    nearest = labels[np.argmin(np.abs(reach[:, None] - labels[None, :]), axis=1)]
    wrong = np.abs(nearest - label) > LABEL_TOLERANCE_RAD * along.radian
    if len(labels) > MAX_AMPLITUDE_COUNT:
        wrong[:] = False
        return Strays(wrong, nearest, _disordered(reach, label), along)
    said = _whole_label(reach, label, labels, along) or _aimed(reach, label, labels, along)
    return Strays(wrong, nearest, said, along)


def _to_labels(
    reach: np.ndarray, label: np.ndarray, labels: np.ndarray, own: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Nearest label, whether it is another, and whether it was hit, once what everybody falls short by is taken out."""
    scaled = reach / np.median(reach / label)
    at = np.argmin(np.abs(scaled[:, None] - labels[None, :]), axis=1)
    gap = np.array([np.min(np.abs(np.delete(labels, i) - each)) for i, each in enumerate(labels)])
    hit = np.abs(scaled - labels[at]) < LABELS_RULE.hit_distance_share * 0.5 * gap[at]
    return labels[at], np.abs(labels[at] - label) > own, hit


def _whole_label(reach: np.ndarray, label: np.ndarray, labels: np.ndarray, along: Coordinate) -> str:
    if len(labels) < 2:
        return ""
    nearest, wrong, hit = _to_labels(reach, label, labels, LABEL_TOLERANCE_RAD * along.radian)
    for own in labels:
        of = np.abs(label - own) <= LABEL_TOLERANCE_RAD * along.radian
        if of.sum() < 2:
            continue
        for other in labels:
            there = of & wrong & (nearest == other)
            if there.sum() >= LABELS_RULE.min_moved_label_share * of.sum() and np.mean(hit[there]) >= 0.5:
                said, went = (f"{along.factor * each:.4g} {along.shown}" for each in (own, other))
                return f"{there.sum()} of {of.sum()} movements labelled {said} go {went}"
    return ""


def _aimed(reach: np.ndarray, label: np.ndarray, labels: np.ndarray, along: Coordinate) -> str:
    if len(labels) < 2:
        return ""
    _, wrong, hit = _to_labels(reach, label, labels, LABEL_TOLERANCE_RAD * along.radian)
    aimed = int((wrong & hit).sum())
    least = max(LABELS_RULE.max_mistaken_share * len(reach), LABELS_RULE.min_hit_share * wrong.sum())
    if aimed >= 2 and aimed > least:
        return f"{aimed} of {len(reach)} movements exactly as far as another label says"
    return ""


def _disordered(reach: np.ndarray, label: np.ndarray) -> str:
    if len(reach) < 10:
        return ""
    order = float(np.corrcoef(tied_ranks(reach), tied_ranks(label))[0, 1])
    return (
        f"a rank correlation of {order:.2f} between labelled and measured amplitudes"
        if order < LABELS_RULE.min_rank_correlation
        else ""
    )


@dataclass(frozen=True)
class EmgClockBounds:
    """Thresholds by which the clocks of EMG and motion are compared."""

    # Leads of activity over motion that are physiologically plausible: the electromechanical delay, the length of a
    # burst, and the error of the estimate
    plausible_lead_s: tuple[float, float] = (-0.1, 0.4)
    max_searched_lead_s: float = 3.0  # Leads are searched up to this time in either direction
    min_lead_correlation: float = 0.2  # Smallest correlation at which a lead counts as found in a long record
    # In a record of T seconds the correlation must also exceed the square root of this time over T. Noise alone
    # reached 0.27 in 24 s.
    chance_correlation_time_s: float = 3.0
    # Smallest correlation at which a lead counts as found in a short part of a record
    min_part_correlation: float = 0.3
    # An implausible lead is reported only if its correlation exceeds that of every plausible lead by this factor
    min_implausible_gain: float = 1.3
    # Length of the running mean that is subtracted, because the effort that holds a limb's weight follows its angle
    running_mean_s: float = 1.0
    part_length_s: float = 20.0  # Length of the parts in which leads are searched to find a drift: a few movements each
    # The lead of a part may differ from a straight line over the record by at most this time
    max_part_deviation_s: float = 0.2
    max_searched_drift: float = 0.02  # Drifts are searched up to this size in either direction [s/s]
    # Clocks that drift apart by less than this over a record count as one: the published advance of EMG
    min_total_drift_s: float = 0.1


EMG_CLOCK = EmgClockBounds()

COMPARISON_RATE_HZ = 50.0
"""Rate at which activity and motion are compared."""


@dataclass(frozen=True)
class EmgLead:
    """The time by which muscle activity leads the motion."""

    lead: float  # positive where EMG comes first [s]
    correlation: float  # correlation between activity and its regression on motion, at that lead
    plausible: bool  # False where the signals agree clearly better at an implausible lead


@dataclass(frozen=True)
class EmgDrift:
    """Drift of the EMG's clock against the clock of the motion."""

    drift: float  # change of the lead per time [s/s]
    error: float  # standard error of the drift [s/s]
    seconds: float  # duration that both recorded [s]
    parts: int  # number of parts in which a lead was found

    @property
    def total(self) -> float:
        """Total drift over the duration that both recorded [s]."""
        return self.drift * self.seconds

    @property
    def clear(self) -> bool:
        """Whether the drift is significant (p < 0.001) and large enough to matter."""
        beyond = -float(stdtrit(self.parts - 2, 0.5e-3)) * self.error
        return abs(self.drift) > beyond and abs(self.total) > EMG_CLOCK.min_total_drift_s


def emg_lead(x: np.ndarray, y: np.ndarray) -> EmgLead:
    """Compare activity with what it is there for; `x` (n, g) and `y` (n, 5) of `emg_and_motion`."""
    longest = int(min(EMG_CLOCK.max_searched_lead_s, 0.25 * len(x) / COMPARISON_RATE_HZ) * COMPARISON_RATE_HZ)
    scores = np.sqrt(_explained(x, y, longest))
    leads = np.arange(-longest, longest + 1) / COMPARISON_RATE_HZ
    best = int(np.argmax(scores))
    inside = (leads >= EMG_CLOCK.plausible_lead_s[0]) & (leads <= EMG_CLOCK.plausible_lead_s[1])
    by_chance = np.sqrt(EMG_CLOCK.chance_correlation_time_s * COMPARISON_RATE_HZ / len(x))
    clear = max(EMG_CLOCK.min_lead_correlation, by_chance)
    elsewhere = (
        not inside[best]
        and scores[best] > clear
        and scores[best] > EMG_CLOCK.min_implausible_gain * max(scores[inside].max(), 0.0)
    )
    return EmgLead(float(leads[best]), float(scores[best]), not elsewhere)


def emg_drift(x: np.ndarray, y: np.ndarray) -> EmgDrift | None:
    """How fast the lead of activity over the motion changes; `x` (n, g) and `y` (n, 5) of `emg_and_motion`.

    What motion explains in short parts, each at its own lag, is added up along straight lines over time; the line with
    the largest sum is made finer by the best lag of every part next to it.
    """
    if len(x) < 120.0 * COMPARISON_RATE_HZ:
        return None
    count = int(min(len(x) / COMPARISON_RATE_HZ / EMG_CLOCK.part_length_s, 24))
    edges = np.linspace(0, len(x), count + 1).astype(int)
    longest = int(EMG_CLOCK.max_searched_lead_s * COMPARISON_RATE_HZ)
    parts = np.array([_explained(x[a:b], y[a:b], longest) for a, b in pairwise(edges)])
    middle = 0.5 * (edges[:-1] + edges[1:]) / COMPARISON_RATE_HZ
    at, seconds = middle - middle.mean(), len(x) / COMPARISON_RATE_HZ
    steepest = min(EMG_CLOCK.max_searched_drift, 2.0 / seconds)
    most = int(np.ceil(0.5 * steepest * seconds * COMPARISON_RATE_HZ)) + 1
    wide = np.pad(parts, ((0, 0), (most, most)))
    lags = np.arange(-longest, longest + 1)
    best = (-np.inf, 0.0, 0.0)
    for drift in np.arange(-steepest, steepest, 1.0 / COMPARISON_RATE_HZ / seconds):
        shift = np.rint(drift * at * COMPARISON_RATE_HZ).astype(int)
        total = sum(part[first : first + len(lags)] for part, first in zip(wide, (most + shift).tolist(), strict=True))
        top = int(np.argmax(total))
        best = max(best, (float(total[top]), drift, lags[top] / COMPARISON_RATE_HZ))
    _, drift, lead = best
    found = [_best_near(part, lead + drift * t, longest) for part, t in zip(parts, at, strict=True)]
    seen = np.array([height > EMG_CLOCK.min_part_correlation**2 for _, height in found])
    if seen.sum() < max(4, 0.5 * count):
        return None
    lag = np.array([each for each, _ in found])[seen]
    t = at[seen] - at[seen].mean()
    slope = float(t @ (lag - lag.mean()) / (t @ t))
    rest = lag - lag.mean() - slope * t
    error = float(np.sqrt(rest @ rest / (len(t) - 2) / (t @ t)))
    return EmgDrift(slope, error, seconds, len(t))


def emg_and_motion(time: np.ndarray, activity: np.ndarray, motion: Kinematics) -> tuple[np.ndarray, np.ndarray] | None:
    """Return envelopes, (n, g), and what they are there for, weight, speed and acceleration, (n, 5), in equal steps.

    Both are without what is slow. `time` (m,) [s]; `activity` (m,) or (m, g). None where they cannot be compared.
    """
    low = max(time[0], motion.time[0])
    high = min(time[-1], motion.time[-1])
    if high - low < 10.0:
        return None
    activity = activity.reshape(len(time), -1)
    fs = (len(time) - 1) / (time[-1] - time[0])
    even = np.arange(low, high, 1.0 / COMPARISON_RATE_HZ)
    # Thinned by block means first: an envelope needs no anti-aliasing sharper than that.
    block = max(int(fs / 200.0), 1)
    at, *thin = (_block_means(each, block) for each in (time, *activity.T))
    smooth = zero_phase_lowpass(np.column_stack(thin), 6.0, 2, fs / block)
    envelopes = [np.interp(even, at, each) for each in smooth.T]
    angle, velocity, acceleration = (
        np.interp(even, motion.time, each) for each in (motion.angle, motion.velocity, motion.acceleration)
    )
    causes = np.sin(angle), velocity, np.abs(velocity), acceleration, np.abs(acceleration)
    x, y = (np.column_stack([_without_slow(each) for each in group]) for group in (envelopes, causes))
    return (x, y) if x.std(axis=0).min() > 0.0 and np.linalg.matrix_rank(y) == y.shape[1] else None


def _block_means(x: np.ndarray, count: int) -> np.ndarray:
    """Return the means of `count` samples after another, (n // count,), of x, (n,), by the product that is fastest."""
    return x[: len(x) // count * count].reshape(-1, count) @ np.full(count, 1.0 / count)


def _explained(x: np.ndarray, y: np.ndarray, longest: int) -> np.ndarray:
    """Share of the envelopes' variance that motion explains, with x that many samples earlier, at all lags up to
    `longest` either way; the mean over envelopes.

    Both have hardly a mean once what is slow is gone: one product of spectra gives all lags of a covariance.
    """
    lags = np.arange(-longest, longest + 1)
    inverse, size = np.linalg.inv(y.T @ y / len(y)), fft.next_fast_len(len(x) + longest, real=True)
    causes, envelopes = fft.rfft(y.T, size), fft.rfft(x.T, size)
    shares = []
    for envelope, own in zip(envelopes, x.T, strict=True):
        c = fft.irfft(causes * envelope.conj(), size)[:, lags] / (len(x) - np.abs(lags))
        shares.append(np.sum(c * (inverse @ c), axis=0) / np.var(own))
    return np.mean(shares, axis=0)


def _best_near(part: np.ndarray, lead: float, longest: int) -> tuple[float, float]:
    """Lag of the highest share within `max_part_deviation_s` of a lead [s], between samples by a parabola, and its
    height."""
    centre, reach = round(lead * COMPARISON_RATE_HZ) + longest, int(EMG_CLOCK.max_part_deviation_s * COMPARISON_RATE_HZ)
    low, high = max(centre - reach, 1), min(centre + reach + 1, len(part) - 1)
    if high <= low:
        return lead, -np.inf
    top = low + int(np.argmax(part[low:high]))
    before, here, after = part[top - 1 : top + 2]
    bend = before - 2.0 * here + after
    between = 0.5 * (before - after) / bend if bend < 0.0 else 0.0
    return (top - longest + float(np.clip(between, -1.0, 1.0))) / COMPARISON_RATE_HZ, float(here)


def _without_slow(x: np.ndarray) -> np.ndarray:
    n = int(EMG_CLOCK.running_mean_s * COMPARISON_RATE_HZ)
    padded = np.pad(x, (n // 2, n - n // 2), mode="edge")
    sums = np.concatenate(([0.0], np.cumsum(padded)))
    return x - (sums[n:] - sums[:-n])[: len(x)] / n
