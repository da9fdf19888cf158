"""Posterior draws of a model linearised at its least-squares solution, reweighted where the model is not linear."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from .ensemble import SEED, Draws, drawn
from .marginal_likelihood import MarginalLikelihood, Noise, Prior

CHECKED_DRAW_COUNT = 1000
"""Number of draws of a nonlinear model whose exact residual is computed to reweight them by importance sampling."""


@dataclass(frozen=True, eq=False)
class LinearisedModel:
    """A model linearised at its least-squares solution.

    It holds the parameters, shape (p,), their Jacobian (m, p) and the residual (m,). `columns`, (m, c), are the effects
    that the model neglects. Their coefficients have the variances a_k s^2 + t_k, where `shares` is a_k and `known` is
    t_k.
    """

    values: np.ndarray
    jacobian: np.ndarray
    residual: np.ndarray
    columns: np.ndarray
    shares: np.ndarray
    known: np.ndarray

    def likelihood(self, prior: Prior, noise: Noise) -> MarginalLikelihood:
        """Return the posterior density for a `prior` on the parameters and a level of `noise`."""
        x, y, p = np.hstack([self.jacobian, self.columns]), self.residual, len(self.values)
        gram, along, square = x.T @ x, x.T @ y, float(y @ y)
        left = y - x @ np.linalg.lstsq(x, y, rcond=None)[0]

        def misfit(values: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
            step = values - self.values
            over = square - 2.0 * step @ along[:p] + np.einsum("wi,ij,wj->w", step, gram[:p, :p], step)
            return over, along[p:] - step @ gram[:p, p:], gram[p:, p:]

        return MarginalLikelihood(misfit, prior, noise, float(left @ left), x.shape[1], self.shares, self.known)

    def draws(
        self,
        likelihood: MarginalLikelihood,
        covariance: np.ndarray,
        bent: Callable[[np.ndarray], np.ndarray] | None = None,
        **sampling,
    ) -> Draws:
        """Sample a `likelihood`, starting from the solution with its `covariance`, shape (p, p).

        `bent` is the exact residual of a nonlinear model, a function from (p,) to (m,). Where it is given, the draws
        are reweighted by it. `sampling` is passed on to `drawn`.
        """
        found = drawn(likelihood, likelihood.start(self.values, covariance), **sampling)
        if bent is None or found.unsettled:
            return found
        rng = np.random.default_rng(SEED)
        some = found.values[rng.choice(len(found.values), CHECKED_DRAW_COUNT, replace=False)]
        left = np.array([bent(place[: len(self.values)]) for place in some])
        gram = self.columns.T @ self.columns
        exact = replace(likelihood, misfit=lambda _: (np.sum(left**2, axis=1), left @ self.columns, gram))
        logs = exact(some) - likelihood(some)
        weights = np.exp(logs - logs.max())
        share = float(weights.sum() ** 2 / np.sum(weights**2) / CHECKED_DRAW_COUNT)
        chosen = some[rng.choice(CHECKED_DRAW_COUNT, CHECKED_DRAW_COUNT, p=weights / weights.sum())]
        return replace(found, values=chosen, weighed=share)
