"""A muscle without an electrode: ways to fill it in, and how near each comes to an electrode that was there.

An electrode that was there is taken away from the recordings that judge. What each way tells of it is compared with
what it recorded, as the activation of its muscle, which is what a force is made of: an envelope and an activation that
was found from a torque can be compared there. Some ways are told the torque of the very samples (``told``), the others
see EMG and angles alone, and only of those does the torque that follows say something.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from .._errors import IdentificationError
from ..fit.muscles.muscle_calibration import MuscleFit, MuscleSamples
from .assisted import AssistedMuscles
from .cross_validation import Fold, Score, block_folds, grouped_folds, score
from .features import derivatives
from .hill import HillMap
from .hill_together import Across, HillTogether
from .muscle_source import ALIASES
from .muscle_trials import warm
from .ridge import Ridge
from .synergies import FEWEST, FOLDS, GAP, Synergies, determined, find_synergies
from .torque_trial import TorqueTrial

WAYS: Mapping[str, str] = {
    "linear": "linear map of the others",
    "synergies": "synergies of the others",
    "pattern": "mean over the joint's cycle",
    "rest": "at rest",
    "synergies_assisted": "synergies, then EMG-assisted (told)",
    "assisted": "EMG-assisted (told)",
    "static": "static optimisation (told)",
}
"""How a muscle is filled in, in words."""

TOLD = ("synergies_assisted", "assisted", "static")
"""Ways that see the measured torque of the samples that they fill in."""

TRUSTS = (0.3, 3.0, 30.0, 300.0)
"""In EMG: what is chosen from."""

EFFORTS = (0.03, 0.3, 3.0, 30.0)
"""Of muscles without EMG: what is chosen from."""

STIFF = 1e6
"""A trust that leaves the recorded ones as they are."""

PENALTIES = (0.1, 10.0, 1000.0)
"""Of the linear map: what is chosen from."""

BINS = 40
"""Of a cycle."""


@dataclass(frozen=True)
class Trust:
    """How much EMG is trusted, and what activity without it costs."""

    trust: float
    effort: float
    chosen: bool = True  # Within what may be fitted; False where it was stated


@dataclass(frozen=True, eq=False)
class FilledIn:
    """One electrode taken away, and one way to do without it."""

    way: str
    channel: str
    recording: str
    muscle: str
    r2: float  # r2, correlation: Of its activation, about what its own EMG gives
    correlation: float
    # That EMG-driven muscles then predict, by joint; None where the way is told it
    torque: Mapping[str, Score] | None
    recorded: np.ndarray  # recorded, filled: (n,) Activation by its own EMG, and filled in
    filled: np.ndarray


@dataclass(frozen=True, eq=False)
class OneJoint:
    """Muscles of a single joint, asked as those of several are."""

    alone: HillMap

    @property
    def joints(self) -> tuple[str, ...]:
        """The one."""
        return (self.alone.joint,)

    @property
    def fit(self) -> MuscleFit:
        """Its muscles, calibrated."""
        return self.alone.fit

    @property
    def driven(self) -> Mapping[str, tuple[str, ...]]:
        """EMG channels, by muscle."""
        return self.alone.driven

    def samples(self, trial: Across) -> tuple[MuscleSamples, slice]:
        """A recording as these muscles see it, and where its own samples lie."""
        return self.alone.samples(trial[self.alone.joint])

    def predict(self, trial: Across) -> dict[str, np.ndarray]:
        """Its torque, shape (n,) [N m]."""
        return {self.alone.joint: self.alone.predict(trial[self.alone.joint])}


Calibrated = OneJoint | HillTogether
"""Muscles of one joint, or of several at once."""


def assisted_muscles(fitted: Calibrated, trial: Across, scale: np.ndarray) -> tuple[AssistedMuscles, slice]:
    """A recording as calibrated muscles see it, and where its own samples lie; `scale` (j,) [N m]."""
    samples, own = fitted.samples(trial)
    count = samples.torque.shape[-1]
    bare = AssistedMuscles(fitted.fit.muscles, samples, np.zeros((len(scale), count)), scale)
    tissue = fitted.fit.predict(samples).reshape(-1, count) - bare.torque(bare.recorded)
    return replace(bare, tissue=tissue), own


def removable(fitted: Calibrated, trial: Across) -> dict[str, tuple[str, tuple[int, ...]]]:
    """Channels that may be taken away: the muscle below each, and all it drives, be it in part, by place."""
    found = {}
    for channel in _one(trial).envelopes:
        muscle = ALIASES.get(channel, channel)
        lost = tuple(i for i, channels in enumerate(fitted.driven.values()) if channel in channels)
        if muscle in fitted.driven and lost:
            found[channel] = muscle, lost
    return found


def _one(trial: Across) -> TorqueTrial:
    """A recording's trial at one of the joints: EMG and angles are the same for all."""
    return next(iter(trial.values()))


