"""Bagged and boosted trees: scikit-learn's trees, put together as its own ensembles do, in two thirds of their time.

Recordings to be fitted are short, and a tree of one takes a millisecond; what scikit-learn's ensembles do around each
(copies of an estimator, checks of numbers that were checked, losses that nobody reads) takes half as long again. Draws
and results are theirs: tests hold them against each other.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from sklearn import config_context
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.tree import DecisionTreeRegressor
from sklearn.utils.validation import check_is_fitted, validate_data

SEEDS = np.iinfo(np.int32).max
"""Below which the seed of each bagged tree is drawn."""


class _Trees(RegressorMixin, BaseEstimator):
    """What both are fitted to and predict from, as single precision: trees compare in no other."""

    def _rows(self, X: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        X, y = validate_data(self, X, y, dtype=np.float32, y_numeric=True)
        return X, np.asarray(y, float)

    def _seen(self, X: np.ndarray) -> np.ndarray:
        check_is_fitted(self)
        return validate_data(self, X, dtype=np.float32, order="C", reset=False)


class BaggedTrees(_Trees):
    """Trees of rows drawn with replacement, averaged: a random forest, as a scikit-learn estimator."""

    def __init__(
        self,
        n_estimators: int = 100,
        min_samples_leaf: int = 1,
        min_samples_split: int = 2,
        max_features: float = 1.0,
        random_state: int = 0,
    ):
        self.n_estimators = n_estimators
        self.min_samples_leaf = min_samples_leaf
        self.min_samples_split = min_samples_split
        self.max_features = max_features
        self.random_state = random_state

    def fit(self, X: np.ndarray, y: np.ndarray) -> BaggedTrees:
        """Grow the trees of `X`, shape (n, k), for `y`, shape (n,)."""
        X, y = self._rows(X, y)
        seeds, draws, n = np.random.RandomState(self.random_state), np.random.RandomState(), len(y)
        self.trees_ = []
        for _ in range(self.n_estimators):
            seed = seeds.randint(SEEDS)
            draws.seed(seed)
            times = np.bincount(draws.randint(0, n, n), minlength=n)
            draws.seed(seed)
            tree = DecisionTreeRegressor(
                min_samples_leaf=self.min_samples_leaf, min_samples_split=self.min_samples_split,
                max_features=self.max_features, random_state=draws,
            )  # fmt: skip
            self.trees_.append(_grown(tree, X, y, times))
        return self

    def predict(self, X: np.ndarray) -> np.ndarray:
        """Torque for features, shape (n,), from `X` of shape (n, k)."""
        X = self._seen(X)
        total = np.zeros(len(X))
        for tree in self.trees_:
            total += tree.predict(X)[:, 0]
        return total / len(self.trees_)


class BoostedTrees(_Trees):
    """Trees one after another, each of what those before it left over: least squares, as a scikit-learn estimator."""

    def __init__(
        self,
        n_estimators: int = 100,
        learning_rate: float = 0.1,
        max_leaf_nodes: int = 11,
        min_samples_leaf: int = 1,
        subsample: float = 1.0,
        max_features: float | None = None,
        random_state: int = 0,
    ):
        self.n_estimators = n_estimators
        self.learning_rate = learning_rate
        self.max_leaf_nodes = max_leaf_nodes
        self.min_samples_leaf = min_samples_leaf
        self.subsample = subsample
        self.max_features = max_features
        self.random_state = random_state

    def fit(self, X: np.ndarray, y: np.ndarray) -> BoostedTrees:
        """Grow the trees of `X`, shape (n, k), for `y`, shape (n,)."""
        X, y = self._rows(X, y)
        draws, n = np.random.RandomState(self.random_state), len(y)
        inside = max(1, int(self.subsample * n))
        self.offset_ = float(np.average(y[:, None], axis=0, weights=np.ones(n))[0])
        reached, self.trees_ = np.full(n, self.offset_), []
        for _ in range(self.n_estimators):
            drawn = _drawn(n, inside, draws) if self.subsample < 1.0 else slice(None)
            tree = DecisionTreeRegressor(
                max_leaf_nodes=self.max_leaf_nodes, min_samples_leaf=self.min_samples_leaf,
                max_features=self.max_features, random_state=draws,
            )  # fmt: skip
            left = y - reached
            self.trees_.append(_grown(tree, X[drawn], left[drawn]))
            reached += self.learning_rate * self.trees_[-1].predict(X)[:, 0]
        return self

    def predict(self, X: np.ndarray) -> np.ndarray:
        """Torque for features, shape (n,), from `X` of shape (n, k)."""
        X = self._seen(X)
        reached = np.full(len(X), self.offset_)
        for tree in self.trees_:
            reached += self.learning_rate * tree.predict(X)[:, 0]
        return reached


def _grown(tree: DecisionTreeRegressor, x: np.ndarray, y: np.ndarray, times: np.ndarray | None = None) -> Any:
    """What the estimator holds once fitted to rows that were checked, each counted so many `times`."""
    with config_context(assume_finite=True, skip_parameter_validation=True):
        return tree.fit(x, y, sample_weight=times, check_input=False).tree_


def _drawn(n: int, inside: int, draws: np.random.RandomState) -> np.ndarray:
    """`inside` of `n` rows, each as likely, in their order."""
    kept, rows = [], draws.uniform(size=n).tolist()
    for i, share in enumerate(rows):
        if share * (n - i) < inside - len(kept):
            kept.append(i)
    return np.array(kept)
