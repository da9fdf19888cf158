"""Posterior draws of a fit's parameters: credible intervals, pairs that trade off, and the sampler's convergence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ...models.estimates import Estimates
from ...models.parameter import Parameter
from .ensemble import Draws, drawn
from .marginal_likelihood import MarginalLikelihood, Prior

MAX_KEPT_DRAWS = 2000
"""A posterior keeps at most this many draws, evenly thinned."""

MIN_TRADE_OFF_CORRELATION = 0.9
"""Two parameters are reported as a pair that trades off when their correlation exceeds this."""

MAX_PRIOR_SHARE = 0.5
"""A credible interval wider than this share of the prior's interval says more about the prior than about the data."""

MIN_DISTANCE_FROM_ZERO = 0.1
"""A parameter differs from zero only if its 95 % interval ends at least this share of the median away from zero.

Draws of a parameter with a bound at zero never cross it, so the sign alone would not be a test.
"""


@dataclass(frozen=True)
class DrawnParameter(Parameter):
    """A parameter described by posterior `draws`, shape (n,).

    The value is their median, the standard error their standard deviation, and the interval lies between their
    quantiles. `prior_share` is the width of that interval divided by the width of the prior's.
    """

    draws: np.ndarray = field(default_factory=lambda: np.zeros(0), repr=False, compare=False)
    prior_share: float = 0.0

    def interval(self, level: float = 0.95) -> tuple[float, float]:
        """Return the credible interval at `level`, with equal tails, in the parameter's unit."""
        low, high = np.quantile(self.draws, [0.5 * (1.0 - level), 0.5 * (1.0 + level)])
        return float(low), float(high)

    @property
    def told_by_prior(self) -> bool:
        """Whether the interval is determined by the prior rather than by the data."""
        return self.prior_share > MAX_PRIOR_SHARE


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Posterior(Estimates):
    """Posterior of all parameters: a mapping from name to `DrawnParameter`.

    Attributes
    ----------
    parameters : tuple of DrawnParameter
        Parameters in the order of the covariance.
    settled : str
        A sentence on the convergence of the sampler.
    unsettled : str
        The reasons why the draws must not be used; empty if the sampler converged.
    """

    parameters: tuple[DrawnParameter, ...]
    settled: str = ""
    unsettled: str = ""

    @property
    def draws(self) -> np.ndarray:
        """The joint draws of all parameters, shape (n, p), SI."""
        return np.column_stack([p.draws for p in self.parameters])

    @property
    def pairs(self) -> tuple[tuple[str, str, float], ...]:
        """Pairs of parameters that trade off, as (name, name, correlation), the strongest correlation first."""
        names = [p.name for p in self.parameters]
        spread = np.sqrt(np.diag(self.covariance))
        correlation = self.covariance / np.maximum(np.outer(spread, spread), np.finfo(float).tiny)
        found = [
            (a, b, float(correlation[i, j]))
            for i, a in enumerate(names)
            for j, b in enumerate(names[:i])
            if abs(correlation[i, j]) > MIN_TRADE_OFF_CORRELATION
        ]
        return tuple(sorted(found, key=lambda pair: -abs(pair[2])))

    def _facts(self) -> tuple[str, ...]:
        return (self.settled, *(f"{a} and {b} trade off (correlation {r:+.2f})" for a, b, r in self.pairs))


def posterior_of(
    names: Sequence[str],
    units: Sequence[str],
    likelihood: MarginalLikelihood,
    values: np.ndarray,
    covariance: np.ndarray,
    *,
    scale: np.ndarray | None = None,
    level: float = 0.95,
    title: str = "",
    **sampling,
) -> Posterior:
    """Sample a `likelihood` and return the posterior of the parameters `names` in `units`.

    The likelihood's parameters are `scale`, shape (p,), times the reported ones. Walkers start around `values`, (p,),
    with `covariance`, (p, p), both in the likelihood's scale. `sampling` is passed on to `drawn`.
    """
    found = drawn(likelihood, likelihood.start(values, covariance), **sampling)
    return summary(names, units, found, likelihood.prior, scale=scale, level=level, title=title)


def summary(
    names: Sequence[str],
    units: Sequence[str],
    found: Draws,
    prior: Prior,
    *,
    scale: np.ndarray | None = None,
    level: float = 0.95,
    title: str = "",
) -> Posterior:
    """Summarise draws as a `Posterior`; the arguments are those of `posterior_of`."""
    p = len(names)
    scale = np.ones(p) if scale is None else scale
    # Thinning uses evenly spaced indices: a stride that divides the number of walkers would drop whole walkers.
    at = np.linspace(0, len(found.values) - 1, min(MAX_KEPT_DRAWS, len(found.values))).round().astype(int)
    draws = found.values[at, :p]
    wide = np.ptp(np.quantile(draws, [0.5 * (1.0 - level), 0.5 * (1.0 + level)], axis=0), axis=0)
    share = wide / np.ptp(prior.interval(level), axis=1)
    draws = draws / scale
    refused = f"the posterior has not settled: {found.unsettled}" if found.unsettled else ""
    parameters = tuple(
        DrawnParameter(
            name,
            unit,
            float(np.median(x)),
            float(np.std(x)),
            identifiable=_told_from_zero(x),
            refused=refused,
            draws=x,
            prior_share=float(s),
        )
        for name, unit, x, s in zip(names, units, draws.T, share, strict=True)
    )
    return Posterior(
        parameters=parameters,
        covariance=np.atleast_2d(np.cov(draws.T)),
        title=title,
        confidence=level,
        settled=found.sentence,
        unsettled=found.unsettled,
    )


def _told_from_zero(draws: np.ndarray) -> bool:
    """Return whether draws, shape (n,), exclude zero, or keep clear of it where a bound lies at zero."""
    low, middle, high = np.quantile(np.sign(np.median(draws)) * draws, [0.025, 0.5, 0.975])
    return bool(low > MIN_DISTANCE_FROM_ZERO * middle and high > 0.0)
