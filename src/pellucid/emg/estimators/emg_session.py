"""Compare envelopes with those that an estimator was fitted to: floor, range and pattern of each channel.

An electrode that is stuck on anew, a cable in another socket or another gain changes one channel. Another speed or load
changes nearly all of them. The torque of a map shows neither: the map goes on as if nothing had happened.

Fitted trials may differ in speed and load. Floors and ranges are therefore kept for each fitted trial, and for each
stretch of it of a few seconds. The ranges of all channels together tell which stretch a recording is most like, and its
ranges are compared with that stretch. Floors may lie anywhere between the lowest and the highest fitted one. Every
fitted trial therefore passes its own comparison.

A channel's *floor* and *top* are two quantiles of its envelope, and its *range* is their difference. Its *pattern* is
the envelope that a ridge regression predicts from joint angles and their rates.

Give an estimator's card a watch: what each channel was in the fitted recordings, and what its change would cost.

The core steps the watch with the estimator (``include/pellucid/emg_watch.hpp``). Its numbers come from the fitted
recordings alone:

pattern
    Ridge regression of the envelope on angles and their rates, with squares and products.
usual
    Largest mean square of what the pattern leaves, with the memory of the watch, in and out of fold. Fitted recordings
    therefore pass their own watch.
margin
    Where the movement tells little of a muscle, this mean square varies much, and other recordings exceed it by chance.
    The margin is the standard deviation of the largest values in blocks of the fitted recordings.
floor, idle
    Envelopes below which a channel gives no signal, and below which its muscle is not active. A silence that lasts more
    than twice as long as the longest fitted one is a change, whatever the movement tells. The second counts only where
    the pattern cannot show a silence.
common scale
    Change of all envelopes together: beyond what the fitted recordings show by a factor, no torque holds.
alike
    Pairs of channels whose exchange would cost torque, and would not be detected.
consequence
    Mean square change of the torque over that of the envelope and the variance of the torque, when the channel is
    doubled, silent or has an offset, whichever costs most: muscles are not linear in their envelopes. It is the share
    of the torque's variance that a squared error of the envelope costs.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations, pairwise

import numpy as np

from ..._core import Biquads
from ..._errors import IdentificationError
from ...numerics.filters import runs
from ..models.emg_estimator import (
    WATCH_DEFAULTS,
    EmgEstimatorCard,
    EstimatorTerm,
    EstimatorWatch,
    WatchedAngle,
    WatchedChannel,
)
from .ridge import Ridge
from .torque_trial import TorqueTrial, filter_and_differentiate


@dataclass(frozen=True)
class SessionThresholds:
    """Thresholds by which a channel has changed, or a recording is beyond what was fitted.

    No measurement is recorded for what is chosen by judgement.
    """

    floor_quantile: float = 0.05  # Quantile of an envelope that is its floor. One silent moment does not move it.
    top_quantile: float = 0.95  # Quantile of an envelope that is its top. One twitch does not move it.
    # A floor may move by at most this share of the fitted range. Between walking and crouching it moves by up to 0.23.
    max_floor_shift: float = 0.25
    # A channel's range may change by at most this factor, up or down, after the common change of all channels is
    # removed. The range of a walker's small muscle changes by a factor of 2.5 within a minute.
    max_range_ratio: float = 3.0
    # Standard deviation of the logarithm of a channel's range between two recordings of the same session
    log_range_deviation: float = 0.4
    # Log-likelihood cost of explaining a channel's range by another gain. Two channels do not count as exchanged if a
    # change of gain explains their ranges as well. Chosen by judgement.
    gain_change_cost: float = 1.5
    # Two channels count as exchanged only if their log-likelihood ratio for an exchange exceeds this. Walkers and
    # runners who were never fitted, and whose cables were right, reach 1.0.
    min_swap_log_likelihood: float = 1.2
    # An envelope matches a pattern if their correlation exceeds this. Chosen by judgement.
    min_pattern_correlation: float = 0.6
    # An envelope whose correlation with its own pattern reaches this is unchanged, whatever other pattern it matches.
    # Chosen by judgement.
    unchanged_correlation: float = 0.7
    # Two envelopes can be one signal only if their correlation exceeds this. Chosen by judgement.
    min_copy_correlation: float = 0.9
    # Two envelopes count as one signal only if Fisher's z of their correlation rose by more than this since the fit.
    # Between walking and crouching it rises by 0.83.
    min_copy_z_rise: float = 1.2
    # A channel counts as another muscle's only if its log-likelihood ratio for that muscle's pattern exceeds this.
    # Chosen by judgement.
    min_pattern_log_likelihood: float = 0.6
    # A value may leave its fitted range by this share of the range before it counts as outside. Chosen by judgement.
    range_margin: float = 0.25
    # Smallest margins about the fitted angles [rad] and rates [rad/s], for joints that were held and so hardly moved.
    # Chosen by judgement.
    motion_margins: tuple[float, float] = (0.1, 0.2)
    # A recording can be judged only if at most this share of its time lies outside the fitted ranges. Chosen by
    # judgement.
    max_outside_share: float = 0.25
    # Penalty of the ridge regression that finds a pattern, for standardised terms. Chosen by judgement.
    pattern_penalty: float = 10.0
    # Shares of the way between two fitted trials at which ranges are interpolated. The way leads from the trial with
    # less effort to the one with more, in logarithms of the ranges. Chosen by judgement.
    interpolation_shares: tuple[float, ...] = (0.25, 0.5, 0.75)
    # Distance of the logarithms of two ranges if only one of them is 0. Chosen by judgement.
    max_log_distance: float = 10.0


SESSION_LIMITS = SessionThresholds()


@dataclass(frozen=True)
class WatchTimes:
    """Stretches of fitted trials that are kept, and samples of which a watch is made.

    No measurement is recorded for what is chosen by judgement.
    """

    # The first stretch ends after this duration [s]. Quantiles of less time are those of a single stride.
    min_seconds: float = 5.0
    interval_s: float = 1.0  # Time between the ends of two stretches [s]. Chosen by judgement.
    # Duration of a stretch [s]. A raised floor counts only if it lasts nearly all of this time.
    window_s: float = 6.0
    # Largest number of stretches kept of a fitted trial: all of five minutes, evenly spaced ones of a longer trial
    max_stretch_count: int = 300
    block_count: int = 5  # Number of blocks of each trial that are left out in turn to see how far a pattern holds
    # Gap between the samples of a pattern's fit and the block that is left out [s], longer than an envelope's memory
    block_gap_s: float = 0.2
    # Smallest number of fitted samples of which patterns are made. A quadratic pattern of three joints has 28 terms.
    min_samples: int = 100
    min_square: float = 1e-12  # Least mean square of a pattern by which the core divides
    # Duration of a block whose largest error counts once [s]: several times the memory, so that blocks are independent
    maximum_block_s: float = 5.0
    min_maximum_count: int = 4  # Smallest number of blocks; those of short recordings are shorter
    floor_share: float = 0.5  # Floor of a channel, as a share of its envelope at rest in the fitted recordings
    # Least floor, as a share of the root mean square: amplifiers have more noise. Chosen by judgement.
    min_floor_share: float = 0.01
    idle_share: float = 0.5  # Share of the root mean square below which a muscle is not active. Chosen by judgement.
    max_rest_ratio: float = 2.0  # A silence is a change after this multiple of the longest fitted one,
    min_rest_s: float = 1.0  # and after this time more than it [s]. Chosen by judgement.


WATCH_TIMES = WatchTimes()

PROBE_OFFSET_SHARE = 0.25
"""Offset by which a channel is probed, as a share of its largest fitted envelope.

