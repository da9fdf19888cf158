r"""Sample a density with ensembles of walkers, and test whether the sampler has converged.

Each walker moves along the difference of two others (differential evolution [1]_), so the scaling and correlation of
the parameters do not matter. Where gradients are known, walkers make Hamiltonian steps instead. Two ensembles start
independently. Three quantities measure convergence: the longest autocorrelation time of any parameter [2]_, the
effective number of independent draws, and the disagreement between the halves of both ensembles [3]_,

.. math::
   \hat R = \sqrt{1 + \frac{\operatorname{var}(\text{means of the four halves})}{\text{mean variance within a half}}}

.. [1] C. J. F. ter Braak, "A Markov chain Monte Carlo version of the genetic algorithm differential evolution", Stat.
   Comput. 16, 2006.
.. [2] J. Goodman, J. Weare, "Ensemble samplers with affine invariance", Comm. App. Math. Comp. Sci. 5, 2010.
.. [3] A. Gelman, D. B. Rubin, "Inference from iterative simulation using multiple sequences", Statist. Sci. 7, 1992.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..._errors import missing_package

SEED = 20261122


@dataclass(frozen=True)
class SamplerSettings:
    """Sizes of ensembles and rounds, and when a sampler has converged."""

    ensemble_count: int = 2  # Number of ensembles that start independently, so that their disagreement can be measured
    # Walkers of an ensemble for each parameter. One call moves all of them, so more walkers cost little.
    walkers_per_dimension: int = 8
    steps_per_round: int = 500  # Number of steps between two tests of convergence
    default_max_steps: int = 8000  # The sampler gives up after this many steps and reports that it has not converged
    burn_in_share: float = 0.25  # The first quarter of the steps is discarded as burn-in
    # The steps kept after burn-in must span at least this many autocorrelation times.
    min_autocorrelation_times: float = 20.0
    # Smallest effective sample size. With fewer draws the 2.5 % quantiles depend on the seed.
    min_independent_draws: int = 1000
    max_r_hat: float = 1.005  # Largest Gelman-Rubin statistic of a converged sampler
    min_weighted_share: float = 0.2  # Smallest effective share of draws after reweighting to another density
    walkers_per_ensemble: int = 4  # Number of walkers in each ensemble. They move independently of each other.
    hamiltonian_steps_per_round: int = 200  # Number of steps between two tests of convergence
    # The sampler gives up after this many steps and reports that it has not converged.
    hamiltonian_max_steps: int = 4000
    first_stride: float = 0.5  # Leapfrog stride before adaptation, in standard deviations of the density
    # A step makes a random number of leapfrog strides, up to this many, so that it never resonates with a period of the
    # density.
    max_strides_per_step: int = 6
    # Each step multiplies the stride by a random factor in this range, so that some steps are short enough where the
    # density is narrow.
    stride_jitter_bounds: tuple[float, float] = (0.5, 1.1)
    target_acceptance_share: float = 0.8  # The stride is adapted until this share of the steps is accepted


SAMPLER_SETTINGS = SamplerSettings()


@dataclass(frozen=True, eq=False)
class Draws:
    """Draws of all walkers, shape (n, d), with the evidence for their convergence."""

    values: np.ndarray
    steps: int  # number of steps of each walker
    memory: float  # longest autocorrelation time of any parameter, in steps
    independent: float  # effective sample size
    apart: float  # Gelman-Rubin statistic; 1 where the halves of the ensembles agree
    weighed: float = 1.0  # effective share of the draws after reweighting; 1 where they were not reweighted

    @property
    def unsettled(self) -> str:
        """The reasons why the draws must not be used; empty if the sampler converged."""
        limits, said = SAMPLER_SETTINGS, []
        if not self.apart < limits.max_r_hat:
            said.append(f"halves of the ensembles disagree (R-hat {self.apart:.3f}, expected below {limits.max_r_hat})")
        if not self.independent >= limits.min_independent_draws:
            said.append(f"{self.independent:.0f} independent draws, expected {limits.min_independent_draws}")
        if not self.steps * (1.0 - limits.burn_in_share) >= limits.min_autocorrelation_times * self.memory:
            said.append(
                f"{self.steps} steps with an autocorrelation time of {self.memory:.0f}, expected "
                f"{limits.min_autocorrelation_times:.0f} times as many steps after burn-in"
            )
        if not self.weighed >= limits.min_weighted_share:
            said.append(
                f"{100 * self.weighed:.0f} % of the draws count, expected {100 * limits.min_weighted_share:.0f} %"
            )
        return "; ".join(said)

    @property
    def sentence(self) -> str:
        """A sentence on the sampler's convergence, with its figures."""
        said = (
            f"{SAMPLER_SETTINGS.ensemble_count} ensembles, {self.independent:.0f} independent draws, autocorrelation "
            f"time {self.memory:.0f} of {self.steps} steps, R-hat {self.apart:.4f}"
        )
        counted = f"; {100.0 * self.weighed:.0f} % of the draws count where the model bends"
        return said if self.weighed == 1.0 else said + counted


