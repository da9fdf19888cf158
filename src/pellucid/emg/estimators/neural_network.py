"""A small network trained by back-propagation, from scikit-learn: the reconstruction of M-BP.

Linear and ridge regression in closed form, by singular values.

Features are made comparable (mean 0, variance 1) and the offset is not penalised:

    b(a) = V diag(s / (s² + a)) Uᵀ (y - mean y),   X standardised = U diag(s) Vᵀ
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from copy import copy

import numpy as np
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.exceptions import ConvergenceWarning
from sklearn.neural_network import MLPRegressor
from sklearn.utils.validation import check_is_fitted, validate_data

from ..._errors import IdentificationError
from .families.family import SEED
from .torque_regressor import mean_and_scale

HIDDEN_NEURON_COUNT = 10
"""Number of neurons in the hidden layer. The original paper does not state it. Chosen by judgement."""


class NeuralNetwork(RegressorMixin, BaseEstimator):
    """One hidden layer of tanh neurons on standardised features, as a scikit-learn estimator."""

    def __init__(self, penalty: float = 1e-2):
        self.penalty = penalty

    def fit(self, X: np.ndarray, y: np.ndarray) -> NeuralNetwork:
        """Train on `X`, shape (n, k), and `y`, shape (n,)."""
        X, y = validate_data(self, X, y, dtype=np.float64, y_numeric=True, ensure_min_samples=2)
        self.mean_, self.scale_ = mean_and_scale(X)
        self.offset_, self.deviation_ = float(np.mean(y)), float(np.std(y)) or 1.0
        self.network_ = MLPRegressor(
            hidden_layer_sizes=(HIDDEN_NEURON_COUNT,),
            activation="tanh",
            solver="lbfgs",
            alpha=self.penalty,
            max_iter=200,
            random_state=SEED,
        )
        with warnings.catch_warnings():
            # Training ends after a fixed number of iterations: early stopping is part of the method.
            warnings.simplefilter("ignore", ConvergenceWarning)
            self.network_.fit((X - self.mean_) / self.scale_, (y - self.offset_) / self.deviation_)
        return self

    def predict(self, X: np.ndarray) -> np.ndarray:
        """Predict the torque for features `X` of shape (n, k), shape (n,)."""
        check_is_fitted(self)
        X = validate_data(self, X, dtype=np.float64, reset=False)
        return self.offset_ + self.deviation_ * self.network_.predict((X - self.mean_) / self.scale_)


SINGULAR_VALUE_TOLERANCE = 1e-10
"""Singular values below this share of the largest are dropped. They belong to features that depend on the others."""


class Ridge(RegressorMixin, BaseEstimator):
    """Least squares with a penalty on the standardised coefficients, as a scikit-learn estimator."""

    def __init__(self, alpha: float = 1.0, products: tuple[int, ...] = ()):
        self.alpha = alpha
        self.products = products

    def fit(self, X: np.ndarray, y: np.ndarray, row_weight: np.ndarray | None = None) -> Ridge:
        """Find the coefficients of `X`, shape (n, k), for `y`, shape (n,), with `row_weight`, shape (n,)."""
        return self._solve(self._decompose(X, y, weight=row_weight))

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
        each = [copy(self).set_params(alpha=alpha)._solve(system) for alpha in alphas]
        seen = self._standardise(validate_data(self, new, dtype=np.float64, reset=False))
        return list(self.offset_ + (seen @ np.column_stack([one.coefficients_ for one in each])).T)

    def _decompose(
        self, X: np.ndarray, y: np.ndarray, squared: bool = False, weight: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return directions of the coefficients, (k, r), their squared singular values and their projections, (r,).

        A projection is the direction's scalar product with the torque, times the singular value. `squared` computes
        them from products of features, which is faster and has half as many digits.
        """
        X, y = validate_data(self, X, y, dtype=np.float64, y_numeric=True)
        x = self._add_products(X)
        self.mean_, self.scale_ = mean_and_scale(x, weight)
        # The product with a constant is a copy of its other factor, and would grow where the constant is another.
        constant = np.isinf(self.scale_[: X.shape[1]])[list(self.products)]
        rows, columns = np.triu_indices(len(self.products))
        self.scale_[X.shape[1] :][constant[rows] | constant[columns]] = np.inf
        self.offset_ = float(np.mean(y) if weight is None else np.average(y, weights=weight))
        x, y = (x - self.mean_) / self.scale_, y - self.offset_
        if weight is not None:
            root = np.sqrt(np.asarray(weight, float))
            x, y = root[:, None] * x, root * y
        if not squared:
            q, r = np.linalg.qr(x)
            u, s, vt = np.linalg.svd(r, full_matrices=False)  # The singular values of r are those of x; r is smaller
            told = s > SINGULAR_VALUE_TOLERANCE * s[0]
            return vt[told].T, s[told] ** 2, s[told] * (u.T @ (q.T @ y))[told]
        if x.shape[0] < x.shape[1]:
            squares, u = np.linalg.eigh(x @ x.T)
            return x.T @ u, np.maximum(squares, 0.0), u.T @ y
        squares, v = np.linalg.eigh(x.T @ x)
        return v, np.maximum(squares, 0.0), v.T @ (x.T @ y)

    def _solve(self, system: tuple[np.ndarray, np.ndarray, np.ndarray]) -> Ridge:
        """Compute the coefficients of a decomposed system."""
        if not self.alpha >= 0.0:
            raise IdentificationError(f"ridge: found the penalty {self.alpha:g}, expected at least 0")
        directions, squares, gathered = system
        self.coefficients_ = directions @ (gathered / (squares + self.alpha))
        return self

    def predict(self, X: np.ndarray) -> np.ndarray:
        """Predict the torque for features `X` of shape (n, k), shape (n,)."""
        check_is_fitted(self)
        X = validate_data(self, X, dtype=np.float64, reset=False)
        return self.offset_ + self._standardise(X) @ self.coefficients_

    def _standardise(self, X: np.ndarray) -> np.ndarray:
        """Return features and products, standardised as in the fit."""
        return (self._add_products(X) - self.mean_) / self.scale_

    def unscaled_coefficients(self, names: Sequence[str]) -> dict[str, float]:
        """Return the coefficients for features that are not standardised: ``"offset"``, then each term by `names`.

        A product is named by its two factors with ``" * "`` between.
        """
        chosen = [names[i] for i in self.products]
        terms = [*names, *(f"{chosen[i]} * {chosen[j]}" for i, j in zip(*np.triu_indices(len(chosen)), strict=True))]
        slopes = self.coefficients_ / self.scale_
        return {"offset": self.offset_ - float(slopes @ self.mean_), **dict(zip(terms, slopes.tolist(), strict=True))}

    def _add_products(self, x: np.ndarray) -> np.ndarray:
        """Return features with their products, shape (n, terms)."""
        if not len(self.products):
            return x
        chosen = x[:, list(self.products)]
        rows, columns = np.triu_indices(chosen.shape[1])
        return np.hstack([x, chosen[:, rows] * chosen[:, columns]])
