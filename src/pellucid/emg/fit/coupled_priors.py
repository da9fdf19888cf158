"""Anatomical priors of muscles that are calibrated across several joints: correlated strengths and a common delay.

The muscles of a functional group are strong or weak together, so their strengths are correlated among people. All
muscles share one shape of activation, one delay and, unless cross-validation prefers more, one time constant. The time
from an envelope to the force lies between 10 and 100 ms; it is the sum of a pure delay and two first-order lags.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..models.hill import FreeParameter, HillMuscle
from .muscle_calibration import QUANTITY_FREEDOMS, Prior, muscle_priors

MUSCLE_GROUPS: Mapping[str, tuple[str, ...]] = {
    "quadriceps": ("rectus_femoris", "vastus_intermedius", "vastus_lateralis", "vastus_medialis"),
    "hamstrings": ("biceps_femoris_long", "biceps_femoris_short", "semimembranosus", "semitendinosus"),
    "triceps_surae": ("gastrocnemius_lateralis", "gastrocnemius_medialis", "soleus"),
}
"""Functional groups of muscles. A muscle in no group is uncorrelated with the others."""

GROUP_STRENGTH_CORRELATION = 0.7
"""Correlation among people between the logarithms of the strengths of a group's muscles."""


@dataclass(frozen=True)
class DelayBounds:
    """Bounds of the time from an envelope to the force, and its prior."""

    min_total_s: float = 0.01  # Shortest time from an envelope to the force, pure delay and lags together
    max_total_s: float = 0.1  # Longest time from an envelope to the force, pure delay and lags together
    min_lag_s: float = 0.005  # Smallest time constant of either lag
    # Margin for rounding, by which the longest pure delay stays below `max_total_s` minus the lags
    rounding_s: float = 1e-6
    # Bounds of the clock offset of an EMG stream, where it is estimated; positive where the stream is early
    offset_bounds_s: tuple[float, float] = (-0.15, 0.3)
    offset_spread_s: float = 0.1  # Prior standard deviation of that offset around 0


DELAYS = DelayBounds()


@dataclass(frozen=True)
class Timing:
    """How the time from an envelope to the force is divided into lags and a pure delay."""

    longest_lag: float  # largest time constant of either lag [s]; the pure delay takes the remainder of 100 ms
    own: bool = False  # whether each muscle has its own time constant
    offset: bool = False  # whether the clock offset of the EMG stream is estimated

    def pure(self, period: float) -> float:
        """Return the longest pure delay [s] for a sampling `period` [s], so that delay and lags stay below 100 ms."""
        pole = np.exp(-period / self.longest_lag)
        return DELAYS.max_total_s - 2.0 * period * float(pole / (1.0 - pole)) - DELAYS.rounding_s

    @property
    def ahead(self) -> float:
        """Time by which envelopes are advanced before they are delayed, so that a late stream has a short delay [s]."""
        return -DELAYS.offset_bounds_s[0] if self.offset else 0.0

    @property
    def words(self) -> str:
        """The timing as a noun phrase."""
        return ("a time constant each" if self.own else "one time constant") + f" up to {1e3 * self.longest_lag:.0f} ms"


TIMING_CANDIDATES = tuple(Timing(longest, own) for own in (False, True) for longest in (0.025, 0.04))
"""Candidates from which cross-validation within the fitted data chooses, the simplest first."""

_PRIOR_QUANTITIES_WITHOUT_TIMING = ("strength", "tendon_slack_length", "optimal_fibre_length", "passive_scale", "shape")


def coupled_priors(
    muscles: Sequence[HillMuscle], timing: Timing, period: float
) -> tuple[tuple[Prior, ...], np.ndarray]:
    """Return the p free parameters of muscles across joints with their priors, and the inverse correlation matrix.

    The matrix, shape (p, p), is that of the deviations from anatomy. `period` is the sampling period [s].
    """
    names = tuple(m.name for m in muscles)
    priors = [*muscle_priors(muscles, _PRIOR_QUANTITIES_WITHOUT_TIMING), *_timing_priors(names, timing, period)]
    correlation = np.eye(len(priors))
    at = {p.free.muscles[0]: i for i, p in enumerate(priors) if p.free.quantity == "strength"}
    for group in MUSCLE_GROUPS.values():
        own = [at[name] for name in group if name in at]
        correlation[np.ix_(own, own)] = GROUP_STRENGTH_CORRELATION
    np.fill_diagonal(correlation, 1.0)
    return tuple(priors), np.linalg.inv(correlation)


def _timing_priors(names: tuple[str, ...], timing: Timing, period: float) -> list[Prior]:
    """Return the priors of the time constants and of the delay."""
    most, spread = timing.longest_lag, QUANTITY_FREEDOMS["time_constant"].spread
    of = [(f"time_constant.{name}", (name,)) for name in names] if timing.own else [("time_constant", names)]
    lags = [
        Prior(
            FreeParameter(name, "time_constant", driven, DELAYS.min_lag_s, most),
            0.5 * (DELAYS.min_lag_s + most),
            spread,
        )
        for name, driven in of
    ]
    first, last = DELAYS.min_total_s, timing.pure(period)
    middle, spread = 0.5 * (first + last), QUANTITY_FREEDOMS["delay"].spread
    if timing.offset:
        first, last, middle = 0.0, last + timing.ahead + DELAYS.offset_bounds_s[1], middle + timing.ahead
        spread = DELAYS.offset_spread_s
    return [*lags, Prior(FreeParameter("delay", "delay", names, first, last), middle, spread)]