Chosen by judgement; no measurement is recorded.
"""


@dataclass(frozen=True)
class ChannelChange:
    """One channel that differs from the fitted one."""

    muscle: str  # Muscle of the channel
    kind: str  # "silent", "floor", "level", "swapped", "pattern" or "crosstalk"; kinds of raw EMG are in `raw_session`
    found: str  # Description of the channel now
    expected: str  # Description of the channel as fitted
    other: str = ""  # Muscle whose signal the channel carries


@dataclass(frozen=True)
class ChannelComparison:
    """Result of comparing a recording's channels with the fitted ones."""

    floor_shift: Mapping[str, float]  # Shift of each floor, as a share of the fitted range
    range_ratio: Mapping[str, float]  # Range of each channel over the fitted range
    # Correlation with the muscle's own pattern; empty if the movement is another one
    own_correlation: Mapping[str, float]
    changes: tuple[ChannelChange, ...]  # Channels that differ from the fitted ones
    # Share of the time in which an angle, a speed or several envelopes are outside the fitted ranges
    outside_share: float
    has_other_effort: bool  # Whether most ranges changed: by another speed or load, not by an electrode

    @property
    def changed(self) -> tuple[str, ...]:
        """Muscles whose channels changed, each once."""
        return tuple(dict.fromkeys(change.muscle for change in self.changes))

    @property
    def is_valid(self) -> bool:
        """Whether the fitted estimator may be used on this recording at all."""
        return not self.has_other_effort and self.outside_share <= SESSION_LIMITS.max_outside_share


