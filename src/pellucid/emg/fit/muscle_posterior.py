r"""Posterior of an isolated muscle's length offset, while the constants of the muscle model may be wrong.

The force along a recording is computed on a grid of length offsets, with its derivative with respect to the logarithm
of each constant. The effect of a wrong constant enters as neglected physics (``numerics.posterior``). A muscle has the
same force on both sides of its optimal length, so walkers start at every offset that the grid finds probable.

Information that a recording contains on calibrated muscles: covariance and verdicts.

With J the Jacobian of the errors in the cost, S the long-run covariance of the scores (errors are coloured) and
:math:`\lambda` the weight of anatomy, the covariance of an estimate is the sum of the effects of noise and of the
prior:

.. math::
   C = H^{-1} (S + \lambda^4 I) H^{-1}, \qquad H = J^T J + \lambda^2 I

in squared standard deviations among people, so that 1 is the variance without any recording. For coupled priors the
inverse of their correlation matrix replaces I.

Posterior of calibrated muscles: the anatomical prior combined with one person's recordings.

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
mode. The number :math:`q` of ``numerics.posterior`` counts only the parameters that the recording determines: those
that anatomy determines use up no degrees of freedom.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from itertools import pairwise

import numpy as np
from scipy.special import ndtr, ndtri

from ..._errors import listed_names
from ...models.estimates import Parameter, Verdict
from ...numerics.posterior.ensemble import drawn, drawn_by_gradients
from ...numerics.posterior.posterior import (
    PRIOR_LOG_VARIANCE_SPREAD,
    MarginalLikelihood,
    Noise,
    Posterior,
    Prior,
    summary,
)
from ...numerics.searches.bounded_least_squares import bounded_least_squares
from ...numerics.uncertainty import (
    block_length,
    correlation_time,
    degrees_of_freedom,
    long_run_covariance,
    sandwich_covariance,
)
from .muscle_calibration import MuscleFit, MuscleProblem, MuscleSamples, muscle_priors, solve_calibration

CONSTANT_ERROR_SHARE = 0.3
"""Prior standard deviation of every constant of the model, relative to its value, where s is 1."""

OFFSET_NAME = "offset"
"""Name under which the offset is reported."""

OFFSET_UNIT = "m"
"""Unit in which the offset is reported."""


@dataclass(frozen=True, eq=False)
class ForceGrid:
    """Modelled force of a muscle at every offset of a grid, and the measured force."""

    offsets: np.ndarray  # (g,) ascending length offsets [m]
    forces: np.ndarray  # (g, m) modelled force at each offset [N]
    slopes: np.ndarray  # (g, m, c) derivative of the force with respect to the logarithm of each constant [N]
    measured: np.ndarray  # (m,) measured force [N]
    lengths: tuple[int, ...]  # number of samples of each recording

    def slope(self, offset: float) -> np.ndarray:
        """Return the derivative of the force with respect to the offset, shape (m,) [N/m]."""
        i = int(np.clip(np.searchsorted(self.offsets, offset), 1, len(self.offsets) - 1))
        return (self.forces[i] - self.forces[i - 1]) / (self.offsets[i] - self.offsets[i - 1])

    def residual(self, offset: float) -> np.ndarray:
        """Return measured minus modelled force, shape (m,) [N], interpolated linearly between the grid's offsets."""
        i = int(np.clip(np.searchsorted(self.offsets, offset), 1, len(self.offsets) - 1))
        share = (offset - self.offsets[i - 1]) / (self.offsets[i] - self.offsets[i - 1])
        return self.measured - (1.0 - share) * self.forces[i - 1] - share * self.forces[i]

    @property
    def best(self) -> float:
        """The grid's offset with the smallest sum of squared residuals [m]."""
        return float(self.offsets[np.argmin(np.sum((self.measured - self.forces) ** 2, axis=1))])


def offset_interval(grid: ForceGrid, offset: float) -> Parameter:
    """Return an offset with its least-squares interval: coloured residuals, the constants taken as exactly known."""
    covariance = sandwich_covariance(grid.slope(offset)[:, None], grid.residual(offset), grid.lengths)
    return Parameter(OFFSET_NAME, OFFSET_UNIT, offset, float(np.sqrt(covariance[0, 0])))


