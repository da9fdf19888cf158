"""Bagged trees."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..features import Features, FeatureSet
from .family import SEED, Family, Regressor

MATLAB_DEFAULT_SETTINGS = {
    "n_estimators": 100,
    "min_samples_leaf": 5,
    "min_samples_split": 10,
    "max_features": 1.0 / 3.0,
}
"""Documented defaults of MATLAB's ``fitrensemble``, since the thesis names no settings.

It grows 100 trees with leaves of at least 5 samples, and draws a third of the predictors at each split.
"""


def make_bagged_trees(settings: Mapping[str, Any], seen: Features) -> Regressor:
    """Make an estimator that averages trees of samples drawn with replacement."""
    from ..tree_ensembles import BaggedTrees

    return BaggedTrees(random_state=SEED, **settings)


FAMILIES = {
    "bagging": Family(
        "bagged trees",
        make_bagged_trees,
        tuple(
            {"n_estimators": 100, "min_samples_leaf": leaf, "max_features": share}
            for leaf, share in ((5, 1.0 / 3.0), (2, 1.0), (10, 1.0))
        ),
        feature_choice_settings={"n_estimators": 25, "min_samples_leaf": 5, "max_features": 1.0 / 3.0},
        rank=20,
        colour="directional",
        weight_argument="row_weight",
    ),
    "bagging_published": Family(
        "bagged trees, MATLAB's defaults",
        make_bagged_trees,
        (MATLAB_DEFAULT_SETTINGS,),
        only_features=FeatureSet(),
        rank=81,
        colour="directional",
    ),
}
