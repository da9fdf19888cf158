r"""One group of parameters after the other, of several joints: holds, constant velocities, sweeps, then couplings.

A step-by-step identification isolates what is sought [1]_. While the other joints stay where they are, each joint is
held at angle after angle (gravity and what keeps it from moving), goes up and down at constant velocities (gravity
again, dry and viscous friction, by direction), and is swept (its inertia). What joints do to one another shows only
when several move: each pair is swept, one from slow to fast while the other goes from fast to slow, so that they meet
in every combination of directions.

.. [1] D. Verdel et al., "An identification-based method improving the transparency of a robotic upper limb
   exoskeleton", Robotica, 2021, section 3.3: 20 angles of 5 s each, five velocities of which the fastest is eleven
   times the slowest, ten slow movements each way, and eq. 5 for the sweep.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import combinations

import numpy as np

from ..._errors import PellucidError
from .excitation import trapezoid
from .tree_limits import TreeLimits


@dataclass(frozen=True)
class StepSettings:
    """How close to the limits steps go, and how they are tried."""

    limit_share: float = 0.95  # Steps use this share of each limit
    range_sample_count: int = 41  # Number of positions at which a joint's free range is checked
    max_check_rate_hz: float = 200.0  # Limits along a step are verified at most at this rate [Hz]
    vigour_factor: float = 0.85  # A step that exceeds a limit is tried again with its vigour multiplied by this factor
    max_tries: int = 20  # A step is left out after this many tries
    ease_duration_s: float = 2.0  # Time in which a sweep grows at its start and fades at its end [s]


STEP_SETTINGS = StepSettings()


@dataclass(frozen=True)
class Step:
    """One step of the protocol."""

    kind: str  # "hold", "constant", "slow", "sweep" or "coupling", in this order
    joints: tuple[int, ...]  # joints that move
    first: int  # first sample
    last: int  # sample after the last one


@dataclass(frozen=True, eq=False)
class StepByStep:
    """The whole protocol, from rest to rest."""

    rate: float  # sampling rate [Hz]
    position: np.ndarray  # (n, m) [rad; m]
    steps: tuple[Step, ...]
    left_out: tuple[str, ...]  # steps that exceed a limit at every vigour, with the limit

    @property
    def duration(self) -> float:
        """Duration of the protocol [s]."""
        return len(self.position) / self.rate


def step_by_step(
    limits: TreeLimits,
    rate: float,
    *,
    posture: Sequence[float] | None = None,
    angles: int = 20,
    hold: float = 5.0,
    velocities: int = 5,
    ratio: float = 11.0,
    slow: int = 10,
    sweep: float = 25.0,
    frequencies: tuple[float, float] = (1.0, 4.0),
) -> StepByStep:
    """Isolate each joint about a `posture`, then couple each pair.

    `rate` [Hz]; `posture` (m,) [rad; m], the middle of the ranges if not given; `angles` and `hold` [s] of each joint's
    holds; `velocities`, the fastest `ratio` times the slowest; `slow` movements each way at the slowest; `sweep` [s]
    from the first to the second of `frequencies` [rad/s].
    """
    count = len(limits.names)
    at = 0.5 * (limits.low + limits.high) if posture is None else np.array(posture, float)
    still = limits.passed(*(x[None, :] for x in (at, np.zeros(count), np.zeros(count))))
    if at.shape != (count,) or still is not None:
        raise PellucidError(
            f"step by step: found the posture {at.tolist()}: {still or 'wrong length'}, expected {count} angles within "
            "the limits"
        )
    pieces: list[np.ndarray] = [np.tile(at, (max(round(rate), 1), 1))]
    steps: list[Step] = []
    left_out: list[str] = []

    def add(kind: str, joints: tuple[int, ...], made: Callable[[float], np.ndarray]) -> None:
        """Append a step; `made` returns the joints' offsets from the posture, (n, joints), for a vigour of 0 to 1."""
        vigour, passed = 1.0, None
        for _ in range(STEP_SETTINGS.max_tries):
            path = np.tile(at, (len(moved := made(vigour)), 1))
            path[:, joints] += moved
            passed = _first_passed_limit(path, limits, rate)
            if passed is None:
                first = sum(map(len, pieces))
                pieces.append(path)
                steps.append(Step(kind, joints, first, first + len(path)))
                return
            vigour *= STEP_SETTINGS.vigour_factor
        left_out.append(f"{kind} of {' and '.join(limits.names[k] for k in joints)}: {passed}")

    ways = [_free_range(limits, at, k) for k in range(count)]
    for k in range(count):
        low, high = ways[k] - at[k]
        speed, change = (
            STEP_SETTINGS.limit_share * limits.velocity[k],
            STEP_SETTINGS.limit_share * limits.acceleration[k],
        )
        go = _JointTravel(rate, speed, change)
        places = np.linspace(low, high, angles) if angles else np.zeros(0)
        add("hold", (k,), partial(_visit, go, places, hold))
        speeds = np.geomspace(speed / ratio, speed, velocities)
        add("constant", (k,), partial(_move_up_and_down, go, low, high, speeds))
        slowest = np.full(slow, speed / ratio)
        add("slow", (k,), partial(_move_up_and_down, go, low, high, slowest))
        add("sweep", (k,), partial(_sweep_joints, limits, at, ways, (k,), rate, sweep, frequencies))
    for pair in combinations(range(count), 2):
        add("coupling", pair, partial(_sweep_joints, limits, at, ways, pair, rate, sweep, frequencies))
    pieces.append(np.tile(at, (max(round(rate), 1), 1)))
    return StepByStep(rate, np.concatenate(pieces), tuple(steps), tuple(left_out))


