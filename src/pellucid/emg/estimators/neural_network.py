"""A small network trained by back-propagation, from scikit-learn: the reconstruction of M-BP."""

from __future__ import annotations

import warnings

import numpy as np
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.exceptions import ConvergenceWarning
from sklearn.neural_network import MLPRegressor
from sklearn.utils.validation import check_is_fitted, validate_data

from .families.family import SEED
from .standardise import mean_and_scale

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
