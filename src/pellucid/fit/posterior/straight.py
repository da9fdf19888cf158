"""Draws about a least-squares solution: a model taken as straight there, and draws weighed again where it bends."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from .ensemble import SEED, Draws, drawn
from .marginal_likelihood import MarginalLikelihood, Noise, Prior

CHECKED = 1000
"""Draws of a model that bends whose residual is computed as it is, and by which they are weighed."""


@dataclass(frozen=True, eq=False)
class Straight:
    """A model at its least-squares solution: parameters, (p,), their `jacobian`, (m, p), what is left over, (m,), and
    columns of what it lacks or does not know, (m, c), with the variances a_k and t_k of their coefficients."""

    values: np.ndarray
    jacobian: np.ndarray
    residual: np.ndarray
    columns: np.ndarray
    shares: np.ndarray
    known: np.ndarray

    def likelihood(self, prior: Prior, noise: Noise) -> MarginalLikelihood:
        """The posterior's density with a `prior` of the parameters and so much `noise`."""
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
        """Draws of a `likelihood`, beginning with the `covariance`, (p, p), of the solution; weighed by what a model
        that is `bent` leaves over at values, (p,) to (m,). `sampling` is what `drawn` takes."""
        found = drawn(likelihood, likelihood.start(self.values, covariance), **sampling)
        if bent is None or found.unsettled:
            return found
        rng = np.random.default_rng(SEED)
        some = found.values[rng.choice(len(found.values), CHECKED, replace=False)]
        left = np.array([bent(place[: len(self.values)]) for place in some])
        gram = self.columns.T @ self.columns
        exact = replace(likelihood, misfit=lambda _: (np.sum(left**2, axis=1), left @ self.columns, gram))
        logs = exact(some) - likelihood(some)
        weights = np.exp(logs - logs.max())
        share = float(weights.sum() ** 2 / np.sum(weights**2) / CHECKED)
        chosen = some[rng.choice(CHECKED, CHECKED, p=weights / weights.sum())]
        return replace(found, values=chosen, weighed=share)
