"""How much gain and delay a worn orthosis's loop bears, to the number: gain and delay margins of a law, and the worst.

The base distribution asks only whether a loop bears the margins wanted (`pellucid.controllers.stability.bears`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pellucid.controllers.coupling import Coupling
from pellucid.controllers.residual_compensator import ResidualDesign, first_failing
from pellucid.controllers.stability import LinearSystem, closed_loop, radius, sampled, worn_orthosis


@dataclass(frozen=True)
class Margins:
    """What a loop bears."""

    stable: bool  # Whether the loop is stable as it is; the margins are 0 where it is not
    gain_db: float  # Largest factor on the command [dB]; infinite where none up to 40 dB destabilises
    delay: float  # Largest added dead time [s]; infinite where none up to the search's end destabilises
    radius: float  # Largest magnitude of the closed loop's eigenvalues [1]


def margins(
    coupling: Coupling,
    controller: LinearSystem,
    period: float,
    *,
    speed: float = 1.0,
    most_delay: float = 0.1,
) -> Margins:
    """Gain and delay margin of a controller on a worn orthosis, from the closed loop's eigenvalues. `period` [s];
    `speed` [rad/s]; `most_delay` [s]."""
    worn = worn_orthosis(coupling, speed)
    plant = LinearSystem(
        worn.a, worn.b[:, :1], worn.c[:2], worn.d[:2, :1]
    )  # from the torque wanted to encoder and spring
    held = sampled(plant, period, coupling.delay)
    own = radius(closed_loop(held, controller))
    if own >= 1:
        return Margins(False, 0.0, 0.0, own)

    def unstable_gain(decibel: float) -> bool:
        return radius(closed_loop(held, controller, 10 ** (decibel / 20))) >= 1

    def unstable_delay(delay: float) -> bool:
        return radius(closed_loop(sampled(plant, period, coupling.delay + delay), controller)) >= 1

    gain = _first(unstable_gain, np.arange(0, 40.1, 1.0))
    delay = _first(unstable_delay, np.arange(0, most_delay + 1e-9, 0.004))
    return Margins(True, gain, delay, own)


def design_margins(
    made: ResidualDesign, plant: Coupling | None = None, speed: float = 1.0, trust: float = 1.0
) -> Margins:
    """Gain and delay margin of a design, at one speed of the friction. `speed` [rad/s]."""
    plant = plant or made.coupling
    return margins(plant, made.linear(speed, trust), made.period, speed=speed)


def worst_margins(
    made: ResidualDesign, plants: Sequence[Coupling], speeds: Sequence[float] = (0.1, 0.5, 1.5, 4.0)
) -> Margins:
    """The smallest margins over plants that differ from the one designed for, and over speeds. `speeds` [rad/s]."""
    return worst([design_margins(made, p, s, trust) for p in plants for s in speeds for trust in (0.0, 1.0)])


def worst(found: Sequence[Margins]) -> Margins:
    """The smallest of several margins."""
    return Margins(
        all(f.stable for f in found),
        min(f.gain_db for f in found),
        min(f.delay for f in found),
        max(f.radius for f in found),
    )


def bears_all(
    made: ResidualDesign,
    plants: Sequence[Coupling],
    *,
    gain_db: float,
    delay: float,
    speeds: Sequence[float] = (0.1, 0.5, 1.5, 4.0),
) -> bool:
    """Whether margins hold on every plant, at every speed, with and without EMG. `gain_db`, `delay` [dB], [s];
    `speeds` [rad/s]."""
    cases = [(plant, speed, trust) for speed in speeds for trust in (0.0, 1.0) for plant in plants]
    return first_failing(made, cases, gain_db=gain_db, delay=delay) is None


def crossings(omega: np.ndarray, response: np.ndarray) -> tuple[float, float]:
    """Gain and delay margin read off an open loop's frequency response, for a loop that is stable as it is. `omega`
    (n,) [rad/s]; `response` (n,); gives `gain`, `delay` [s]."""
    phase = np.unwrap(np.angle(response))
    size = np.log(np.abs(response))
    gain = delay = np.inf
    turn = (phase + np.pi) / (2 * np.pi)  # a whole number where L is on the negative real axis
    for i in np.flatnonzero(np.floor(turn[1:]) != np.floor(turn[:-1])):
        whole = max(np.floor(turn[i]), np.floor(turn[i + 1]))
        share = (whole - turn[i]) / (turn[i + 1] - turn[i])
        factor = np.exp(-(size[i] + share * (size[i + 1] - size[i])))
        if factor > 1:
            gain = min(gain, factor)
    for i in np.flatnonzero(np.sign(size[1:]) != np.sign(size[:-1])):
        share = -size[i] / (size[i + 1] - size[i])
        at = omega[i] + share * (omega[i + 1] - omega[i])
        left = (phase[i] + share * (phase[i + 1] - phase[i]) + np.pi) % (2 * np.pi)
        delay = min(delay, left / at)
    return float(gain), float(delay)


def _first(fails: Callable[[float], bool], grid: np.ndarray) -> float:
    """Where a condition first holds along a grid, by bisection; infinite where it never does."""
    for low, high in pairwise(grid):
        if fails(high):
            while high - low > 1e-4 * max(high, 1e-3):
                middle = (low + high) / 2
                low, high = (low, middle) if fails(middle) else (middle, high)
            return float(low)
    return float("inf")
