r"""Posterior of calibrated muscles: the anatomical prior combined with one person's recordings.

The parameters z are standard deviations from anatomy, within bounds and coupled by `coupled_priors`. The rows are those
of the calibration: each joint's error divided by the standard deviation of its reference. Their variance is enlarged
for autocorrelation by :math:`\hat v = \operatorname{median}_i S_{ii}/(J^T J)_{ii}`, with S the scores' covariance. A
calibration chooses the weight of anatomy by cross-validation; here anatomy has its own weight, the variation between
people. The quantities that all muscles share (`SHARED_QUANTITIES`), which a calibration keeps fixed, are free too.

A recording hardly determines most parameters, and many would end on a bound. Therefore the sampler draws u, and z is
the quantile of the bounded normal distribution that corresponds to u:

.. math::
   z = \Phi^{-1}\left(\Phi(a) + (\Phi(b) - \Phi(a))\,\Phi(u)\right)

The prior of each u is then a standard normal distribution without bounds, and the posterior is nearly normal around its
mode. The number :math:`q` of ``marginal_likelihood`` counts only the parameters that the recording determines: those
that anatomy determines use up no degrees of freedom.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace

import numpy as np
from scipy.special import ndtr, ndtri

from ...numerics.posterior.ensemble import drawn_by_gradients
from ...numerics.posterior.posterior import (
    PRIOR_LOG_VARIANCE_SPREAD,
    MarginalLikelihood,
    Noise,
    Posterior,
    Prior,
    summary,
)
from ...numerics.searches.bounded_least_squares import bounded_least_squares
from .muscle_calibration import MuscleFit, MuscleProblem, MuscleSamples, muscle_priors, solve_calibration
from .muscle_posterior import recording_information

SHARED_QUANTITIES = ("max_velocity", "force_length_width", "optimal_length_shift")
"""Quantities with one value for all muscles. A calibration keeps them at their anatomical values."""


@dataclass(frozen=True)
class PosteriorSettings:
    """Numbers of the sampling."""

    # A weight of anatomy so small that it only selects among parameters that fit the recording equally well
    weak_anatomy_weight: float = 1e-5
    predicted_draw_count: int = 200  # Torques are computed for about this many of the draws
    # Beyond this many standard deviations of u, z differs from its bound by rounding errors only
    max_normal_deviation: float = 6.0


POSTERIOR = PosteriorSettings()


class _Anatomy(Prior):
    """The prior of z with coupled muscles. Its intervals are in the parameters' own units."""

    _problem: MuscleProblem

    def __init__(self, problem: MuscleProblem):
        p = len(problem.names)
        super().__init__(problem.lower, problem.upper, np.zeros(p), np.ones(p))
        object.__setattr__(self, "_problem", problem)

    def log_density(self, values: np.ndarray) -> np.ndarray:
        return -0.5 * np.einsum("wp,pq,wq->w", values, self._problem.hold, values)

    def interval(self, level: float) -> np.ndarray:
        return self._problem.values(super().interval(level).T).T


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class CalibrationPosterior(Posterior):
    """Posterior of calibrated muscles.

    Attributes
    ----------
    problem : MuscleProblem
        The calibration problem, in which the quantities that all muscles share are free too.
    """

    problem: MuscleProblem = field(repr=False)

    def torques(self, samples: MuscleSamples) -> np.ndarray:
        """Predict the torque of some draws, shape (k, n) or (k, j, n) [N m]; the samples' own torque is not used."""
        some = self.draws[:: max(1, len(self.draws) // POSTERIOR.predicted_draw_count)]
        return np.array([self.problem.torque(z, samples) for z in map(self.problem.deviations, some)])


@dataclass(frozen=True, eq=False)
class _Bounded:
    """The conversion between z within bounds, shape (..., p), and u without bounds."""

    lower: np.ndarray  # (p,)
    upper: np.ndarray

    @property
    def _ends(self) -> tuple[np.ndarray, np.ndarray]:
        low = ndtr(self.lower)
        return low, ndtr(self.upper) - low

    def z(self, u: np.ndarray) -> np.ndarray:
        low, wide = self._ends
        return np.clip(ndtri(low + wide * ndtr(u)), self.lower, self.upper)

    def u(self, z: np.ndarray) -> np.ndarray:
        low, wide = self._ends
        return np.clip(
            ndtri(np.clip((ndtr(z) - low) / wide, 0.0, 1.0)),
            -POSTERIOR.max_normal_deviation,
            POSTERIOR.max_normal_deviation,
        )

    def log_slope(self, u: np.ndarray, z: np.ndarray) -> np.ndarray:
        """Return the logarithm of the derivative of z with respect to u."""
        return np.log(self._ends[1]) + 0.5 * (z**2 - u**2)


class _Density:
    """The posterior density of (u, log v), with its gradient."""

    def __init__(self, problem: MuscleProblem, likelihood: MarginalLikelihood):
        self.problem, self.likelihood = problem, likelihood
        self.bounded = _Bounded(problem.lower, problem.upper)
        self.coupled = problem.hold - np.eye(len(problem.names))

    def __call__(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        off = np.abs(places[:, -1] - np.log(self.likelihood.noise.variance))
        good = np.isfinite(places).all(axis=1) & (off < 10.0 * PRIOR_LOG_VARIANCE_SPREAD)
        logs, slopes = np.full(len(places), -np.inf), np.zeros(places.shape)
        if good.any():
            logs[good], slopes[good] = self._inside(places[good])
        return logs, slopes

    def _inside(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        u, log_v = places[:, :-1], places[:, -1:]
        z = self.bounded.z(u)
        steep = self.bounded.log_slope(u, z)
        found = [self.problem.weighed(each) for each in z]
        square = np.array([np.sum(error**2) for error, _ in found])
        moment = np.array([slopes.reshape(len(slopes), -1) @ error.ravel() for error, slopes in found])
        none = np.zeros((len(places), 0))
        here = replace(self.likelihood, misfit=lambda _: (square, none, np.zeros((0, 0))))
        logs = here(np.hstack([z, log_v])) + np.sum(steep, axis=1)
        # The prior of u alone is standard normal, so the gradients of the prior and of the conversion add up to -u.
        by_u = -u - np.exp(steep) * (z @ self.coupled + moment / np.exp(log_v))
        noise, q = self.likelihood.noise, self.likelihood.columns
        missed = noise.freedom * noise.variance + square - self.likelihood.least
        by_v = -0.5 * (noise.freedom + q) + 0.5 * missed / np.exp(log_v[:, 0])
        by_v -= (log_v[:, 0] - np.log(noise.variance)) / PRIOR_LOG_VARIANCE_SPREAD**2
        return logs, np.column_stack([by_u, by_v])

    def about_mode(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the density's mode near a fit's z, shape (p,), and its covariance there by the muscles' Jacobian."""
        p, noise, bounded, coupled = len(z), self.likelihood.noise, self.bounded, self.coupled

        def equations(u: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
            at = bounded.z(u)
            gain = np.exp(bounded.log_slope(u, at))
            error, slopes = self.problem.weighed(at)
            error, rows = error.ravel(), gain[:, None] * slopes.reshape(p, -1)
            normal = rows @ rows.T / noise.variance + np.eye(p) + gain[:, None] * coupled * gain
            cost = 0.5 * float(error @ error) / noise.variance + 0.5 * float(u @ u + at @ coupled @ at)
            return cost, rows @ error / noise.variance + u + gain * (coupled @ at), normal

        far = np.full(p, POSTERIOR.max_normal_deviation)
        end = bounded_least_squares(equations, np.clip(bounded.u(z), -2.0, 2.0), -far, far)
        covariance = np.zeros((p + 1, p + 1))
        covariance[:p, :p] = np.linalg.inv(end.normal)
        covariance[p, p] = 2.0 / (noise.freedom + self.likelihood.columns)
        return np.append(end.x, np.log(noise.variance)), covariance


def _refuse_misfit(values: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Refuse to be called: the density of a calibration takes the misfit from the problem itself."""
    raise NotImplementedError("the misfit of a calibration is that of its problem")


def calibration_posterior(fit: MuscleFit, *, level: float = 0.95, title: str = "", **sampling) -> CalibrationPosterior:
    """Return the posterior of calibrated muscles, in their units; `sampling` is passed to `drawn_by_gradients`."""
    problem, z = _with_common(fit)
    # R is the smallest residual over all parameters; the full weight of anatomy would prevent the fit from reaching it.
    least = solve_calibration(problem.held_by(POSTERIOR.weak_anatomy_weight), starts=1, near=z).z
    data, scores, freedom = recording_information(fit)
    told = np.diag(data) > 0.0
    variance = float(np.median(np.diag(scores)[told] / np.diag(data)[told]))
    known = np.linalg.eigvalsh(data)
    likelihood = MarginalLikelihood(
        _refuse_misfit, _Anatomy(problem), Noise(variance, freedom),
        float(np.sum(problem.weighed(least)[0] ** 2)), float(np.sum(known / (known + variance))),
    )  # fmt: skip
    density = _Density(problem, likelihood)
    found = drawn_by_gradients(density, *density.about_mode(z), **sampling)
    found = replace(found, values=problem.values(density.bounded.z(found.values[:, :-1])))
    made = summary(problem.names, problem.units, found, likelihood.prior, level=level, title=title)
    # These parameters are factors of anatomical values, so "differs from zero" is replaced by "determined by the data".
    told_apart = tuple(replace(x, identifiable=not x.told_by_prior) for x in made.parameters)
    own = {f.name: getattr(made, f.name) for f in fields(made)}
    return CalibrationPosterior(**{**own, "parameters": told_apart}, problem=problem)


def _with_common(fit: MuscleFit) -> tuple[MuscleProblem, np.ndarray]:
    """Return the problem in which the shared quantities are free too, and the fit's z in it."""
    old = fit.problem
    common = [q for q in SHARED_QUANTITIES if q not in {p.free.quantity for p in old.priors}]
    k = len(old.priors)
    priors = (*old.priors, *muscle_priors(old.model.muscles, common))
    problem = MuscleProblem(
        old.model.muscles, old.samples, priors=priors, hold=old.hold[:k, :k], passive=old.passive, weight=old.weight
    )
    return problem, np.concatenate([fit.z[:k], np.zeros(len(common)), fit.z[k:]])