def offset_likelihood(grid: ForceGrid) -> MarginalLikelihood:
    """Return the posterior density of the offset, with the errors of the model's constants integrated out."""
    left = (grid.measured - grid.forces)[:, :, None]
    both = np.concatenate([left, CONSTANT_ERROR_SHARE * grid.slopes], axis=2)
    products = np.einsum("gmi,gmj->gij", both, both)
    across = np.einsum("gmi,gmj->gij", both[:-1], both[1:])
    across = across + np.swapaxes(across, 1, 2)
    step = grid.offsets[1] - grid.offsets[0]

    def misfit(values: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        # The residual is interpolated linearly between two offsets, so its products are quadratic. Interpolating the
        # products linearly could make the sum of squares smaller than R, and v would collapse to zero.
        place = np.clip((values[:, 0] - grid.offsets[0]) / step, 0.0, len(grid.offsets) - 1.0)
        low = np.minimum(place.astype(int), len(grid.offsets) - 2)
        share = (place - low)[:, None, None]
        rest = 1.0 - share
        found = rest**2 * products[low] + rest * share * across[low] + share**2 * products[low + 1]
        return found[:, 0, 0], found[:, 1:, 0], found[:, 1:, 1:]

    at = int(np.argmin(products[:, 0, 0]))
    # R is the smallest sum of squares over all offsets and constants.
    solved = [x[0, 0] - x[0, 1:] @ np.linalg.lstsq(x[1:, 1:], x[1:, 0], rcond=None)[0] for x in products]
    least = float(min(solved))
    noise = Noise.of(grid.slope(grid.best)[:, None], left[at, :, 0], list(grid.lengths))
    # The part of the residual that the constants can explain is misfit, not noise.
    noise = Noise(noise.variance * min(1.0, least / products[at, 0, 0]), noise.freedom)
    half = 0.5 * (grid.offsets[-1] - grid.offsets[0])
    prior = Prior(grid.offsets[:1], grid.offsets[-1:], np.zeros(1), np.array([half]))
    count = grid.slopes.shape[2]
    return MarginalLikelihood(misfit, prior, noise, least, 1 + count, np.ones(count), np.zeros(count))


def offset_posterior(grid: ForceGrid, *, level: float = 0.95, **sampling) -> Posterior:
    """Sample the offset and return its posterior; `sampling` is passed on to `drawn`."""
    likelihood = offset_likelihood(grid)
    log_v = np.log(likelihood.noise.variance)
    known = np.column_stack([grid.offsets, np.full(len(grid.offsets), log_v), np.full(len(grid.offsets), np.log(0.1))])
    logs = likelihood(known)
    shares = np.exp(logs - logs.max())
    step = grid.offsets[1] - grid.offsets[0]

    def begin(rng: np.random.Generator, walkers: int) -> np.ndarray:
        offsets = rng.choice(grid.offsets, walkers, p=shares / shares.sum()) + step * rng.uniform(-0.5, 0.5, walkers)
        inside = np.clip(offsets, grid.offsets[0] + 1e-6 * step, grid.offsets[-1] - 1e-6 * step)
        return np.column_stack(
            [inside, log_v + 0.3 * rng.standard_normal(walkers), np.log(0.1) + 0.3 * rng.standard_normal(walkers)]
        )

    return summary([OFFSET_NAME], [OFFSET_UNIT], drawn(likelihood, begin, **sampling), likelihood.prior, level=level)


MAX_IDENTIFIED_SPREAD_SHARE = 0.7
"""A parameter is not identified if its standard error exceeds this share of the standard deviation among people."""

MAX_NAMED_PARAMETERS = 6
"""Largest number of parameters that a verdict names if there are more than twice as many."""

AT_BOUND_REFUSAL = "on a physiological bound: not identifiable"
"""Reason why a parameter on a bound has no standard error: its value follows from the choice of the bound."""


def covariance(fit: MuscleFit) -> np.ndarray:
    """Return the covariance of the estimate in squared standard deviations among people, shape (p, p)."""
    _, scores, _ = recording_information(fit)
    pull = fit.problem.weight**2
    free = np.flatnonzero(~fit.at_bound)
    inverse = np.linalg.inv(fit.normal[np.ix_(free, free)])
    result = np.zeros_like(fit.normal)
    inner = np.ix_(free, free)
    result[inner] = inverse @ (scores[inner] + pull**2 * fit.problem.hold[inner]) @ inverse
    return result


def muscle_parameters(fit: MuscleFit) -> tuple[Parameter, ...]:
    """Return the parameters with standard errors; unidentified ones are marked, and those on a bound have none."""
    sd, gains, values = np.sqrt(np.diag(covariance(fit))), fit.problem.gains(fit.z), fit.problem.values(fit.z)
    return tuple(
        Parameter(
            name, unit, float(x), float("nan" if b else s * g), bool(b),
            identifiable=bool(s < MAX_IDENTIFIED_SPREAD_SHARE and not b),
            refused=AT_BOUND_REFUSAL if b else "",
        )
        for name, unit, x, s, g, b in zip(
            fit.problem.names, fit.problem.units, values, sd, gains, fit.at_bound, strict=True
        )
    )  # fmt: skip


def reported_covariance(fit: MuscleFit) -> np.ndarray:
    """Return the covariance in the parameters' units, (p, p); NaN in rows and columns of parameters on a bound."""
    gains = np.where(fit.at_bound, np.nan, fit.problem.gains(fit.z))
    return covariance(fit) * np.outer(gains, gains)


def count_bounds_reported_as_estimates(fit: MuscleFit, reported: Sequence[Parameter]) -> int:
    """Count the parameters among `reported` that ended on a bound and are reported as if they had been estimated."""
    found = {p.name: p for p in reported}
    return sum(
        found[name].identifiable or found[name].trusted or bool(np.isfinite(found[name].standard_error))
        for name in np.array(fit.problem.names)[fit.at_bound]
    )


def muscle_verdicts(fit: MuscleFit, what: str) -> tuple[Verdict, ...]:
    """Return the verdicts on parameters that the recording does not determine; `what` names the calibration."""
    found = muscle_parameters(fit)
    bound = [f"{p.name} ({p.value:.3g}{'' if p.unit == '1' else ' ' + p.unit})" for p in found if p.at_bound]
    unknown = [p.name for p in found if not p.at_bound and not p.identifiable]
    said = []
    if bound:
        text = (
            f"{what}, muscles: {len(bound)} of {len(found)} parameters ended on a physiological bound and are not "
            f"identifiable: {', '.join(bound)}. The torque estimate remains valid, but these values are not "
            "measurements of the person."
        )
        said.append(Verdict("warning", text))
    if unknown:
        text = (
            f"{what}, muscles: the recording does not identify {_listed(unknown)}; these parameters stay close to "
            "their anatomical values."
        )
        said.append(Verdict("note", text))
    if not said:
        said.append(Verdict("good", f"{what}, muscles: all {len(found)} parameters are identified, none on a bound."))
    return tuple(said)


def _listed(names: Sequence[str]) -> str:
    """Join parameters' names, only the first ones where they are too many to be read."""
    return listed_names(names, MAX_NAMED_PARAMETERS if len(names) > 2 * MAX_NAMED_PARAMETERS else len(names))


def recording_information(fit: MuscleFit) -> tuple[np.ndarray, np.ndarray, float]:
    """Return J'J of the recording alone, the long-run covariance of its scores, each (p, p), and its degrees of
    freedom."""
    problem = fit.problem
    error, slopes = problem.weighed(fit.z)
    weight = np.atleast_2d(problem.samples.weight)
    counted = np.any(weight > 0.0, axis=0)
    starts = (*problem.samples.data.starts, weight.shape[1])
    lengths = [n for n in (int(counted[a:b].sum()) for a, b in pairwise(starts)) if n]
    rows = np.atleast_2d(error)
    # Errors of several joints are correlated, so their scores are summed, and the longest correlation time is used.
    scores = (slopes * error).reshape(len(slopes), len(rows), -1).sum(axis=1)[:, counted].T
    memory = max(correlation_time(row[counted], lengths) for row in rows)
    flat = slopes.reshape(len(slopes), -1)
    freedom = degrees_of_freedom(block_length(memory, len(scores)), len(scores))
    return flat @ flat.T, long_run_covariance(scores, rows[0][counted], lengths, memory), freedom


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


POSTERIOR_DRAWS = PosteriorSettings()


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
        some = self.draws[:: max(1, len(self.draws) // POSTERIOR_DRAWS.predicted_draw_count)]
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
            -POSTERIOR_DRAWS.max_normal_deviation,
            POSTERIOR_DRAWS.max_normal_deviation,
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

        far = np.full(p, POSTERIOR_DRAWS.max_normal_deviation)
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
    least = solve_calibration(problem.held_by(POSTERIOR_DRAWS.weak_anatomy_weight), starts=1, near=z).z
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
