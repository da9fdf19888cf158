"""Bagged and boosted trees: scikit-learn's ensembles, their trees grown in the core.

Recordings to be fitted are short, and dozens of ensembles choose among features and settings. scikit-learn sorts the
rows of every node anew; the core sorts them once for all trees of an ensemble. Draws and results are scikit-learn's:
tests hold them against each other.
"""

from __future__ import annotations

import numpy as np
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.utils.validation import check_is_fitted, validate_data

from .._core import SortedRows, drawn_rows, tree_answers

SEEDS = np.iinfo(np.int32).max
"""Below which seeds are drawn: of each bagged tree, and of the features at its splits."""


class _Trees(RegressorMixin, BaseEstimator):
    """What both are fitted to and predict from, as single precision: trees compare in no other."""

    def _rows(self, X: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        X, y = validate_data(self, X, y, dtype=np.float32, y_numeric=True)
        return X, np.asarray(y, float)

    def _settings(self, X: np.ndarray, per_split: int = 2, leaves: int = 0) -> dict[str, int]:
        """What each tree is grown with."""
        return {
            "features": X.shape[1] if self.max_features is None else max(1, int(self.max_features * X.shape[1])),
            "leaves": leaves,
            "per_leaf": self.min_samples_leaf,
            "per_split": max(per_split, 2 * self.min_samples_leaf),
        }

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
        rows, settings = SortedRows(X), self._settings(X, self.min_samples_split)
        self.trees_ = []
        for _ in range(self.n_estimators):
            seed = seeds.randint(SEEDS)
            draws.seed(seed)
            times = np.bincount(draws.randint(0, n, n), minlength=n)
            draws.seed(seed)
            self.trees_.append(rows.grown(y, times, draws.randint(SEEDS), **settings))
        return self

    def predict(self, X: np.ndarray) -> np.ndarray:
        """Torque for features, shape (n,), from `X` of shape (n, k)."""
        X = self._seen(X)
        total = np.zeros(len(X))
        for tree in self.trees_:
            total += tree_answers(tree, X)
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
        rows, settings = SortedRows(X), self._settings(X, leaves=self.max_leaf_nodes)
        inside = max(1, int(self.subsample * n))
        self.offset_ = float(np.average(y[:, None], axis=0, weights=np.ones(n))[0])
        reached, self.trees_ = np.full(n, self.offset_), []
        for _ in range(self.n_estimators):
            times = drawn_rows(draws.uniform(size=n), inside) if self.subsample < 1.0 else np.ones(n)
            self.trees_.append(rows.grown(y - reached, times, draws.randint(SEEDS), **settings))
            reached += self.learning_rate * tree_answers(self.trees_[-1], X)
        return self

    def predict(self, X: np.ndarray) -> np.ndarray:
        """Torque for features, shape (n,), from `X` of shape (n, k)."""
        X = self._seen(X)
        reached = np.full(len(X), self.offset_)
        for tree in self.trees_:
            reached += self.learning_rate * tree_answers(tree, X)
        return reached
