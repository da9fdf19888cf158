"""Trees: one of them, bagged ones, and least-squares boosting."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from ..torque_trial import Features, FeatureSet
from .family import SEED, Family, Regressor

# Documented defaults of MATLAB's ``fitrtree`` and ``fitrensemble``, since the thesis names no settings.
ONE_TREE = {"min_samples_leaf": 1, "min_samples_split": 10}
# 100 trees with leaves of at least 5 samples; a third of the predictors is drawn at each split.
BAGGED_TREES = {"n_estimators": 100, "min_samples_leaf": 5, "min_samples_split": 10, "max_features": 1.0 / 3.0}
# LSBoost splits a tree at most 10 times, leaves hold at least 5 samples, and steps are not shrunk.
BOOSTED_TREES = {"n_estimators": 100, "learning_rate": 1.0, "max_leaf_nodes": 11, "min_samples_leaf": 5}


def make_tree(settings: Mapping[str, Any], seen: Features) -> Regressor:
    """Make one regression tree."""
    from ..tree_ensembles import OneTree

    return OneTree(random_state=SEED, **settings)


def make_bagged_trees(settings: Mapping[str, Any], seen: Features) -> Regressor:
    """Make an estimator that averages trees of samples drawn with replacement."""
    from ..tree_ensembles import BaggedTrees

    return BaggedTrees(random_state=SEED, **settings)


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
        aliases=("boosting",), rank=10, colour="fitted", scored_causally=True, weight_argument="row_weight",
    ),
    "bagging": Family(
        "bagged trees",
        make_bagged_trees,
        tuple(
            {"n_estimators": 100, "min_samples_leaf": leaf, "max_features": share}
            for leaf, share in ((5, 1.0 / 3.0), (2, 1.0), (10, 1.0))
        ),
        feature_choice_settings={"n_estimators": 25, "min_samples_leaf": 5, "max_features": 1.0 / 3.0},
        rank=20, colour="directional", weight_argument="row_weight",
    ),
    "tree": Family(
        "one tree", make_tree, tuple({"min_samples_leaf": leaf} for leaf in (5, 10, 20, 40)), rank=30, colour="load",
        weight_argument="row_weight",
    ),
    **{
        f"{name}_published": Family(
            f"{words}, MATLAB's defaults", make, (settings,), only_features=FeatureSet(), rank=rank, colour=colour
        )
        for rank, name, words, make, settings, colour in (
            (80, "boost", "least-squares boosting", make_boosted_trees, BOOSTED_TREES, "fitted"),
            (81, "bagging", "bagged trees", make_bagged_trees, BAGGED_TREES, "directional"),
            (82, "tree", "one tree", make_tree, ONE_TREE, "load"),
        )
    },
}  # fmt: skip

FAMILIES |= {
    "motion_boost": replace(
        FAMILIES["boost"], description="least-squares boosting without EMG", muscles=False, aliases=(), rank=44,
        short="boosting, angles alone", scored_causally=False,
    ),
    "motion_bagging": replace(
        FAMILIES["bagging"], description="bagged trees without EMG", muscles=False, rank=45,
        short="bagging, angles alone",
    ),
}  # fmt: skip
