r"""A strap's stiffness and damping as draws: with what it does beside both, and bodies that are not exactly known.

About the identified strap a further torque :math:`\psi` of its stretch D changes the limb's angle by
:math:`-g H\psi`, with H the strap's own answer to a torque. Four are what straps are known to do and a spring with a
damper does not,

.. math::
   \psi = D^3, \qquad w\tanh(D/w), \qquad \dot D_T + D_T/T = \dot D, \qquad \ddot D

it hardens, has a slack of some w, a branch of it relaxes, or something turns with it. Each is as large beside the
strap's own span as what is left over, or half of the strap's own torque if that is less, times s. The bodies'
parameters, whose balance gave the torque, enter with their own covariance. The angle is all but straight in 1/k and
b/k: draws are of these, and the prior is of k and b.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.signal import lfilter

from ..._errors import IdentificationError
from ..parameter import Parameter
from ..strap.coupled_impedance import DECAY, CouplingFit
from ..strap.strap_search import Spectrum, StrapPoint, StrapProblem, StrapTrial
from ..strap.strap_torque import StrappedSwing, StrapTorque
from .ensemble import FEWEST_WEIGHED
from .marginal_likelihood import Noise, Prior
from .posterior import Posterior, summary
from .straight import Straight

NAMES = ("stiffness", "damping", "gain")
UNITS = ("N*m/rad", "N*m*s/rad", "1")
STIFF, DAMPED, GAIN = 100.0, 10.0, 0.05
"""Standard deviations before any data, of stiffness and damping above 0 and of an IMU's gain about 1: a strap of 100
N m/rad holds a swing within 5 degrees."""

CLOCK, MOUNTING = 1.0, 1.0
"""The same of an IMU's clock [s] and mounting [rad], about what was found."""

SLACK = 0.5
"""Width of a slack, over the stretch's spread."""

RELAXATION = 1.0
"""Time in which a branch relaxes [s]."""

MOST = 0.5
"""Of the strap's own torque that each of these may make, at one standard deviation, where s is 1."""

OWN = 0.02
"""Share of a column beside the strap's own span below which it cannot be told from it, and is left to the strap."""


class _ByCompliance(Prior):
    """A prior of stiffness, damping and others, of places that begin with 1/k and b/k."""

    def log_density(self, values: np.ndarray) -> np.ndarray:
        return super().log_density(_turned(values)) - 3.0 * np.log(values[:, 0])

    def inside(self, values: np.ndarray) -> np.ndarray:
        return np.all(values[:, :2] > 0.0, axis=1)


def _turned(values: np.ndarray) -> np.ndarray:
    """k and b of 1/k and b/k, and the other way round; places (w, p)."""
    return np.column_stack([1.0 / values[:, 0], values[:, 1] / values[:, 0], values[:, 2:]])


def _turn(values: np.ndarray) -> np.ndarray:
    """Derivative of k, b and the others by places that begin with 1/k and b/k, (p, p), at one of them, (p,)."""
    k, lag = 1.0 / values[0], values[1]
    turn = np.eye(len(values))
    turn[:2, :2] = [[-(k**2), 0.0], [-lag * k**2, k]]
    return turn