def choose_trust(fitted: Calibrated, trials: Sequence[Across]) -> Trust:
    """The trust and the effort with which muscles taken away from what was fitted are told best."""
    scale = scale_of(trials)
    seen = [(trial, *assisted_muscles(fitted, trial, scale)) for trial in trials]
    best = (np.inf, Trust(TRUSTS[-1], EFFORTS[-1]))
    for trust in TRUSTS:
        for effort in EFFORTS:
            missed = 0.0
            for trial, muscles, own in seen:
                kept = warm(_one(trial))
                for muscle, lost in removable(fitted, trial).values():
                    at = list(fitted.driven).index(muscle)
                    told = muscles.assisted(lost, trust=trust, effort=effort)[at, own]
                    truth = muscles.recorded[at, own]
                    missed += float(np.sum((told - truth)[kept:] ** 2) / np.sum(truth[kept:] ** 2))
            best = min(best, (missed, Trust(trust, effort)), key=lambda each: each[0])
    return best[1]


def scale_of(trials: Sequence[Across]) -> np.ndarray:
    """Standard deviation of each joint's torque that is fitted, (j,) [N m]."""
    return np.array([np.std(np.concatenate([trial[joint].torque for trial in trials])) for joint in trials[0]])


def filled_in(
    fitted: Calibrated,
    trials: Sequence[Across],
    judged: Sequence[Across],
    trust: Trust,
    lost: Sequence[str] = (),
) -> list[FilledIn]:
    """Every electrode taken away in turn from the recordings that judge, and every way to do without it; of those that
    were `lost` nothing is known there."""
    if any(_one(trial).heldout for trial in trials):
        raise IdentificationError("filling in: found a held-out trial to fit, expected it to judge")
    scale, filling, found = scale_of(trials), Filling(trials), []
    for trial in judged:
        # What came before a recording is not filled in: all ways begin with it.
        trial = {joint: replace(own, lead={}) for joint, own in trial.items()}
        muscles, own = assisted_muscles(fitted, trial, scale)
        kept = slice(warm(_one(trial)), None)
        truth = muscles.recorded
        for channel, (muscle, its_own) in removable(fitted, trial).items():
            if channel in lost:
                continue
            at = list(fitted.driven).index(muscle)
            for way in WAYS:
                torque, plain = None, way.removesuffix("_assisted")
                if way in ("assisted", "static"):
                    how = STIFF if way == "static" else trust.trust
                    told = muscles.assisted(its_own, trust=how, effort=trust.effort)[at, own]
                elif plain == "synergies" and not filling.grouped:
                    continue
                else:
                    without = filling.without(trial, (*lost, channel), plain)
                    seen, part = assisted_muscles(fitted, without, scale)
                    if way in TOLD:
                        told = seen.assisted(trust=trust.trust, effort=trust.effort)[at, part]
                    else:
                        told = seen.recorded[at, part]
                        made = fitted.predict(without)
                        torque = {j: score(trial[j].torque[kept], made[j][kept]) for j in fitted.joints}
                a, b = truth[at, own][kept], told[kept]
                together = float(np.corrcoef(a, b)[0, 1]) if np.std(a) > 0.0 and np.std(b) > 0.0 else 0.0
                found.append(FilledIn(way, channel, _one(trial).name, muscle, determined(a, b), together, torque, a, b))
    return found


