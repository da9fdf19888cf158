r"""Stiffness of a joint along a movement, from calibrated muscles, with what is not known of it.

.. math::
   K_{jk} = -\frac{\partial \tau_j}{\partial q_k} = \sum_m \left(\frac{\partial l_m}{\partial q_j}
   \frac{\partial l_m}{\partial q_k} k_m + \frac{\partial^2 l_m}{\partial q_j \partial q_k} F_m\right) + k_{tissue}

k of a muscle is either what its attached cross-bridges give at once, in series with its tendon [1]_ [2]_, or the slope
of the model's own force. Both come from the core that is stepped live (``include/pellucid/muscle_stiffness.hpp``). The
interval holds the calibration's covariance and what muscles and tendons differ by; whether the model is right it cannot
know.

.. [1] P. M. H. Rack, D. R. Westbury, "The short range stiffness of active mammalian muscle and its effect on mechanical
   properties", J. Physiol. 240, 1974.
.. [2] L. Cui, E. J. Perreault, H. Maas, T. G. Sandercock, "Modeling short-range stiffness of feline lower hindlimb
   muscles", J. Biomech. 41, 2008.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ..fit.muscles.muscle_calibration import MuscleFit
from ..fit.muscles.muscle_information import covariance
from ..models.emg_estimator import SHORT_RANGE_STIFFNESS_ERROR_SHARE, EmgEstimatorCard
from ..models.hill import MUSCLE_QUANTITIES
from .torque_trial import TorqueTrial

TENDON_SPREAD = 0.3
"""Standard error of a tendon's strain under F_0, a share of it: tendons of one leg differ by as much."""

POSTURES = 4
"""Of equal shares of a movement's time, from its smallest angle to its largest."""

LONGEST = 3000
"""Samples of a movement that are looked at."""

LEAST_MOVED = 0.05
"""By which a parameter is moved at least to see what stiffness it changes, in standard deviations among people: else by
its standard error, so that where a muscle just begins to pull counts as much as it may."""

KINDS = ("short_range", "slope")
"""At once, and by Hill's slope."""


@dataclass(frozen=True)
class PostureStiffness:
    """Mean over a share of a movement."""

    low: float  # low, high: Angles of the share [rad]
    high: float
    torque: float  # Mean, by the muscles [N m]
    value: Mapping[str, float]  # By `KINDS` [N m/rad]
    error: Mapping[str, float]  # Standard errors


@dataclass(frozen=True, eq=False)
class JointStiffness:
    """Of a joint along a movement."""

    joint: str
    recording: str
    time: np.ndarray  # time, torque: (n,) [s] and [N m]
    torque: np.ndarray
    value: Mapping[str, np.ndarray]  # (n,) By `KINDS` [N m/rad]
    error: Mapping[str, np.ndarray]  # (n,) Standard errors
    whole: PostureStiffness  # Over all of it
    postures: tuple[PostureStiffness, ...]  # From the smallest angle to the largest


def joint_stiffness(card: EmgEstimatorCard, fit: MuscleFit, trial: TorqueTrial) -> JointStiffness:
    """Along a trial, by the muscles of a card of one joint and the fit that they come from."""
    shown = slice(0, LONGEST)
    # A trial's envelopes are relative already.
    card = replace(card, chain="none", channels=tuple(replace(c, scale=1.0) for c in card.channels))
    time = np.round(1e6 * card.period * np.arange(len(trial.time[shown])))
    emg = np.array([trial.envelopes[c.name][shown] for c in card.channels])
    angle = np.array([trial.angles[a][shown] for a in card.angles])
    own = np.asarray(trial.angles[trial.joint][shown], float)

    def run(of: EmgEstimatorCard) -> tuple[np.ndarray, np.ndarray]:
        torque, _, short_range, slope = of.build().run(time, emg, angle)
        return torque[0], np.array([short_range[0, 0], slope[0, 0]])

    torque, value = run(card)
    spread = np.array(covariance(fit))
    # What ended on a bound is known no better than of anybody.
    spread[fit.at_bound, fit.at_bound] = 1.0
    steps = np.maximum(LEAST_MOVED, np.sqrt(np.diag(spread)))
    slopes = np.array(
        [(run(_moved(card, fit, i, h))[1] - run(_moved(card, fit, i, -h))[1]) / (2.0 * h) for i, h in enumerate(steps)]
    )
    known = np.array([SHORT_RANGE_STIFFNESS_ERROR_SHARE, TENDON_SPREAD])
    apart = np.array(
        [
            (run(replace(card, **{name: (1.0 + h) * x}))[1] - run(replace(card, **{name: (1.0 - h) * x}))[1])
            / (2.0 * h)
            for name, x, h in (("gamma", card.gamma, known[0]), ("tendon_strain", card.tendon_strain, known[1]))
        ]
    )

    def error(by: np.ndarray, beside: np.ndarray) -> float | np.ndarray:
        return np.sqrt(np.einsum("p...,pq,q...->...", by, spread, by) + np.einsum("k...,k->...", beside**2, known**2))

    def mean(inside: np.ndarray) -> PostureStiffness:
        means = {kind: float(value[i, inside].mean()) for i, kind in enumerate(KINDS)}
        errors = {
            kind: float(error(slopes[:, i, inside].mean(axis=1), apart[:, i, inside].mean(axis=1)))
            for i, kind in enumerate(KINDS)
        }
        low, high = float(own[inside].min()), float(own[inside].max())
        return PostureStiffness(low, high, float(torque[inside].mean()), means, errors)

    order = np.argsort(own, kind="stable")
    return JointStiffness(
        trial.joint,
        trial.name,
        trial.time[shown] - trial.time[0],
        torque,
        dict(zip(KINDS, value, strict=True)),
        {kind: error(slopes[:, i], apart[:, i]) for i, kind in enumerate(KINDS)},
        mean(np.arange(len(own))),
        tuple(mean(np.sort(part)) for part in np.array_split(order, POSTURES)),
    )


def _moved(card: EmgEstimatorCard, fit: MuscleFit, i: int, by: float) -> EmgEstimatorCard:
    """The card with one parameter moved, as far as muscles can be made of it."""
    z = np.array(fit.z, float)
    z[i] += by
    values, count = fit.problem.values(z), len(fit.problem.priors)
    low, high = fit.problem.model.bounds
    values[:count] = np.clip(values[:count], np.minimum(low, 0.5 * np.abs(low)), high + np.abs(high))
    muscles = {m.name: m for m in fit.problem.model.with_values(values[:count])}
    made = tuple(
        replace(m, numbers=dict(zip(MUSCLE_QUANTITIES, map(float, muscles[m.name].vector()), strict=True)))
        for m in card.muscles
    )
    tissue = dict(zip(("offset", "stiffness", "damping"), map(float, values[count:]), strict=False))
    return replace(card, muscles=made, joints=(replace(card.joints[0], **tissue),))
