"""What is known of parameters, as draws: intervals of any shape, pairs that trade off, how well the draws settled."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ..estimates import Estimates
from ..parameter import Parameter
from .ensemble import Draws, drawn
from .marginal_likelihood import MarginalLikelihood, Prior

KEPT = 2000
"""Draws that are kept, evenly thinned."""

TRADE_OFF = 0.9
"""Correlation from which on two parameters are named as a pair."""

PRIOR_SHARE = 0.5
"""Of the prior's width: an interval as wide tells more of the prior than of the data."""


FROM_ZERO = 0.1
"""Of the median: where the interval's end towards 0 is closer, draws pile up there, as two standard errors would."""


@dataclass(frozen=True)
class DrawnParameter(Parameter):
    """A parameter known by `draws`, (n,): its value is their median, its standard error their spread, its interval
    between their quantiles. `prior_share`: how wide it is, over what was held beforehand."""

    draws: np.ndarray = field(default_factory=lambda: np.zeros(0), repr=False, compare=False)
    prior_share: float = 0.0

    def interval(self, level: float = 0.95) -> tuple[float, float]:
        """Credible interval at `level`, as likely missed on either side, in the parameter's unit."""
        low, high = np.quantile(self.draws, [0.5 * (1.0 - level), 0.5 * (1.0 + level)])
        return float(low), float(high)

    @property
    def told_by_prior(self) -> bool:
        """Whether the data add little to what was held beforehand."""
        return self.prior_share > PRIOR_SHARE


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Posterior(Estimates):
    """Parameters by name, each with its draws.

    Attributes
    ----------
    settled : str
        How well the draws have settled, in words.
    unsettled : str
        Why none of it should be read; empty where it may be.
    """

    settled: str = ""
    unsettled: str = ""

    @property
    def draws(self) -> np.ndarray:
        """Of all parameters together, shape (n, p), SI."""
        return np.column_stack([p.draws for p in self.parameters])

    @property
    def pairs(self) -> tuple[tuple[str, str, float], ...]:
        """Parameters that trade off, two and two, with their correlation, the closest first."""
        names = [p.name for p in self.parameters]
        spread = np.sqrt(np.diag(self.covariance))
        correlation = self.covariance / np.maximum(np.outer(spread, spread), np.finfo(float).tiny)
        found = [
            (a, b, float(correlation[i, j]))
            for i, a in enumerate(names)
            for j, b in enumerate(names[:i])
            if abs(correlation[i, j]) > TRADE_OFF
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
    """Draw from a `likelihood` whose parameters are `scale`, (p,), times those `names` in `units`, starting about
    `values`, (p,), with their `covariance`, (p, p), in the likelihood's own scale; `sampling` is what `drawn` takes."""
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
    """The parameters that were drawn; arguments as of `posterior_of`."""
    p = len(names)
    scale = np.ones(p) if scale is None else scale
    # A stride that divides the number of walkers would keep some of them and drop the others.
    at = np.linspace(0, len(found.values) - 1, min(KEPT, len(found.values))).round().astype(int)
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
    """Whether draws, (n,), leave 0 out; of what a bound keeps above 0, whether they leave the bound."""
    low, middle, high = np.quantile(np.sign(np.median(draws)) * draws, [0.025, 0.5, 0.975])
    return bool(low > FROM_ZERO * middle and high > 0.0)
