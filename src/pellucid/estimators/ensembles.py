"""Trees, bagged trees and least-squares boosting, from scikit-learn.

Settings under ``published`` follow what MATLAB's ``fitrtree`` and ``fitrensemble`` are documented to do when nothing is
asked: the thesis names these functions and no settings.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np

SEED = 20210
"""Of bagging's and boosting's draws."""

PUBLISHED: Mapping[str, Mapping[str, Any]] = {
    "tree": {"min_samples_leaf": 1, "min_samples_split": 10},
    "bagging": {"n_estimators": 100, "min_samples_leaf": 5, "min_samples_split": 10, "max_features": 1.0 / 3.0},
    "boost": {"n_estimators": 100, "learning_rate": 1.0, "max_leaf_nodes": 11, "min_samples_leaf": 5},
}
"""fitrtree: leaves of at least 1, parents of at least 10. fitrensemble: 100 trees; leaves of at least 5; bagging
draws a third of the predictors at each split; LSBoost splits a tree at most 10 times and does not shrink its steps."""

TUNED: Mapping[str, tuple[Mapping[str, Any], ...]] = {
    "tree": tuple({"min_samples_leaf": leaf} for leaf in (5, 10, 20, 40)),
    "bagging": tuple(
        {"n_estimators": 100, "min_samples_leaf": leaf, "max_features": share}
        for leaf, share in ((5, 1.0 / 3.0), (2, 1.0), (10, 1.0))
    ),
    "boost": tuple(
        {
            "n_estimators": trees, "learning_rate": step, "max_leaf_nodes": leaves, "min_samples_leaf": 5,
            "subsample": 0.5, "max_features": share,
        }
        for trees, step, leaves, share in (
            (100, 0.1, 11, 1.0), (100, 0.1, 6, 0.5), (150, 0.1, 11, 0.5), (150, 0.1, 4, 0.5),
        )
    ),
}  # fmt: skip
"""What cross-validation chooses from."""

QUICK: Mapping[str, Mapping[str, Any]] = {
    "bagging": {"n_estimators": 25, "min_samples_leaf": 5, "max_features": 1.0 / 3.0},
    "boost": {
        "n_estimators": 50, "learning_rate": 0.2, "max_leaf_nodes": 11, "min_samples_leaf": 5,
        "subsample": 0.5, "max_features": 0.5,
    },
}  # fmt: skip
"""With which features are chosen: which of them tell something shows with few trees."""


class Regressor(Protocol):
    """Anything that is fitted to features and a torque."""

    def fit(self, x: np.ndarray, y: np.ndarray) -> Regressor:
        """Fit to features `x` and torque `y`."""

    def predict(self, x: np.ndarray) -> np.ndarray:
        """Torque for features `x`."""


def make_ensemble(kind: str, settings: Mapping[str, Any]) -> Regressor:
    """An estimator made of trees, not yet fitted; its draws have a seed.

    Parameters
    ----------
    kind : str
        ``"tree"``, ``"bagging"`` or ``"boost"``.
    settings : Mapping
        scikit-learn's, as in `PUBLISHED` and `TUNED`.

    Returns
    -------
    Regressor
    """
    from sklearn.ensemble import GradientBoostingRegressor, RandomForestRegressor
    from sklearn.tree import DecisionTreeRegressor

    if kind == "tree":
        return DecisionTreeRegressor(random_state=SEED, **settings)
    if kind == "bagging":
        return RandomForestRegressor(random_state=SEED, **settings)
    # A limit on leaves is a limit on splits: depth must not be one as well.
    return GradientBoostingRegressor(random_state=SEED, max_depth=None, **settings)
