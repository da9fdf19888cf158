r"""Calibrated muscles as draws: what a recording leaves open of them within what anatomy holds.

Parameters are z, standard deviations from anatomy, within bounds and coupled as `coupled_priors` has them. Rows are the
calibration's own, each joint's errors over its reference's spread; they count for as little as their colour asks, which
scores say without any inverse: :math:`\hat v = \operatorname{median}_i S_{ii}/(J^T J)_{ii}`. Unlike a calibration,
whose weight of anatomy is chosen by what it predicts, anatomy holds here for what it is: people differ by so much. What
calibrations leave as it is of all muscles (`COMMON`) is free too.

Most parameters are hardly told by a recording, and many would end on a bound. So draws are of u, with z the quantile,
within the bounds, of the normal distribution that u has by itself:

.. math::
   z = \Phi^{-1}\left(\Phi(a) + (\Phi(b) - \Phi(a))\,\Phi(u)\right)

What anatomy says of each alone is then a standard normal distribution without bounds, and about its mode the density is
nearly normal, by the Jacobian that muscles have anyway. :math:`q` of ``marginal_likelihood`` counts the parameters that
the recording tells: those that anatomy tells take no freedom from the rows.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace

import numpy as np
from scipy.special import ndtr, ndtri

from ..muscles.muscle_calibration import MuscleFit, MuscleProblem, MuscleSamples, calibrate_muscles
from ..muscles.muscle_freedom import muscle_priors
from ..muscles.muscle_information import told_by_recording
from ..searches.bounded_least_squares import bounded_least_squares
from .hamiltonian import drawn_by_gradients
from .marginal_likelihood import WEAK, MarginalLikelihood, Noise, Prior
from .posterior import Posterior, summary

COMMON = ("max_velocity", "force_length_width", "optimal_length_shift")
"""One number each of all muscles, which calibrations leave as anatomy has it."""

HARDLY = 1e-5
"""A weight of anatomy that only chooses among what a recording cannot tell apart."""

PREDICTED = 200
"""Draws whose torques are asked for."""

FLAT = 6.0
"""Standard deviations of u beyond which z is told from its bound by rounding alone."""


class _Anatomy(Prior):
    """A prior of z whose muscles are coupled, and whose intervals are in the parameters' units."""

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
    """Calibrated muscles, each number with its draws.

    Attributes
    ----------
    problem : MuscleProblem
        What was calibrated, with what all muscles have in common free too.
    """

    problem: MuscleProblem = field(repr=False)

    def torques(self, samples: MuscleSamples) -> np.ndarray:
        """Of some of the draws, (k, n) or (k, j, n) [N m]; the samples' own torque is not looked at."""
        some = self.draws[:: max(1, len(self.draws) // PREDICTED)]
        return np.array([self.problem.torque(z, samples) for z in map(self.problem.deviations, some)])


@dataclass(frozen=True, eq=False)
class _Bounded:
    """Between z within bounds, (..., p), and u without."""

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
        return np.clip(ndtri(np.clip((ndtr(z) - low) / wide, 0.0, 1.0)), -FLAT, FLAT)

    def log_slope(self, u: np.ndarray, z: np.ndarray) -> np.ndarray:
        """Of z by u."""
        return np.log(self._ends[1]) + 0.5 * (z**2 - u**2)


class _Density:
    """Of u and log v, with its gradient."""

    def __init__(self, problem: MuscleProblem, likelihood: MarginalLikelihood):
        self.problem, self.likelihood = problem, likelihood
        self.bounded = _Bounded(problem.lower, problem.upper)
        self.coupled = problem.hold - np.eye(len(problem.names))

    def __call__(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        off = np.abs(places[:, -1] - np.log(self.likelihood.noise.variance))
        good = np.isfinite(places).all(axis=1) & (off < 10.0 * WEAK)
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
        # What u has by itself is normal: anatomy's own pull and the turn's slope make -u of it.
        by_u = -u - np.exp(steep) * (z @ self.coupled + moment / np.exp(log_v))
        noise, q = self.likelihood.noise, self.likelihood.columns
        missed = noise.freedom * noise.variance + square - self.likelihood.least
        by_v = -0.5 * (noise.freedom + q) + 0.5 * missed / np.exp(log_v[:, 0])
        by_v -= (log_v[:, 0] - np.log(noise.variance)) / WEAK**2
        return logs, np.column_stack([by_u, by_v])

    def about_mode(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Its mode, about a fit's z, (p,), and its covariance there by the muscles' Jacobian."""
        p, noise, bounded, coupled = len(z), self.likelihood.noise, self.bounded, self.coupled

        def equations(u: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
            at = bounded.z(u)
            gain = np.exp(bounded.log_slope(u, at))
            error, slopes = self.problem.weighed(at)
            error, rows = error.ravel(), gain[:, None] * slopes.reshape(p, -1)
            normal = rows @ rows.T / noise.variance + np.eye(p) + gain[:, None] * coupled * gain
            cost = 0.5 * float(error @ error) / noise.variance + 0.5 * float(u @ u + at @ coupled @ at)
            return cost, rows @ error / noise.variance + u + gain * (coupled @ at), normal

        far = np.full(p, FLAT)
        end = bounded_least_squares(equations, np.clip(bounded.u(z), -2.0, 2.0), -far, far)
        covariance = np.zeros((p + 1, p + 1))
        covariance[:p, :p] = np.linalg.inv(end.normal)
        covariance[p, p] = 2.0 / (noise.freedom + self.likelihood.columns)
        return np.append(end.x, np.log(noise.variance)), covariance


def calibration_posterior(fit: MuscleFit, *, level: float = 0.95, title: str = "", **sampling) -> CalibrationPosterior:
    """Draws of calibrated muscles, in their units; `sampling` is what `drawn_by_gradients` takes."""
    problem, z = _with_common(fit)
    # The least that any parameters leave over: a weight of anatomy would hold back from it.
    least = calibrate_muscles(problem.held_by(HARDLY), starts=1, near=z).z
    data, scores, freedom = told_by_recording(fit)
    told = np.diag(data) > 0.0
    variance = float(np.median(np.diag(scores)[told] / np.diag(data)[told]))
    known = np.linalg.eigvalsh(data)
    likelihood = MarginalLikelihood(
        lambda values: None, _Anatomy(problem), Noise(variance, freedom),
        float(np.sum(problem.weighed(least)[0] ** 2)), float(np.sum(known / (known + variance))),
    )  # fmt: skip
    density = _Density(problem, likelihood)
    found = drawn_by_gradients(density, *density.about_mode(z), **sampling)
    found = replace(found, values=problem.values(density.bounded.z(found.values[:, :-1])))
    made = summary(problem.names, problem.units, found, likelihood.prior, level=level, title=title)
    # Factors of what anatomy has are not to be told from 0.
    told_apart = tuple(replace(x, identifiable=not x.told_by_prior) for x in made.parameters)
    own = {f.name: getattr(made, f.name) for f in fields(made)}
    return CalibrationPosterior(**{**own, "parameters": told_apart}, problem=problem)


def _with_common(fit: MuscleFit) -> tuple[MuscleProblem, np.ndarray]:
    """The problem with what is common to all muscles free too, and the fit's z in it."""
    old = fit.problem
    common = [q for q in COMMON if q not in {p.free.quantity for p in old.priors}]
    k = len(old.priors)
    priors = (*old.priors, *muscle_priors(old.model.muscles, common))
    problem = MuscleProblem(
        old.model.muscles, old.samples, priors=priors, hold=old.hold[:k, :k], passive=old.passive, weight=old.weight
    )
    return problem, np.concatenate([fit.z[:k], np.zeros(len(common)), fit.z[k:]])
