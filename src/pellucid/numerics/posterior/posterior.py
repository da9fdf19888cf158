r"""Posterior draws of a fit's parameters: credible intervals, pairs that trade off, and the sampler's convergence.

Posterior draws of a model linearised at its least-squares solution, reweighted where the model is not linear.

Posterior density of parameters, given coloured residuals and effects that the model neglects.

.. math::
   y = f(\beta) + \sum_k c_k\varphi_k + e, \qquad c_k \sim N(0, a_k s^2 + t_k), \qquad
   e \sim N(0, v), \qquad \nu\hat v / v \sim \chi^2_\nu

:math:`v` is the variance of a row, enlarged to allow for the residuals' autocorrelation. :math:`\hat v` is its estimate
from blocks of scores and :math:`\nu` the number of blocks (``numerics/uncertainty.py``). Every row counts for less, but
all frequencies keep the weights of least squares. Whitening by an autoregression would change these weights: it would
favour the frequencies that filters removed, where derivatives carry the most noise. The :math:`c_k` are integrated out:

.. math::
   \log p = -\frac{\nu + q}{2}\log v - \frac{\nu\hat v}{2v} - \frac{r^T r - R}{2v} + \frac{1}{2} u^T A^{-1} u
   - \frac{1}{2}\log|A|, \qquad A = I + D^{1/2}\Phi^T\Phi D^{1/2}/v, \quad u = D^{1/2}\Phi^T r/v

with r the residual of the parameters, R the smallest residual sum of squares over all parameters and c, q the number of
parameters and c together, and D the diagonal matrix of the variances of c. The posterior is close to least squares
where the data determine the parameters, and respects their bounds where the data do not.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from ...models.estimates import Estimates, Parameter
from ..uncertainty import (
    block_length,
    correlation_time,
    degrees_of_freedom,
    sandwich_covariance,
    student_to_normal_ratio,
)
from .ensemble import SEED, Draws, drawn

DISCREPANCY_SCALE_BOUNDS = (0.01, 1.0)
"""Range of s, the size of the neglected effects divided by the least-squares residual. The prior is uniform in log
s."""

PRIOR_LOG_VARIANCE_SPREAD = 3.0
"""Prior standard deviation of log v around the estimate from the blocks."""


@dataclass(frozen=True)
class Prior:
    """Prior of p parameters: normal around `centre` with standard deviation `spread`, cut at bounds; each (p,), SI."""

    lower: np.ndarray
    upper: np.ndarray
    centre: np.ndarray
    spread: np.ndarray

    def inside(self, values: np.ndarray) -> np.ndarray:
        """Return which places, shape (w, p), lie within the bounds, shape (w,)."""
        return np.all((values >= self.lower) & (values <= self.upper), axis=1)

    def log_density(self, values: np.ndarray) -> np.ndarray:
        """Return the log density at places within the bounds, shape (w,), up to a constant."""
        return -0.5 * np.sum(((values - self.centre) / self.spread) ** 2, axis=1)

    def interval(self, level: float) -> np.ndarray:
        """Return the prior's own interval at `level` with equal tails, shape (p, 2)."""
        from scipy.special import ndtr, ndtri

        low, high = (ndtr((end - self.centre) / self.spread) for end in (self.lower, self.upper))
        tails = [0.5 * (1.0 - level), 0.5 * (1.0 + level)]
        return np.column_stack([self.centre + self.spread * ndtri(low + t * (high - low)) for t in tails])


class Misfit(Protocol):
    """A function from parameters, shape (w, p), to r^T r (w,), Phi^T r (w, c) and Phi^T Phi, (c, c) or (w, c, c)."""

    def __call__(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]: ...


@dataclass(frozen=True)
class Noise:
    """Variance of a row, enlarged for autocorrelation, and the degrees of freedom of its estimate."""

    variance: float
    freedom: float

    @classmethod
    def of(cls, jacobian: np.ndarray, residual: np.ndarray, lengths: list[int]) -> Noise:
        """Estimate the noise at a least-squares solution.

        The variance is chosen so that ordinary standard errors equal those from blocks of scores, by the median over
        the parameters. `jacobian`, shape (m, p), and `residual`, (m,), are made of stretches of `lengths` rows.
        """
        memory = correlation_time(residual, lengths)
        freedom = degrees_of_freedom(block_length(memory, len(residual)), len(residual))
        error = np.diag(sandwich_covariance(jacobian, residual, lengths, memory=memory))
        scale = np.linalg.norm(jacobian, axis=0)
        textbook = np.diag(np.linalg.inv((jacobian / scale).T @ (jacobian / scale))) / scale**2
        # The degrees of freedom already widen the tails here, so the factor in the variance is taken out.
        return cls(float(np.median(error / textbook)) / student_to_normal_ratio(freedom) ** 2, freedom)


