r"""Evidence that a motion is that of a spring with a locked end, and not that of a joint.

The effort of a spring follows its deflection, :math:`\tau = k q`. Over small angles the weight of a joint does the
same, :math:`\tau = m g l q`. The two differ in their inertia: a weight at the lever l has at least
:math:`J = m l^2`, so that :math:`l \le J g / k` whatever the units of angle and effort are. A weight whose inertia
allows no useful lever is a spring.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .uncertainty import correlation_length

GRAVITY = 9.80665
"""Standard acceleration of free fall [m/s^2]."""

MIN_LEVER_M = 0.01
"""A weight whose inertia allows no longer lever than this is none [m]: it is most likely a spring."""

USUAL_LEVER_M = 0.05
"""The motion shows inertia if that of the weight at this lever [m] would exceed what is left unexplained."""

MIN_EXCESS = 3.0
"""It must do so by this factor (RMS)."""

MAX_SPRING_UNEXPLAINED_SHARE = 0.1
"""A spring explains the effort if it leaves at most this share of its variance."""

STANDARD_ERRORS = 1.96
"""Half the width of an interval in standard errors."""


@dataclass(frozen=True)
class SpringEvidence:
    """What a motion shows of a spring, in the units of its position and effort."""

    stiffness: float  # slope of the effort over the position
    unexplained_share: float  # share of the effort's variance that spring, friction and inertia leave
    longest_lever: float  # longest lever that the inertia allows a weight of this slope [m]; inf if it does not show
    travel: float  # range of the position without its outermost samples

    @property
    def follows(self) -> bool:
        """Whether the effort follows the position as a spring's does; a weight may do so, too."""
        return self.stiffness > 0.0 and self.unexplained_share <= MAX_SPRING_UNEXPLAINED_SHARE

    @property
    def is_no_weight(self) -> bool:
        """Whether the effort follows the position, and the inertia allows no lever at which a weight could hang."""
        return self.follows and self.longest_lever < MIN_LEVER_M


def spring_evidence(
    position: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray, effort: np.ndarray
) -> SpringEvidence | None:
    """Return the evidence of low-passed samples, each (n,); None if too few are known or nothing moves."""
    known = np.isfinite(position) & np.isfinite(velocity) & np.isfinite(acceleration) & np.isfinite(effort)
    q, v, a, y = (x[known] for x in (position, velocity, acceleration, effort))
    if len(q) < 50 or np.ptp(q) == 0.0 or np.ptp(y) == 0.0:
        return None
    low, high = np.percentile(q, (0.5, 99.5))
    columns = np.column_stack([q - q.mean(), a, v, np.sign(v), np.ones(len(q))])
    scale = np.maximum(np.linalg.norm(columns, axis=0), np.finfo(float).tiny)
    unit = columns / scale
    values = np.linalg.lstsq(unit, y, rcond=1e-10)[0] / scale
    left = y - columns @ values
    power = float(left @ left)
    share = power / float(np.sum((y - y.mean()) ** 2))
    variance = power / len(q) * correlation_length(left) * np.diag(np.linalg.pinv(unit.T @ unit)) / scale**2
    stiffness, inertia = float(values[0]), float(values[1])
    lever = np.inf
    if stiffness > 0.0:
        usual = USUAL_LEVER_M * stiffness / GRAVITY * float(np.linalg.norm(a))
        if usual > MIN_EXCESS * np.sqrt(power):
            most = inertia + STANDARD_ERRORS * float(np.sqrt(max(variance[1], 0.0)))
            lever = max(most, 0.0) * GRAVITY / stiffness
    return SpringEvidence(stiffness, share, float(lever), float(high - low))
