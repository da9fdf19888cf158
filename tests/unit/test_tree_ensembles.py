"""Ensembles of trees are scikit-learn's own: the same draws, the same trees, the same answers."""

from __future__ import annotations

import numpy as np
import pytest
from sklearn.ensemble import GradientBoostingRegressor, RandomForestRegressor
from sklearn.tree import DecisionTreeRegressor

from pellucid._core import SortedRows, drawn_rows, tree_answers
from pellucid.emg.estimators.families import ESTIMATOR_FAMILIES
from pellucid.emg.estimators.tree_ensembles import BaggedTrees, BoostedTrees, OneTree


def recording(rng, n=160):
    x = rng.standard_normal((n, 6)).astype(np.float32)
    x[:, 5] = 2.0  # that never changes
    return x, x[:, 0] + np.sin(3.0 * x[:, 1]) + 0.1 * rng.standard_normal(n)


@pytest.mark.parametrize(
    ("ours", "theirs", "family"),
    [
        (OneTree, DecisionTreeRegressor, "tree"),
        (OneTree, DecisionTreeRegressor, "tree_published"),
        (BaggedTrees, RandomForestRegressor, "bagging"),
        (BaggedTrees, RandomForestRegressor, "bagging_published"),
        (BoostedTrees, GradientBoostingRegressor, "boost"),
        (BoostedTrees, GradientBoostingRegressor, "boost_published"),
    ],
)
def test_they_answer_as_scikit_learns(ours, theirs, family, rng):
    (x, y), new = recording(rng), rng.standard_normal((50, 6))
    depth = {"max_depth": None} if theirs is GradientBoostingRegressor else {}
    for settings in ESTIMATOR_FAMILIES[family].settings:
        few = {**settings, "random_state": 7} | ({} if ours is OneTree else {"n_estimators": 15})
        expected = theirs(**few, **depth).fit(x, y).predict(new)
        made = ours(**few).fit(x, y)
        np.testing.assert_allclose(made.predict(new), expected, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("leaves", [0, 9])
@pytest.mark.parametrize(("share", "per_leaf"), [(1.0, 1), (0.5, 3), (0.2, 2)])
def test_of_equal_values_they_part_the_same_rows(leaves, share, per_leaf, rng):
    # Which of two features that part the same rows is taken is rounding's: scikit-learn's sort leaves equal values in
    # no order. Rows that it saw get the same answers either way.
    for seed in range(8):
        x, y = recording(rng)
        x[:, 2:5] = np.round(3.0 * x[:, 2:5])
        times = rng.integers(0, 4, len(y)).astype(float)
        seen = times > 0.0
        theirs = DecisionTreeRegressor(
            max_leaf_nodes=leaves or None, min_samples_leaf=per_leaf, max_features=share, random_state=seed
        ).fit(x[seen], y[seen], sample_weight=times[seen])
        drawn = np.random.RandomState(seed).randint(np.iinfo(np.int32).max)
        kept = {"features": max(1, int(6 * share)), "leaves": leaves, "per_leaf": per_leaf, "per_split": 2 * per_leaf}
        made = SortedRows(x).grown(y, times, drawn, **kept)
        np.testing.assert_allclose(tree_answers(made, x[seen]), theirs.predict(x[seen]), rtol=1e-12, atol=1e-12)
        assert len(made) == theirs.tree_.node_count


def test_a_tree_of_one_row_answers_it():
    made = SortedRows([[1.0]]).grown([3.0], [2.0], 0, features=1, leaves=0, per_leaf=1, per_split=2)
    np.testing.assert_array_equal(made, [[-1.0, -1.0, -1.0, 3.0]])
    np.testing.assert_array_equal(tree_answers(made, [[0.0], [np.nan]]), 3.0)


def test_rows_are_drawn_as_often_as_asked(rng):
    shares = rng.uniform(size=(400, 30))
    drawn = np.array([drawn_rows(each, 12) for each in shares])
    assert np.all(drawn.sum(axis=1) == 12.0)
    # Each row as likely: within four standard errors.
    assert np.all(np.abs(drawn.mean(axis=0) - 0.4) < 4.0 * np.sqrt(0.4 * 0.6 / 400))


def test_misuse_is_refused():
    usual = {"features": 1, "leaves": 0, "per_leaf": 1, "per_split": 2}
    rows = SortedRows([[1.0], [2.0]])
    with pytest.raises(ValueError, match=r"x: got shape \(2,\), expected \(n, k\), both above 0"):
        SortedRows([1.0, 2.0])
    with pytest.raises(ValueError, match="x: expected finite numbers"):
        SortedRows([[np.nan]])
    with pytest.raises(ValueError, match=r"y: got shape \(1,\), expected \(2,\), as long as x"):
        rows.grown([1.0], [1.0, 1.0], 0, **usual)
    with pytest.raises(ValueError, match="times: found 0 for every row, expected a row that counts"):
        rows.grown([1.0, 2.0], [0.0, 0.0], 0, **usual)
    with pytest.raises(ValueError, match="features: expected a whole number from 1 to 1"):
        rows.grown([1.0, 2.0], [1.0, 1.0], 0, **{**usual, "features": 2})
    # A node that leads back would never end.
    with pytest.raises(ValueError, match="nodes: expected features of x, and children further on"):
        tree_answers([[0.0, 0.0, 0.0, 1.0]], [[1.0]])
    with pytest.raises(ValueError, match=r"nodes: got shape \(0, 4\), expected \(m, 4\), m above 0"):
        tree_answers(np.empty((0, 4)), [[1.0]])
    with pytest.raises(ValueError, match="inside: expected a whole number from 0 to 2"):
        drawn_rows([0.1, 0.2], 3)
