"""Definition of an estimator: its features, the settings it chooses from, and how it is made."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from ..torque_trial import Features, FeatureSet, list_feature_sets

SEED = 20210
"""Seed of every estimator's random draws."""


class Regressor(Protocol):
    """An estimator with the interface of scikit-learn: it is fitted to features and a torque."""

    def fit(self, x: np.ndarray, y: np.ndarray, /, **weights: Any) -> Regressor:
        """Fit to features `x`, shape (n, k), and torque `y`, shape (n,) [N m].

        Families with a `weight_argument` also pass weights of the rows, shape (n,).
        """

    def predict(self, x: np.ndarray) -> np.ndarray:
        """Predict the torque for features `x`."""

    def get_params(self) -> dict[str, Any]:
        """Return the settings by name."""


def _refuse_features(settings: Mapping[str, Any], seen: Features) -> Regressor:
    """Refuse to make an estimator of features, for families that fit trials."""
    raise NotImplementedError("this family fits trials, not features")


@dataclass(frozen=True)
class Family:
    """A kind of estimator that can be requested by name."""

    description: str  # Description for tables
    # Constructor of an unfitted scikit-learn estimator, from settings and the features that it will see
    make: Callable[[Mapping[str, Any], Features], Regressor] = _refuse_features
    settings: tuple[Mapping[str, Any], ...] = ({},)  # Candidate settings
    lags: bool | None = None  # Whether it sees earlier envelopes; None: cross-validation decides
    muscles: bool = True  # Whether it sees EMG at all
    # Whether it sees the torque measured so far; it then cannot be compared with estimators that do not
    sees_measured_torque: bool = False
    # Whether it reconstructs a published method; such an estimator is compared with, and never recommended
    reconstruction: bool = False
    only_features: FeatureSet | None = None  # Only features it may see; None: they are chosen
    # Whether every pair of features and settings is tried; otherwise features are chosen first, then settings
    tries_all_pairs: bool = False
    # Settings with which features are chosen, if that is done first; None: the first of `settings`
    feature_choice_settings: Mapping[str, Any] | None = None
    smoothing: float = 0.05  # Length of the moving average on its output [s]; 0 for none
    # Name of a setting along which estimators share their work, by a method `predict_each(x, y, values, new)` that fits
    # with each of `values`, shape (n, k) and (n,), and returns the predictions for `new`, shape (m, k), of each
    shared_setting: str | None = None
    # Function that fits trials itself, for estimators not made of features: from trials, name and causality to a map
    fit_trials: Callable[[Any, str, bool], Any] | None = None
    # Name of the estimator that it corrects, and the function that makes it of this estimator's fit: from the fit,
    # trials, name and causality to a map. Both are then fitted once
    corrects: str = ""
    correct_fit: Callable[[Any, Any, str, bool], Any] | None = None
    aliases: tuple[str, ...] = ()  # Further names
    rank: int = 100  # Place in tables, the lowest first
    # Whether anatomy holds its form; it is then recommended for recordings unlike all fitted ones
    is_anatomical: bool = False
    short: str = ""  # Name in legends; "": the description
    colour: str = "ink"  # Role of its colour in figures
    shows_muscles: bool = False  # Whether reports show the muscles that it calibrates, with the band of its torque
    rivals_muscles: bool = False  # Whether muscles are compared with it: a regression of the same inputs
    scored_causally: bool = False  # Whether it is also scored with features of the past alone
    runs_live: bool = False  # Whether its causal map becomes a card that runs sample by sample
    # Name of the argument of `fit` that takes weights of rows; trials are then weighed by `find_trial_weights`. Empty
    # for published methods, which have none, and for estimators that fit trials themselves
    weight_argument: str = ""

    def candidates(self, *, neighbours: bool) -> tuple[FeatureSet, ...]:
        """Return the feature sets that it may choose from. `neighbours`: whether other joints' angles are recorded."""
        if self.only_features is not None:
            return (self.only_features,)
        return list_feature_sets(neighbours=neighbours, lags=self.lags, muscles=self.muscles)

    def weights(self, row_weight: np.ndarray | None) -> dict[str, np.ndarray]:
        """Return the keyword arguments that pass weights, shape (n,), to its `fit`; none if it takes none."""
        return {self.weight_argument: row_weight} if self.weight_argument and row_weight is not None else {}

    def fit_and_predict(
        self,
        settings: Sequence[Mapping[str, Any]],
        seen: Features,
        x: np.ndarray,
        y: np.ndarray,
        new: np.ndarray,
        row_weight: np.ndarray | None = None,
    ) -> list[np.ndarray]:
        """Fit an estimator for each of `settings` and return its predictions for rows `new`, shape (m, k).

        Each is fitted to rows `x`, shape (n, k), of the features `seen`, and to the torque `y`, shape (n,) [N m].
        `row_weight`, shape (n,), weighs the rows if the family weighs trials.
        """
        weights = self.weights(row_weight)
        if self.shared_setting is None:
            return [self.make(each, seen).fit(x, y, **weights).predict(new) for each in settings]
        alike: dict[str, list[int]] = {}
        for i, each in enumerate(settings):
            alike.setdefault(repr({k: v for k, v in each.items() if k != self.shared_setting}), []).append(i)
        found: dict[int, np.ndarray] = {}
        for indices in alike.values():
            made: Any = self.make(settings[indices[0]], seen)
            values = [settings[i][self.shared_setting] for i in indices]
            found |= zip(indices, made.predict_each(x, y, values, new, **weights), strict=True)
        return [found[i] for i in range(len(settings))]
