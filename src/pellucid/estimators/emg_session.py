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
    floor: np.ndarray  # floor, span: (k,) in the envelopes' unit
    span: np.ndarray
    low: np.ndarray = field(repr=False)  # low, high: (2 angles,) ends of angles [rad] and their rates [rad/s]
    high: np.ndarray = field(repr=False)
    patterns: tuple[Ridge, ...] = field(repr=False)  # Of each envelope, by angles and rates
    repeats: np.ndarray  # (k,) Whether the pattern of one half of what was fitted is that of the other
    others: tuple[Ridge, ...] = field(repr=False)  # Of each envelope, by the other envelopes
    together: np.ndarray = field(repr=False)  # (k, k) Fisher's z of every two envelopes

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
        return cls(muscles, floor, top - floor, moved.min(axis=0), moved.max(axis=0), patterns, repeats, others,
                   _together(x))  # fmt: skip

    def compared(self, trial: TorqueTrial) -> Compared:
        """A trial's channels against those fitted."""
        x, moved = _stacked([trial])
        floor, top = np.quantile(x, (FLOOR, TOP), axis=0)
        span = np.where(self.span > 0.0, self.span, np.inf)
        risen, level = (floor - self.floor) / span, (top - floor) / span
        many = bool(np.sum((level > LEVEL) | (level < 1.0 / LEVEL)) > max(2, 0.5 * len(self.muscles)))
        margin = np.maximum(BEYOND * (self.high - self.low), np.tile(HELD, len(self.low) // 2))
        away = ((moved < self.low - margin) | (moved > self.high + margin)).any(axis=1)
        goes_with = self._correlations(x, moved) if np.mean(away) <= ELSEWHERE else None
        changes = [] if many else self._changes(floor, risen, level / _common(level), goes_with, _together(x))
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
        self,
        floor: np.ndarray,
        risen: np.ndarray,
        level: np.ndarray,
        goes_with: np.ndarray | None,
        together: np.ndarray,
    ) -> list[ChannelChange]:
        found, swapped = [], self._swapped(level, goes_with)
        copies = self._copies(level, goes_with, together)
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
                rather = _unexplained(goes_with[k, k]) - _unexplained(goes_with[best, k])
                if known and goes_with[k, k] < OWN and goes_with[best, k] > CLEAR and rather > PATTERN:
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

    def _swapped(self, level: np.ndarray, goes_with: np.ndarray | None) -> dict[int, int]:
        """Pairs of channels that stand for each other, the clearest first, by the likelihood of pattern and range."""
        if goes_with is None:
            return {}
        unexplained = _unexplained(goes_with)
        with np.errstate(divide="ignore", invalid="ignore"):
            # Of range as channel k against that of muscle i as fitted.
            off = np.log(level[None, :] * self.span[None, :] / self.span[:, None]) ** 2 / (2.0 * SPREAD**2)
        scores = []
        for i in range(len(self.muscles)):
            for k in range(i + 1, len(self.muscles)):
                rather = min(off[i, i], GAIN) + min(off[k, k], GAIN) - off[i, k] - off[k, i]
                if self.repeats[i] and self.repeats[k]:
                    rather += unexplained[i, i] + unexplained[k, k] - unexplained[i, k] - unexplained[k, i]
                if np.isfinite(rather) and rather > RATHER:
                    scores.append((rather, i, k))
        pairs: dict[int, int] = {}
        for _, i, k in sorted(scores, reverse=True):
            if i not in pairs and k not in pairs:
                pairs |= {i: k, k: i}
        return pairs


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
