r"""Decide whether recordings separate the share of the load lost in motoring from the share lost in generating.

With :math:`\alpha` the mean of both shares and :math:`\delta` half their difference, a joint with load y needs

.. math::  \tau = (1 + \delta)\,y + \alpha\,|y|\,\mathrm{sign}\,\dot q + \dots

If inertia and gravity are unknown, :math:`\delta` is not identifiable, because it scales both equally. A payload of
known mass contributes a known part of y, so recordings with different payloads identify :math:`\delta`. The drive
constant must be known too: an unknown constant scales every effort, as :math:`1 + \delta` does.

Neither share is negative, so :math:`|\delta| \le \alpha` holds without any payload. Both shares become free parameters
if the payloads determine :math:`\delta` more tightly than that.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ..._errors import IdentificationError
from ...models.estimates import Parameter
from ...models.friction_terms import SEPARATE_LOAD_FEATURE, TERMS
from ...models.joint import JointModel
from ...numerics.motion import Motion
from ...numerics.regression import Solution, Stack
from ...numerics.uncertainty import correlation_time, sandwich_covariance
from .discrepancy import COMMON_LOAD_COEFFICIENT, LOAD_SHARE_SPREAD_RATIO, estimate_discrepancy
from .friction_solver import solve_family
from .joint_estimate import JointEstimate, joint_states

LOAD_SHARE_NAMES = tuple(term.name for term in TERMS if term.feature == SEPARATE_LOAD_FEATURE)
"""Names of the two load coefficients: the shares of the load lost in motoring and in generating."""


@dataclass(frozen=True)
class LoadShares:
    """Decision on whether load friction has a separate coefficient for each direction of power."""

    separate: bool
    why: Literal["", "no known load", "unknown drive", "same payload", "small payload"] = ""  # reason if not separate


def decide_load_shares(model: JointModel, data: Stack[Motion]) -> LoadShares:
    """Decide whether the payloads of `data` separate the two shares of a `model` in which both are free."""
    payloads = {motion.payload for motion in data.motions}
    if not any(mass for mass, _ in payloads):
        return LoadShares(False, "no known load")
    if model.effort_unit not in ("N*m", "N"):
        return LoadShares(False, "unknown drive")
    if len(payloads) < 2:
        return LoadShares(False, "same payload")
    try:
        found = solve_family(model, data)
    except IdentificationError:
        return LoadShares(False, "small payload")
    at = [model.names.index(name) for name in LOAD_SHARE_NAMES]
    mean = float(np.mean(found.values[at]))
    if not _half_difference_error(model, data, found, at) < LOAD_SHARE_SPREAD_RATIO * mean:
        return LoadShares(False, "small payload")
    return LoadShares(True)


def widen_for_unknown_shares(constant: Parameter, estimate: JointEstimate) -> Parameter:
    r"""Widen the error of a drive `constant` from payloads, because the two load shares may differ.

    The payloads determine the constant divided by :math:`1 + \delta`. An `estimate` with load friction limits
    :math:`\delta`.
    """
    if COMMON_LOAD_COEFFICIENT not in estimate:
        return constant
    error = np.hypot(
        constant.standard_error, LOAD_SHARE_SPREAD_RATIO * estimate[COMMON_LOAD_COEFFICIENT].value * constant.value
    )
    return replace(constant, standard_error=float(error))


def _half_difference_error(model: JointModel, data: Stack[Motion], found: Solution, at: list[int]) -> float:
    """Return the standard error of half the difference of the two shares, whose indices are `at`."""
    memory = correlation_time(found.residual, data.lengths)
    covariance = sandwich_covariance(found.jacobian, found.residual, data.lengths, memory=memory)
    states = joint_states(model, data, found.values)
    beside = estimate_discrepancy(model.names, found.values, found.jacobian, found.residual, states, covariance)
    total = (covariance + beside.covariance)[np.ix_(at, at)]
    half_difference = np.array([0.5, -0.5])
    return float(np.sqrt(half_difference @ total @ half_difference))
