r"""Uncertainty of a joint's parameters from an undetected spring in parallel to the drive.

Over a small range of angles the effort of a spring, k q, is nearly that of gravity. Recordings then show only their
sum. The stiffness is estimated together with all friction that a family may lack, without samples near standstill, with
its standard error s. Where the model has no spring, a stiffness of N(0, \kappa^2) is expected of hoses, cables and
skin. With the estimate :math:`\hat k` its second moment is

.. math::
   E[k^2] = (w \hat k)^2 + w s^2, \qquad w = \frac{\kappa^2}{\kappa^2 + s^2}

It counts with the probability that a spring of this size would not have been found, times that there is one. Where the
model has a spring, the difference of its stiffness from :math:`\hat k` is in doubt instead. Parameters move by their
derivative by k.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...models.joint import PARALLEL_STIFFNESS, JointModel
from ...numerics.distributions import normal_share_below
from ...numerics.motion import Motion
from ...numerics.regression import Solution, Stack, column_norms, some_columns, triangular_factor
from .discrepancy import States
from .left_out_stretches import LeftOutStretches


@dataclass(frozen=True)
class SpringSettings:
    """Settings of the search for a spring in parallel to the drive, and of the uncertainty that it causes."""

    # Samples into which the filters carry speeds below this share of the root mean square speed are excluded: the
    # errors of friction near standstill lie where a spring is stretched most.
    slow_speed_share: float = 0.15
    # Usual stiffness as a share of gravity per radian: hoses and cables of exoskeletons had 2 to 13 %.
    usual_gravity_share: float = 0.08
    # Probability, before anything is recorded, that there is a spring. Chosen by judgement: as likely as none.
    usual_probability: float = 0.5
    # A spring beside gravity is found if it saves this share of the squared error on left-out stretches; on plain
    # joints of MuJoCo and Pinocchio none saved more than 0.02. Where no gravity is estimated that a spring could
    # falsify, it must save as much as any richer model (`MIN_IMPROVEMENT`).
    min_saved_share: float = 0.03
    # A spring that all neglected effects together could also make is found if it alone saves this share. Joints without
    # one stay below 0.07 with a low p value; limbs in an orthosis with springs of 4 to 8 N*m/rad reached 0.68 and more.
    min_needed_share: float = 0.5
    # A spring of this many standard errors, or more if that saves less, is found in one of two recordings.
    found_standard_errors: float = 3.0


SPRING_SETTINGS = SpringSettings()

SPRING_CAUSE = "a parallel spring"
"""Cause that is reported if a spring in parallel to the drive adds most to a parameter's interval."""


@dataclass(frozen=True)
class SpringDoubt:
    """Uncertainty of the other parameters from an undetected spring in parallel to the drive."""

    stiffness: float  # standard deviation of the stiffness that is in doubt, in the unit of the stiffness
    covariance: np.ndarray  # what it adds to the parameters' covariance, (p, p)


def find_spring_doubt(model: JointModel, data: Stack[Motion], found: Solution, states: States) -> SpringDoubt | None:
    """Return what a spring leaves open of a solution of a `model`; None where no spring can be taken for gravity."""
    names = model.names
    if "gravity" not in names or PARALLEL_STIFFNESS in model.known:
        return None
    gravity = abs(float(found.values[names.index("gravity")]))
    stretches = LeftOutStretches(model, data, found.values, states, SPRING_SETTINGS.slow_speed_share, found)
    told = stretches.spring()
    del stretches  # its regressors are large
    if told is None:
        return None
    estimate, error, independent = told
    has_spring = PARALLEL_STIFFNESS in names
    if has_spring:
        moment = (estimate - float(found.values[names.index(PARALLEL_STIFFNESS)])) ** 2
    else:
        moment = _hidden_moment(estimate, error, SPRING_SETTINGS.usual_gravity_share * gravity, independent)
    free = column_norms(found.jacobian) > 0.0
    if has_spring:
        free[names.index(PARALLEL_STIFFNESS)] = False
    slope = np.zeros(len(names))
    factor = triangular_factor(some_columns(found.jacobian, free), states.position)
    slope[free] = -np.linalg.lstsq(factor[:, :-1], factor[:, -1], rcond=None)[0]
    if has_spring:
        slope[names.index(PARALLEL_STIFFNESS)] = 1.0
    return SpringDoubt(float(np.sqrt(moment)), moment * np.outer(slope, slope))


def _hidden_moment(estimate: float, error: float, usual: float, independent: float) -> float:
    """Return the second moment of the stiffness of a spring that was not found, by so many `independent` samples."""
    weight = usual**2 / (usual**2 + error**2)
    least = max(SPRING_SETTINGS.found_standard_errors, np.sqrt(SPRING_SETTINGS.min_saved_share * independent))
    missed = normal_share_below(least - usual / max(error, np.finfo(float).tiny))
    return SPRING_SETTINGS.usual_probability * missed * ((weight * estimate) ** 2 + weight * error**2)
