"""Whether envelopes are still those that an estimator was fitted to: floor, level and pattern, channel by channel.

An electrode that is stuck on anew, a cable in another socket or another gain changes one channel; another speed or load
changes nearly all of them. Neither shows in the torque of a map, which goes on as if nothing had happened.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from .._errors import IdentificationError
from .features import derivatives
from .ridge import Ridge
from .torque_trial import TorqueTrial

FLOOR, TOP = 0.05, 0.95
"""Quantiles of an envelope between which it ranges: a twitch, or one silent moment, moves neither."""

RISEN = 0.2
"""Share of the fitted range by which a floor may move."""

LEVEL = 3.0
"""Times the fitted range that one channel may reach, or fall short of, among others that do not: a small muscle of a
walker comes to 2.5 within a minute."""

ALIKE = 1.5
"""Times by which two ranges differ that may be one muscle's."""

FOLLOWS = 0.2
"""Correlation by which an envelope goes with another muscle's pattern rather than its own before they are confused."""

CLEAR = 0.5
"""Correlation from which an envelope is said to go with a pattern at all."""

BEYOND = 0.25
"""Share of the fitted range by which a value may pass its ends."""

ELSEWHERE = 0.25
"""Share of a recording out of the fitted ranges, in time, from which nothing tells whether an estimate holds."""

PENALTY = 10.0
"""Of a pattern's ridge regression, for standardised terms."""