def _point(values: np.ndarray) -> StrapPoint:
    """The strap and its instruments of such a place, (p,)."""
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
    """Draws of an identified strap from the swings that it was fitted on; `gain` of the IMU as known before, if it is;
    `sampling` is what `drawn` takes."""
    if fit.stiffness.at_bound or fit.damping.at_bound:
        raise IdentificationError("the strap was stopped at a bound: about it there is nothing to draw")
    trials = [StrapTrial(s, t) for s, t in zip(swings, torques, strict=True)]
    problem = StrapProblem(trials, None, True)
    problem.leave_out(DECAY * fit.damping.value / fit.stiffness.value)
    shifts, offsets = (np.array([getattr(i, name) for i in fit.instruments]) for name in ("shift", "offset"))
    point = StrapPoint(fit.stiffness.value, fit.damping.value, 0.0, fit.instruments[0].gain, shifts, offsets)
    residual, jacobian, bodies = problem.about(point)
    values = np.concatenate([[point.stiffness, point.damping, point.gain], np.ravel([shifts, offsets], "F")])
    lengths = [len(b) for b in bodies]
    lacking = np.concatenate([_lacking(t, point, i) for i, t in enumerate(trials)])
    lacking, size = _beside(lacking, jacobian, float(np.sqrt(np.mean(residual**2))))
    # In units of their standard errors, the bodies' parameters are columns of a known size.
    turned, vectors = np.linalg.eigh(torques[0].covariance)
    known = np.concatenate(bodies) @ (vectors * np.sqrt(np.maximum(turned, 0.0)))
    columns = np.hstack([lacking * size, known])
    shares = np.array([1.0] * lacking.shape[1] + [0.0] * known.shape[1])
    about = (1.0, GAIN) if gain is None else (gain.value, gain.standard_error)
    spread = np.array([STIFF, DAMPED, about[1]] + [CLOCK, MOUNTING] * len(trials))
    centre = np.concatenate([[0.0, 0.0, about[0]], values[3:]])
    lower = np.concatenate([[0.0, 0.0], np.full(len(values) - 2, -np.inf)])
    prior = Prior(lower, np.full(len(values), np.inf), centre, spread)
    values = _turned(values[None])[0]
    jacobian = jacobian @ _turn(values)
    prior = _ByCompliance(prior.lower, prior.upper, prior.centre, prior.spread)
    straight = Straight(values, jacobian, residual, columns, shares, 1.0 - shares)
    noise = Noise.of(jacobian, residual, lengths)
    likelihood = straight.likelihood(prior, noise)
    noise = Noise(noise.variance * min(1.0, likelihood.least / float(residual @ residual)), noise.freedom)
    likelihood = straight.likelihood(prior, noise)

    def left_over(place: np.ndarray) -> np.ndarray:
        return problem.about(_point(place), at=point)[0]

    weak = noise.variance / np.concatenate([[np.inf, np.inf], spread[2:]]) ** 2
    covariance = noise.variance * np.linalg.inv(jacobian.T @ jacobian + np.diag(weak))
    found = straight.draws(likelihood, covariance, left_over, **sampling)
    if found.weighed < FEWEST_WEIGHED:
        # About where the draws lie, far from least squares, it is straighter.
        values = np.median(found.values[:, : len(values)], axis=0)
        residual, jacobian, _ = problem.about(_point(values), at=point)
        straight = Straight(values, jacobian @ _turn(values), residual, columns, shares, 1.0 - shares)
        likelihood = replace(straight.likelihood(prior, noise), least=likelihood.least)
        found = straight.draws(likelihood, covariance, left_over, **sampling)
    found = replace(found, values=_turned(found.values))
    prior = Prior(*(x[: len(NAMES)] for x in (prior.lower, prior.upper, prior.centre, prior.spread)))
    return summary(NAMES, UNITS, found, prior, level=level, title="Posterior of a strap")


def _lacking(trial: StrapTrial, point: StrapPoint, number: int) -> np.ndarray:
    """What four kinds of neglected physics, each as large as the spring's torque, do to the limb's angle at the IMU's
    samples that count, (m, 4)."""
    k, b = point.stiffness, point.damping
    stretch = trial.forcing.response(k, b, 0.0)[:, 0]
    stretch = stretch - stretch.mean()
    period, spread = 1.0 / trial.fs, max(float(np.std(stretch)), 1e-9)
    rate = np.gradient(stretch, period)
    relaxed = lfilter([1.0, -1.0], [1.0, -np.exp(-period / RELAXATION)], stretch)
    width = SLACK * spread
    torque = np.column_stack([stretch**3, width * np.tanh(stretch / width), relaxed, np.gradient(rate, period)])
    torque *= k * spread / np.std(torque, axis=0)
    answer = Spectrum(torque, trial.fs).response(k, b, 0.0)
    time, kept = trial.times(float(point.shifts[number]))
    return -point.gain * trial.sample(answer, time[kept])[0]


def _beside(columns: np.ndarray, own: np.ndarray, size: float) -> tuple[np.ndarray, np.ndarray]:
    """Columns that are more than a strap's own, (m, c), and what makes each as large beside these as `size`, `MOST` at
    most, (c,)."""
    basis = np.linalg.qr(own / np.linalg.norm(own, axis=0))[0]
    beside = np.linalg.norm(columns - basis @ (basis.T @ columns), axis=0)
    some = beside > OWN * np.linalg.norm(columns, axis=0)
    return columns[:, some], np.minimum(size * np.sqrt(len(columns)) / beside[some], MOST)
