r"""Hamiltonian Monte Carlo: sample a density of many parameters along its gradient.

A walker at x has a momentum p that is drawn anew for every step. It moves through the density as a body moves through a
potential [1]_,

.. math::
   \dot x = \Sigma p, \qquad \dot p = \nabla\log\pi(x), \qquad p \sim N(0, \Sigma^{-1}),

integrated by leapfrog, with the density's covariance around its mode as :math:`\Sigma`. The energy error of leapfrog
decides whether the new place is accepted. The ensemble sampler (``ensemble``) needs several walkers for each parameter
and hundreds of steps for an independent draw; at sixty parameters this method takes a tenth of its time. The stride is
adapted during burn-in only.

.. [1] R. M. Neal, "MCMC using Hamiltonian dynamics", Handbook of Markov Chain Monte Carlo, ch. 5, 2011.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .ensemble import ENSEMBLE_COUNT, SEED, Draws, require_sampler, settled

WALKERS_PER_ENSEMBLE = 4
"""Number of walkers in each ensemble. They move independently of each other."""

STEPS_PER_ROUND = 200
"""Number of steps between two tests of convergence."""

DEFAULT_MAX_STEPS = 4000
"""The sampler gives up after this many steps and reports that it has not converged."""

FIRST_STRIDE = 0.5
"""Leapfrog stride before adaptation, in standard deviations of the density."""

MAX_STRIDES_PER_STEP = 6
"""A step makes a random number of leapfrog strides, up to this many, so that it never resonates with a period of the
density."""

STRIDE_JITTER_BOUNDS = (0.5, 1.1)
"""Each step multiplies the stride by a random factor in this range, so that some steps are short enough where the
density is narrow."""

TARGET_ACCEPTANCE_SHARE = 0.8
"""The stride is adapted until this share of the steps is accepted."""

Density = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
"""A function from places, shape (w, d), to the logarithm of a density, (w,), and its gradient, (w, d)."""


def drawn_by_gradients(
    density: Density, mode: np.ndarray, covariance: np.ndarray, *, seed: int = SEED, most: int = DEFAULT_MAX_STEPS
) -> Draws:
    """Sample a `density` until the sampler converges, or for `most` steps.

    Walkers start around its `mode`, shape (d,), with `covariance`, (d, d), its approximate covariance there.
    """
    require_sampler()  # the package that computes autocorrelation times
    rng = np.random.default_rng(seed)
    root = np.linalg.cholesky(covariance)
    x = mode + rng.standard_normal((ENSEMBLE_COUNT * WALKERS_PER_ENSEMBLE, len(mode))) @ root.T
    x, stride, seen = _run(density, rng, x, root, FIRST_STRIDE, adapt=True)
    # The density may be wider far from its mode, so the covariance of the first round is mixed in.
    root = np.linalg.cholesky(0.5 * covariance + 0.5 * np.cov(seen.reshape(-1, len(mode)).T))
    x, stride, _ = _run(density, rng, x, root, stride, adapt=True)
    taken, found = [], None
    while found is None or (found.unsettled and found.steps < most):
        x, stride, seen = _run(density, rng, x, root, stride)
        taken.append(seen)
        chain = np.concatenate(taken)
        found = settled(
            [chain[:, i * WALKERS_PER_ENSEMBLE : (i + 1) * WALKERS_PER_ENSEMBLE] for i in range(ENSEMBLE_COUNT)]
        )
    return found


def _run(
    density: Density, rng: np.random.Generator, x: np.ndarray, root: np.ndarray, stride: float, adapt: bool = False
) -> tuple[np.ndarray, float, np.ndarray]:
    """Run one round; return the walkers' places, (w, d), the stride, and all places, (`STEPS_PER_ROUND`, w, d)."""

    def pulled(at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        logs, slopes = density(at)
        good = np.isfinite(logs) & np.isfinite(slopes).all(axis=1)
        return np.where(good, logs, -np.inf), np.where(good[:, None], slopes @ root, 0.0)

    logs, pull = pulled(x)
    seen = np.empty((STEPS_PER_ROUND, *x.shape))
    for i in range(STEPS_PER_ROUND):
        momentum = rng.standard_normal(x.shape)
        energy = logs - 0.5 * np.sum(momentum**2, axis=1)
        at, high, steep, step = x, logs, pull, stride * rng.uniform(*STRIDE_JITTER_BOUNDS)
        for _ in range(rng.integers(1, MAX_STRIDES_PER_STEP + 1)):
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
            stride *= np.exp(0.1 * (kept.mean() - TARGET_ACCEPTANCE_SHARE))
    return x, stride, seen
