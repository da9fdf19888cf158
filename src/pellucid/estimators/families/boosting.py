"""Least-squares boosting of trees."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..features import Features, FeatureSet
from .family import SEED, Family, Regressor

PUBLISHED = {"n_estimators": 100, "learning_rate": 1.0, "max_leaf_nodes": 11, "min_samples_leaf": 5}
"""What MATLAB's ``fitrensemble`` is documented to do when nothing is asked (the thesis names no settings): LSBoost
splits a tree at most 10 times, leaves hold at least 5, and steps are not shrunk."""


def boosted(settings: Mapping[str, Any], seen: Features) -> Regressor:
    """Trees one after another; a limit on leaves is one on splits."""
    from ..tree_ensembles import BoostedTrees

    return BoostedTrees(random_state=SEED, **settings)


FAMILIES = {
    "boost": Family(
        "least-squares boosting",
        boosted,
        tuple(
            {
                "n_estimators": trees, "learning_rate": step, "max_leaf_nodes": leaves, "min_samples_leaf": 5,
                "subsample": 0.5, "max_features": share,
            }
            for trees, step, leaves, share in (
                (100, 0.1, 11, 1.0), (100, 0.1, 6, 0.5), (150, 0.1, 11, 0.5), (150, 0.1, 4, 0.5),
            )
        ),
        # Which features tell something shows with few trees.
        quick={
            "n_estimators": 50, "learning_rate": 0.2, "max_leaf_nodes": 11, "min_samples_leaf": 5,
            "subsample": 0.5, "max_features": 0.5,
        },
        aliases=("boosting",),
        rank=10,
    ),
    "boost_published": Family(
        "least-squares boosting, MATLAB's defaults", boosted, (PUBLISHED,), fixed=FeatureSet(), rank=80
    ),
}  # fmt: skip
