"""A small network trained by back-propagation, from scikit-learn: the reconstruction of M-BP."""

from __future__ import annotations

import warnings

import numpy as np

from .ensembles import SEED

HIDDEN = 10
"""Neurons in its one hidden layer; the original does not say."""


class NeuralNetwork:
    """One hidden layer of tanh neurons on standardised features.

    Parameters
    ----------
    penalty : float
        On squared weights.
    """

    def __init__(self, penalty: float = 1e-2):
        self.penalty = penalty

    def fit(self, x: np.ndarray, y: np.ndarray) -> NeuralNetwork:
        """Train.

        Parameters
        ----------
        x : ndarray, shape (n, k)
        y : ndarray, shape (n,)

        Returns
        -------
        NeuralNetwork
        """
        from sklearn.exceptions import ConvergenceWarning
        from sklearn.neural_network import MLPRegressor

        self._centre, scale = x.mean(axis=0), x.std(axis=0)
        self._scale = np.where(scale > 0.0, scale, 1.0)
        self._mean, self._spread = float(np.mean(y)), float(np.std(y)) or 1.0
        self._network = MLPRegressor(
            hidden_layer_sizes=(HIDDEN,),
            activation="tanh",
            solver="lbfgs",
            alpha=self.penalty,
            max_iter=200,
            random_state=SEED,
        )
        with warnings.catch_warnings():
            # It ends after its iterations: early stopping is part of the method.
            warnings.simplefilter("ignore", ConvergenceWarning)
            self._network.fit((x - self._centre) / self._scale, (y - self._mean) / self._spread)
        return self

    def predict(self, x: np.ndarray) -> np.ndarray:
        """Torque for features.

        Parameters
        ----------
        x : ndarray, shape (n, k)

        Returns
        -------
        ndarray, shape (n,)
        """
        return self._mean + self._spread * self._network.predict((x - self._centre) / self._scale)
