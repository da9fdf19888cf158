r"""The density of parameters behind coloured residuals and physics that their model lacks.

.. math::
   y = f(\beta) + \sum_k c_k\varphi_k + e, \qquad c_k \sim N(0, a_k s^2 + t_k), \qquad
   e \sim N(0, v), \qquad \nu\hat v / v \sim \chi^2_\nu

:math:`v` is a row's variance as large as its colour makes it count, :math:`\hat v` what blocks of scores say of it and
:math:`\nu` how many blocks there are (``fit/uncertainty.py``): rows count for less, and no frequency is weighed
otherwise than least squares does. Whitening by an autoregression would, and give most weight where filters left the
least and derivatives carry the most noise. The :math:`c_k` are integrated out:

.. math::
   \log p = -\frac{\nu + q}{2}\log v - \frac{\nu\hat v}{2v} - \frac{r^T r - R}{2v} + \frac{1}{2} u^T A^{-1} u
   - \frac{1}{2}\log|A|, \qquad A = I + D^{1/2}\Phi^T\Phi D^{1/2}/v, \quad u = D^{1/2}\Phi^T r/v

with r what parameters leave over, R the least that any parameters and c leave, q how many of both there are, and D the
variances of c. The posterior stays close to least squares where the data tell everything, and keeps to bounds where
they do not.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from ..uncertainty import block_length, correlation_time, freedom_of, sandwich, student_over_normal

SHARES = (0.01, 1.0)
"""Range of s, in units of what least squares leaves over: even in the logarithm."""

WEAK = 3.0
"""Standard deviation of log v about that of the blocks, before any data."""


@dataclass(frozen=True)
class Prior:
    """What is held of p parameters beforehand: normal about `centre` with `spread`, within bounds; each (p,), SI."""

    lower: np.ndarray
    upper: np.ndarray
    centre: np.ndarray
    spread: np.ndarray

    def inside(self, values: np.ndarray) -> np.ndarray:
        """Which of an ensemble, (w, p), lie within the bounds, (w,)."""
        return np.all((values >= self.lower) & (values <= self.upper), axis=1)

    def log_density(self, values: np.ndarray) -> np.ndarray:
        """Of an ensemble within the bounds, (w,), up to a constant."""
        return -0.5 * np.sum(((values - self.centre) / self.spread) ** 2, axis=1)

    def interval(self, level: float) -> np.ndarray:
        """What it alone would say, (p, 2)."""
        from scipy.special import ndtr, ndtri

        low, high = (ndtr((end - self.centre) / self.spread) for end in (self.lower, self.upper))
        tails = [0.5 * (1.0 - level), 0.5 * (1.0 + level)]
        return np.column_stack([self.centre + self.spread * ndtri(low + t * (high - low)) for t in tails])


class Misfit(Protocol):
    """What parameters leave over, of an ensemble at once, (w, p): r^T r (w,), Phi^T r (w, c), Phi^T Phi (c, c) or
    (w, c, c)."""

    def __call__(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]: ...


@dataclass(frozen=True)
class Noise:
    """Variance of a row as large as its colour makes it count, and the degrees of freedom with which it is known."""

    variance: float
    freedom: float

    @classmethod
    def of(cls, jacobian: np.ndarray, residual: np.ndarray, lengths: list[int]) -> Noise:
        """As much as makes the textbook's errors those of blocks of scores, by their median over parameters.
        `jacobian` (m, p) and `residual` (m,) at the least-squares solution, in stretches of `lengths`."""
        memory = correlation_time(residual, lengths)
        freedom = freedom_of(block_length(memory, len(residual)), len(residual))
        error = np.diag(sandwich(jacobian, residual, lengths, memory=memory))
        scale = np.linalg.norm(jacobian, axis=0)
        textbook = np.diag(np.linalg.inv((jacobian / scale).T @ (jacobian / scale))) / scale**2
        # Student's tails come with the freedom here, not with the variance.
        return cls(float(np.median(error / textbook)) / student_over_normal(freedom) ** 2, freedom)


@dataclass(frozen=True)
class MarginalLikelihood:
    """The posterior's logarithm, of an ensemble at once. A place is (p parameters, log v, log s), without the last
    where s has no part in anything."""

    misfit: Misfit
    prior: Prior
    noise: Noise
    least: float  # R
    columns: int  # q
    shares: np.ndarray = field(default_factory=lambda: np.zeros(0))  # (c,) a_k, 0 or more
    known: np.ndarray = field(default_factory=lambda: np.zeros(0))  # (c,) t_k
    scale_prior: tuple[float, float] | None = None  # Of log v: mean and standard deviation; weak if None

    @property
    def scaled(self) -> bool:
        """Whether s is drawn."""
        return bool(np.any(self.shares > 0.0))

    def __call__(self, places: np.ndarray) -> np.ndarray:
        """Logarithm of the density, (w,), at places (w, d)."""
        p = len(self.prior.lower)
        log_v = places[:, p]
        good = self.prior.inside(places[:, :p]) & (np.abs(log_v - np.log(self.noise.variance)) < 10.0 * WEAK)
        if self.scaled:
            ends = np.log(SHARES)
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
        mean, spread = (np.log(self.noise.variance), WEAK) if self.scale_prior is None else self.scale_prior
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
        """Where walkers begin: about `values`, (p,), with their `covariance`, (p, p), inside the bounds."""
        error = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        error = np.where(error > 0.0, error, self.prior.spread)
        correlation = covariance / np.outer(error, error)
        turned = np.linalg.eigh(0.5 * (correlation + correlation.T))
        root = turned[1] * np.sqrt(np.maximum(turned[0], 1e-6))

        def begin(rng: np.random.Generator, walkers: int) -> np.ndarray:
            at = values + error * (rng.standard_normal((walkers, len(values))) @ root.T)
            # What falls outside is put back evenly: all on a bound, walkers would have no differences to move along.
            low = np.maximum(self.prior.lower, values - 2.0 * error)
            high = np.minimum(self.prior.upper, values + 2.0 * error)
            evenly = low + (high - low) * rng.random(at.shape)
            at = np.where((at > self.prior.lower) & (at < self.prior.upper), at, evenly)
            log_v = np.log(self.noise.variance) + 0.3 * rng.standard_normal((walkers, 1))
            log_s = rng.uniform(*np.log(SHARES), (walkers, 1))[:, : int(self.scaled)]
            return np.hstack([at, log_v, log_s])

        return begin
