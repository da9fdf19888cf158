"""What anatomy says of muscles that one calibration frees across several joints: groups that are alike, one delay.

A group's muscles are strong or weak together in one person, so their strengths spread together; all muscles have one
shape of activation, one delay and, unless the data want more, one time constant. From an envelope to the force no more
than 100 ms pass and no fewer than 10: pure delay and two lags share them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...models.hill import FreeParameter, HillMuscle
from .muscle_freedom import FREEDOMS, Prior, muscle_priors

GROUPS: Mapping[str, tuple[str, ...]] = {
    "quadriceps": ("rectus_femoris", "vastus_intermedius", "vastus_lateralis", "vastus_medialis"),
    "hamstrings": ("biceps_femoris_long", "biceps_femoris_short", "semimembranosus", "semitendinosus"),
    "triceps_surae": ("gastrocnemius_lateralis", "gastrocnemius_medialis", "soleus"),
}
"""Muscles that do the same work; what is in none is alone."""

ALIKE = 0.7
"""Correlation among people of the strengths (in logarithms) of a group's muscles."""

SHORTEST, LONGEST = 0.01, 0.1
"""Of all that passes between an envelope and the force it stands for, pure delay and lags together [s]."""

LEAST_LAG = 0.005
"""Of either lag's time constant [s]."""

ROUNDING = 1e-6
"""Of a delay: its sum with lags is not to exceed the longest [s]."""

OFFSETS = (-0.15, 0.3)
"""How late or early a stream of EMG may be recorded, where that is to be found: positive where it runs ahead [s]."""

OFFSET_SPREAD = 0.1
"""Standard deviation about 0 of that [s]."""


@dataclass(frozen=True)
class Timing:
    """How the time from an envelope to the force is shared out."""

    longest_lag: float  # Time constant of either lag at most [s]; what two such lags leave of 100 ms is pure delay
    own: bool = False  # Whether each muscle has a time constant of its own
    offset: bool = False  # Whether the stream may have been recorded early or late

    def pure(self, period: float) -> float:
        """Longest pure delay [s], of samples every `period` [s]: no muscle's delay and lags exceed 100 ms."""
        pole = np.exp(-period / self.longest_lag)
        return LONGEST - 2.0 * period * float(pole / (1.0 - pole)) - ROUNDING

    @property
    def ahead(self) -> float:
        """How far envelopes are brought forward before they are delayed, so that a late stream is a short delay [s]."""
        return -OFFSETS[0] if self.offset else 0.0

    @property
    def words(self) -> str:
        """What it is, in a line."""
        return ("a time constant each" if self.own else "one time constant") + f" up to {1e3 * self.longest_lag:.0f} ms"


TIMINGS = tuple(Timing(longest, own) for own in (False, True) for longest in (0.025, 0.04))
"""What cross-validation within what is fitted chooses from, the simplest first."""

_OTHERS = ("strength", "tendon_slack_length", "optimal_fibre_length", "passive_scale", "shape")


def coupled_priors(
    muscles: Sequence[HillMuscle], timing: Timing, period: float
) -> tuple[tuple[Prior, ...], np.ndarray]:
    """Free parameters of muscles across joints with their priors, p of them, and the inverse of the correlations of
    their departures from anatomy, (p, p); samples come every `period` [s]."""
    names = tuple(m.name for m in muscles)
    priors = [*muscle_priors(muscles, _OTHERS), *_times(names, timing, period)]
    correlation = np.eye(len(priors))
    at = {p.free.muscles[0]: i for i, p in enumerate(priors) if p.free.quantity == "strength"}
    for group in GROUPS.values():
        own = [at[name] for name in group if name in at]
        correlation[np.ix_(own, own)] = ALIKE
    np.fill_diagonal(correlation, 1.0)
    return tuple(priors), np.linalg.inv(correlation)


def _times(names: tuple[str, ...], timing: Timing, period: float) -> list[Prior]:
    """Time constants and the delay."""
    most, spread = timing.longest_lag, FREEDOMS["time_constant"].spread
    of = [(f"time_constant.{name}", (name,)) for name in names] if timing.own else [("time_constant", names)]
    lags = [
        Prior(FreeParameter(name, "time_constant", driven, LEAST_LAG, most), 0.5 * (LEAST_LAG + most), spread)
        for name, driven in of
    ]
    first, last = SHORTEST, timing.pure(period)
    middle, spread = 0.5 * (first + last), FREEDOMS["delay"].spread
    if timing.offset:
        first, last, middle = 0.0, last + timing.ahead + OFFSETS[1], middle + timing.ahead
        spread = OFFSET_SPREAD
    return [*lags, Prior(FreeParameter("delay", "delay", names, first, last), middle, spread)]
