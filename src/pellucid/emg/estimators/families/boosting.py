"""Least-squares boosting of trees."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..features import Features, FeatureSet
from .family import SEED, Family, Regressor

MATLAB_DEFAULT_SETTINGS = {"n_estimators": 100, "learning_rate": 1.0, "max_leaf_nodes": 11, "min_samples_leaf": 5}
"""Documented defaults of MATLAB's ``fitrensemble``, since the thesis names no settings.

LSBoost splits a tree at most 10 times, leaves hold at least 5 samples, and steps are not shrunk.
"""


def make_boosted_trees(settings: Mapping[str, Any], seen: Features) -> Regressor:
    """Make an estimator that adds trees one after another. A limit on leaves limits the splits."""
    from ..tree_ensembles import BoostedTrees

    return BoostedTrees(random_state=SEED, **settings)


FAMILIES = {
    "boost": Family(
        "least-squares boosting",
        make_boosted_trees,
        tuple(
            {
                "n_estimators": trees, "learning_rate": step, "max_leaf_nodes": leaves, "min_samples_leaf": 5,
                "subsample": 0.5, "max_features": share,
            }
            for trees, step, leaves, share in (
                (100, 0.1, 11, 1.0), (100, 0.1, 6, 0.5), (150, 0.1, 11, 0.5), (150, 0.1, 4, 0.5),
            )
        ),
        # Few trees suffice to show which features are informative.
        feature_choice_settings={
            "n_estimators": 50, "learning_rate": 0.2, "max_leaf_nodes": 11, "min_samples_leaf": 5,
            "subsample": 0.5, "max_features": 0.5,
        },
        aliases=("boosting",),
        rank=10,
        colour="fitted",
        scored_causally=True,
        weight_argument="row_weight",
    ),
    "boost_published": Family(
        "least-squares boosting, MATLAB's defaults", make_boosted_trees, (MATLAB_DEFAULT_SETTINGS,),
        only_features=FeatureSet(), rank=80, colour="fitted",
    ),
}  # fmt: skip
