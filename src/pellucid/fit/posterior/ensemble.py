r"""Draws from a density by ensembles of walkers, and whether they have settled.

Walkers move along differences of others (differential evolution [1]_), so that how parameters are scaled or correlated
does not matter; two ensembles start apart. Judged are, over all parameters, the longest autocorrelation time :math:`t`
[2]_, the number of independent draws that leaves, and how far halves of either ensemble differ [3]_,

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

from ..._errors import PellucidError

SEED = 20261122
ENSEMBLES = 2
WALKERS = 8
"""For each dimension: more are moved in one call at little cost."""

ROUND = 500
"""Steps between two looks at whether draws have settled."""

MOST_STEPS = 8000
BURNT = 0.25
"""Share of the steps that is thrown away, from the beginning."""

TIMES = 20.0
"""Autocorrelation times that what is kept of a walker must last."""

FEWEST = 1000
"""Independent draws: 2.5 % quantiles of fewer move from seed to seed."""

APART = 1.005
"""Of `apart`, the most."""


FEWEST_WEIGHED = 0.2
"""Share of draws that must count where they were weighed by another density than they came from."""


@dataclass(frozen=True, eq=False)
class Draws:
    """What an ensemble drew, (n, d), and how well it had settled."""

    values: np.ndarray
    steps: int  # Of each walker
    memory: float  # The longest autocorrelation time, in steps
    independent: float  # Draws that are worth something by themselves
    apart: float  # 1 where halves of the ensembles agree
    weighed: float = 1.0  # Share that counts, where they were weighed by another density

    @property
    def unsettled(self) -> str:
        """Why the draws should not be read, in words; empty where they may be."""
        said = []
        if not self.apart < APART:
            said.append(f"halves of the ensembles disagree (R-hat {self.apart:.3f}, expected below {APART})")
        if not self.independent >= FEWEST:
            said.append(f"{self.independent:.0f} independent draws, expected {FEWEST}")
        if not self.steps * (1.0 - BURNT) >= TIMES * self.memory:
            said.append(f"{self.steps} steps at a memory of {self.memory:.0f}, expected {TIMES:.0f} times as many")
        if not self.weighed >= FEWEST_WEIGHED:
            said.append(f"{100 * self.weighed:.0f} % of the draws count, expected {100 * FEWEST_WEIGHED:.0f} %")
        return "; ".join(said)

    @property
    def sentence(self) -> str:
        """How well they have settled."""
        said = (
            f"{ENSEMBLES} ensembles, {self.independent:.0f} independent draws, autocorrelation time {self.memory:.0f} "
            f"of {self.steps} steps, R-hat {self.apart:.4f}"
        )
        return (
            said
            if self.weighed == 1.0
            else f"{said}; {100.0 * self.weighed:.0f} % of the draws count where the model bends"
        )


def drawn(
    log_density: Callable[[np.ndarray], np.ndarray],
    start: Callable[[np.random.Generator, int], np.ndarray],
    *,
    seed: int = SEED,
    most: int = MOST_STEPS,
) -> Draws:
    """Draws from a density whose logarithm takes an ensemble at once, (w, d) to (w,); `start` gives so many places with
    some density, (w, d), and `most` steps are taken."""
    emcee = require_sampler()
    rng = np.random.default_rng(seed)
    d = start(rng, 1).shape[1]
    moves = [(emcee.moves.DEMove(), 0.9), (emcee.moves.DESnookerMove(), 0.1)]
    ensembles, states = [], []
    for number in range(ENSEMBLES):
        sampler = emcee.EnsembleSampler(WALKERS * d, d, log_density, moves=moves, vectorize=True)
        sampler.random_state = np.random.RandomState(seed + number).get_state()
        ensembles.append(sampler)
        states.append(start(rng, WALKERS * d))
    found = None
    while found is None or (found.unsettled and found.steps < most):
        for number, sampler in enumerate(ensembles):
            states[number] = sampler.run_mcmc(states[number], ROUND)
        found = settled([sampler.get_chain() for sampler in ensembles])
    return found


def settled(chains: list[np.ndarray]) -> Draws:
    """Draws of several ensembles, each (steps, walkers, d), without their beginnings, and how well they had settled."""
    time = require_sampler().autocorr.integrated_time
    steps = len(chains[0])
    kept = [chain[round(BURNT * steps) :] for chain in chains]
    together = np.concatenate(kept, axis=1)
    if any(np.any(np.ptp(chain, axis=0).max(axis=0) == 0.0) for chain in kept):  # no walker ever moved
        return Draws(together.reshape(-1, together.shape[2]), steps, np.inf, 0.0, np.inf)
    memory = float(np.max(time(together, tol=0, quiet=True)))
    # Walkers lead each other: an ensemble's mean may remember longer than any of them.
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
    """The package that draws; a PellucidError that says what to install where it is missing."""
    try:
        import emcee
    except ModuleNotFoundError:
        raise PellucidError(
            'posterior: found no package emcee, expected it: pip install "pellucid[posterior]"'
        ) from None
    return emcee
