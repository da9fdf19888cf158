"""Choose how sharply the direction of motion is known, which decides where friction changes its sign.

At a reversal friction jumps, and with it the acceleration. A low-pass that suits the acceleration rounds that jump,
and moves the instant at which the filtered velocity is zero by several milliseconds. For as long, the regressor of dry
friction has the wrong sign, and inertia and friction take up the difference. A position that is filtered less turns
where the joint turned, as long as the encoder's noise and steps do not turn it more often. The recordings decide: a
sharper direction is used if it predicts stretches of the fitted recordings better.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..._errors import IdentificationError
from ...models.joint import JointModel
from ...numerics.motion import Motion, require_fitted, with_direction_share
from ...numerics.regression import stack
from .friction_solver import cross_validate_family, solve_family

DIRECTION_SHARES = (1.0, 2.0, 4.0, 8.0)
"""Cut-offs of the position that gives the direction, over that of the low-pass; the first is the low-pass itself."""

MAX_CUTOFF_SHARE = 0.4
"""Largest of these cut-offs, as a share of the sampling rate."""


@dataclass(frozen=True)
class DirectionChoice:
    """How sharply the direction of motion is known, and the errors that decided it."""

    share: float = 1.0  # cut-off of the position that gives the direction, over that of the low-pass
    errors: tuple[tuple[float, float], ...] = ()  # share and RMS error of the effort on left-out stretches


def choose_direction(model: JointModel, motions: Sequence[Motion], min_improvement: float) -> DirectionChoice:
    """Choose the direction of motion by the effort of fitted `motions`, with a `model` that is fast to solve.

    Of the cut-offs whose error the best one improves on by no more than the share `min_improvement` the lowest is
    chosen. Motions without a recorded position or a low-pass keep the sign of their velocity.
    """
    require_fitted(motions, "choose_direction")
    cutoffs = [m.filtering.lowpass for m in motions]
    if any(m.raw_position is None for m in motions) or not all(cutoffs):
        return DirectionChoice()
    most = min(MAX_CUTOFF_SHARE * m.fs / (m.filtering.lowpass or np.inf) for m in motions)
    errors = []
    for share in DIRECTION_SHARES:
        if share > 1.0 and share > most:
            break
        data = stack([with_direction_share(m, share) for m in motions])
        try:
            crossed = cross_validate_family(model, data, solve_family(model, data))
        except IdentificationError:
            return DirectionChoice()  # the fit that follows reports the error
        errors.append((share, float(np.sqrt(np.mean(np.square(np.concatenate(crossed)))))))
    smallest = min(error for _, error in errors)
    chosen = next(share for share, error in errors if smallest >= (1.0 - min_improvement) * error)
    return DirectionChoice(chosen, tuple(errors))
