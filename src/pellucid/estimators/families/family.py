"""What an estimator is asked for by: its features, the settings it chooses from, how it is made."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from ..features import Features, FeatureSet, feature_sets

SEED = 20210
"""Of every estimator's draws."""


class Regressor(Protocol):
    """Anything that is fitted to features and a torque, as scikit-learn's estimators are."""

    def fit(self, x: np.ndarray, y: np.ndarray) -> Regressor:
        """Fit to features `x`, shape (n, k), and torque `y`, shape (n,) [N m]."""

    def predict(self, x: np.ndarray) -> np.ndarray:
        """Torque for features `x`."""


def _made_of_trials(settings: Mapping[str, Any], seen: Features) -> Regressor:
    raise NotImplementedError("this family fits trials, not features")


@dataclass(frozen=True)
class Family:
    """An estimator that can be asked for by name."""

    words: str  # What it is
    # From settings and the features it will see to a scikit-learn estimator, not yet fitted
    make: Callable[[Mapping[str, Any], Features], Regressor] = _made_of_trials
    settings: tuple[Mapping[str, Any], ...] = ({},)  # Candidates
    lags: bool | None = None  # Whether it sees earlier envelopes; None: cross-validation decides
    muscles: bool = True  # Whether it sees EMG at all
    told: bool = False  # Whether it is told the torque measured so far, which others are not: no peer of theirs
    # Whether it rebuilds what another paper says of its own method: it is compared with, and never named first
    reconstruction: bool = False
    fixed: FeatureSet | None = None  # The only features it sees, where they are not to be chosen
    every: bool = False  # Every pair of features and settings is tried; otherwise features first, then settings
    # Settings with which features are chosen, where that is done first; None: the first of `settings`
    quick: Mapping[str, Any] | None = None
    smoothing: float = 0.05  # Length of the moving average on its output [s]; 0 for none
    # A setting along which estimators share their work: theirs have `predict_each(x, y, values, new)`
    along: str | None = None
    # Fits trials itself, where features do not do: from trials, name and whether it is causal to a fitted map
    whole: Callable[[Any, str, bool], Any] | None = None
    aliases: tuple[str, ...] = ()  # What it may also be called
    rank: int = 100  # Its place in tables, the lowest first
    # Beyond what was fitted it is 0: muscles held by anatomy; 1: muscles that are not; 2: linear in its terms;
    # 3: within the torques it has seen
    reach: int = 3

    def candidates(self, *, neighbours: bool) -> tuple[FeatureSet, ...]:
        """Feature sets it may choose from; `neighbours`: whether other joints' angles are there."""
        if self.fixed is not None:
            return (self.fixed,)
        return feature_sets(neighbours=neighbours, lags=self.lags, muscles=self.muscles)

    def predicted(
        self, settings: Sequence[Mapping[str, Any]], seen: Features, x: np.ndarray, y: np.ndarray, new: np.ndarray
    ) -> list[np.ndarray]:
        """What one for each of `settings` says of rows `new`, shape (m, k), fitted to rows `x`, shape (n, k), of what
        is `seen` and `y`, shape (n,) [N m]."""
        if self.along is None:
            return [self.make(each, seen).fit(x, y).predict(new) for each in settings]
        alike: dict[str, list[int]] = {}
        for i, each in enumerate(settings):
            alike.setdefault(repr({k: v for k, v in each.items() if k != self.along}), []).append(i)
        found: dict[int, np.ndarray] = {}
        for indices in alike.values():
            made = self.make(settings[indices[0]], seen)
            found |= zip(indices, made.predict_each(x, y, [settings[i][self.along] for i in indices], new), strict=True)
        return [found[i] for i in range(len(settings))]