@dataclass(frozen=True)
class ChannelChange:
    """One channel that is not what it was."""

    muscle: str
    kind: str  # "floor", "level", "swapped" or "pattern"
    found: str
    expected: str
    other: str = ""  # The muscle whose pattern it goes with


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
    floor: np.ndarray  # floor, span: (k,) in the envelopes' unit
    span: np.ndarray
    low: np.ndarray = field(repr=False)  # low, high: (2 angles,) ends of angles [rad] and their rates [rad/s]
    high: np.ndarray = field(repr=False)
    patterns: tuple[Ridge, ...] = field(repr=False)  # Of each envelope, by angles and rates
    repeats: np.ndarray  # (k,) Whether the pattern of one half of what was fitted is that of the other
    others: tuple[Ridge, ...] = field(repr=False)  # Of each envelope, by the other envelopes

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
        half = len(x) // 2
        earlier = (Ridge(PENALTY, everything).fit(moved[:half], x[:half, k]) for k in range(len(muscles)))
        made = np.column_stack([pattern.predict(moved[half:]) for pattern in earlier])
        repeats = np.diag(_correlations(made, x[half:])) > CLEAR
        others = ()
        if len(muscles) > 1:
            others = tuple(Ridge(PENALTY).fit(np.delete(x, k, axis=1), x[:, k]) for k in range(len(muscles)))
        return cls(muscles, floor, top - floor, moved.min(axis=0), moved.max(axis=0), patterns, repeats, others)

    def compared(self, trial: TorqueTrial) -> Compared:
        """A trial's channels against those fitted."""
        x, moved = _stacked([trial])
        floor, top = np.quantile(x, (FLOOR, TOP), axis=0)
        span = np.where(self.span > 0.0, self.span, np.inf)
        risen, level = (floor - self.floor) / span, (top - floor) / span
        many = bool(np.sum((level > LEVEL) | (level < 1.0 / LEVEL)) > max(2, 0.5 * len(self.muscles)))
        margin = BEYOND * (self.high - self.low)
        away = ((moved < self.low - margin) | (moved > self.high + margin)).any(axis=1)
        goes_with = self._correlations(x, moved) if np.mean(away) <= ELSEWHERE else None
        changes = [] if many else self._changes(floor, risen, level, goes_with)
        named = {change.muscle for change in changes}
        loud = [
            (x[:, k] > self.floor[k] + (1.0 + 2.0 * BEYOND) * self.span[k])
            for k, muscle in enumerate(self.muscles)
            if muscle not in named
        ]
        away |= np.sum(loud, axis=0) >= max(2, 0.25 * len(self.muscles))

        def by_muscle(values: np.ndarray) -> dict[str, float]:
            return dict(zip(self.muscles, map(float, values), strict=True))

        own = {} if goes_with is None else by_muscle(np.diag(goes_with))
        return Compared(by_muscle(risen), by_muscle(level), own, tuple(changes), float(np.mean(away)), many)

    def rescaled(self, trial: TorqueTrial, seconds: float, muscles: Collection[str]) -> TorqueTrial:
        """The trial with floor and range of some muscles brought to those fitted, by its first `seconds` [s] alone."""
        first = trial.time <= trial.time[0] + seconds
        made = dict(trial.envelopes)
        for k, muscle in enumerate(self.muscles):
            if muscle in muscles:
                floor, top = np.quantile(made[muscle][first], (FLOOR, TOP))
                scale = self.span[k] / (top - floor) if top > floor else 1.0
                made[muscle] = np.maximum(self.floor[k] + scale * (made[muscle] - floor), 0.0)
        return replace(trial, envelopes=made, lead={})

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
        self, floor: np.ndarray, risen: np.ndarray, level: np.ndarray, goes_with: np.ndarray | None
    ) -> list[ChannelChange]:
        found, swapped = [], self._swapped(level, goes_with)
        for k, muscle in enumerate(self.muscles):
            if k in swapped:
                other = self.muscles[swapped[k]]
                found.append(
                    ChannelChange(muscle, "swapped", f"level and pattern of {other}", "its own: are cables or columns "
                                  "exchanged?", other)
                )  # fmt: skip
                continue
            if abs(risen[k]) > RISEN:
                expected = f"{self.floor[k]:.2g}, within {100 * RISEN:g} % of its range, as fitted"
                found.append(ChannelChange(muscle, "floor", f"a floor of {floor[k]:.2g}", expected))
            if not 1.0 / LEVEL <= level[k] <= LEVEL:
                expected = f"{1 / LEVEL:.1g} to {LEVEL:g} times"
                found.append(ChannelChange(muscle, "level", f"{level[k]:.2g} times the range as fitted", expected))
            if goes_with is not None:
                best = int(np.argmax(goes_with[:, k]))
                known = self.repeats[k] and self.repeats[best]
                if known and best != k and goes_with[best, k] > max(CLEAR, goes_with[k, k] + FOLLOWS):
                    other = self.muscles[best]
                    said = f"the pattern of {other} (correlation {goes_with[best, k]:.2f})"
                    found.append(ChannelChange(muscle, "pattern", said, f"its own ({goes_with[k, k]:.2f})", other))
        return found

    def _swapped(self, level: np.ndarray, goes_with: np.ndarray | None) -> dict[int, int]:
        """Pairs of channels that stand for each other: by pattern where patterns differ, else by their ranges."""
        pairs: dict[int, int] = {}
        if goes_with is None:
            return pairs
        n = len(self.muscles)
        for i in range(n):
            for k in range(i + 1, n):
                crossed, straight = goes_with[i, k] + goes_with[k, i], goes_with[i, i] + goes_with[k, k]
                ranges = level[i] * self.span[i] / self.span[k], level[k] * self.span[k] / self.span[i]
                taken_over = all(1.0 / ALIKE <= ratio <= ALIKE for ratio in ranges)
                moved = not all(1.0 / ALIKE**2 <= level[j] <= ALIKE**2 for j in (i, k))
                known = self.repeats[i] and self.repeats[k]
                by_pattern = (
                    known and crossed > straight + 2.0 * FOLLOWS and min(goes_with[i, k], goes_with[k, i]) > 0.0
                )
                by_range = taken_over and moved and (crossed > straight - FOLLOWS or not known)
                if (by_pattern and (taken_over or not moved)) or by_range:
                    pairs |= {i: k, k: i}
        return pairs


def _correlations(made: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Of every column of one with every column of the other, both (n, k): shape (k, k); 0 where one rests."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.nan_to_num(np.corrcoef(made.T, x.T)[: made.shape[1], made.shape[1] :])


def _stacked(trials: Sequence[TorqueTrial]) -> tuple[np.ndarray, np.ndarray]:
    """Envelopes (n, k), and angles with their rates (n, 2 j), of trials one after another."""
    x = np.vstack([np.column_stack(list(trial.envelopes.values())) for trial in trials])
    moved = []
    for trial in trials:
        of_joints = [derivatives(np.asarray(q, float), trial.fs, causal=False)[:2] for q in trial.angles.values()]
        moved.append(np.column_stack([column for pair in of_joints for column in pair]))
    return x, np.vstack(moved)
