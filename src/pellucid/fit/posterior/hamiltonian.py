r"""Draws by gradients: for densities of many parameters, most of which a recording hardly tells.

A walker has a momentum p, drawn anew for every step, and runs along the density as a body would along its potential
[1]_,

.. math::
   \dot x = \Sigma p, \qquad \dot p = \nabla\log\pi(x), \qquad p \sim N(0, \Sigma^{-1}),

by leapfrog, with the density's covariance about its mode for :math:`\Sigma`. What leapfrog gains or loses of the energy
decides whether the walker stays where it came to. Ensembles of walkers that move along each other's differences
(``ensemble``) need several walkers for each parameter and hundreds of steps for a new draw: at sixty parameters this
takes a tenth of their time. The stride is set while steps are taken that are thrown away.

.. [1] R. M. Neal, "MCMC using Hamiltonian dynamics", Handbook of Markov Chain Monte Carlo, ch. 5, 2011.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .ensemble import ENSEMBLES, SEED, Draws, require_sampler, settled

WALKERS = 4
"""Of each ensemble; they do not know of each other."""

ROUND = 200
"""Steps between two looks at whether draws have settled."""

MOST_STEPS = 4000
STRIDE = 0.5
"""Of leapfrog at first, in standard deviations."""

LONGEST = 6
"""Strides of one step: as many are drawn, so that none of the density's own periods is met each time."""

JITTER = (0.5, 1.1)
"""By which each step's stride is multiplied: where the density is narrow some steps are short enough."""

ACCEPTED = 0.8
"""Share of steps that are to be taken, by which the stride is set."""

Density = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
"""Logarithm of a density, (w,), and its gradient, (w, d), at places (w, d)."""


def drawn_by_gradients(
    density: Density, mode: np.ndarray, covariance: np.ndarray, *, seed: int = SEED, most: int = MOST_STEPS
) -> Draws:
    """Draws from a `density` about its `mode`, (d,), where its `covariance` is nearly this, (d, d); `most` steps are
    taken."""
    require_sampler()  # its autocorrelation times judge
    rng = np.random.default_rng(seed)
    root = np.linalg.cholesky(covariance)
    x = mode + rng.standard_normal((ENSEMBLES * WALKERS, len(mode))) @ root.T
    x, stride, seen = _run(density, rng, x, root, STRIDE, adapt=True)
    # Far from the mode the density may be wider than it is there.
    root = np.linalg.cholesky(0.5 * covariance + 0.5 * np.cov(seen.reshape(-1, len(mode)).T))
    x, stride, _ = _run(density, rng, x, root, stride, adapt=True)
    taken, found = [], None
    while found is None or (found.unsettled and found.steps < most):
        x, stride, seen = _run(density, rng, x, root, stride)
        taken.append(seen)
        chain = np.concatenate(taken)
        found = settled([chain[:, i * WALKERS : (i + 1) * WALKERS] for i in range(ENSEMBLES)])
    return found


def _run(
    density: Density, rng: np.random.Generator, x: np.ndarray, root: np.ndarray, stride: float, adapt: bool = False
) -> tuple[np.ndarray, float, np.ndarray]:
    """Walkers after a round, (w, d), the stride, and where they were, (`ROUND`, w, d)."""

    def pulled(at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        logs, slopes = density(at)
        good = np.isfinite(logs) & np.isfinite(slopes).all(axis=1)
        return np.where(good, logs, -np.inf), np.where(good[:, None], slopes @ root, 0.0)

    logs, pull = pulled(x)
    seen = np.empty((ROUND, *x.shape))
    for i in range(ROUND):
        momentum = rng.standard_normal(x.shape)
        energy = logs - 0.5 * np.sum(momentum**2, axis=1)
        at, high, steep, step = x, logs, pull, stride * rng.uniform(*JITTER)
        for _ in range(rng.integers(1, LONGEST + 1)):
            momentum = momentum + 0.5 * step * steep
            at = at + step * momentum @ root.T
            high, steep = pulled(at)
            momentum = momentum + 0.5 * step * steep
        kept = np.exp(np.minimum(0.0, high - 0.5 * np.sum(momentum**2, axis=1) - energy))
        stays = rng.random(len(x)) < kept
        x, pull = np.where(stays[:, None], at, x), np.where(stays[:, None], steep, pull)
        logs = np.where(stays, high, logs)
        seen[i] = x
        if adapt:
            stride *= np.exp(0.1 * (kept.mean() - ACCEPTED))
    return x, stride, seen