@dataclass(frozen=True, eq=False)
class FittedSession:
    """Channels of the fitted trials: their floors, ranges, patterns and correlations."""

    muscles: tuple[str, ...]
    trials: int  # Number of fitted trials
    floor: np.ndarray  # Floor of each channel over all fitted trials together, shape (k,), in the envelopes' unit
    span: np.ndarray  # Range of each channel over all fitted trials together, shape (k,), in the envelopes' unit
    floors: np.ndarray = field(repr=False)  # Floors of each fitted trial, then of each stretch, shape (s, k)
    spans: np.ndarray = field(repr=False)  # Ranges of each fitted trial, then of each stretch, shape (s, k)
    low: np.ndarray = field(repr=False)  # Smallest angles [rad] and rates [rad/s], shape (2 angles,)
    high: np.ndarray = field(repr=False)  # Largest angles [rad] and rates [rad/s], shape (2 angles,)
    patterns: tuple[Ridge, ...] = field(repr=False)  # Regression of each envelope on angles and rates
    repeats: np.ndarray  # Whether the pattern of the trials' first halves holds in their second, shape (k,)
    others: tuple[Ridge, ...] = field(repr=False)  # Regression of each envelope on the other envelopes
    together: np.ndarray = field(repr=False)  # Largest Fisher's z of every two fitted envelopes, shape (k, k)
    # Largest log-likelihood ratio, at least 0, by which fitted channel k matched the pattern of muscle i rather than
    # its own, shape (k, k)
    own_doubt: np.ndarray = field(repr=False)
    # Largest log-likelihood ratio, at least 0, for an exchange of two fitted channels, shape (k, k)
    swap_doubt: np.ndarray = field(repr=False)

    @classmethod
    def from_trials(cls, trials: Sequence[TorqueTrial]) -> FittedSession:
        """Describe the channels of fitted trials, all with the same muscles and angles."""
        if not trials:
            raise IdentificationError("channels of a session: found no fitted trial, expected at least one")
        muscles = tuple(trials[0].envelopes)
        if any(tuple(t.envelopes) != muscles or tuple(t.angles) != tuple(trials[0].angles) for t in trials):
            raise IdentificationError(
                f"trials {', '.join(t.name for t in trials)}: expected the same muscles and angles in each"
            )
        x, moved = _stack_trials(trials)
        floor, top = np.quantile(x, (SESSION_LIMITS.floor_quantile, SESSION_LIMITS.top_quantile), axis=0)
        others: tuple[Ridge, ...] = ()
        if len(muscles) > 1:
            others = tuple(
                Ridge(SESSION_LIMITS.pattern_penalty).fit(np.delete(x, k, axis=1), x[:, k]) for k in range(len(muscles))
            )
        parts = [*trials, *(part for trial in trials for part in _stretches_of(trial))]
        stretches = [_stack_trials([part]) for part in parts]
        quantiles = np.array(
            [
                np.quantile(each, (SESSION_LIMITS.floor_quantile, SESSION_LIMITS.top_quantile), axis=0)
                for each, _ in stretches
            ]
        )
        moves = [moves for _, moves in stretches]
        none = np.zeros((len(muscles), len(muscles)))
        made = cls(
            muscles,
            len(trials),
            floor,
            top - floor,
            quantiles[:, 0],
            quantiles[:, 1] - quantiles[:, 0],
            np.min([each.min(axis=0) for each in moves], axis=0),
            np.max([each.max(axis=0) for each in moves], axis=0),
            tuple(_fit_patterns([moved], [x])),
            _has_repeating_pattern(trials),
            others,
            np.max([_fisher_z(each) for each, _ in stretches], axis=0),
            none,
            none,
        )
        return made._with_doubts(stretches)

    def _with_doubts(self, stretches: Sequence[tuple[np.ndarray, np.ndarray]]) -> FittedSession:
        """Return a copy with the doubts that the fitted `stretches` themselves raise.

        A stretch holds envelopes, shape (n, k), and angles with their rates, shape (n, 2 angles).
        """
        own, swap = self.own_doubt, self.swap_doubt
        for x, moved in stretches:
            goes_with = self._correlations(x, moved)
            own = np.maximum(own, _other_pattern_log_likelihood(goes_with))
            now = np.diff(np.quantile(x, (SESSION_LIMITS.floor_quantile, SESSION_LIMITS.top_quantile), axis=0), axis=0)[
                0
            ]
            found = self._swap_scores(now, now, goes_with)
            swap = np.maximum(swap, np.where(np.isfinite(found), found, 0.0))
        return replace(self, own_doubt=own, swap_doubt=swap)

    def compare(self, trial: TorqueTrial) -> ChannelComparison:
        """Compare a trial's channels with the fitted ones."""
        x, moved = _stack_trials([trial])
        floor, top = np.quantile(x, (SESSION_LIMITS.floor_quantile, SESSION_LIMITS.top_quantile), axis=0)
        now = top - floor
        like = self._nearest_ranges(now)
        level = _range_ratio(now, like)
        risen = floor - np.clip(floor, self.floors.min(axis=0), self.floors.max(axis=0))
        risen = risen / np.where(like > 0.0, like, np.inf)
        many = bool(
            np.sum((level > SESSION_LIMITS.max_range_ratio) | (level < 1.0 / SESSION_LIMITS.max_range_ratio))
            > max(2, 0.5 * len(self.muscles))
        )
        margin = _range_margin(self.low, self.high)
        away = ((moved < self.low - margin) | (moved > self.high + margin)).any(axis=1)
        goes_with = self._correlations(x, moved) if np.mean(away) <= SESSION_LIMITS.max_outside_share else None
        changes = [] if many else self._find_changes(floor, risen, now, like, goes_with, _fisher_z(x))
        named = {change.muscle for change in changes}
        loudest = (self.floors + (1.0 + 2.0 * SESSION_LIMITS.range_margin) * self.spans).max(axis=0)
        loud = [x[:, k] > loudest[k] for k, muscle in enumerate(self.muscles) if muscle not in named]
        away |= np.sum(loud, axis=0) >= max(2, 0.25 * len(self.muscles))

        def by_muscle(values: np.ndarray) -> dict[str, float]:
            return dict(zip(self.muscles, map(float, values), strict=True))

        own = {} if goes_with is None else by_muscle(np.diag(goes_with))
        return ChannelComparison(by_muscle(risen), by_muscle(level), own, tuple(changes), float(np.mean(away)), many)

    def repair(self, trial: TorqueTrial, seconds: float, compared: ChannelComparison) -> TorqueTrial:
        """Return the trial with its changed channels repaired as far as possible.

        Exchanged channels are exchanged back. A channel that carries another muscle's signal is predicted from the
        other channels. The floor and range of the rest are scaled to the fitted ones, by the first `seconds` [s].
        """
        swapped = {c.muscle: c.other for c in compared.changes if c.kind == "swapped"}
        foreign = {c.muscle for c in compared.changes if c.kind in ("pattern", "crosstalk")}
        back = {muscle: trial.envelopes[swapped.get(muscle, muscle)] for muscle in self.muscles}
        moved = dict.fromkeys(c.muscle for c in compared.changes if c.kind in ("floor", "level"))
        scaled = [m for m in moved if m not in swapped and m not in foreign]
        made = self.rescale(replace(trial, envelopes=back, lead={}), seconds, scaled)
        return self.predict_channels(made, foreign) if foreign and len(foreign) < len(self.muscles) else made

    def rescale(self, trial: TorqueTrial, seconds: float, muscles: Collection[str]) -> TorqueTrial:
        """Return the trial with floor and range of some muscles scaled to the fitted ones.

        The scaling is found in the first `seconds` [s] alone.
        """
        first = trial.time <= trial.time[0] + seconds
        made = dict(trial.envelopes)
        floor, top = np.quantile(
            [made[muscle][first] for muscle in self.muscles],
            (SESSION_LIMITS.floor_quantile, SESSION_LIMITS.top_quantile),
            axis=1,
        )
        like = self._nearest_trial_index(
            top - floor, [k for k, muscle in enumerate(self.muscles) if muscle not in muscles]
        )
        for k, muscle in enumerate(self.muscles):
            if muscle in muscles:
                scale = self.spans[like, k] / (top[k] - floor[k]) if top[k] > floor[k] else 1.0
                made[muscle] = np.maximum(self.floors[like, k] + scale * (made[muscle] - floor[k]), 0.0)
        return replace(trial, envelopes=made, lead={})

    def _nearest_trial_index(self, now: np.ndarray, kept: Sequence[int]) -> int:
        """Return the index of the fitted trial whose ranges are most like `now`, shape (k,).

        Only the channels `kept` are compared, or all if there are none. A slow trial's channel is so scaled to its
        range in slow trials, not to its range over all speeds.
        """
        channels = list(kept) or list(range(len(self.muscles)))
        return _nearest_ranges_index(now[channels], self.spans[: self.trials, channels])

    def _nearest_ranges(self, now: np.ndarray) -> np.ndarray:
        """Return the ranges most like `now` among fitted stretches and interpolations of fitted trials, shape (k,)."""
        whole = self.spans[: self.trials]
        # Trials are sorted by effort. Efforts between two neighbours were not recorded and are interpolated.
        whole = whole[np.argsort(np.prod(np.where(whole > 0.0, whole, 1.0) ** (1.0 / whole.shape[1]), axis=1))]
        between = [
            a ** (1.0 - share) * b**share for a, b in pairwise(whole) for share in SESSION_LIMITS.interpolation_shares
        ]
        spans = np.vstack([self.spans, *between])
        return spans[_nearest_ranges_index(now, spans)]

    def predict_channels(self, trial: TorqueTrial, muscles: Collection[str]) -> TorqueTrial:
        """Return the trial with some envelopes predicted from the others, by the regressions of the fitted trials."""
        bad = [k for k, muscle in enumerate(self.muscles) if muscle in muscles]
        good = [k for k in range(len(self.muscles)) if k not in bad]
        if not good:
            raise IdentificationError(f"recording {trial.name}: found no unchanged channel, expected at least one")
        x = np.column_stack([trial.envelopes[m] for m in self.muscles])
        x[:, bad] = self.floor[bad] + 0.5 * self.span[bad]
        # Several rounds are needed, since replaced channels are also predicted from each other.
        for _ in range(5 if len(bad) > 1 else 1):
            for k in bad:
                x[:, k] = np.maximum(self.others[k].predict(np.delete(x, k, axis=1)), 0.0)
        made = {m: (x[:, k] if k in bad else trial.envelopes[m]) for k, m in enumerate(self.muscles)}
        return replace(trial, envelopes=made, lead={})

    def _correlations(self, x: np.ndarray, moved: np.ndarray) -> np.ndarray:
        """Return the correlation of the pattern of muscle i with the envelope of channel k, shape (k, k)."""
        return _correlations(_predict_all(self.patterns, moved), x)

    def _find_changes(
        self,
        floor: np.ndarray,
        risen: np.ndarray,
        now: np.ndarray,
        like: np.ndarray,
        goes_with: np.ndarray | None,
        together: np.ndarray,
    ) -> list[ChannelChange]:
        """Return the channels that changed.

        Floors, their shifts `risen`, ranges `now` and fitted ranges `like` have shape (k,). Correlations with patterns,
        `goes_with`, and of envelopes, `together`, have shape (k, k).
        """
        level = _range_ratio(now, like)
        level = level / _common_range_ratio(level)
        found, swapped = [], self._find_swapped_pairs(level * like, like, goes_with)
        copies = self._find_copies(level, goes_with, together)
        rather_than_own = None if goes_with is None else _other_pattern_log_likelihood(goes_with) - self.own_doubt
        lowest, highest = self.floors.min(axis=0), self.floors.max(axis=0)
        most = SESSION_LIMITS.max_range_ratio
        for k, muscle in enumerate(self.muscles):
            if k in swapped:
                other = self.muscles[swapped[k]]
                found.append(
                    ChannelChange(muscle, "swapped", f"level and pattern of {other}", "its own; cables or columns are "
                                  "probably interchanged", other)
                )  # fmt: skip
                continue
            if now[k] == 0.0 < like[k]:
                said = f"a constant envelope of {floor[k]:.2g}"
                found.append(ChannelChange(muscle, "silent", said, "one that varies as in the fitted recordings"))
                continue
            if abs(risen[k]) > SESSION_LIMITS.max_floor_shift:
                ends = dict.fromkeys((f"{lowest[k]:.2g}", f"{highest[k]:.2g}"))
                expected = (
                    f"{' to '.join(ends)} within {100 * SESSION_LIMITS.max_floor_shift:g} % of its range, as in the "
                    "fitted recordings"
                )
                found.append(ChannelChange(muscle, "floor", f"a noise floor of {floor[k]:.2g}", expected))
            if not 1.0 / most <= level[k] <= most:
                said = f"{_ratio_words(level[k])} times the fitted range, relative to the change of all channels"
                found.append(ChannelChange(muscle, "level", said, f"1/{most:g} to {most:g} times"))
            if k in copies:
                i, other = copies[k], self.muscles[copies[k]]
                said = f"the signal of {other} (correlation of envelopes {np.tanh(together[i, k]):.3f})"
                expected = f"its own ({np.tanh(self.together[i, k]):.2f} as fitted)"
                found.append(ChannelChange(muscle, "crosstalk", said, expected, other))
            elif goes_with is not None and rather_than_own is not None:
                best = int(np.argmax(goes_with[:, k]))
                known = self.repeats[k] and self.repeats[best]
                clear = (
                    goes_with[k, k] < SESSION_LIMITS.unchanged_correlation
                    and goes_with[best, k] > SESSION_LIMITS.min_pattern_correlation
                )
                if known and clear and rather_than_own[best, k] > SESSION_LIMITS.min_pattern_log_likelihood:
                    other = self.muscles[best]
                    said = f"the pattern of {other} (correlation {goes_with[best, k]:.2f})"
                    found.append(ChannelChange(muscle, "pattern", said, f"its own ({goes_with[k, k]:.2f})", other))
        return found

    def _find_copies(self, level: np.ndarray, goes_with: np.ndarray | None, together: np.ndarray) -> dict[int, int]:
        """Return channels whose envelope became a copy, and the channel that each copies.

        Of two equal channels, the copy is the one that is less like its fitted self.
        """
        close = (together > np.arctanh(SESSION_LIMITS.min_copy_correlation)) & (
            together - self.together > SESSION_LIMITS.min_copy_z_rise
        )
        unlike = np.abs(np.log(np.maximum(level, 1e-3))) / SESSION_LIMITS.log_range_deviation
        if goes_with is not None:
            unlike = unlike + np.where(self.repeats, _log_unexplained_share(np.diag(goes_with)), 0.0)
        return {
            k: int(np.argmax(np.where(close[k], together[k], -np.inf)))
            for k in range(len(self.muscles))
            if any(unlike[k] >= unlike[i] for i in np.flatnonzero(close[k]))
        }

    def _find_swapped_pairs(self, now: np.ndarray, like: np.ndarray, goes_with: np.ndarray | None) -> dict[int, int]:
        """Return pairs of exchanged channels, each in both directions, the clearest first.

        `now` (k,) are the channels' ranges, `like` (k,) the fitted ones; `goes_with` (k, k) is from `_correlations`.
        """
        if goes_with is None:
            return {}
        scores = self._swap_scores(now, like, goes_with) - self.swap_doubt
        pairs: dict[int, int] = {}
        for _, i, k in sorted(
            ((scores[i, k], i, k) for i, k in np.argwhere(scores > SESSION_LIMITS.min_swap_log_likelihood)),
            reverse=True,
        ):
            if i not in pairs and k not in pairs:
                pairs |= {int(i): int(k), int(k): int(i)}
        return pairs

    def _swap_scores(self, now: np.ndarray, like: np.ndarray, goes_with: np.ndarray) -> np.ndarray:
        """Return the log-likelihood ratio for an exchange of channels i and k > i, by pattern and range, shape (k, k).

        Other entries are -inf. `now` (k,) are the channels' ranges, `like` (k,) the fitted ones; `goes_with` (k, k) as
        `_correlations` gives it.
        """
        unexplained = _log_unexplained_share(goes_with)
        with np.errstate(divide="ignore", invalid="ignore"):
            # Row i compares the range of each channel k with that of muscle i.
            off = np.log(now[None, :] / like[:, None]) ** 2 / (2.0 * SESSION_LIMITS.log_range_deviation**2)
        scores = np.full((len(now), len(now)), -np.inf)
        for i in range(len(now)):
            for k in range(i + 1, len(now)):
                rather = (
                    min(off[i, i], SESSION_LIMITS.gain_change_cost)
                    + min(off[k, k], SESSION_LIMITS.gain_change_cost)
                    - off[i, k]
                    - off[k, i]
                )
                if self.repeats[i] and self.repeats[k]:
                    rather += unexplained[i, i] + unexplained[k, k] - unexplained[i, k] - unexplained[k, i]
                if np.isfinite(rather):
                    scores[i, k] = rather
        return scores


