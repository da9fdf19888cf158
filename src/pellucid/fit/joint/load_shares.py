r"""Whether recordings tell the share of the load that is lost in motoring from the share that is lost in generating.

With :math:`\alpha` the mean of both shares and :math:`\delta` half their difference, a joint of load y takes

.. math::  \tau = (1 + \delta)\,y + \alpha\,|y|\,\mathrm{sign}\,\dot q + \dots

A joint whose inertia and gravity are unknown hides :math:`\delta`: it scales both alike. A payload of known mass is a
part of y that does not scale, so that recordings with different payloads tell :math:`\delta`. They tell it only where
the drive's constant is known: an unknown constant scales every effort, as :math:`1 + \delta` does.

Neither share is negative, so :math:`|\delta| \le \alpha` holds without any payload. Both shares are free parameters
where the payloads tell :math:`\delta` better than that.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ..._errors import IdentificationError
from ...models.joint import JointModel
from ..discrepancy import SPLIT, TIED, discrepancy_of
from ..parameter import Parameter
from ..regression import Solution, Stack
from ..uncertainty import correlation_time, sandwich
from .friction_solver import solve_family
from .joint_estimate import JointEstimate, joint_states

SHARES = ("load_motoring", "load_generating")


@dataclass(frozen=True)
class LoadShares:
    """Whether load friction has one coefficient for each direction of power, and, if it has not, why."""

    separate: bool
    why: Literal["", "no known load", "unknown drive", "same payload", "small payload"] = ""


def load_shares(model: JointModel, data: Stack) -> LoadShares:
    """Whether the payloads of `data` tell the two shares apart of a `model` that has them both free."""
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
    at = [model.names.index(name) for name in SHARES]
    mean = float(np.mean(found.values[at]))
    if not _half_difference_error(model, data, found, at) < SPLIT * mean:
        return LoadShares(False, "small payload")
    return LoadShares(True)


def with_unknown_shares(constant: Parameter, estimate: JointEstimate) -> Parameter:
    r"""The `constant` of a drive that payloads gave, its error widened for two shares that may differ.

    The payloads give the constant over :math:`1 + \delta`; an `estimate` with load friction says how large
    :math:`\delta` may be.
    """
    if TIED not in estimate:
        return constant
    error = np.hypot(constant.standard_error, SPLIT * estimate[TIED].value * constant.value)
    return replace(constant, standard_error=float(error))


def _half_difference_error(model: JointModel, data: Stack, found: Solution, at: list[int]) -> float:
    """Standard error of half the difference of the two shares, which are `at` these parameters."""
    memory = correlation_time(found.residual, data.lengths)
    covariance = sandwich(found.jacobian, found.residual, data.lengths, memory=memory)
    states = joint_states(model, data, found.values)
    beside = discrepancy_of(model.names, found.values, found.jacobian, found.residual, states, covariance)
    total = (covariance + beside.covariance)[np.ix_(at, at)]
    half_difference = np.array([0.5, -0.5])
    return float(np.sqrt(half_difference @ total @ half_difference))
