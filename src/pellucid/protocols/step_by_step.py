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
from itertools import combinations

import numpy as np

from .._errors import PellucidError
from .excitation import trapezoid
from .tree_limits import TreeLimits

KINDS = ("hold", "constant", "slow", "sweep", "coupling")

_RESERVE = 0.95  # of each limit
_STATES = 41  # places at which a joint's way is looked at
_CHECKED = 200.0  # Hz, at most, at which limits are verified along a step
_WEAKER = 0.85  # of a step's vigour, after it passed a limit
_TRIES = 20
_EASE = 2.0  # s, in which a sweep grows and fades


@dataclass(frozen=True)
class Step:
    """Part of the protocol."""

    kind: str  # one of KINDS
    joints: tuple[int, ...]  # that move
    first: int  # samples, the last one left out
    last: int


@dataclass(frozen=True, eq=False)
class StepByStep:
    """The whole, from one rest to the next."""

    rate: float  # Hz
    position: np.ndarray  # (n, m) [rad; m]
    steps: tuple[Step, ...]
    left_out: tuple[str, ...]  # Steps that no vigour lets pass, and why

    @property
    def duration(self) -> float:
        """[s]."""
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
        raise PellucidError(f"step by step: the posture {at.tolist()} is not allowed: {still or 'wrong length'}")
    pieces: list[np.ndarray] = [np.tile(at, (max(round(rate), 1), 1))]
    steps: list[Step] = []
    left_out: list[str] = []

    def add(kind: str, joints: tuple[int, ...], made: Callable[[float], np.ndarray]) -> None:
        """`made` gives how far the joints are from the posture, (n, joints), with a vigour of 0 to 1."""
        vigour, passed = 1.0, None
        for _ in range(_TRIES):
            path = np.tile(at, (len(moved := made(vigour)), 1))
            path[:, joints] += moved
            passed = _passed(path, limits, rate)
            if passed is None:
                first = sum(map(len, pieces))
                pieces.append(path)
                steps.append(Step(kind, joints, first, first + len(path)))
                return
            vigour *= _WEAKER
        left_out.append(f"{kind} of {' and '.join(limits.names[k] for k in joints)}: {passed}")

    ways = [_way(limits, at, k) for k in range(count)]
    for k in range(count):
        low, high = ways[k] - at[k]
        speed, change = _RESERVE * limits.velocity[k], _RESERVE * limits.acceleration[k]
        go = _Going(rate, speed, change)
        places = np.linspace(low, high, angles) if angles else np.zeros(0)
        add("hold", (k,), lambda w, go=go, places=places: go.at(w).visiting(w * places, hold))
        speeds = np.geomspace(speed / ratio, speed, velocities)
        add("constant", (k,), lambda w, go=go, a=low, b=high, s=speeds: go.at(w).up_and_down(w * a, w * b, w * s))
        slowest = np.full(slow, speed / ratio)
        add("slow", (k,), lambda w, go=go, a=low, b=high, s=slowest: go.at(w).up_and_down(w * a, w * b, w * s))
        add("sweep", (k,), lambda w, k=k: _swept(limits, at, ways, (k,), rate, sweep, frequencies, w))
    for pair in combinations(range(count), 2):
        add("coupling", pair, lambda w, p=pair: _swept(limits, at, ways, p, rate, sweep, frequencies, w))
    pieces.append(np.tile(at, (max(round(rate), 1), 1)))
    return StepByStep(rate, np.concatenate(pieces), tuple(steps), tuple(left_out))


@dataclass(frozen=True)
class _Going:
    """Ways of one joint, from where it is to where it is, in trapezoids of velocity."""

    rate: float
    speed: float
    change: float

    def at(self, vigour: float) -> _Going:
        return _Going(self.rate, vigour * self.speed, vigour * self.change)

    def to(self, here: float, there: float, speed: float | None = None) -> np.ndarray:
        if abs(there - here) < 1e-9:
            return np.zeros(0)
        return here + trapezoid(there - here, speed or self.speed, self.change, self.rate)

    def visiting(self, places: np.ndarray, hold: float) -> np.ndarray:
        """Each place in turn, held there; gives (n, 1)."""
        made, here = [np.zeros(0)], 0.0
        for place in [*places, 0.0]:
            made += [self.to(here, place), np.full(round(hold * self.rate) if len(places) else 0, place)]
            here = place
        return np.concatenate(made)[:, None]

    def up_and_down(self, low: float, high: float, speeds: np.ndarray) -> np.ndarray:
        """To the lower end, then up and down at each speed, a fifth of a second of rest at each turn; (n, 1)."""
        rest = round(0.2 * self.rate)
        made = [self.to(0.0, low)]
        for speed in speeds:
            for here, there in ((low, high), (high, low)):
                made += [np.full(rest, here), self.to(here, there, float(speed))]
        made += [np.full(rest, low), self.to(low, 0.0)]
        return np.concatenate(made)[:, None]


def _swept(
    limits: TreeLimits,
    at: np.ndarray,
    ways: list[np.ndarray],
    joints: tuple[int, ...],
    rate: float,
    duration: float,
    frequencies: tuple[float, float],
    vigour: float,
) -> np.ndarray:
    """Sines about the posture, the first joint's ever faster, the second's ever slower, (n, joints)."""
    time = np.arange(round(duration * rate)) / rate
    slow, fast = frequencies
    ease = np.clip(np.minimum(time, time[-1] - time) / min(_EASE, 0.25 * duration), 0.0, 1.0)
    ease = ease**3 * (10.0 - 15.0 * ease + 6.0 * ease**2)
    made = []
    for i, k in enumerate(joints):
        first, last = (slow, fast) if i % 2 == 0 else (fast, slow)
        phase = (first + 0.5 * (last - first) * time / duration) * time
        room = min(at[k] - ways[k][0], ways[k][1] - at[k])
        size = min(room, limits.velocity[k] / fast, limits.acceleration[k] / fast**2)
        made.append(_RESERVE * vigour * size * ease * np.sin(phase))
    return np.stack(made, axis=1)


def _way(limits: TreeLimits, at: np.ndarray, joint: int) -> np.ndarray:
    """Between which places a joint may rest, the others in the posture, (2,)."""
    middle = 0.5 * (limits.low[joint] + limits.high[joint])
    half = 0.5 * _RESERVE * (limits.high[joint] - limits.low[joint])
    ends = []
    for end in (min(middle - half, at[joint]), max(middle + half, at[joint])):
        places = np.tile(at, (_STATES, 1))
        places[:, joint] = np.linspace(at[joint], end, _STATES)
        free = (limits.slacks(places, np.zeros_like(places), np.zeros_like(places)) > 0.0).all(axis=1)
        blocked = np.flatnonzero(~free)
        last = blocked[0] - 1 if blocked.size else _STATES - 1
        ends.append(places[max(last, 0), joint])
    return np.array(ends)


def _passed(path: np.ndarray, limits: TreeLimits, rate: float) -> str | None:
    """What a path passes, by differences of its samples."""
    if len(path) < 3:
        return "no room to move"
    velocity = np.gradient(path, 1.0 / rate, axis=0)
    acceleration = np.gradient(velocity, 1.0 / rate, axis=0)
    every = max(1, int(rate / _CHECKED))
    return limits.passed(path[::every], velocity[::every], acceleration[::every])
