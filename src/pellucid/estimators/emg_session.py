"""Whether envelopes are still those that an estimator was fitted to: floor, level and pattern, channel by channel.

An electrode that is stuck on anew, a cable in another socket or another gain changes one channel; another speed or load
changes nearly all of them. Neither shows in the torque of a map, which goes on as if nothing had happened.

Trials that were fitted may differ in speed and load. Floors and ranges are therefore kept for each fitted trial and for
each stretch of it that is as long as a watch compares. The ranges of all channels together tell which of these a
recording is most like, and ranges are held against that one; floors may lie anywhere between the lowest and the highest
that was fitted. Whatever was fitted so passes its own comparison.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from .._errors import IdentificationError
from .features import derivatives
from .ridge import Ridge
from .torque_trial import TorqueTrial

FLOOR, TOP = 0.05, 0.95
"""Quantiles of an envelope between which it ranges: a twitch, or one silent moment, moves neither."""

RISEN = 0.25
"""Share of the fitted range by which a floor may move: between walking and crouching one comes to 0.23."""

LEVEL = 3.0
"""Times the fitted range that one channel may reach, or fall short of, among others that do not: a small muscle of a
walker comes to 2.5 within a minute."""

SPREAD = 0.4
"""Standard deviation of the logarithm of a channel's range between two recordings of the same session."""

GAIN = 1.5
"""Log-likelihood that another gain costs: two channels are not exchanged where one gain explains it as well."""

RATHER = 1.2
"""Log-likelihood by which envelopes are another muscle's rather than their own before they are called exchanged: of
walkers and runners never fitted, whose cables were as they should be, it comes to 1.0."""

CLEAR = 0.6
"""Correlation from which an envelope is said to go with a pattern at all."""

OWN = 0.7
"""Correlation from which an envelope goes with its own pattern, whatever else it goes with."""

ONE_SIGNAL = 0.9
"""Correlation of two envelopes from which they may be one signal."""

CLOSER = 1.2
"""By how much Fisher's z of two envelopes may rise before they are: between walking and crouching it rises by 0.83."""

PATTERN = 0.6
"""Log-likelihood by which an envelope that no longer goes with its own pattern goes with another muscle's."""

BEYOND = 0.25
"""Share of the fitted range by which a value may pass its ends."""

HELD = (0.1, 0.2)
"""Angle [rad] and rate [rad/s] by which even a joint that was held may differ."""

ELSEWHERE = 0.25
"""Share of a recording out of the fitted ranges, in time, from which nothing tells whether an estimate holds."""

PENALTY = 10.0
"""Of a pattern's ridge regression, for standardised terms."""

MIN_WATCH_S = 5.0
"""Seconds of samples before a watch says anything: the quantiles of fewer are those of a single stride."""

COMPARISON_INTERVAL_S = 1.0
"""Seconds between two comparisons of a watch."""

WINDOW_S = 6.0
"""Seconds of samples that a watch compares: nearly all of them must have a raised floor before it counts as one."""

BETWEEN_SHARES = (0.25, 0.5, 0.75)
"""Places between two fitted trials, as shares of the way from the one with less effort to the other in logarithms."""

MAX_LOG_DISTANCE = 10.0
"""Distance of the logarithms of two ranges of which only one is 0."""

MAX_STRETCH_COUNT = 300
"""Stretches of a fitted trial that are kept at most: those of five minutes, or evenly spaced ones of a longer trial."""


@dataclass(frozen=True)
class ChannelChange:
    """One channel that is not what it was."""

    muscle: str
    kind: str  # "floor", "level", "swapped", "pattern" or "crosstalk"; of raw EMG as in `raw_session`
    found: str
    expected: str
    other: str = ""  # The muscle that it goes with


