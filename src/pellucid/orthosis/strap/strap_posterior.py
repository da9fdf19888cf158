r"""Posterior of a strap's stiffness and damping, with neglected effects of the strap and uncertain bodies.

Around the identified strap, an additional torque :math:`\psi` of its stretch D changes the limb's angle by
:math:`-g H\psi`, with H the strap's response to a torque. Real straps have four effects that a spring with a damper
neglects,

.. math::
   \psi = D^3, \qquad w\tanh(D/w), \qquad \dot D_T + D_T/T = \dot D, \qquad \ddot D

hardening, slack of width w, a branch that relaxes with time constant T, and additional inertia. Outside the space that
stiffness and damping span, each is scaled to the size of the residual times s, but to at most half of the strap's
torque. The strap's torque follows from a balance of the bodies, whose parameters enter with their covariance. The angle
is nearly linear in 1/k and b/k, so these are sampled; the prior is stated for k and b.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import lfilter

from ..._errors import IdentificationError
from ...models.estimates import Parameter
from ...numerics.posterior.ensemble import SAMPLER_SETTINGS
from ...numerics.posterior.posterior import LinearisedModel, Noise, Posterior, Prior, summary
from .coupled_impedance import CouplingFit, Spectrum, StrapPoint, StrapProblem, StrapTrial, decay_time
from .strap_model import StrappedSwing, StrapTorque

NAMES = ("stiffness", "damping", "gain")
UNITS = ("N*m/rad", "N*m*s/rad", "1")
"""Units of `NAMES`, in their order."""


@dataclass(frozen=True)
class PosteriorSettings:
    """Priors of a strap and its instruments, and the sizes of neglected effects."""

    # Prior standard deviation of the stiffness above 0 [N m/rad]. A strap this stiff holds a swing within 5 degrees.
    prior_stiffness_spread: float = 100.0
    prior_damping_spread: float = 10.0  # prior standard deviation of the damping above 0 [N m s/rad]
    prior_gain_spread: float = 0.05  # prior standard deviation of the IMU's gain around 1 [1]
    prior_clock_spread_s: float = 1.0  # prior standard deviation of the IMU's clock offset around its estimate [s]
    # Prior standard deviation of the IMU's mounting angle around its estimate [rad].
    prior_mounting_spread_rad: float = 1.0
    slack_width_share: float = 0.5  # width w of the neglected slack, divided by the standard deviation of the stretch
    relaxation_time_s: float = 1.0  # time constant T of the neglected branch that relaxes [s]
    # Largest standard deviation of one neglected effect, divided by the strap's torque, where s is 1.
    max_neglected_torque_share: float = 0.5
    # A neglected effect is used only if its column keeps at least this share of its norm after projection on the
    # strap's own columns. Otherwise it cannot be distinguished from stiffness and damping.
    min_column_remainder: float = 0.02


POSTERIOR_SETTINGS = PosteriorSettings()


class _ByCompliance(Prior):
    """The prior of k, b and further parameters, evaluated at places that begin with 1/k and b/k."""

    def log_density(self, values: np.ndarray) -> np.ndarray:
        return super().log_density(_turned(values)) - 3.0 * np.log(values[:, 0])

    def inside(self, values: np.ndarray) -> np.ndarray:
        return np.all(values[:, :2] > 0.0, axis=1)


def _turned(values: np.ndarray) -> np.ndarray:
    """Convert places, shape (w, p), from 1/k and b/k to k and b, or back: the conversion is its own inverse."""
    return np.column_stack([1.0 / values[:, 0], values[:, 1] / values[:, 0], values[:, 2:]])


def _turn(values: np.ndarray) -> np.ndarray:
    """Return the Jacobian, shape (p, p), of (k, b, further parameters) with respect to (1/k, b/k, further
    parameters)."""
    k, lag = 1.0 / values[0], values[1]
    turn = np.eye(len(values))
    turn[:2, :2] = [[-(k**2), 0.0], [-lag * k**2, k]]
    return turn


def _point(values: np.ndarray) -> StrapPoint:
    """Return the strap and its instruments at a place, shape (p,), that begins with 1/k and b/k."""
    stiffness, damping, gain, *clocks = _turned(values[None])[0]
    return StrapPoint(stiffness, damping, 0.0, gain, np.array(clocks[::2]), np.array(clocks[1::2]))


def strap_posterior(
    swings: Sequence[StrappedSwing],
    torques: Sequence[StrapTorque],
    fit: CouplingFit,
    *,
    gain: Parameter | None = None,
    level: float = 0.95,
    **sampling,
) -> Posterior:
    """Return the posterior of an identified strap, from the swings that it was fitted to.

    `gain` is the IMU's gain if a calibration has determined it. `sampling` is passed on to `drawn`.
    """
    if fit.stiffness.at_bound or fit.damping.at_bound:
        raise IdentificationError(
            "stiffness or damping of the strap is on its bound, so that no posterior can be sampled; record swings at "
            "more speeds and amplitudes"
        )
    trials = [StrapTrial(s, t) for s, t in zip(swings, torques, strict=True)]
    problem = StrapProblem(trials, None, True)
    problem.leave_out(decay_time(fit.stiffness.value, fit.damping.value))
    shifts, offsets = (np.array([getattr(i, name) for i in fit.instruments]) for name in ("shift", "offset"))
    point = StrapPoint(fit.stiffness.value, fit.damping.value, 0.0, fit.instruments[0].gain, shifts, offsets)
    residual, jacobian, bodies = problem.about(point)
    values = np.concatenate([[point.stiffness, point.damping, point.gain], np.ravel([shifts, offsets], "F")])
    lengths = [len(b) for b in bodies]
    lacking = np.concatenate([_lacking(t, point, i) for i, t in enumerate(trials)])
    lacking, size = _beside(lacking, jacobian, float(np.sqrt(np.mean(residual**2))))
    # The parameters of the bodies, scaled by their standard errors, are further columns with coefficients of variance
    # 1.
    turned, vectors = np.linalg.eigh(torques[0].covariance)
    known = np.concatenate(bodies) @ (vectors * np.sqrt(np.maximum(turned, 0.0)))
    columns = np.hstack([lacking * size, known])
    shares = np.array([1.0] * lacking.shape[1] + [0.0] * known.shape[1])
    about = (1.0, POSTERIOR_SETTINGS.prior_gain_spread) if gain is None else (gain.value, gain.standard_error)
    spread = np.array(
        [POSTERIOR_SETTINGS.prior_stiffness_spread, POSTERIOR_SETTINGS.prior_damping_spread, about[1]]
        + [POSTERIOR_SETTINGS.prior_clock_spread_s, POSTERIOR_SETTINGS.prior_mounting_spread_rad] * len(trials)
    )
    centre = np.concatenate([[0.0, 0.0, about[0]], values[3:]])
    lower = np.concatenate([[0.0, 0.0], np.full(len(values) - 2, -np.inf)])
    prior = Prior(lower, np.full(len(values), np.inf), centre, spread)
    values = _turned(values[None])[0]
    jacobian = jacobian @ _turn(values)
    prior = _ByCompliance(prior.lower, prior.upper, prior.centre, prior.spread)
    straight = LinearisedModel(values, jacobian, residual, columns, shares, 1.0 - shares)
    noise = Noise.of(jacobian, residual, lengths)
    likelihood = straight.likelihood(prior, noise)
    noise = Noise(noise.variance * min(1.0, likelihood.least / float(residual @ residual)), noise.freedom)
    likelihood = straight.likelihood(prior, noise)

    def left_over(place: np.ndarray) -> np.ndarray:
        return problem.about(_point(place), at=point)[0]

    weak = noise.variance / np.concatenate([[np.inf, np.inf], spread[2:]]) ** 2
    covariance = noise.variance * np.linalg.inv(jacobian.T @ jacobian + np.diag(weak))
    found = straight.draws(likelihood, covariance, left_over, **sampling)
    if found.weighed < SAMPLER_SETTINGS.min_weighted_share:
        # Too few draws count after reweighting: linearise again at their median, which is far from least squares.
        values = np.median(found.values[:, : len(values)], axis=0)
        residual, jacobian, _ = problem.about(_point(values), at=point)
        straight = LinearisedModel(values, jacobian @ _turn(values), residual, columns, shares, 1.0 - shares)
        likelihood = replace(straight.likelihood(prior, noise), least=likelihood.least)
        found = straight.draws(likelihood, covariance, left_over, **sampling)
    found = replace(found, values=_turned(found.values))
    prior = Prior(*(x[: len(NAMES)] for x in (prior.lower, prior.upper, prior.centre, prior.spread)))
    return summary(NAMES, UNITS, found, prior, level=level, title="Posterior of a strap")


def _lacking(trial: StrapTrial, point: StrapPoint, number: int) -> np.ndarray:
    """Return the limb's angle that each of the four neglected effects would cause, shape (m, 4).

    Each effect is scaled to the spring's torque; rows are the IMU's samples that are used.
    """
    k, b = point.stiffness, point.damping
    stretch = trial.forcing.response(k, b, 0.0)[:, 0]
    stretch = stretch - stretch.mean()
    period, spread = 1.0 / trial.fs, max(float(np.std(stretch)), 1e-9)
    rate = np.gradient(stretch, period)
    relaxed = lfilter([1.0, -1.0], [1.0, -np.exp(-period / POSTERIOR_SETTINGS.relaxation_time_s)], stretch)
    width = POSTERIOR_SETTINGS.slack_width_share * spread
    torque = np.column_stack([stretch**3, width * np.tanh(stretch / width), relaxed, np.gradient(rate, period)])
    torque *= k * spread / np.std(torque, axis=0)
    answer = Spectrum(torque, trial.fs).response(k, b, 0.0)
    time, kept = trial.times(float(point.shifts[number]))
    return -point.gain * trial.sample(answer, time[kept])[0]


def _beside(columns: np.ndarray, own: np.ndarray, size: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the columns that stiffness and damping cannot replace, shape (m, c), and their scales, (c,).

    A scale makes the part of the column outside the span of `own` as large as `size` (root mean square), and is limited
    by `POSTERIOR_SETTINGS.max_neglected_torque_share`.
    """
    basis = np.linalg.qr(own / np.linalg.norm(own, axis=0))[0]
    beside = np.linalg.norm(columns - basis @ (basis.T @ columns), axis=0)
    some = beside > POSTERIOR_SETTINGS.min_column_remainder * np.linalg.norm(columns, axis=0)
    return columns[:, some], np.minimum(
        size * np.sqrt(len(columns)) / beside[some], POSTERIOR_SETTINGS.max_neglected_torque_share
    )
