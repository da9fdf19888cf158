"""Base of the regressors of torque: settings are the fields of a dataclass, and rows are checked once.

It does without scikit-learn's base class, which takes longer to load and to check rows than most fits take.
`TorqueRegressor` makes a scikit-learn estimator of each.
"""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np

from ..._errors import IdentificationError


class PlainRegressor:
    """Base of a dataclass whose fields are the settings."""

    DTYPE: type = np.float64
    """Precision of the features."""

    n_features_in_: int
    """Number of columns that it was fitted to."""

    def get_params(self) -> dict[str, Any]:
        """Return the settings by name."""
        return {each.name: getattr(self, each.name) for each in fields(self)}  # type: ignore[arg-type]

    def _check_fitted_rows(self, X: np.ndarray, y: np.ndarray, ndim: int = 1) -> tuple[np.ndarray, np.ndarray]:
        """Return checked features, shape (n, k), and torque, shape (n,) or with `ndim` 2 (n, m), for the fit."""
        X, y = self._check_rows(X), np.asarray(y, float)
        if y.ndim != ndim or len(y) != len(X) or not np.isfinite(y).all():
            raise IdentificationError(f"regression: found torques of shape {y.shape}, expected {len(X)} finite numbers")
        self.n_features_in_ = X.shape[1]
        return X, y

    def _check_new_rows(self, X: np.ndarray) -> np.ndarray:
        """Return checked features, shape (n, k), for a prediction."""
        X = self._check_rows(X)
        if X.shape[1] != self.n_features_in_:
            raise IdentificationError(f"regression: found {X.shape[1]} columns, expected {self.n_features_in_}")
        return X

    def _check_rows(self, X: np.ndarray) -> np.ndarray:
        X = np.ascontiguousarray(X, self.DTYPE)
        if X.ndim != 2 or not X.size or not np.isfinite(X).all():
            raise IdentificationError(f"regression: found features of shape {X.shape}, expected finite rows")
        return X
