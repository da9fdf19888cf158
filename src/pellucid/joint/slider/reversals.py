r"""Estimate the presliding travel, over which friction builds up before a joint slips, from slow reversals.

While a joint reverses, its friction changes from one level to the other over twice the travel, along the curve of
``presliding.hpp``. All other terms hardly change:

.. math::
    \tau = c + g\,(q - q_t) + b\,\dot q + F_+ \max(s, 0) + F_- \min(s, 0),  \qquad  s = s(q;\,x_s)

with the turning point :math:`q_t`. For each reversal the travel :math:`x_s` with the smallest residual is searched; the
other parameters are linear. The estimate is the median over reversals, because a joint that jumps as it breaks away
makes single reversals unreliable.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ... import _core
from ...models.parameter import Parameter
from ...numerics.filters import zero_phase_lowpass

LOWPASS_HZ = 15.0
"""Cut-off of the low-pass on position and effort. A joint breaks away within a tenth of a second."""

TURN_BAND_RAD = 12e-3
"""Range of motion on either side of a reversal that is used. The largest travel is less than half of it."""

MIN_TRAVEL_RAD = 2e-5
"""Smallest travel that is tried, below the resolution of most encoders."""

MAX_TRAVEL_RAD = 4.8e-3
"""Largest travel that is tried."""

TRAVEL_CANDIDATE_COUNT = 25
"""Number of travels that are tried before the search is refined."""

KEPT_BAND_SHARE = 0.6
"""Last share of the band before a reversal that is fitted. Before it, some contacts are not yet dragged along."""

MIN_TURN_COUNT = 6
"""Smallest number of reversals, from which the median has a 95 % interval."""


def find_turns(position: np.ndarray) -> list[tuple[int, int, int]]:
    """Find the reversals of a motion, shape (n,) [rad], that move by more than the band on either side.

    Each is given by three samples: start of the band, turning point, end of the band. The first reversal is excluded,
    because the deflection of the contacts before it is unknown.
    """
    found, far, up = [], 0, None
    for k, here in enumerate(position):
        if up is None:
            if abs(here - position[0]) > TURN_BAND_RAD:
                far, up = k, here > position[0]
        elif (here > position[far]) == up:
            far = k
        elif abs(here - position[far]) > TURN_BAND_RAD:
            before = np.flatnonzero(np.abs(position[:far] - position[far]) > TURN_BAND_RAD)
            if len(before):
                found.append((int(before[-1]), far, k))
            far, up = k, not up
    return found[1:]


def travel_of_turn(position: np.ndarray, velocity: np.ndarray, effort: np.ndarray, turn: int) -> float:
    """Return the travel that explains one reversal best [rad].

    `position`, `velocity` and `effort`, each of shape (n,), are the samples around it, and `turn` is its sample.
    """
    kept = (np.abs(position - position[turn]) < KEPT_BAND_SHARE * TURN_BAND_RAD) | (np.arange(len(position)) > turn)
    plain = np.column_stack([np.ones(len(position)), position - position[turn], velocity])

    def left(travel: float) -> float:
        s = _core.presliding(travel, position)
        columns = np.column_stack([plain, np.maximum(s, 0.0), np.minimum(s, 0.0)])[kept]
        return float(np.sum((effort[kept] - columns @ np.linalg.lstsq(columns, effort[kept], rcond=None)[0]) ** 2))

    from scipy.optimize import minimize_scalar

    tried = np.geomspace(MIN_TRAVEL_RAD, MAX_TRAVEL_RAD, TRAVEL_CANDIDATE_COUNT)
    best = int(np.argmin([left(x) for x in tried]))
    ends = np.log(tried[[max(best - 1, 0), min(best + 1, TRAVEL_CANDIDATE_COUNT - 1)]])
    return float(np.exp(minimize_scalar(lambda x: left(np.exp(x)), bounds=tuple(ends), method="bounded").x))


def presliding_travel(recorded: Sequence[tuple[np.ndarray, np.ndarray, float]]) -> Parameter | None:
    """Estimate the presliding travel from slow reversals; None if there are too few of them.

    Each recording is a position [rad] and an effort, both of shape (n,), with their rate [Hz].
    """
    found = []
    for position, effort, fs in recorded:
        thin = max(int(fs / (13.0 * LOWPASS_HZ)), 1)
        q, tau = (zero_phase_lowpass(x, LOWPASS_HZ, 2, fs)[::thin] for x in (position, effort))
        velocity = np.gradient(q) * (fs / thin)
        for first, turn, last in find_turns(q):
            part = slice(first, last)
            found.append(travel_of_turn(q[part], velocity[part], tau[part], turn - first))
    if len(found) < MIN_TURN_COUNT:
        return None
    low, high = _median_interval(np.sort(found))
    value = float(np.median(found))
    # A card's interval is symmetric. The wider half of the interval is used, so that no law underestimates the travel.
    error = max(high - value, value - low) / 1.959964
    return Parameter("presliding_travel", "rad", value, error, at_bound=value < 2.0 * MIN_TRAVEL_RAD)


def _median_interval(ordered: np.ndarray) -> tuple[float, float]:
    """Return the distribution-free 95 % interval of the median of `ordered`, from order statistics."""
    from scipy.stats import binom

    n = len(ordered)
    k = int(binom.ppf(0.025, n, 0.5))
    return float(ordered[max(k - 1, 0)]), float(ordered[min(n - k, n - 1)])
