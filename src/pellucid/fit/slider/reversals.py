r"""Over what way friction builds up before a joint slips, from slow motions that turn round.

While a joint turns round, its friction goes from one level to the other over twice the travel, along the curve of
``presliding.hpp``, and everything else hardly changes:

.. math::
    \tau = c + g\,(q - q_t) + b\,\dot q + F_+ \max(s, 0) + F_- \min(s, 0),  \qquad  s = s(q;\,x_s)

with the turning point :math:`q_t`. Of each turn the travel :math:`x_s` that leaves least is sought; the rest is linear.
Their median is the travel: where a joint jumps as it breaks away, one turn says little.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ... import _core
from ...signals.filters import zero_phase_lowpass
from ..parameter import Parameter

LOWPASS = 15.0  # Hz: a joint that breaks away does so within a tenth of a second
BAND = 12e-3  # rad: of the motion on either side of a turn; the largest travel is less than half of it
LEAST, MOST, TRIED = 2e-5, 4.8e-3, 25  # rad: travels that are tried, from less than most encoders count
KEPT = 0.6  # of the band before a turn: by there every contact has been dragged along
FEWEST = 6  # turns, for an interval of the median at 95 %


def turns(position: np.ndarray) -> list[tuple[int, int, int]]:
    """Where a motion, shape (n,) [rad], turns round for more than the band: the sample that begins the band, the turn,
    and the sample that ends it. What comes before the first is left out: nobody knows how contacts were bent."""
    found, far, up = [], 0, None
    for k, here in enumerate(position):
        if up is None:
            if abs(here - position[0]) > BAND:
                far, up = k, here > position[0]
        elif (here > position[far]) == up:
            far = k
        elif abs(here - position[far]) > BAND:
            before = np.flatnonzero(np.abs(position[:far] - position[far]) > BAND)
            if len(before):
                found.append((int(before[-1]), far, k))
            far, up = k, not up
    return found[1:]


def travel_of_turn(position: np.ndarray, velocity: np.ndarray, effort: np.ndarray, turn: int) -> float:
    """The travel that explains one turn best [rad], of position, velocity and effort around it, each shape (n,), which
    begin where contacts are dragged along, and the turn's sample."""
    kept = (np.abs(position - position[turn]) < KEPT * BAND) | (np.arange(len(position)) > turn)
    plain = np.column_stack([np.ones(len(position)), position - position[turn], velocity])

    def left(travel: float) -> float:
        s = _core.presliding(travel, position)
        columns = np.column_stack([plain, np.maximum(s, 0.0), np.minimum(s, 0.0)])[kept]
        return float(np.sum((effort[kept] - columns @ np.linalg.lstsq(columns, effort[kept], rcond=None)[0]) ** 2))

    from scipy.optimize import minimize_scalar

    tried = np.geomspace(LEAST, MOST, TRIED)
    best = int(np.argmin([left(x) for x in tried]))
    ends = np.log(tried[[max(best - 1, 0), min(best + 1, TRIED - 1)]])
    return float(np.exp(minimize_scalar(lambda x: left(np.exp(x)), bounds=tuple(ends), method="bounded").x))


def presliding_travel(recorded: Sequence[tuple[np.ndarray, np.ndarray, float]]) -> Parameter | None:
    """The travel of slow reversals, each recording a position [rad], an effort, both shape (n,), and a rate [Hz]; None
    where they turn round too seldom."""
    found = []
    for position, effort, fs in recorded:
        thin = max(int(fs / (13.0 * LOWPASS)), 1)
        q, tau = (zero_phase_lowpass(x, LOWPASS, 2, fs)[::thin] for x in (position, effort))
        velocity = np.gradient(q) * (fs / thin)
        for first, turn, last in turns(q):
            part = slice(first, last)
            found.append(travel_of_turn(q[part], velocity[part], tau[part], turn - first))
    if len(found) < FEWEST:
        return None
    low, high = _median_interval(np.sort(found))
    value = float(np.median(found))
    # On a card an interval is symmetric: as wide as the wider half, so that no law takes the travel for smaller.
    error = max(high - value, value - low) / 1.959964
    return Parameter("presliding_travel", "rad", value, error, at_bound=value < 2.0 * LEAST)


def _median_interval(ordered: np.ndarray) -> tuple[float, float]:
    """The interval at 95 % that order alone gives a median."""
    from scipy.stats import binom

    n = len(ordered)
    k = int(binom.ppf(0.025, n, 0.5))
    return float(ordered[max(k - 1, 0)]), float(ordered[min(n - k, n - 1)])
