"""Choose what decides on the sign of friction: the filtered velocity, a sharper direction of motion, or a travel.

At a reversal friction jumps, and with it the acceleration. A low-pass that suits the acceleration rounds that jump,
and moves the instant at which the filtered velocity is zero by several milliseconds. For as long, the regressor of dry
friction has the wrong sign, and inertia and friction take up the difference. A position that is filtered less turns
where the joint turned, as long as the encoder's noise and steps do not turn it more often. The recordings decide: a
sharper direction is used if it predicts stretches of the fitted recordings better.

Contacts that bend before they slip let friction build up over a travel instead (`presliding.py`). With a sign that
jumps, viscous friction, Coulomb friction and weight take up the difference. A travel is used on the same condition. Its
value and interval that are reported are estimated apart.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..._errors import IdentificationError
from ...models.joint import JointModel
from ...numerics.motion import Motion, require_fitted, with_friction_direction
from ...numerics.regression import Stack, stack
from .friction_solver import cross_validated_residuals, solve_family
from .presliding import PRESLIDING_SEARCH, position_resolution

DIRECTION_SHARES = (1.0, 2.0, 4.0, 8.0)
"""Cut-offs of the position that gives the direction, over that of the low-pass; the first is the low-pass itself."""

MAX_CUTOFF_SHARE = 0.4
"""Largest of these cut-offs, as a share of the sampling rate."""

TRAVEL_COUNT = 8
"""Number of travels that are tried."""

MAX_TRAVEL_RANGE_SHARE = 0.02
"""Largest travel that is tried, as a share of the range of motion."""

MIN_TRAVEL_RANGE_SHARE = 1e-4
"""Smallest travel that is tried, as a share of the range of motion; and at least two steps of the encoder."""


@dataclass(frozen=True)
class DirectionChoice:
    """What decides on the sign of friction, and the errors by which it was chosen."""

    share: float = 1.0  # cut-off of the position that gives the direction, over that of the low-pass
    travel: float = 0.0  # travel over which friction builds up after a turn [rad or m]; 0: at once
    # share, travel and RMS error of the effort on left-out stretches of each candidate, the simplest first
    errors: tuple[tuple[float, float, float], ...] = ()

    def apply(self, motion: Motion) -> Motion:
        """Return the motion with this direction of friction."""
        return with_friction_direction(motion, self.share, self.travel) if self.errors else motion


def choose_direction(
    models: Sequence[JointModel], motions: Sequence[Motion], min_improvement: float
) -> DirectionChoice:
    """Choose what decides on the sign of friction, by the effort of fitted `motions`.

    Each candidate has the error of the best of some `models` that are fast to solve. Where friction grows with the
    load, a model without load friction misses more than a direction can save. Of the candidates whose error the best
    one improves on by no more than the share `min_improvement` the simplest is chosen: the sign of the velocity, a
    sharper direction, a travel. Motions without a recorded position or a low-pass keep the sign of their velocity.
    """
    require_fitted(motions, "choose_direction")
    if any(m.raw_position is None or not m.filtering.lowpass for m in motions):
        return DirectionChoice()
    most = min(MAX_CUTOFF_SHARE * m.fs / (m.filtering.lowpass or np.inf) for m in motions)
    shares = [share for share in DIRECTION_SHARES if share <= max(most, 1.0)]
    span = max(float(np.ptp(m.position[m.inner])) for m in motions)
    least = max(MIN_TRAVEL_RANGE_SHARE * span, PRESLIDING_SEARCH.min_encoder_steps * position_resolution(motions))
    farthest = MAX_TRAVEL_RANGE_SHARE * span
    travels = np.geomspace(least, farthest, TRAVEL_COUNT).tolist() if least < farthest else []
    tried = [(share, 0.0) for share in shares] + [(min(4.0, shares[-1]), travel) for travel in travels]
    errors, targets = [], stack(motions).targets
    for share, travel in tried:
        data = Stack(tuple(with_friction_direction(m, share, travel) for m in motions), targets)
        try:
            crossed = [cross_validated_residuals(solve_family(model, data), data.lengths) for model in models]
        except IdentificationError:
            return DirectionChoice()  # the fit that follows reports the error
        errors.append((share, travel, min(float(np.sqrt(np.mean(np.concatenate(each) ** 2))) for each in crossed)))
    smallest = min(error for *_, error in errors)
    share, travel = next((s, t) for s, t, error in errors if smallest >= (1.0 - min_improvement) * error)
    if travel:  # every travel is as simple as another
        travel = min((error, t) for _, t, error in errors if t)[1]
    return DirectionChoice(share, travel, tuple(errors))
