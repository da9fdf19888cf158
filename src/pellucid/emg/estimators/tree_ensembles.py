"""One tree, bagged and boosted trees: scikit-learn's, grown in the core.

Fitted recordings are short, and dozens of ensembles are fitted to choose features and settings. scikit-learn sorts the
rows of every node anew; the core sorts them once for all trees of an ensemble. Random draws and results are equal to
scikit-learn's, which tests check.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..._core import SortedRows, drawn_rows, tree_answers
from .plain_regressor import PlainRegressor

MAX_SEED = np.iinfo(np.int32).max
"""Upper bound of the seeds that are drawn for each bagged tree and for the features at its splits."""


class _TreeRegressor(PlainRegressor):
    """Common base. Features are in single precision, in which trees compare them."""

    DTYPE = np.float32

    min_samples_leaf: int
    max_features: float | None = None

    def _tree_settings(self, X: np.ndarray, per_split: int = 2, leaves: int = 0) -> dict[str, int]:
        """Return the settings with which the core grows each tree."""
        return {
            "features": X.shape[1] if self.max_features is None else max(1, int(self.max_features * X.shape[1])),
            "leaves": leaves,
            "per_leaf": self.min_samples_leaf,
            "per_split": max(per_split, 2 * self.min_samples_leaf),
        }


@dataclass(eq=False)
class OneTree(_TreeRegressor):
    """A single tree of all rows and features."""

    min_samples_leaf: int = 1
    min_samples_split: int = 2
    random_state: int = 0

    def fit(self, X: np.ndarray, y: np.ndarray, row_weight: np.ndarray | None = None) -> OneTree:
        """Grow the tree of `X`, shape (n, k), for `y`, shape (n,), with `row_weight`, shape (n,)."""
        X, y = self._check_fitted_rows(X, y)
        seed = np.random.RandomState(self.random_state).randint(MAX_SEED)
        weight = np.ones(len(y)) if row_weight is None else row_weight
        self.tree_ = SortedRows(X).grown(y, weight, seed, **self._tree_settings(X, self.min_samples_split))
        return self

    def predict(self, X: np.ndarray) -> np.ndarray:
        """Torque for features, shape (n,), from `X` of shape (n, k)."""
        return tree_answers(self.tree_, self._check_new_rows(X))


@dataclass(eq=False)
class BaggedTrees(_TreeRegressor):
    """Average of trees of rows drawn with replacement: a random forest."""

    n_estimators: int = 100
    min_samples_leaf: int = 1
    min_samples_split: int = 2
    max_features: float = 1.0
    random_state: int = 0

    def fit(self, X: np.ndarray, y: np.ndarray, row_weight: np.ndarray | None = None) -> BaggedTrees:
        """Grow the trees of `X`, shape (n, k), for `y`, shape (n,), with `row_weight`, shape (n,)."""
        X, y = self._check_fitted_rows(X, y)
        seeds, draws, n = np.random.RandomState(self.random_state), np.random.RandomState(), len(y)
        rows, settings = SortedRows(X), self._tree_settings(X, self.min_samples_split)
        self.trees_ = []
        for _ in range(self.n_estimators):
            seed = seeds.randint(MAX_SEED)
            draws.seed(seed)
            times = np.bincount(draws.randint(0, n, n), minlength=n)
            times = times if row_weight is None else times * row_weight
            draws.seed(seed)
            self.trees_.append(rows.grown(y, times, draws.randint(MAX_SEED), **settings))
        return self

    def predict(self, X: np.ndarray) -> np.ndarray:
        """Torque for features, shape (n,), from `X` of shape (n, k)."""
        X = self._check_new_rows(X)
        total = np.zeros(len(X))
        for tree in self.trees_:
            total += tree_answers(tree, X)
        return total / len(self.trees_)


@dataclass(eq=False)
class BoostedTrees(_TreeRegressor):
    """Sum of trees, each fitted to the residual of those before it: least squares."""

    n_estimators: int = 100
    learning_rate: float = 0.1
    max_leaf_nodes: int = 11
    min_samples_leaf: int = 1
    subsample: float = 1.0
    max_features: float | None = None
    random_state: int = 0

    def fit(self, X: np.ndarray, y: np.ndarray, row_weight: np.ndarray | None = None) -> BoostedTrees:
        """Grow the trees of `X`, shape (n, k), for `y`, shape (n,), with `row_weight`, shape (n,)."""
        X, y = self._check_fitted_rows(X, y)
        draws, n = np.random.RandomState(self.random_state), len(y)
        rows, settings = SortedRows(X), self._tree_settings(X, leaves=self.max_leaf_nodes)
        inside = max(1, int(self.subsample * n))
        weight = np.ones(n) if row_weight is None else np.asarray(row_weight, float)
        self.offset_ = float(np.average(y[:, None], axis=0, weights=weight)[0])
        reached, self.trees_ = np.full(n, self.offset_), []
        for _ in range(self.n_estimators):
            times = drawn_rows(draws.uniform(size=n), inside) if self.subsample < 1.0 else np.ones(n)
            self.trees_.append(rows.grown(y - reached, times * weight, draws.randint(MAX_SEED), **settings))
            reached += self.learning_rate * tree_answers(self.trees_[-1], X)
        return self

    def predict(self, X: np.ndarray) -> np.ndarray:
        """Torque for features, shape (n,), from `X` of shape (n, k)."""
        X = self._check_new_rows(X)
        reached = np.full(len(X), self.offset_)
        for tree in self.trees_:
            reached += self.learning_rate * tree_answers(tree, X)
        return reached
