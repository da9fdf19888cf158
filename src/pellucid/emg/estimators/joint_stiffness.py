r"""Stiffness of a joint along a movement, from calibrated muscles, with its standard error.

.. math::
   K_{jk} = -\frac{\partial \tau_j}{\partial q_k} = \sum_m \left(\frac{\partial l_m}{\partial q_j}
   \frac{\partial l_m}{\partial q_k} k_m + \frac{\partial^2 l_m}{\partial q_j \partial q_k} F_m\right) + k_{tissue}

A muscle's k is either its short-range stiffness or the slope of the model's own force. Short-range stiffness is the
immediate stiffness of attached cross-bridges, in series with the tendon [1]_ [2]_. Both come from the core that is
stepped live (``include/pellucid/muscle_stiffness.hpp``). The standard error covers the calibration's covariance and the
variation among muscles and tendons. It does not cover errors of the model itself.

.. [1] P. M. H. Rack, D. R. Westbury, "The short range stiffness of active mammalian muscle and its effect on mechanical
   properties", J. Physiol. 240, 1974.
.. [2] L. Cui, E. J. Perreault, H. Maas, T. G. Sandercock, "Modeling short-range stiffness of feline lower hindlimb
   muscles", J. Biomech. 41, 2008.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ..fit.muscle_calibration import PASSIVE_TISSUE_PARAMETERS, MuscleFit
from ..fit.muscle_posterior import covariance
from ..models.emg_estimator import SHORT_RANGE, EmgEstimatorCard
from ..models.hill import MUSCLE_QUANTITIES
from .torque_trial import TorqueTrial


@dataclass(frozen=True)
class StiffnessSettings:
    """How stiffness and its standard error are computed.

    No measurement is recorded for what is chosen by judgement.
    """

    # Standard error of a tendon's strain under F_0, as a share of the strain. Tendons of one leg differ by as much.
    strain_error_share: float = 0.3
    # Number of postures into which a movement is divided, from its smallest angle to its largest, of equal time. Chosen
    # by judgement.
    posture_count: int = 4
    max_sample_count: int = 3000  # Largest number of samples of a movement that are used. Chosen by judgement.
    # Smallest step of a parameter in the derivative of stiffness, in standard deviations among people. The step is the
    # parameter's standard error if that is larger. The derivative then includes muscles that only begin to pull within
    # the error.
    min_step: float = 0.05


STIFFNESS_STEPS = StiffnessSettings()


STIFFNESS_KINDS = ("short_range", "slope")
"""Kinds of stiffness: short-range stiffness, and the slope of the Hill model's force."""


@dataclass(frozen=True)
class PostureStiffness:
    """Mean stiffness over a range of angles."""

    low: float  # Smallest angle [rad]
    high: float  # Largest angle [rad]
    torque: float  # Mean torque of the muscles [N m]
    value: Mapping[str, float]  # Mean stiffness by `STIFFNESS_KINDS` [N m/rad]
    error: Mapping[str, float]  # Standard errors by `STIFFNESS_KINDS` [N m/rad]


@dataclass(frozen=True, eq=False)
class JointStiffness:
    """Stiffness of a joint along a movement."""

    joint: str
    recording: str
    time: np.ndarray  # Time, shape (n,) [s]
    torque: np.ndarray  # Torque of the muscles, shape (n,) [N m]
    value: Mapping[str, np.ndarray]  # Stiffness by `STIFFNESS_KINDS`, shape (n,) [N m/rad]
    error: Mapping[str, np.ndarray]  # Standard errors by `STIFFNESS_KINDS`, shape (n,) [N m/rad]
    whole: PostureStiffness  # Mean over the whole movement
    postures: tuple[PostureStiffness, ...]  # Means by posture, from the smallest angle to the largest


def joint_stiffness(card: EmgEstimatorCard, fit: MuscleFit, trial: TorqueTrial) -> JointStiffness:
    """Compute the stiffness along a trial from the muscles of a one-joint card and the fit that they come from."""
    shown = slice(0, STIFFNESS_STEPS.max_sample_count)
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
    # A parameter that ended on a bound keeps the standard deviation among people.
    spread[fit.at_bound, fit.at_bound] = 1.0
    steps = np.maximum(STIFFNESS_STEPS.min_step, np.sqrt(np.diag(spread)))
    slopes = np.array(
        [
            (run(_move_parameter(card, fit, i, h))[1] - run(_move_parameter(card, fit, i, -h))[1]) / (2.0 * h)
            for i, h in enumerate(steps)
        ]
    )
    known = np.array([SHORT_RANGE.error_share, STIFFNESS_STEPS.strain_error_share])
    apart = np.array(
        [
            (run(replace(card, **{name: (1.0 + h) * x}))[1] - run(replace(card, **{name: (1.0 - h) * x}))[1])
            / (2.0 * h)
            for name, x, h in (("gamma", card.gamma, known[0]), ("tendon_strain", card.tendon_strain, known[1]))
        ]
    )

    def error(by: np.ndarray, beside: np.ndarray) -> np.ndarray:
        variance = np.einsum("p...,pq,q...->...", by, spread, by) + np.einsum("k...,k->...", beside**2, known**2)
        return np.asarray(np.sqrt(variance))

    def mean(inside: np.ndarray) -> PostureStiffness:
        means = {kind: float(value[i, inside].mean()) for i, kind in enumerate(STIFFNESS_KINDS)}
        errors = {
            kind: float(error(slopes[:, i, inside].mean(axis=1), apart[:, i, inside].mean(axis=1)))
            for i, kind in enumerate(STIFFNESS_KINDS)
        }
        low, high = float(own[inside].min()), float(own[inside].max())
        return PostureStiffness(low, high, float(torque[inside].mean()), means, errors)

    order = np.argsort(own, kind="stable")
    return JointStiffness(
        trial.joint,
        trial.name,
        trial.time[shown] - trial.time[0],
        torque,
        dict(zip(STIFFNESS_KINDS, value, strict=True)),
        {kind: error(slopes[:, i], apart[:, i]) for i, kind in enumerate(STIFFNESS_KINDS)},
        mean(np.arange(len(own))),
        tuple(mean(np.sort(part)) for part in np.array_split(order, STIFFNESS_STEPS.posture_count)),
    )


def _move_parameter(card: EmgEstimatorCard, fit: MuscleFit, i: int, by: float) -> EmgEstimatorCard:
    """Return the card with parameter `i` moved `by` some standard deviations, clipped to values that muscles allow."""
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
    joint = card.joints[0]
    if fit.problem.passive:
        offset, stiffness, damping = map(float, values[count : count + len(PASSIVE_TISSUE_PARAMETERS)])
        joint = replace(joint, offset=offset, stiffness=stiffness, damping=damping)
    return replace(card, muscles=made, joints=(joint,))
