"""Linear and ridge regression in closed form, by singular values.

Features are made comparable (mean 0, variance 1) and the offset is not penalised:

    b(a) = V diag(s / (s² + a)) Uᵀ (y - mean y),   X standardised = U diag(s) Vᵀ
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy

import numpy as np
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.utils.validation import check_is_fitted, validate_data

from .._errors import IdentificationError
from .standardise import mean_and_scale

DEPENDENT = 1e-10
"""Singular values below this share of the largest are those of features that others already say."""


class Ridge(RegressorMixin, BaseEstimator):
    """Least squares with a penalty on the standardised coefficients, as a scikit-learn estimator."""

    def __init__(self, alpha: float = 1.0, products: tuple[int, ...] = ()):
        self.alpha = alpha
        self.products = products

    def fit(self, X: np.ndarray, y: np.ndarray) -> Ridge:
        """Find the coefficients of `X`, shape (n, k), for `y`, shape (n,)."""
        return self._solved(self._decomposed(X, y))

    def predict_each(self, X: np.ndarray, y: np.ndarray, alphas: Sequence[float], new: np.ndarray) -> list[np.ndarray]:
        """What estimators like this one with each of `alphas` say of `new`, shape (m, k), once fitted: nearly all the
        work is done once.
        """
        # Eigenvalues are as good where a penalty stands beside them.
        system = self._decomposed(X, y, squared=min(alphas) > 0.0)
        each = [copy(self).set_params(alpha=alpha)._solved(system) for alpha in alphas]
        seen = self._comparable(validate_data(self, new, dtype=np.float64, reset=False))
        return list(self.offset_ + (seen @ np.column_stack([one.coefficients_ for one in each])).T)

    def _decomposed(
        self, X: np.ndarray, y: np.ndarray, squared: bool = False
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Directions among the coefficients, (k, r), and for each the square of its singular value and what it gathers
        of the torque, both (r,); `squared`: from products of features, faster, to half as many digits.
        """
        X, y = validate_data(self, X, y, dtype=np.float64, y_numeric=True)
        x = self._expanded(X)
        self.mean_, self.scale_ = mean_and_scale(x)
        # The product with a constant is a copy of its other factor, and would grow where the constant is another.
        constant = np.isinf(self.scale_[: X.shape[1]])[list(self.products)]
        rows, columns = np.triu_indices(len(self.products))
        self.scale_[X.shape[1] :][constant[rows] | constant[columns]] = np.inf
        self.offset_ = float(np.mean(y))
        x, y = (x - self.mean_) / self.scale_, y - self.offset_
        if not squared:
            q, r = np.linalg.qr(x)
            u, s, vt = np.linalg.svd(r, full_matrices=False)  # as of x itself, and much smaller
            told = s > DEPENDENT * s[0]
            return vt[told].T, s[told] ** 2, s[told] * (u.T @ (q.T @ y))[told]
        if x.shape[0] < x.shape[1]:
            squares, u = np.linalg.eigh(x @ x.T)
            return x.T @ u, np.maximum(squares, 0.0), u.T @ y
        squares, v = np.linalg.eigh(x.T @ x)
        return v, np.maximum(squares, 0.0), v.T @ (x.T @ y)

    def _solved(self, system: tuple[np.ndarray, np.ndarray, np.ndarray]) -> Ridge:
        if not self.alpha >= 0.0:
            raise IdentificationError(f"ridge: found the penalty {self.alpha:g}, expected at least 0")
        directions, squares, gathered = system
        self.coefficients_ = directions @ (gathered / (squares + self.alpha))
        return self

    def predict(self, X: np.ndarray) -> np.ndarray:
        """Torque for features, shape (n,), from `X` of shape (n, k)."""
        check_is_fitted(self)
        X = validate_data(self, X, dtype=np.float64, reset=False)
        return self.offset_ + self._comparable(X) @ self.coefficients_

    def _comparable(self, X: np.ndarray) -> np.ndarray:
        """Features and products as they were made comparable when this was fitted."""
        return (self._expanded(X) - self.mean_) / self.scale_

    def plain(self, names: Sequence[str]) -> dict[str, float]:
        """The same map on features as they are: ``"offset"``, then the coefficient of each term, by `names`.

        A product is named by its two factors with ``" * "`` between.
        """
        chosen = [names[i] for i in self.products]
        terms = [*names, *(f"{chosen[i]} * {chosen[j]}" for i, j in zip(*np.triu_indices(len(chosen)), strict=True))]
        slopes = self.coefficients_ / self.scale_
        return {"offset": self.offset_ - float(slopes @ self.mean_), **dict(zip(terms, slopes.tolist(), strict=True))}

    def _expanded(self, x: np.ndarray) -> np.ndarray:
        if not len(self.products):
            return x
        chosen = x[:, list(self.products)]
        rows, columns = np.triu_indices(chosen.shape[1])
        return np.hstack([x, chosen[:, rows] * chosen[:, columns]])
