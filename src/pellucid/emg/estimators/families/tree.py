"""One regression tree, from scikit-learn."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..features import Features, FeatureSet
from .family import SEED, Family, Regressor

MATLAB_DEFAULT_SETTINGS = {"min_samples_leaf": 1, "min_samples_split": 10}
"""Documented defaults of MATLAB's ``fitrtree``, since the thesis names no settings."""


def make_tree(settings: Mapping[str, Any], seen: Features) -> Regressor:
    """Make one regression tree."""
    from sklearn.tree import DecisionTreeRegressor

    return DecisionTreeRegressor(random_state=SEED, **settings)


FAMILIES = {
    "tree": Family(
        "one tree",
        make_tree,
        tuple({"min_samples_leaf": leaf} for leaf in (5, 10, 20, 40)),
        rank=30,
        colour="load",
        weight_argument="sample_weight",
    ),
    "tree_published": Family(
        "one tree, MATLAB's defaults",
        make_tree,
        (MATLAB_DEFAULT_SETTINGS,),
        only_features=FeatureSet(),
        rank=82,
        colour="load",
    ),
}