def _stretches_of(trial: TorqueTrial) -> list[TorqueTrial]:
    """Return the stretches of a trial, evenly spaced where there are too many."""
    every, window = max(1, round(WATCH_TIMES.interval_s * trial.fs)), round(WATCH_TIMES.window_s * trial.fs)
    first = -(-round(WATCH_TIMES.min_seconds * trial.fs) // every) * every
    ends = range(first, len(trial) + 1, every)
    if len(ends) > WATCH_TIMES.max_stretch_count:
        ends = np.linspace(first, len(trial), WATCH_TIMES.max_stretch_count).astype(int).tolist()
    parts = [slice(max(0, end - window), end) for end in ends]
    return [
        replace(
            trial, time=trial.time[part], torque=trial.torque[part], lead={}, muscles=None,
            envelopes={m: x[part] for m, x in trial.envelopes.items()},
            angles={j: q[part] for j, q in trial.angles.items()},
        )
        for part in parts
    ]  # fmt: skip


def _has_repeating_pattern(trials: Sequence[TorqueTrial]) -> np.ndarray:
    """Return whether the pattern of the trials' first halves holds in the second half of the median trial, (k,)."""
    each = [(*_stack_trials([trial]), len(trial) // 2) for trial in trials]
    patterns = _fit_patterns([moved[:half] for _, moved, half in each], [x[:half] for x, _, half in each])
    found = [np.diag(_correlations(_predict_all(patterns, moved[half:]), x[half:])) for x, moved, half in each]
    return np.median(found, axis=0) > SESSION_LIMITS.min_pattern_correlation


def _other_pattern_log_likelihood(goes_with: np.ndarray) -> np.ndarray:
    """Return the log-likelihood ratio for channel k to match the pattern of muscle i rather than its own, (k, k)."""
    unexplained = _log_unexplained_share(goes_with)
    return np.diag(unexplained)[None, :] - unexplained


def _ratio_words(ratio: float) -> str:
    """Return a ratio beyond its limits with so many digits that it reads as beyond them."""
    most = SESSION_LIMITS.max_range_ratio
    texts = (f"{ratio:.{digits}g}" for digits in range(2, 16))
    return next((text for text in texts if not 1.0 / most <= float(text) <= most), f"{ratio!r}")


def _range_ratio(now: np.ndarray, like: np.ndarray) -> np.ndarray:
    """Return ranges `now` over fitted ones, both (k,).

    The ratio is 1 for a channel that never varied, and 0 for one that varies only now.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(like > 0.0, now / like, np.where(now > 0.0, 0.0, 1.0))


def _nearest_ranges_index(now: np.ndarray, spans: np.ndarray) -> int:
    """Return which of `spans`, (s, k), is nearest to `now`, (k,), by the sum of the distances of logarithms.

    This sum is robust: a single channel that changed hardly affects which one is nearest.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        apart = np.abs(np.log(now / spans))
    return int(np.argmin(np.nan_to_num(apart, nan=0.0, posinf=SESSION_LIMITS.max_log_distance).sum(axis=1)))


def _common_range_ratio(level: np.ndarray) -> float:
    """Return the factor by which all ranges changed together, from `level` (k,), as another speed or load changes them.

    It is the median, or with up to three channels the factor nearest to 1.
    """
    known = np.log(level[level > 0.0])
    if not len(known):
        return 1.0
    return float(np.exp(np.median(known) if len(known) > 3 else known[np.argmin(np.abs(known))]))


def _log_unexplained_share(correlation: np.ndarray) -> np.ndarray:
    """Return the logarithm of the share of an envelope's variance that a pattern of this correlation leaves."""
    return np.log(np.maximum(1.0 - np.maximum(correlation, 0.0) ** 2, 1e-6))


def _correlations(made: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return the correlation of every column of one with every column of the other, both (n, k), shape (k, k).

    The correlation of a constant column is 0.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.nan_to_num(np.corrcoef(made.T, x.T)[: made.shape[1], made.shape[1] :])


def _fisher_z(x: np.ndarray) -> np.ndarray:
    """Return Fisher's z of every two envelopes, from shape (n, k) to (k, k); 0 on the diagonal."""
    z = np.arctanh(np.clip(_correlations(x, x), -0.9999, 0.9999))
    return z - np.diag(np.diag(z))


def _stack_trials(trials: Sequence[TorqueTrial]) -> tuple[np.ndarray, np.ndarray]:
    """Return envelopes, shape (n, k), and angles with their rates, shape (n, 2 j), of trials one after another."""
    x = np.vstack([np.column_stack(list(trial.envelopes.values())) for trial in trials])
    return x, np.vstack([_motion(trial, trial.angles, causal=False) for trial in trials])


def _motion(trial: TorqueTrial, angles: Iterable[str], *, causal: bool) -> np.ndarray:
    """Return angles and their rates, shape (n, 2 angles); `causal` ones are as the core filters them."""
    pairs = [filter_and_differentiate(np.asarray(trial.angles[a], float), trial.fs, causal=causal)[:2] for a in angles]
    return np.column_stack([column for pair in pairs for column in pair])


def _fit_patterns(moved: Sequence[np.ndarray], x: Sequence[np.ndarray]) -> list[Ridge]:
    """Return the pattern of each channel from motion, shape (n, 2 angles) each, and envelopes, shape (n, k) each."""
    motion, envelopes = np.vstack(moved), np.vstack(x)
    everything = tuple(range(motion.shape[1]))
    return Ridge(SESSION_LIMITS.pattern_penalty, everything).fit_each(motion, envelopes)


def _predict_all(patterns: Sequence[Ridge], moved: np.ndarray) -> np.ndarray:
    """Return the envelopes by their patterns, shape (n, k)."""
    return np.column_stack([pattern.predict(moved) for pattern in patterns])


def _range_margin(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return the margin about ranges of angles and rates, shape (2 angles,)."""
    least = np.tile(SESSION_LIMITS.motion_margins, len(low) // 2)
    return np.maximum(SESSION_LIMITS.range_margin * (high - low), least)


def add_channel_watch(
    card: EmgEstimatorCard,
    trials: Mapping[str, Sequence[TorqueTrial]],
    left_out_errors: Mapping[str, float] | None = None,
) -> EmgEstimatorCard:
    """Return the card with a watch of its channels.

    Parameters
    ----------
    card : EmgEstimatorCard
        Estimator that was calibrated on the trials.
    trials : mapping of str to sequence of TorqueTrial
        Fitted trials of each of its joints: the same recordings in the same order.
    left_out_errors : mapping of str to float, optional
        RMSE of each joint's torque in cross-validation [N m], from which the interval of the torque follows. Otherwise
        it follows from samples that were fitted, and is too narrow.

    Returns
    -------
    EmgEstimatorCard
        The card itself if there are too few samples, a torque that does not change, or more inputs than the core steps.
    """
    first = list(next(iter(trials.values())))
    names = [channel.name for channel in card.channels]
    if sum(map(len, first)) < WATCH_TIMES.min_samples or not names or card.misfit:
        return card
    x = [np.column_stack([t.envelopes[name] for name in names]) for t in first]
    moved = [_motion(t, card.angles, causal=True) for t in first]
    ceiling = np.array([channel.ceiling for channel in card.channels])
    patterns = _fit_patterns(moved, x)
    within = [_predict(patterns, m, ceiling) for m in moved]
    left_out = [_predict_left_out(i, first, moved, x, ceiling) for i in range(len(first))]
    means = tuple(
        np.mean(np.vstack([a * b for a, b in zip(u, v, strict=True)]), axis=0)
        for u, v in ((x, x), (x, left_out), (left_out, left_out))
    )
    each = [
        [_remembered_error(e, p, t.fs, WATCH_DEFAULTS.memory_s, means) for e, p, t in zip(x, made, first, strict=True)]
        for made in (within, left_out)
    ]
    usual, margin = np.max([_largest_and_spread([error for error, _ in own], first[0].fs) for own in each], axis=0)
    scales = np.concatenate([common for own in each for _, common in own])
    consequence, errors, residual = _consequences(card, trials, x)
    if not np.isfinite(consequence).all():
        return card
    features = [f"{what}.{angle}" for angle in card.angles for what in ("angle", "velocity")]
    limit = np.maximum(WATCH_DEFAULTS.named_loss, consequence * margin)
    seen = consequence * (means[2] - usual) > limit
    others = [
        (float(margin[k]), *_silences(k, channel.rest, seen[k], x, first[0].fs, means[0][k]))
        for k, channel in enumerate(card.channels)
    ]
    channels = tuple(
        WatchedChannel(
            *map(float, numbers), tuple(_term(*each) for each in pattern.unscaled_coefficients(features).items()), *own
        )
        for *numbers, pattern, own in zip(consequence, usual, *means, patterns, others, strict=True)
    )
    low, high = np.vstack(moved).min(axis=0), np.vstack(moved).max(axis=0)
    margin = _range_margin(low, high)
    ends = zip((low - margin).reshape(-1, 2), (high + margin).reshape(-1, 2), strict=True)
    angles = tuple(
        WatchedAngle(float(least[0]), float(most[0]), float(least[1]), float(most[1])) for least, most in ends
    )
    if left_out_errors is not None:
        errors = tuple(left_out_errors[joint.name] for joint in card.joints)
    room = WATCH_DEFAULTS.max_common_change
    watch = EstimatorWatch(
        channels,
        angles,
        residual=residual,
        errors=errors,
        common_low=float(min(1.0, scales.min())) / room,
        common_high=float(max(1.0, scales.max())) * room,
        alike=_alike_pairs(names, x, left_out, consequence, usual, limit),
    )
    return replace(card, watch=watch)


def _largest_and_spread(errors: Sequence[np.ndarray], fs: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the largest error of each channel, and the standard deviation of the largest ones of blocks, (k,) each.

    `errors` are mean squares, shape (n, k) each.
    """
    count = sum(map(len, errors))
    length = min(round(WATCH_TIMES.maximum_block_s * fs), count // WATCH_TIMES.min_maximum_count)
    maxima = np.array(
        [block.max(axis=0) for own in errors for block in np.array_split(own, max(1, round(len(own) / length)))]
    )
    return maxima.max(axis=0), np.std(maxima, axis=0, ddof=1)


def _silences(
    k: int, rest: float, is_seen: bool, x: Sequence[np.ndarray], fs: float, square: float
) -> tuple[float, float, float, float]:
    """Return floor, idle level and the durations below them [s] that are a change of channel k, as a channel has them.

    `is_seen` is whether the pattern shows that a channel is silent; `square` is its mean square.
    """
    usual = float(np.sqrt(square))
    floor = max(WATCH_TIMES.floor_share * rest, WATCH_TIMES.min_floor_share * usual)
    idle = WATCH_TIMES.idle_share * usual

    def limit(level: float) -> float:
        longest = max((r.stop - r.start for own in x for r in runs(own[:, k] <= level)), default=0) / fs
        return max(WATCH_TIMES.max_rest_ratio * longest, longest + WATCH_TIMES.min_rest_s)

    return floor, limit(floor), idle, 0.0 if is_seen else limit(idle)


def _alike_pairs(
    names: Sequence[str],
    x: Sequence[np.ndarray],
    made: Sequence[np.ndarray],
    consequence: np.ndarray,
    usual: np.ndarray,
    limit: np.ndarray,
) -> tuple[tuple[str, str], ...]:
    """Return the pairs of channels whose exchange costs torque, and no channel more than its `limit`, shape (k,).

    `x` are envelopes and `made` their patterns, shape (n, k) each.
    """
    envelopes, patterns = np.vstack(x), np.vstack(made)
    square, together = np.mean(envelopes**2, axis=0), envelopes.T @ envelopes / len(envelopes)
    # Row i: the mean square that the pattern of channel i leaves of each channel
    left = square[None, :] - 2.0 * patterns.T @ envelopes / len(envelopes) + np.mean(patterns**2, axis=0)[:, None]
    loss = consequence[:, None] * (left - usual[:, None])
    cost = np.maximum.outer(consequence, consequence) * (square[:, None] + square[None, :] - 2.0 * together)
    is_named = loss > limit[:, None]
    is_unnoticed = (cost > WATCH_DEFAULTS.max_loss) & ~(is_named | is_named.T)
    return tuple((names[i], names[k]) for i, k in combinations(range(len(names)), 2) if is_unnoticed[i, k])


def _predict(patterns: Sequence[Ridge], moved: np.ndarray, ceiling: np.ndarray) -> np.ndarray:
    """Return the envelopes by their patterns, within 0 and the channels' ceilings, shape (n, k)."""
    return np.clip(_predict_all(patterns, moved), 0.0, ceiling)


def _predict_left_out(
    index: int,
    trials: Sequence[TorqueTrial],
    moved: Sequence[np.ndarray],
    x: Sequence[np.ndarray],
    ceiling: np.ndarray,
) -> np.ndarray:
    """Return a trial's envelopes by patterns of all trials without the block that is predicted, shape (n, k)."""
    n, gap = len(trials[index]), round(WATCH_TIMES.block_gap_s * trials[index].fs)
    edges, made = np.linspace(0, n, WATCH_TIMES.block_count + 1).astype(int), np.empty_like(x[index])
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
) -> tuple[np.ndarray, np.ndarray]:
    """Return the mean square of x - s p over max(1, s^2), with the memory of the watch, shape (n, k), and s, (n,).

    `means` are <x x>, <x p> and <p p> with which the memory begins, shape (k,) each.
    """
    share = min(1.0, 1.0 / (seconds * fs))
    memory = [[share, 0.0, 0.0, 1.0, share - 1.0, 0.0]]
    square, product, pattern_square = (
        mean + np.column_stack([Biquads(memory).filter(column) for column in (y - mean).T])
        for y, mean in zip((x * x, x * pattern, pattern * pattern), means, strict=True)
    )
    common = _common_factor(np.sqrt(square / np.maximum(pattern_square, WATCH_TIMES.min_square)))
    scale = common[:, None]
    missed = square - 2.0 * scale * product + scale**2 * pattern_square
    return np.maximum(missed, 0.0) / np.maximum(1.0, scale**2), common


def _common_factor(factors: np.ndarray) -> np.ndarray:
    """Return the median of each row, or with up to three channels the factor nearest to 1, shape (n,)."""
    if factors.shape[1] > 3:
        return np.median(factors, axis=1)
    nearest = np.argmin(np.maximum(factors, 1.0 / np.maximum(factors, 1e-6)), axis=1)
    return np.take_along_axis(factors, nearest[:, None], axis=1)[:, 0]


def _consequences(
    card: EmgEstimatorCard, trials: Mapping[str, Sequence[TorqueTrial]], x: Sequence[np.ndarray]
) -> tuple[np.ndarray, tuple[float, ...], float]:
    """Return the share of the torque's variance that a squared error of each channel costs, shape (k,).

    With several joints, the largest loss counts. Also return the RMSE of each joint's torque [N m], and the smallest
    share of a joint's variance that the torque leaves unexplained.
    """
    bare = replace(card.of_envelopes(), watch=None)
    first = list(next(iter(trials.values())))

    def torques(envelopes: Sequence[np.ndarray]) -> np.ndarray:
        made = []
        for trial, own in zip(first, envelopes, strict=True):
            time = np.round(1e6 * (1.0 + card.period * np.arange(len(trial))))
            angles = np.array([trial.angles[a] for a in card.angles])
            made.append(bare.build().run(time, np.ascontiguousarray(own.T), angles)[0])
        return np.concatenate(made, axis=1)

    variance = np.array([np.var(np.concatenate([t.torque for t in trials[j.name]])) for j in card.joints])
    usual, offset = torques(x), PROBE_OFFSET_SHARE * np.vstack(x).max(axis=0)
    found = np.zeros(len(card.channels))
    for k in range(len(found)):
        own = np.arange(len(found)) == k
        for gain, added in ((2.0, 0.0), (0.0, 0.0), (1.0, offset[k])):
            changed = [np.where(own, gain * e + added, e) for e in x]
            square = np.mean([((c - e)[:, k] ** 2).mean() for c, e in zip(changed, x, strict=True)])
            with np.errstate(divide="ignore", invalid="ignore"):
                cost = np.mean((torques(changed) - usual) ** 2, axis=1) / variance / square
            found[k] = np.maximum(found[k], 0.0 if square == 0.0 else cost.max())
    reference = np.array([np.concatenate([t.torque for t in trials[j.name]]) for j in card.joints])
    square_error = np.mean((usual - reference) ** 2, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        residual = float(np.min(square_error / variance))
    errors = tuple(np.sqrt(square_error).tolist())
    return found, errors, max(residual, WATCH_DEFAULTS.min_residual) if np.isfinite(residual) else 0.0


def _term(name: str, weight: float) -> EstimatorTerm:
    """Return one term of a pattern, given its name among the coefficients of a ridge regression."""
    first, _, second = ("", "", "") if name == "offset" else name.partition(" * ")
    return EstimatorTerm(float(weight), first, second)
