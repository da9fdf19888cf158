"""One regression tree, from scikit-learn."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..features import Features, FeatureSet
from .family import SEED, Family, Regressor

PUBLISHED = {"min_samples_leaf": 1, "min_samples_split": 10}
"""What MATLAB's ``fitrtree`` is documented to do when nothing is asked (the thesis names no settings)."""


def one_tree(settings: Mapping[str, Any], seen: Features) -> Regressor:
    """A tree."""
    from sklearn.tree import DecisionTreeRegressor

    return DecisionTreeRegressor(random_state=SEED, **settings)


FAMILIES = {
    "tree": Family("one tree", one_tree, tuple({"min_samples_leaf": leaf} for leaf in (5, 10, 20, 40)), rank=30),
    "tree_published": Family("one tree, MATLAB's defaults", one_tree, (PUBLISHED,), fixed=FeatureSet(), rank=82),
}