def _visit(travel: _JointTravel, places: np.ndarray, hold: float, vigour: float) -> np.ndarray:
    """Return offsets of a joint that is held at each of `places` [rad or m] for `hold` [s], all scaled by `vigour`."""
    return travel.at(vigour).visiting(vigour * places, hold)


def _move_up_and_down(travel: _JointTravel, low: float, high: float, speeds: np.ndarray, vigour: float) -> np.ndarray:
    """Return offsets of a joint that moves between `low` and `high` at each of `speeds`, all scaled by `vigour`."""
    return travel.at(vigour).up_and_down(vigour * low, vigour * high, vigour * speeds)


@dataclass(frozen=True)
class _JointTravel:
    """Moves of one joint from the posture and back, with trapezoidal velocity."""

    rate: float
    speed: float
    change: float

    def at(self, vigour: float) -> _JointTravel:
        return _JointTravel(self.rate, vigour * self.speed, vigour * self.change)

    def to(self, here: float, there: float, speed: float | None = None) -> np.ndarray:
        if abs(there - here) < 1e-9:
            return np.zeros(0)
        return here + trapezoid(there - here, speed or self.speed, self.change, self.rate)

    def visiting(self, places: np.ndarray, hold: float) -> np.ndarray:
        """Return a motion that visits each place in turn and holds it, (n, 1)."""
        made, here = [np.zeros(0)], 0.0
        for place in [*places, 0.0]:
            made += [self.to(here, place), np.full(round(hold * self.rate) if len(places) else 0, place)]
            here = place
        return np.concatenate(made)[:, None]

    def up_and_down(self, low: float, high: float, speeds: np.ndarray) -> np.ndarray:
        """Return a motion to the lower end, then up and down at each speed, resting 0.2 s at each turn; (n, 1)."""
        rest = round(0.2 * self.rate)
        made = [self.to(0.0, low)]
        for speed in speeds:
            for here, there in ((low, high), (high, low)):
                made += [np.full(rest, here), self.to(here, there, float(speed))]
        made += [np.full(rest, low), self.to(low, 0.0)]
        return np.concatenate(made)[:, None]


def _sweep_joints(
    limits: TreeLimits,
    at: np.ndarray,
    ways: list[np.ndarray],
    joints: tuple[int, ...],
    rate: float,
    duration: float,
    frequencies: tuple[float, float],
    vigour: float,
) -> np.ndarray:
    """Return swept sines about the posture, (n, joints): the first joint from slow to fast, the second reversed."""
    time = np.arange(round(duration * rate)) / rate
    slow, fast = frequencies
    ease = np.clip(np.minimum(time, time[-1] - time) / min(STEP_SETTINGS.ease_duration_s, 0.25 * duration), 0.0, 1.0)
    ease = ease**3 * (10.0 - 15.0 * ease + 6.0 * ease**2)
    made = []
    for i, k in enumerate(joints):
        first, last = (slow, fast) if i % 2 == 0 else (fast, slow)
        phase = (first + 0.5 * (last - first) * time / duration) * time
        room = min(at[k] - ways[k][0], ways[k][1] - at[k])
        size = min(room, limits.velocity[k] / fast, limits.acceleration[k] / fast**2)
        made.append(STEP_SETTINGS.limit_share * vigour * size * ease * np.sin(phase))
    return np.stack(made, axis=1)


def _free_range(limits: TreeLimits, at: np.ndarray, joint: int) -> np.ndarray:
    """Return the range in which a joint may rest while the others keep the posture, (2,)."""
    middle = 0.5 * (limits.low[joint] + limits.high[joint])
    half = 0.5 * STEP_SETTINGS.limit_share * (limits.high[joint] - limits.low[joint])
    ends = []
    for end in (min(middle - half, at[joint]), max(middle + half, at[joint])):
        places = np.tile(at, (STEP_SETTINGS.range_sample_count, 1))
        places[:, joint] = np.linspace(at[joint], end, STEP_SETTINGS.range_sample_count)
        free = (limits.slacks(places, np.zeros_like(places), np.zeros_like(places)) > 0.0).all(axis=1)
        blocked = np.flatnonzero(~free)
        last = blocked[0] - 1 if blocked.size else STEP_SETTINGS.range_sample_count - 1
        ends.append(places[max(last, 0), joint])
    return np.array(ends)


def _first_passed_limit(path: np.ndarray, limits: TreeLimits, rate: float) -> str | None:
    """Return the first limit that a path exceeds, from differences of its samples; None without one."""
    if len(path) < 3:
        return "no room to move"
    velocity = np.gradient(path, 1.0 / rate, axis=0)
    acceleration = np.gradient(velocity, 1.0 / rate, axis=0)
    every = max(1, int(rate / STEP_SETTINGS.max_check_rate_hz))
    return limits.passed(path[::every], velocity[::every], acceleration[::every])
