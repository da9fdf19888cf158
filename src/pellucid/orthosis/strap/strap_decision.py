"""What is held of one wearer's strap, decided once, so that no two verdicts can contradict each other.

Every verdict on a strap reads this object. A prediction is praised only if a model of the strap holds and none of its
parameters is rejected; two estimates are said to agree only beside the numbers that were compared.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...models.estimates import Parameter
from .coupled_impedance import CouplingFit
from .identified_strap import IdentifiedStrap

MIN_CEILING_SHARE = 0.8
"""A strap predicts well if it reaches this share of the fit that the IMU's error allows."""


@dataclass(frozen=True)
class StrapDecision:
    """Decisions about one strap."""

    holds: bool  # whether no neglected effect improves the model's prediction; a spring and damper alone count as held
    rejected: tuple[Parameter, ...]  # parameters of the spring and damper that were stopped at zero
    predicts: bool  # whether swings that were not fitted are predicted about as well as the IMU's error allows
    has_inertia: bool  # whether the spring and the damper seem to have an inertia
    sides_agree: bool | None  # whether spring and damper are alike from both bodies; None without the limb's

    @property
    def is_good(self) -> bool:
        """Whether the strap may be trusted: it holds, nothing of it is rejected, and it predicts."""
        return self.holds and not self.rejected and self.predicts


def decide_strap(
    fit: CouplingFit, other: CouplingFit | None, strap: IdentifiedStrap | None, *, reached: float, ceiling: float
) -> StrapDecision:
    """Decide what is held of a strap.

    `fit` and `other` are the spring and damper by the orthosis's and by the limb's balance. Of the mismatch in swings
    that were not fitted, `reached` is explained, and the IMU's error allows `ceiling` [%]; NaN where that is unknown.
    """
    low, high = fit.inertia.interval()
    agree = None
    if other is not None:
        apart = abs(other.stiffness.value - fit.stiffness.value)
        agree = bool(apart <= 1.96 * np.hypot(other.stiffness.standard_error, fit.stiffness.standard_error))
    return StrapDecision(
        holds=strap is None or strap.fits,
        rejected=tuple(p for p in (fit.stiffness, fit.damping) if p.at_bound),
        predicts=bool(reached > MIN_CEILING_SHARE * (ceiling if np.isfinite(ceiling) else 100.0)),
        has_inertia=not low <= 0.0 <= high,
        sides_agree=agree,
    )
