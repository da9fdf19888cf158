"""A small network trained by back-propagation: the reconstruction of M-BP.

Start, loss and search are those of scikit-learn's ``MLPRegressor``, which tests check.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .families.family import SEED
from .feature_scale import mean_and_scale
from .plain_regressor import PlainRegressor

HIDDEN_NEURON_COUNT = 10
"""Number of neurons in the hidden layer. The original paper does not state it. Chosen by judgement."""

MAX_TRAINING_STEPS = 200
"""Largest number of steps of the search. Early stopping is part of the method."""

MAX_GRADIENT = 1e-4
"""Gradient of the loss below which the search ends."""


@dataclass(eq=False)
class NeuralNetwork(PlainRegressor):
    """One hidden layer of tanh neurons on standardised features."""

    penalty: float = 1e-2

    def fit(self, X: np.ndarray, y: np.ndarray) -> NeuralNetwork:
        """Train on `X`, shape (n, k), and `y`, shape (n,)."""
        from scipy.optimize import minimize  # takes a third of a second to load

        X, y = self._check_fitted_rows(X, y)
        self.mean_, self.scale_ = mean_and_scale(X)
        self.offset_, self.deviation_ = float(np.mean(y)), float(np.std(y)) or 1.0
        x, target = (X - self.mean_) / self.scale_, ((y - self.offset_) / self.deviation_)[:, None]
        found = minimize(
            self._loss_and_gradient,
            _draw_start(x.shape[1]),
            args=(x, target),
            method="L-BFGS-B",
            jac=True,
            options={"maxiter": MAX_TRAINING_STEPS, "gtol": MAX_GRADIENT},
        )
        self.packed_ = found.x
        return self

    def predict(self, X: np.ndarray) -> np.ndarray:
        """Predict the torque for features `X` of shape (n, k), shape (n,)."""
        X = self._check_new_rows(X)
        weights, output_weights, offsets, output_offset = _unpack(self.packed_, X.shape[1])
        hidden = np.tanh((X - self.mean_) / self.scale_ @ weights + offsets)
        return self.offset_ + self.deviation_ * (hidden @ output_weights + output_offset).ravel()

    def _loss_and_gradient(self, packed: np.ndarray, x: np.ndarray, target: np.ndarray) -> tuple[float, np.ndarray]:
        """Return half the mean square error with the penalty, and its gradient, from weights in one array."""
        n = len(x)
        weights, output_weights, offsets, output_offset = _unpack(packed, x.shape[1])
        hidden = np.tanh(x @ weights + offsets)
        error = hidden @ output_weights
        error += output_offset
        error -= target
        first, last = weights.ravel(), output_weights.ravel()
        loss = 0.5 * (error**2).mean(axis=0).mean() + (0.5 * self.penalty) * (first @ first + last @ last) / n
        back = error @ output_weights.T
        back *= 1.0 - hidden**2
        gradient = np.empty_like(packed)
        parts = _unpack(gradient, x.shape[1])
        parts[0][:] = (x.T @ back + self.penalty * weights) / n
        parts[1][:] = (hidden.T @ error + self.penalty * output_weights) / n
        parts[2][:] = back.sum(axis=0) / n
        parts[3][:] = error.sum(axis=0) / n
        return float(loss), gradient


def _unpack(packed: np.ndarray, columns: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return views of the weights of the neurons and of the output, and of their offsets."""
    first = columns * HIDDEN_NEURON_COUNT
    second, third = first + HIDDEN_NEURON_COUNT, first + 2 * HIDDEN_NEURON_COUNT
    return (
        packed[:first].reshape(columns, HIDDEN_NEURON_COUNT),
        packed[first:second, None],
        packed[second:third],
        packed[third:],
    )


def _draw_start(columns: int) -> np.ndarray:
    """Return the weights and offsets from which training starts, drawn as Glorot and Bengio propose."""
    draws, hidden = np.random.RandomState(SEED), HIDDEN_NEURON_COUNT
    bound, output_bound = np.sqrt(6.0 / (columns + hidden)), np.sqrt(6.0 / (hidden + 1))
    weights = draws.uniform(-bound, bound, columns * hidden)
    offsets = draws.uniform(-bound, bound, hidden)
    output_weights = draws.uniform(-output_bound, output_bound, hidden)
    return np.concatenate([weights, output_weights, offsets, draws.uniform(-output_bound, output_bound, 1)])