def drawn(
    log_density: Callable[[np.ndarray], np.ndarray],
    start: Callable[[np.random.Generator, int], np.ndarray],
    *,
    seed: int = SEED,
    most: int = SAMPLER_SETTINGS.default_max_steps,
) -> Draws:
    """Sample a density until the sampler converges, or for `most` steps.

    `log_density` takes all walkers at once, from shape (w, d) to (w,). `start` returns w starting points of positive
    density, shape (w, d).
    """
    emcee = require_sampler()
    rng = np.random.default_rng(seed)
    d = start(rng, 1).shape[1]
    moves = [(emcee.moves.DEMove(), 0.9), (emcee.moves.DESnookerMove(), 0.1)]
    ensembles, states = [], []
    for number in range(SAMPLER_SETTINGS.ensemble_count):
        sampler = emcee.EnsembleSampler(
            SAMPLER_SETTINGS.walkers_per_dimension * d, d, log_density, moves=moves, vectorize=True
        )
        sampler.random_state = np.random.RandomState(seed + number).get_state()
        ensembles.append(sampler)
        states.append(start(rng, SAMPLER_SETTINGS.walkers_per_dimension * d))
    found = None
    while found is None or (found.unsettled and found.steps < most):
        for number, sampler in enumerate(ensembles):
            states[number] = sampler.run_mcmc(states[number], SAMPLER_SETTINGS.steps_per_round)
        found = settled([sampler.get_chain() for sampler in ensembles])
    return found


def settled(chains: list[np.ndarray]) -> Draws:
    """Return the draws of several chains, each of shape (steps, walkers, d), without burn-in, and their convergence."""
    time = require_sampler().autocorr.integrated_time
    steps = len(chains[0])
    kept = [chain[round(SAMPLER_SETTINGS.burn_in_share * steps) :] for chain in chains]
    together = np.concatenate(kept, axis=1)
    if any(np.any(np.ptp(chain, axis=0).max(axis=0) == 0.0) for chain in kept):  # no walker ever moved
        return Draws(together.reshape(-1, together.shape[2]), steps, np.inf, 0.0, np.inf)
    memory = float(np.max(time(together, tol=0, quiet=True)))
    # Walkers of one ensemble depend on each other, so their mean may have a longer memory than any single walker.
    means = np.stack([chain.mean(axis=1) for chain in kept], axis=1)
    spread = together.var(axis=(0, 1)) / np.mean(means.var(axis=0), axis=0)
    led = float(np.min(len(kept) * len(means) * spread / time(means, tol=0, quiet=True)))
    independent = min(led, together.shape[0] * together.shape[1] / memory)
    halves = [half for chain in kept for half in np.array_split(chain.reshape(-1, chain.shape[2]), 2)]
    within = np.mean([half.var(axis=0) for half in halves], axis=0)
    between = np.var([half.mean(axis=0) for half in halves], axis=0, ddof=1)
    apart = float(np.max(np.sqrt(1.0 + between / within)))
    values = together.reshape(-1, together.shape[2])
    return Draws(values, steps, memory, independent, apart)


def require_sampler():
    """Return the sampling package emcee, or raise a PellucidError that says what to install."""
    try:
        import emcee
    except ModuleNotFoundError:
        raise missing_package("posterior", "emcee", "posterior") from None
    return emcee


Density = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
"""A function from places, shape (w, d), to the logarithm of a density, (w,), and its gradient, (w, d)."""


def drawn_by_gradients(
    density: Density,
    mode: np.ndarray,
    covariance: np.ndarray,
    *,
    seed: int = SEED,
    most: int = SAMPLER_SETTINGS.hamiltonian_max_steps,
) -> Draws:
    """Sample a `density` until the sampler converges, or for `most` steps.

    Walkers start around its `mode`, shape (d,), with `covariance`, (d, d), its approximate covariance there.
    """
    require_sampler()  # the package that computes autocorrelation times
    rng = np.random.default_rng(seed)
    root = np.linalg.cholesky(covariance)
    x = (
        mode
        + rng.standard_normal((SAMPLER_SETTINGS.ensemble_count * SAMPLER_SETTINGS.walkers_per_ensemble, len(mode)))
        @ root.T
    )
    x, stride, seen = _run(density, rng, x, root, SAMPLER_SETTINGS.first_stride, adapt=True)
    # The density may be wider far from its mode, so the covariance of the first round is mixed in.
    root = np.linalg.cholesky(0.5 * covariance + 0.5 * np.cov(seen.reshape(-1, len(mode)).T))
    x, stride, _ = _run(density, rng, x, root, stride, adapt=True)
    taken, found = [], None
    while found is None or (found.unsettled and found.steps < most):
        x, stride, seen = _run(density, rng, x, root, stride)
        taken.append(seen)
        chain = np.concatenate(taken)
        found = settled(
            [
                chain[:, i * SAMPLER_SETTINGS.walkers_per_ensemble : (i + 1) * SAMPLER_SETTINGS.walkers_per_ensemble]
                for i in range(SAMPLER_SETTINGS.ensemble_count)
            ]
        )
    return found


def _run(
    density: Density, rng: np.random.Generator, x: np.ndarray, root: np.ndarray, stride: float, adapt: bool = False
) -> tuple[np.ndarray, float, np.ndarray]:
    """Run one round; return the walkers' places, (w, d), the stride, and all places, (steps, w, d)."""

    def pulled(at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        logs, slopes = density(at)
        good = np.isfinite(logs) & np.isfinite(slopes).all(axis=1)
        return np.where(good, logs, -np.inf), np.where(good[:, None], slopes @ root, 0.0)

    logs, pull = pulled(x)
    seen = np.empty((SAMPLER_SETTINGS.hamiltonian_steps_per_round, *x.shape))
    for i in range(SAMPLER_SETTINGS.hamiltonian_steps_per_round):
        momentum = rng.standard_normal(x.shape)
        energy = logs - 0.5 * np.sum(momentum**2, axis=1)
        at, high, steep, step = x, logs, pull, stride * rng.uniform(*SAMPLER_SETTINGS.stride_jitter_bounds)
        for _ in range(rng.integers(1, SAMPLER_SETTINGS.max_strides_per_step + 1)):
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
            stride *= np.exp(0.1 * (kept.mean() - SAMPLER_SETTINGS.target_acceptance_share))
    return x, stride, seen