@dataclass(frozen=True)
class MarginalLikelihood:
    """Log density of the posterior, for all walkers at once.

    A place is (p parameters, log v, log s). It has no log s where no neglected effect is scaled by s.
    """

    misfit: Misfit
    prior: Prior
    noise: Noise
    least: float  # R
    columns: float  # q, or an effective number of columns
    shares: np.ndarray = field(default_factory=lambda: np.zeros(0))  # (c,) a_k, 0 or more
    known: np.ndarray = field(default_factory=lambda: np.zeros(0))  # (c,) t_k
    scale_prior: tuple[float, float] | None = None  # prior mean and standard deviation of log v; None: a weak prior

    @property
    def scaled(self) -> bool:
        """Whether s is among the sampled parameters."""
        return bool(np.any(self.shares > 0.0))

    def __call__(self, places: np.ndarray) -> np.ndarray:
        """Return the log density, shape (w,), at places of shape (w, d)."""
        p = len(self.prior.lower)
        log_v = places[:, p]
        good = self.prior.inside(places[:, :p]) & (
            np.abs(log_v - np.log(self.noise.variance)) < 10.0 * PRIOR_LOG_VARIANCE_SPREAD
        )
        if self.scaled:
            ends = np.log(DISCREPANCY_SCALE_BOUNDS)
            good &= (places[:, p + 1] >= ends[0]) & (places[:, p + 1] <= ends[1])
        found = np.full(len(places), -np.inf)
        if good.any():
            found[good] = self._inside(places[good])
        return found

    def _inside(self, places: np.ndarray) -> np.ndarray:
        p = len(self.prior.lower)
        values, log_v = places[:, :p], places[:, p]
        v = np.exp(log_v)
        square, moment, gram = self.misfit(values)
        mean, spread = (
            (np.log(self.noise.variance), PRIOR_LOG_VARIANCE_SPREAD) if self.scale_prior is None else self.scale_prior
        )
        found = self.prior.log_density(values) - 0.5 * ((log_v - mean) / spread) ** 2
        found -= 0.5 * (self.noise.freedom + self.columns) * log_v
        found -= 0.5 * (self.noise.freedom * self.noise.variance + square - self.least) / v
        if len(self.shares):
            s2 = np.exp(2.0 * places[:, p + 1]) if self.scaled else np.zeros(len(places))
            root = np.sqrt(s2[:, None] * self.shares + self.known)
            u = root * moment / v[:, None]
            a = root[:, :, None] * gram * root[:, None, :] / v[:, None, None] + np.eye(len(self.shares))
            lower = np.linalg.cholesky(a)
            half = np.linalg.solve(lower, u[:, :, None])[:, :, 0]
            found += 0.5 * np.sum(half**2, axis=1) - np.sum(np.log(np.diagonal(lower, axis1=1, axis2=2)), axis=1)
        return found

    def start(self, values: np.ndarray, covariance: np.ndarray):
        """Return a function that draws starting points around `values`, (p,), with `covariance`, (p, p), in bounds."""
        error = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        error = np.where(error > 0.0, error, self.prior.spread)
        correlation = covariance / np.outer(error, error)
        turned = np.linalg.eigh(0.5 * (correlation + correlation.T))
        root = turned[1] * np.sqrt(np.maximum(turned[0], 1e-6))

        def begin(rng: np.random.Generator, walkers: int) -> np.ndarray:
            at = values + error * (rng.standard_normal((walkers, len(values))) @ root.T)
            # Starting points beyond a bound are redrawn uniformly within it. Clipped to the bound they would all be
            # equal, and the ensemble moves along differences.
            low = np.maximum(self.prior.lower, values - 2.0 * error)
            high = np.minimum(self.prior.upper, values + 2.0 * error)
            evenly = low + (high - low) * rng.random(at.shape)
            at = np.where((at > self.prior.lower) & (at < self.prior.upper), at, evenly)
            log_v = np.log(self.noise.variance) + 0.3 * rng.standard_normal((walkers, 1))
            least, largest = np.log(DISCREPANCY_SCALE_BOUNDS)
            log_s = rng.uniform(least, largest, (walkers, 1))[:, : int(self.scaled)]
            return np.hstack([at, log_v, log_s])

        return begin


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
    """Summarise draws as a `Posterior` of the parameters `names` in `units`.

    The draws' parameters are `scale`, shape (p,), times the reported ones.
    """
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
