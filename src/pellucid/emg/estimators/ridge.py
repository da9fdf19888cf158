"""Linear and ridge regression in closed form, by singular values.

Features are made comparable (mean 0, variance 1) and the offset is not penalised:

    b(a) = V diag(s / (s² + a)) Uᵀ (y - mean y),   X standardised = U diag(s) Vᵀ
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from ..._errors import IdentificationError
from .feature_scale import mean_and_scale
from .plain_regressor import PlainRegressor

SINGULAR_VALUE_TOLERANCE = 1e-10
"""Singular values below this share of the largest are dropped. They belong to features that depend on the others."""


@dataclass(eq=False)
class Ridge(PlainRegressor):
    """Least squares with a penalty on the standardised coefficients."""

    alpha: float = 1.0
    products: tuple[int, ...] = ()

    def fit(self, X: np.ndarray, y: np.ndarray, row_weight: np.ndarray | None = None) -> Ridge:
        """Find the coefficients of `X`, shape (n, k), for `y`, shape (n,), with `row_weight`, shape (n,)."""
        self.coefficients_ = _solve(self._decompose(X, y, weight=row_weight), self.alpha)
        return self

    def fit_each(self, X: np.ndarray, columns: np.ndarray) -> list[Ridge]:
        """Return a fit of each of `columns`, shape (n, m), to the same features; most of the work is shared."""
        system = self._decompose(X, columns, squared=self.alpha > 0.0)
        made = []
        for offset, coefficients in zip(self.offset_, _solve(system, self.alpha).T, strict=True):
            made.append(copy(self))
            made[-1].offset_, made[-1].coefficients_ = float(offset), coefficients
        return made

    def predict_each(
        self,
        X: np.ndarray,
        y: np.ndarray,
        alphas: Sequence[float],
        new: np.ndarray,
        row_weight: np.ndarray | None = None,
    ) -> list[np.ndarray]:
        """Fit with each of `alphas` and return the predictions for `new`, shape (m, k); most of the work is shared."""
        # With a penalty, the less accurate eigenvalues of products suffice.
        system = self._decompose(X, y, squared=min(alphas) > 0.0, weight=row_weight)
        coefficients = np.column_stack([_solve(system, alpha) for alpha in alphas])
        seen = self._standardise(self._check_new_rows(new))
        return list(self.offset_ + (seen @ coefficients).T)

    def _decompose(
        self, X: np.ndarray, y: np.ndarray, squared: bool = False, weight: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return directions of the coefficients, (k, r), their squared singular values and their projections, (r,).

        A projection is the direction's scalar product with the torque, times the singular value; (r, m) for `y` of
        shape (n, m). `squared` computes them from products of features, which is faster and has half as many digits.
        """
        X, y = self._check_fitted_rows(X, y, np.ndim(y) or 1)
        x = self._add_products(X)
        self.mean_, self.scale_ = mean_and_scale(x, weight)
        # The product with a constant is a copy of its other factor, and would grow where the constant is another.
        constant = np.isinf(self.scale_[: X.shape[1]])[list(self.products)]
        rows, columns = _pairs(len(self.products))
        self.scale_[X.shape[1] :][constant[rows] | constant[columns]] = np.inf
        offset = np.average(y, axis=0, weights=weight)
        self.offset_: Any = float(offset) if y.ndim == 1 else offset
        x, y = (x - self.mean_) / self.scale_, y - offset
        if weight is not None:
            root = np.sqrt(np.asarray(weight, float))
            x, y = root[:, None] * x, root * y
        if not squared:
            q, r = np.linalg.qr(x)
            u, s, vt = np.linalg.svd(r, full_matrices=False)  # The singular values of r are those of x; r is smaller
            told = s > SINGULAR_VALUE_TOLERANCE * s[0]
            return vt[told].T, s[told] ** 2, (s[told] * (u.T @ (q.T @ y))[told].T).T
        if x.shape[0] < x.shape[1]:
            squares, u = np.linalg.eigh(x @ x.T)
            return x.T @ u, np.maximum(squares, 0.0), u.T @ y
        squares, v = np.linalg.eigh(x.T @ x)
        return v, np.maximum(squares, 0.0), v.T @ (x.T @ y)

    def predict(self, X: np.ndarray) -> np.ndarray:
        """Predict the torque for features `X` of shape (n, k), shape (n,)."""
        return self.offset_ + self._standardise(self._check_new_rows(X)) @ self.coefficients_

    def _standardise(self, X: np.ndarray) -> np.ndarray:
        """Return features and products, standardised as in the fit."""
        return (self._add_products(X) - self.mean_) / self.scale_

    def unscaled_coefficients(self, names: Sequence[str]) -> dict[str, float]:
        """Return the coefficients for features that are not standardised: ``"offset"``, then each term by `names`.

        A product is named by its two factors with ``" * "`` between.
        """
        chosen = [names[i] for i in self.products]
        terms = [*names, *(f"{chosen[i]} * {chosen[j]}" for i, j in zip(*_pairs(len(chosen)), strict=True))]
        slopes = self.coefficients_ / self.scale_
        return {"offset": self.offset_ - float(slopes @ self.mean_), **dict(zip(terms, slopes.tolist(), strict=True))}

    def _add_products(self, x: np.ndarray) -> np.ndarray:
        """Return features with their products, shape (n, terms)."""
        if not len(self.products):
            return x
        chosen = x[:, list(self.products)]
        rows, columns = _pairs(chosen.shape[1])
        return np.hstack([x, chosen[:, rows] * chosen[:, columns]])


@lru_cache(maxsize=64)
def _pairs(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return rows and columns of the products of so many features, their squares among them."""
    return np.triu_indices(count)


def _solve(system: tuple[np.ndarray, np.ndarray, np.ndarray], alpha: float) -> np.ndarray:
    """Return the coefficients of a decomposed system with the penalty `alpha`, shape (k,) or (k, m)."""
    if not alpha >= 0.0:
        raise IdentificationError(f"ridge: found the penalty {alpha:g}, expected at least 0")
    directions, squares, gathered = system
    return directions @ (gathered.T / (squares + alpha)).T
