r"""Where gravity says that hanging is: the angle by which an encoder's zero is off.

A body that hangs at zero is turned by :math:`g\sin q`. With the encoder's zero elsewhere the angle is
:math:`q + \varphi`, and

.. math::  g\sin(q + \varphi) = g_s\sin q + g_c\cos q, \qquad \varphi = \operatorname{atan2}(g_c, g_s)

so that a fit which frees the cosine too gives :math:`\varphi` with its interval.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...models.joint import SYMBOLS_BY_NAME, JointModel
from ...signals.motion import Motion
from ..block_test import contest
from ..crossed_residuals import crossed_residuals
from ..regression import Stack, predicted
from ..uncertainty import sandwich
from .friction_solver import solve_family


@dataclass(frozen=True)
class AngleZero:
    """`angle` to be added to what the encoder says [rad] and its `standard_error`; `gravity` there, in the effort's
    unit; `p_value` of the model with a cosine predicting held-out effort no better, its error `before` and `after`."""

    angle: float
    standard_error: float
    gravity: float
    p_value: float
    before: float
    after: float


def has_weight(model: JointModel) -> bool:
    """Whether gravity is among what a `model` leaves free, so that it can tell where hanging is."""
    return "gravity" in model.names and not {"gravity", "gravity_cosine"} & set(model.known)


def with_free_zero(model: JointModel) -> JointModel:
    """The same family with both terms of gravity free."""
    free = tuple(SYMBOLS_BY_NAME[n] for n in ("gravity", "gravity_cosine"))
    rest = tuple(s for s in model.symbols if s not in free)
    return replace(model, symbols=(rest[0], *free, *rest[1:]))


def angle_zero(model: JointModel, data: Stack, held: Sequence[Motion]) -> AngleZero:
    """The encoder's zero by a fit of `model` to `data` with the cosine free, tested on `held` motions, or on blocks of
    `data` each predicted from the others where there are none."""
    free = with_free_zero(model)
    tied = replace(free, symbols=tuple(s for s in free.symbols if s.name != "gravity_cosine"))
    fits = {name: solve_family(each, data, consistent=False) for name, each in (("free", free), ("tied", tied))}
    found = fits["free"]
    at = [free.names.index(n) for n in ("gravity", "gravity_cosine")]
    sine, cosine = found.values[at]
    covariance = sandwich(found.jacobian, found.residual, data.lengths)[np.ix_(at, at)]
    size = float(np.hypot(sine, cosine))
    slope = np.array([-cosine, sine]) / size**2
    if held:
        residuals = {
            name: [m.rows(m.effort - e) for m, e in zip(held, predicted(each, fits[name].values, held), strict=True)]
            for name, each in (("free", free), ("tied", tied))
        }
    else:
        residuals = {name: crossed_residuals(fit, data.lengths) for name, fit in fits.items()}
    judged = contest(residuals)
    return AngleZero(
        angle=float(np.arctan2(cosine, sine)),
        standard_error=float(np.sqrt(max(slope @ covariance @ slope, 0.0))),
        gravity=size,
        p_value=judged.p_values["tied"] if judged.winner == "free" else 1.0,
        before=judged.errors["tied"],
        after=judged.errors["free"],
    )
