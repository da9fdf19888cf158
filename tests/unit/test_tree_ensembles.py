"""Ensembles of trees are scikit-learn's own: the same draws, the same trees, the same answers."""

from __future__ import annotations

import numpy as np
import pytest
from sklearn.base import clone
from sklearn.ensemble import GradientBoostingRegressor, RandomForestRegressor

from pellucid.estimators.families import ESTIMATORS
from pellucid.estimators.tree_ensembles import BaggedTrees, BoostedTrees


@pytest.mark.parametrize(
    ("ours", "theirs", "family"),
    [
        (BaggedTrees, RandomForestRegressor, "bagging"),
        (BaggedTrees, RandomForestRegressor, "bagging_published"),
        (BoostedTrees, GradientBoostingRegressor, "boost"),
        (BoostedTrees, GradientBoostingRegressor, "boost_published"),
    ],
)
def test_they_answer_as_scikit_learns(ours, theirs, family, rng):
    x, new = rng.standard_normal((160, 5)), rng.standard_normal((50, 5))
    x[:, 4] = np.round(x[:, 4])  # with ties
    y = x[:, 0] + np.sin(3.0 * x[:, 1]) + 0.1 * rng.standard_normal(160)
    depth = {"max_depth": None} if theirs is GradientBoostingRegressor else {}
    for settings in ESTIMATORS[family].settings:
        few = {**settings, "n_estimators": 15, "random_state": 7}
        expected = theirs(**few, **depth).fit(x, y).predict(new)
        made = clone(ours(**few)).fit(x, y)
        np.testing.assert_allclose(made.predict(new), expected, rtol=1e-12, atol=1e-12)