class Filling:
    """Envelopes of muscles whose electrodes are lost, from what trials to fit had of them and the others."""

    def __init__(self, trials: Sequence[Across]):
        trials = self._trials = tuple(map(_one, trials))
        self.channels = tuple(trials[0].envelopes)
        known = np.concatenate([np.column_stack([t.envelopes[n] for n in self.channels]) for t in trials])
        top = known.max(axis=0)
        self._top = np.where(top > 0.0, top, 1.0)
        # Filters run both ways leave a little below 0.
        self._known = np.maximum(known, 0.0) / self._top
        self._folds = _folds(trials)

    @property
    def grouped(self) -> bool:
        """Whether there are muscles enough for synergies."""
        return len(self.channels) > FEWEST

    def without(self, trial: Across, lost: Sequence[str], way: str = "synergies") -> dict[str, TorqueTrial]:
        """A recording whose `lost` channels are filled in; their own EMG there is not looked at."""
        unknown = [channel for channel in lost if channel not in self.channels]
        if unknown or set(lost) >= set(self.channels):
            raise IdentificationError(
                f"filling in {', '.join(lost)}: found EMG of {', '.join(self.channels)} in what is fitted, expected "
                f"{', '.join(unknown) or 'one more'} there"
            )
        seen, across, trial = [i for i, name in enumerate(self.channels) if name not in lost], trial, _one(trial)
        x = np.column_stack([trial.envelopes[n] if n not in lost else np.zeros(len(trial)) for n in self.channels])
        x = np.maximum(x, 0.0) / self._top
        made = {}
        for channel in lost:
            at = self.channels.index(channel)
            if way == "rest":
                envelope = np.zeros(len(trial))
            elif way == "pattern":
                envelope = _pattern(channel, self._trials, trial)
            elif way == "linear":
                envelope = self._linear(at, tuple(seen)).predict(x[:, seen]) * self._top[at]
            else:
                envelope = self._synergies(at, tuple(seen)).rebuilt(x, seen)[:, at] * self._top[at]
            made[channel] = np.maximum(envelope, 0.0)
        return {j: replace(own, envelopes={**own.envelopes, **made}, lead={}) for j, own in across.items()}

    def _linear(self, at: int, seen: tuple[int, ...]) -> Ridge:
        x, y = self._known[:, seen], self._known[:, at]
        missed = [sum(_missed(Ridge(p).fit(x[f], y[f]).predict(x[g]), y[g]) for f, g in self._folds) for p in PENALTIES]
        return Ridge(PENALTIES[int(np.argmin(missed))]).fit(x, y)

    def _synergies(self, at: int, seen: tuple[int, ...]) -> Synergies:
        """As many as tell this muscle from the others best, blocks or trials left out in turn."""
        missed = [
            sum(
                _missed(own.rebuilt(self._known[g], seen)[:, at], self._known[g, at])
                for own, (_, g) in zip(tried, self._folds, strict=True)
            )
            for tried in self._tried
        ]
        return self._whole[int(np.argmin(missed))]

    @cached_property
    def _tried(self) -> list[list[Synergies]]:
        """Of every number, without each fold."""
        return [[find_synergies(self._known[f], self.channels, k) for f, _ in self._folds] for k in self._numbers]

    @cached_property
    def _whole(self) -> list[Synergies]:
        return [find_synergies(self._known, self.channels, k) for k in self._numbers]

    @property
    def _numbers(self) -> range:
        return range(1, len(self.channels) - 1)


def _missed(told: np.ndarray, truth: np.ndarray) -> float:
    return float(np.sum((np.maximum(told, 0.0) - truth) ** 2))


def _folds(trials: Sequence[TorqueTrial]) -> list[Fold]:
    """Trials in turn, or blocks of a single one."""
    if len(trials) > 1:
        return grouped_folds([name for i, t in enumerate(trials) for name in [str(i)] * len(t)])
    return block_folds(trials[0].time, FOLDS, GAP)


def _pattern(channel: str, trials: Sequence[TorqueTrial], judged: TorqueTrial) -> np.ndarray:
    """Mean of what was fitted at the same place in the cycle of the joint's angle and speed, (n,)."""
    moved = [derivatives(np.asarray(t.angles[t.joint], float), t.fs, causal=False)[:2] for t in (*trials, judged)]
    q, v = (np.concatenate([each[i] for each in moved[:-1]]) for i in (0, 1))
    middle, size, speed = q.mean(), q.std() or 1.0, v.std() or 1.0

    def phase(angle: np.ndarray, rate: np.ndarray) -> np.ndarray:
        return np.arctan2(-rate / speed, (angle - middle) / size)

    known = np.concatenate([t.envelopes[channel] for t in trials])
    place = ((phase(q, v) + np.pi) / (2.0 * np.pi) * BINS).astype(int) % BINS
    count = np.bincount(place, minlength=BINS)
    mean = np.bincount(place, known, minlength=BINS) / np.maximum(count, 1)
    centre = -np.pi + (np.arange(BINS) + 0.5) * 2.0 * np.pi / BINS
    met = count > 0
    return np.interp(phase(*moved[-1]), centre[met], mean[met], period=2.0 * np.pi)
