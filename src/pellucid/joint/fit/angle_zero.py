r"""Zero error of an encoder, estimated from gravity.

A body that hangs at zero is turned by :math:`g\sin q`. With the encoder's zero elsewhere the angle is
:math:`q + \varphi`, and

.. math::  g\sin(q + \varphi) = g_s\sin q + g_c\cos q, \qquad \varphi = \operatorname{atan2}(g_c, g_s)

so that a fit with both terms free gives :math:`\varphi` with its interval.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...models.joint import SYMBOLS_BY_NAME, JointModel
from ...numerics.block_test import compare_held_out
from ...numerics.motion import Motion
from ...numerics.regression import Stack
from ...numerics.uncertainty import sandwich_covariance
from .friction_solver import cross_validated_residuals, solve_family


@dataclass(frozen=True)
class AngleZero:
    """Zero error of an encoder, with a test on left-out blocks."""

    angle: float  # angle to add to the encoder's reading [rad]
    standard_error: float  # standard error of `angle` [rad]
    gravity: float  # amplitude of gravity with the corrected zero, in the effort's unit
    p_value: float  # p value of the hypothesis that the corrected zero predicts effort no better
    before: float  # RMS effort error with the recorded zero
    after: float  # RMS effort error with the corrected zero


def has_free_gravity(model: JointModel) -> bool:
    """Return whether gravity is a free parameter of `model`, so that the zero can be estimated."""
    return "gravity" in model.names and not {"gravity", "gravity_cosine"} & set(model.known)


def with_free_zero(model: JointModel) -> JointModel:
    """Return the model with both terms of gravity free."""
    free = tuple(SYMBOLS_BY_NAME[n] for n in ("gravity", "gravity_cosine"))
    rest = tuple(s for s in model.symbols if s not in free)
    return replace(model, symbols=(rest[0], *free, *rest[1:]))


def estimate_angle_zero(model: JointModel, data: Stack[Motion]) -> AngleZero:
    """Estimate the encoder's zero error by fitting `model` to `data` with both terms of gravity free.

    The correction is tested on blocks of `data` that are predicted from the others.
    """
    free = with_free_zero(model)
    tied = replace(free, symbols=tuple(s for s in free.symbols if s.name != "gravity_cosine"))
    fits = {name: solve_family(each, data, consistent=False) for name, each in (("free", free), ("tied", tied))}
    found = fits["free"]
    at = [free.names.index(n) for n in ("gravity", "gravity_cosine")]
    sine, cosine = found.values[at]
    covariance = sandwich_covariance(found.jacobian, found.residual, data.lengths)[np.ix_(at, at)]
    size = float(np.hypot(sine, cosine))
    slope = np.array([-cosine, sine]) / size**2
    judged = compare_held_out({name: cross_validated_residuals(fit, data.lengths) for name, fit in fits.items()})
    return AngleZero(
        angle=float(np.arctan2(cosine, sine)),
        standard_error=float(np.sqrt(max(slope @ covariance @ slope, 0.0))),
        gravity=size,
        p_value=judged.p_values["tied"] if judged.winner == "free" else 1.0,
        before=judged.errors["tied"],
        after=judged.errors["free"],
    )