@dataclass(frozen=True)
class Compared:
    """A recording's channels against those fitted."""

    floor: Mapping[str, float]  # How far floors moved, in ranges as fitted
    level: Mapping[str, float]  # Range over that fitted
    own: Mapping[str, float]  # Correlation with the muscle's own pattern; empty where the movement is another
    changes: tuple[ChannelChange, ...]
    elsewhere: float  # Share of its time in which an angle, a speed or several envelopes are beyond what was fitted
    effort: bool  # Whether most levels changed: another speed or load, which is no electrode's fault

    @property
    def changed(self) -> tuple[str, ...]:
        """Muscles whose channel changed, each once."""
        return tuple(dict.fromkeys(change.muscle for change in self.changes))

    @property
    def holds(self) -> bool:
        """Whether what was fitted may be asked of it at all."""
        return not self.effort and self.elsewhere <= ELSEWHERE


@dataclass(frozen=True, eq=False)
class FittedSession:
    """What the channels of fitted trials were."""

    muscles: tuple[str, ...]
    trials: int  # How many were fitted
    floor: np.ndarray  # floor, span: (k,) of all fitted trials together, in the envelopes' unit
    span: np.ndarray
    # floors, spans: (s, k) the same of each fitted trial, then of every stretch of each that a watch compares
    floors: np.ndarray = field(repr=False)
    spans: np.ndarray = field(repr=False)
    low: np.ndarray = field(repr=False)  # low, high: (2 angles,) ends of angles [rad] and their rates [rad/s]
    high: np.ndarray = field(repr=False)
    patterns: tuple[Ridge, ...] = field(repr=False)  # Of each envelope, by angles and rates
    repeats: np.ndarray  # (k,) Whether the pattern of each trial's first half is that of its second
    others: tuple[Ridge, ...] = field(repr=False)  # Of each envelope, by the other envelopes
    together: np.ndarray = field(repr=False)  # (k, k) Largest Fisher's z of every two envelopes within what was fitted
    # (k, k) Largest log-likelihood ratio within what was fitted by which channel k goes with the pattern of muscle i
    # rather than with its own, at least 0
    own_doubt: np.ndarray = field(repr=False)
    # (k, k) Largest log-likelihood ratio within what was fitted for an exchange of two channels, at least 0
    swap_doubt: np.ndarray = field(repr=False)

    @classmethod
    def of(cls, trials: Sequence[TorqueTrial]) -> FittedSession:
        """Of trials that were fitted, all with the same muscles and angles."""
        muscles = tuple(trials[0].envelopes)
        if any(tuple(t.envelopes) != muscles or tuple(t.angles) != tuple(trials[0].angles) for t in trials):
            raise IdentificationError(
                f"trials {', '.join(t.name for t in trials)}: expected the same muscles and angles in each"
            )
        x, moved = _stacked(trials)
        floor, top = np.quantile(x, (FLOOR, TOP), axis=0)
        everything = tuple(range(moved.shape[1]))
        patterns = tuple(Ridge(PENALTY, everything).fit(moved, x[:, k]) for k in range(len(muscles)))
        others = ()
        if len(muscles) > 1:
            others = tuple(Ridge(PENALTY).fit(np.delete(x, k, axis=1), x[:, k]) for k in range(len(muscles)))
        parts = [*trials, *(part for trial in trials for part in _watched_stretches(trial))]
        stretches = [_stacked([part]) for part in parts]
        quantiles = np.array([np.quantile(each, (FLOOR, TOP), axis=0) for each, _ in stretches])
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
            patterns,
            _repeating(trials),
            others,
            np.max([_together(each) for each, _ in stretches], axis=0),
            none,
            none,
        )
        return made._with_doubts(stretches)

    def _with_doubts(self, stretches: Sequence[tuple[np.ndarray, np.ndarray]]) -> FittedSession:
        """The same with what its own `stretches`, envelopes (n, k) and motion (n, 2 angles), say against themselves."""
        own, swap = self.own_doubt, self.swap_doubt
        for x, moved in stretches:
            goes_with = self._correlations(x, moved)
            own = np.maximum(own, _rather_than_own(goes_with))
            now = np.diff(np.quantile(x, (FLOOR, TOP), axis=0), axis=0)[0]
            found = self._swap_scores(now, now, goes_with)
            swap = np.maximum(swap, np.where(np.isfinite(found), found, 0.0))
        return replace(self, own_doubt=own, swap_doubt=swap)

    def compared(self, trial: TorqueTrial) -> Compared:
        """A trial's channels against those fitted."""
        x, moved = _stacked([trial])
        floor, top = np.quantile(x, (FLOOR, TOP), axis=0)
        now = top - floor
        like = self._span_like(now)
        level = _level(now, like)
        risen = floor - np.clip(floor, self.floors.min(axis=0), self.floors.max(axis=0))
        risen = risen / np.where(like > 0.0, like, np.inf)
        many = bool(np.sum((level > LEVEL) | (level < 1.0 / LEVEL)) > max(2, 0.5 * len(self.muscles)))
        margin = np.maximum(BEYOND * (self.high - self.low), np.tile(HELD, len(self.low) // 2))
        away = ((moved < self.low - margin) | (moved > self.high + margin)).any(axis=1)
        goes_with = self._correlations(x, moved) if np.mean(away) <= ELSEWHERE else None
        changes = [] if many else self._changes(floor, risen, now, like, goes_with, _together(x))
        named = {change.muscle for change in changes}
        loudest = (self.floors + (1.0 + 2.0 * BEYOND) * self.spans).max(axis=0)
        loud = [x[:, k] > loudest[k] for k, muscle in enumerate(self.muscles) if muscle not in named]
        away |= np.sum(loud, axis=0) >= max(2, 0.25 * len(self.muscles))

        def by_muscle(values: np.ndarray) -> dict[str, float]:
            return dict(zip(self.muscles, map(float, values), strict=True))

        own = {} if goes_with is None else by_muscle(np.diag(goes_with))
        return Compared(by_muscle(risen), by_muscle(level), own, tuple(changes), float(np.mean(away)), many)

    def mended(self, trial: TorqueTrial, seconds: float, compared: Compared) -> TorqueTrial:
        """The trial with channels that changed brought back as far as they can be.

        What was exchanged is exchanged again; a channel that carries another muscle's signal is what the others tell;
        floor and range of the rest are those fitted, by the first `seconds` [s].
        """
        swapped = {c.muscle: c.other for c in compared.changes if c.kind == "swapped"}
        foreign = {c.muscle for c in compared.changes if c.kind in ("pattern", "crosstalk")}
        back = {muscle: trial.envelopes[swapped.get(muscle, muscle)] for muscle in self.muscles}
        moved = dict.fromkeys(c.muscle for c in compared.changes if c.kind in ("floor", "level"))
        scaled = [m for m in moved if m not in swapped and m not in foreign]
        made = self.rescaled(replace(trial, envelopes=back, lead={}), seconds, scaled)
        return self.without(made, foreign) if foreign and len(foreign) < len(self.muscles) else made

    def rescaled(self, trial: TorqueTrial, seconds: float, muscles: Collection[str]) -> TorqueTrial:
        """The trial with floor and range of some muscles brought to those fitted, by its first `seconds` [s] alone."""
        first = trial.time <= trial.time[0] + seconds
        made = dict(trial.envelopes)
        floor, top = np.quantile([made[muscle][first] for muscle in self.muscles], (FLOOR, TOP), axis=1)
        like = self._most_alike(top - floor, [k for k, muscle in enumerate(self.muscles) if muscle not in muscles])
        for k, muscle in enumerate(self.muscles):
            if muscle in muscles:
                scale = self.spans[like, k] / (top[k] - floor[k]) if top[k] > floor[k] else 1.0
                made[muscle] = np.maximum(self.floors[like, k] + scale * (made[muscle] - floor[k]), 0.0)
        return replace(trial, envelopes=made, lead={})

    def _most_alike(self, now: np.ndarray, kept: Sequence[int]) -> int:
        """The fitted trial whose ranges are most like those `now`, (k,), by the channels `kept`, all if there is none.

        A slow trial's channel is brought to what it was in slow trials, not to the range over all speeds.
        """
        channels = list(kept) or list(range(len(self.muscles)))
        return _most_alike(now[channels], self.spans[: self.trials, channels])

    def _span_like(self, now: np.ndarray) -> np.ndarray:
        """Ranges of the fitted stretch, or of what lies between two fitted trials, most like those `now`; all (k,)."""
        whole = self.spans[: self.trials]
        # Trials in the order of their effort; between two neighbours lie others that nobody recorded.
        whole = whole[np.argsort(np.prod(np.where(whole > 0.0, whole, 1.0) ** (1.0 / whole.shape[1]), axis=1))]
        between = [a ** (1.0 - share) * b**share for a, b in pairwise(whole) for share in BETWEEN_SHARES]
        spans = np.vstack([self.spans, *between])
        return spans[_most_alike(now, spans)]

    def without(self, trial: TorqueTrial, muscles: Collection[str]) -> TorqueTrial:
        """The trial with some envelopes replaced by what the others made of them when the estimator was fitted."""
        bad = [k for k, muscle in enumerate(self.muscles) if muscle in muscles]
        good = [k for k in range(len(self.muscles)) if k not in bad]
        if not good:
            raise IdentificationError(f"recording {trial.name}: found no channel that is as it was, expected one")
        x = np.column_stack([trial.envelopes[m] for m in self.muscles])
        x[:, bad] = self.floor[bad] + 0.5 * self.span[bad]
        # A few rounds, since two that are replaced may stand for each other.
        for _ in range(5 if len(bad) > 1 else 1):
            for k in bad:
                x[:, k] = np.maximum(self.others[k].predict(np.delete(x, k, axis=1)), 0.0)
        made = {m: (x[:, k] if k in bad else trial.envelopes[m]) for k, m in enumerate(self.muscles)}
        return replace(trial, envelopes=made, lead={})

    def _correlations(self, x: np.ndarray, moved: np.ndarray) -> np.ndarray:
        """Of the pattern of muscle i with the envelope of channel k, shape (k, k)."""
        return _correlations(np.column_stack([pattern.predict(moved) for pattern in self.patterns]), x)

    def _changes(
        self,
        floor: np.ndarray,
        risen: np.ndarray,
        now: np.ndarray,
        like: np.ndarray,
        goes_with: np.ndarray | None,
        together: np.ndarray,
    ) -> list[ChannelChange]:
        """What changed, by floors, their rise, ranges, fitted ones, all (k,), and correlations, both (k, k)."""
        level = _level(now, like)
        level = level / _common(level)
        found, swapped = [], self._swapped(level * like, like, goes_with)
        copies = self._copies(level, goes_with, together)
        rather_than_own = None if goes_with is None else _rather_than_own(goes_with) - self.own_doubt
        lowest, highest = self.floors.min(axis=0), self.floors.max(axis=0)
        for k, muscle in enumerate(self.muscles):
            if k in swapped:
                other = self.muscles[swapped[k]]
                found.append(
                    ChannelChange(muscle, "swapped", f"level and pattern of {other}", "its own: are cables or columns "
                                  "exchanged?", other)
                )  # fmt: skip
                continue
            if abs(risen[k]) > RISEN:
                ends = dict.fromkeys((f"{lowest[k]:.2g}", f"{highest[k]:.2g}"))
                expected = f"{' to '.join(ends)}, within {100 * RISEN:g} % of its range, as fitted"
                found.append(ChannelChange(muscle, "floor", f"a floor of {floor[k]:.2g}", expected))
            if not 1.0 / LEVEL <= level[k] <= LEVEL:
                said = f"{level[k]:.2g} times the range as fitted, what all changed by taken off"
                found.append(ChannelChange(muscle, "level", said, f"{1 / LEVEL:.1g} to {LEVEL:g} times"))
            if k in copies:
                i, other = copies[k], self.muscles[copies[k]]
                said = f"the signal of {other} (correlation of envelopes {np.tanh(together[i, k]):.3f})"
                expected = f"its own ({np.tanh(self.together[i, k]):.2f} as fitted)"
                found.append(ChannelChange(muscle, "crosstalk", said, expected, other))
            elif goes_with is not None:
                best = int(np.argmax(goes_with[:, k]))
                known = self.repeats[k] and self.repeats[best]
                clear = goes_with[k, k] < OWN and goes_with[best, k] > CLEAR
                if known and clear and rather_than_own[best, k] > PATTERN:
                    other = self.muscles[best]
                    said = f"the pattern of {other} (correlation {goes_with[best, k]:.2f})"
                    found.append(ChannelChange(muscle, "pattern", said, f"its own ({goes_with[k, k]:.2f})", other))
        return found

    def _copies(self, level: np.ndarray, goes_with: np.ndarray | None, together: np.ndarray) -> dict[int, int]:
        """Channels whose envelope became another's, and which; of the two, the one that is less like itself."""
        close = (together > np.arctanh(ONE_SIGNAL)) & (together - self.together > CLOSER)
        unlike = np.abs(np.log(np.maximum(level, 1e-3))) / SPREAD
        if goes_with is not None:
            unlike = unlike + np.where(self.repeats, _unexplained(np.diag(goes_with)), 0.0)
        return {
            k: int(np.argmax(np.where(close[k], together[k], -np.inf)))
            for k in range(len(self.muscles))
            if any(unlike[k] >= unlike[i] for i in np.flatnonzero(close[k]))
        }

    def _swapped(self, now: np.ndarray, like: np.ndarray, goes_with: np.ndarray | None) -> dict[int, int]:
        """Pairs of channels that stand for each other, the clearest first, by ranges (k,), fitted ones and patterns."""
        if goes_with is None:
            return {}
        scores = self._swap_scores(now, like, goes_with) - self.swap_doubt
        pairs: dict[int, int] = {}
        for _, i, k in sorted(((scores[i, k], i, k) for i, k in np.argwhere(scores > RATHER)), reverse=True):
            if i not in pairs and k not in pairs:
                pairs |= {int(i): int(k), int(k): int(i)}
        return pairs

    def _swap_scores(self, now: np.ndarray, like: np.ndarray, goes_with: np.ndarray) -> np.ndarray:
        """Log-likelihood ratio for an exchange of channels i and k > i, by pattern and range; (k, k), elsewhere -inf.

        `now` (k,) are the channels' ranges, `like` (k,) fitted ones; `goes_with` (k, k) as `_correlations` gives it.
        """
        unexplained = _unexplained(goes_with)
        with np.errstate(divide="ignore", invalid="ignore"):
            # Row i: the range of each channel k against that of muscle i.
            off = np.log(now[None, :] / like[:, None]) ** 2 / (2.0 * SPREAD**2)
        scores = np.full((len(now), len(now)), -np.inf)
        for i in range(len(now)):
            for k in range(i + 1, len(now)):
                rather = min(off[i, i], GAIN) + min(off[k, k], GAIN) - off[i, k] - off[k, i]
                if self.repeats[i] and self.repeats[k]:
                    rather += unexplained[i, i] + unexplained[k, k] - unexplained[i, k] - unexplained[k, i]
                if np.isfinite(rather):
                    scores[i, k] = rather
        return scores


def _watched_stretches(trial: TorqueTrial) -> list[TorqueTrial]:
    """The stretches of a trial that a watch compares, at most `MAX_STRETCH_COUNT`, evenly spaced."""
    every, window = max(1, round(COMPARISON_INTERVAL_S * trial.fs)), round(WINDOW_S * trial.fs)
    first = -(-round(MIN_WATCH_S * trial.fs) // every) * every
    ends = range(first, len(trial) + 1, every)
    if len(ends) > MAX_STRETCH_COUNT:
        ends = np.linspace(first, len(trial), MAX_STRETCH_COUNT).astype(int).tolist()
    parts = [slice(max(0, end - window), end) for end in ends]
    return [
        replace(
            trial, time=trial.time[part], torque=trial.torque[part], lead={}, muscles=None,
            envelopes={m: x[part] for m, x in trial.envelopes.items()},
            angles={j: q[part] for j, q in trial.angles.items()},
        )
        for part in parts
    ]  # fmt: skip


def _repeating(trials: Sequence[TorqueTrial]) -> np.ndarray:
    """Whether the pattern of the trials' first halves is, in the median trial, that of its second half, (k,)."""
    each = [_stacked([trial]) for trial in trials]
    halves = [len(x) // 2 for x, _ in each]
    x, moved = (np.vstack([both[i][:half] for both, half in zip(each, halves, strict=True)]) for i in (0, 1))
    everything = tuple(range(moved.shape[1]))
    patterns = [Ridge(PENALTY, everything).fit(moved, x[:, k]) for k in range(x.shape[1])]
    found = [
        np.diag(_correlations(np.column_stack([pattern.predict(moved[half:]) for pattern in patterns]), x[half:]))
        for (x, moved), half in zip(each, halves, strict=True)
    ]
    return np.median(found, axis=0) > CLEAR


def _rather_than_own(goes_with: np.ndarray) -> np.ndarray:
    """Log-likelihood ratio by which channel k goes with the pattern of muscle i rather than with its own, (k, k)."""
    unexplained = _unexplained(goes_with)
    return np.diag(unexplained)[None, :] - unexplained


def _level(now: np.ndarray, like: np.ndarray) -> np.ndarray:
    """Ranges `now` over fitted ones, both (k,); 1 of a channel that never ranged, 0 of one that ranges only now."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(like > 0.0, now / like, np.where(now > 0.0, 0.0, 1.0))


def _most_alike(now: np.ndarray, spans: np.ndarray) -> int:
    """Which of `spans`, (s, k), is nearest to `now`, (k,), by the sum of the logarithms' distances.

    A single channel that changed hardly moves such a sum from one to another.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        apart = np.abs(np.log(now / spans))
    return int(np.argmin(np.nan_to_num(apart, nan=0.0, posinf=MAX_LOG_DISTANCE).sum(axis=1)))


def _common(level: np.ndarray) -> float:
    """What all ranges changed by, of `level` (k,): another speed's or load's; of few channels the one nearest to 1."""
    known = np.log(level[level > 0.0])
    if not len(known):
        return 1.0
    return float(np.exp(np.median(known) if len(known) > 3 else known[np.argmin(np.abs(known))]))


def _unexplained(correlation: np.ndarray) -> np.ndarray:
    """Logarithm of the share of an envelope's variance that a pattern with this correlation leaves."""
    return np.log(np.maximum(1.0 - np.maximum(correlation, 0.0) ** 2, 1e-6))


def _correlations(made: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Of every column of one with every column of the other, both (n, k): shape (k, k); 0 where one rests."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.nan_to_num(np.corrcoef(made.T, x.T)[: made.shape[1], made.shape[1] :])


def _together(x: np.ndarray) -> np.ndarray:
    """Fisher's z of every two envelopes, (n, k) to (k, k); 0 of one with itself."""
    z = np.arctanh(np.clip(_correlations(x, x), -0.9999, 0.9999))
    return z - np.diag(np.diag(z))


def _stacked(trials: Sequence[TorqueTrial]) -> tuple[np.ndarray, np.ndarray]:
    """Envelopes (n, k), and angles with their rates (n, 2 j), of trials one after another."""
    x = np.vstack([np.column_stack(list(trial.envelopes.values())) for trial in trials])
    moved = []
    for trial in trials:
        of_joints = [derivatives(np.asarray(q, float), trial.fs, causal=False)[:2] for q in trial.angles.values()]
        moved.append(np.column_stack([column for pair in of_joints for column in pair]))
    return x, np.vstack(moved)
