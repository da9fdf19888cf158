r"""The drive constant from recordings with known payloads.

A payload of mass m at distance l adds a known effort :math:`\tau_p`. In the drive's own unit u (ampere or volt)

.. math::  u = W \beta' + \tau_p / k

so that 1/k is one more coefficient of the regression, with its interval. It needs recordings whose payloads differ:
otherwise :math:`\tau_p` is proportional to columns of W.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..._errors import IdentificationError
from ...models.joint import GRAVITY, JointModel
from ...signals.motion import Motion
from ..parameter import Parameter
from ..regression import Stack, linearised
from ..uncertainty import sandwich


def payload_effort(motion: Motion, rotary: bool) -> np.ndarray:
    """Effort that a known payload takes, shape (n,): m l^2 a + m g l sin q (rotary) or m a (prismatic) [N*m or N]."""
    mass, distance = motion.payload
    if rotary:
        return mass * distance * (distance * motion.acceleration + GRAVITY * np.sin(motion.position))
    return mass * motion.acceleration


def drive_constant(model: JointModel, data: Stack) -> Parameter:
    """Effort per ampere or volt, from known payloads. Gives [N*m/A, N*m/V, N/A or N/V]."""
    if len({m.payload for m in data.motions}) < 2:
        raise IdentificationError(
            "the drive constant needs recordings with at least two different payloads (none counts as one); "
            f"found {data.motions[0].payload[0]:g} kg in all"
        )
    model = replace(model, payload_scale=0.0)
    zero = np.zeros(len(model.symbols))
    efforts, regressors = linearised(model, zero, data.motions)
    known = data.reduced([payload_effort(m, model.motion == "rotary") for m in data.motions])
    w = np.column_stack([data.reduced(regressors), known])
    norms = np.linalg.norm(w, axis=0)
    if np.linalg.cond(w / norms) > 1e6:
        raise IdentificationError("the payload's effort cannot be told from the joint's own in these recordings")
    target = data.target - data.reduced(efforts)
    values = np.linalg.lstsq(w, target, rcond=None)[0]
    covariance = sandwich(w, target - w @ values, data.lengths)
    inverse, sd = values[-1], float(np.sqrt(covariance[-1, -1]))
    if not inverse > 3.0 * sd:
        raise IdentificationError(
            f"the payload's effect on the drive is {inverse:.3g} +- {sd:.2g} {model.effort_unit} per unit of effort: "
            "too small or of the wrong sign; check the payload's mass and the sign of the drive's channel"
        )
    unit = f"{'N*m' if model.motion == 'rotary' else 'N'}/{model.effort_unit}"
    return Parameter("drive_constant", unit, float(1.0 / inverse), float(sd / inverse**2))
