"""Bagged trees."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..features import Features, FeatureSet
from .family import SEED, Family, Regressor

PUBLISHED = {"n_estimators": 100, "min_samples_leaf": 5, "min_samples_split": 10, "max_features": 1.0 / 3.0}
"""What MATLAB's ``fitrensemble`` is documented to do when nothing is asked (the thesis names no settings): 100 trees,
leaves of at least 5, a third of the predictors drawn at each split."""


def bagged(settings: Mapping[str, Any], seen: Features) -> Regressor:
    """Trees of samples drawn with replacement, averaged."""
    from ..tree_ensembles import BaggedTrees

    return BaggedTrees(random_state=SEED, **settings)


FAMILIES = {
    "bagging": Family(
        "bagged trees",
        bagged,
        tuple(
            {"n_estimators": 100, "min_samples_leaf": leaf, "max_features": share}
            for leaf, share in ((5, 1.0 / 3.0), (2, 1.0), (10, 1.0))
        ),
        quick={"n_estimators": 25, "min_samples_leaf": 5, "max_features": 1.0 / 3.0},
        rank=20,
    ),
    "bagging_published": Family("bagged trees, MATLAB's defaults", bagged, (PUBLISHED,), fixed=FeatureSet(), rank=81),
}
