r"""How much gain and delay the loop of a worn robot of several joints bears, and how far it is from passive.

Margins are asked of one joint with the others' loops closed, and of all together, on the linear loop of
`pellucid.controllers.tree_stability`. Beside them stands what needs no limb: how much damping a person must bring
before any limb that is itself passive can be held without ringing [1]_ (the robot's passivity, that of its impedance).

For one joint the margins are what `pellucid_lab.knee.loop_margins` says, and a test holds them to that.

.. [1] J. E. Colgate, J. M. Brown, "Factors affecting the Z-width of a haptic display", Proc. IEEE ICRA, 1994.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from pellucid import _core
from pellucid._errors import PellucidError
from pellucid.controllers.stability import LinearSystem, radius
from pellucid.controllers.tree_stability import (
    DRAWN_LIMBS,
    Limb,
    TreeCoupling,
    closed_tree,
    sampled_each,
    with_limb,
    worn_tree,
)

from ..knee.loop_margins import crossings

MOST_GAIN = 40.0
"""The search for a gain margin ends at this gain [dB]."""

_FREQUENCY_POINT_COUNT = 800
"""Number of frequencies at which a loop's response is computed."""


@dataclass(frozen=True, eq=False)
class TreeMargins:
    """Stability margins of a loop of m joints: 0 if the loop is unstable, infinite if the search found no limit."""

    stable: bool
    radius: float  # largest magnitude of the closed loop's eigenvalues [1]
    gain_db: np.ndarray  # (m,) gain margin of one joint with the others' loops closed [dB]
    delay: np.ndarray  # (m,) delay margin of one joint with the others' loops closed [s]
    gain_together_db: float  # gain margin of all commands together [dB]
    delay_together: float  # delay margin of all commands together [s]


@dataclass(frozen=True)
class Passivity:
    """Shortage of passivity at a robot's joints for any wearer."""

    below: float  # Frequency up to which it is passive [Hz]; infinite where everywhere below the search's end
    shortage: float  # Damping that a person must bring at every joint for any passive limb to be safe [N m s/rad]


def tree_margins(
    coupling: TreeCoupling,
    controller: LinearSystem,
    period: float,
    *,
    speed: float = 1.0,
    most_delay: float = 0.1,
) -> TreeMargins:
    """Gain and delay margins of a law, joint by joint and together. `controller` from encoders (m,), or from encoders,
    drives and cuffs too, to efforts wanted (m,); `period`, `most_delay` [s]; `speed` [rad/s]."""
    m = coupling.joints
    plant = _seen(coupling, controller, speed)
    late = np.full(m, coupling.delay)
    held = sampled_each(plant, period, late)
    own = radius(closed_tree(held, controller))
    if own >= 1.0:
        return TreeMargins(False, own, np.zeros(m), np.zeros(m), 0.0, 0.0)
    omega = np.geomspace(1e-2, 0.999 * np.pi / period, _FREQUENCY_POINT_COUNT)
    loop = _response(held, omega, period)
    law = _response(controller, omega, period)
    loop = law @ loop  # (points, m, m); 1 - L = 0 is the verge
    gains, delays = np.empty(m), np.empty(m)
    for k in range(m):
        others = [j for j in range(m) if j != k]
        alone = -_opened(loop, k, others)
        gains[k], delays[k] = _exact(held, plant, controller, period, late, (k,), crossings(omega, alone), most_delay)
    every = [crossings(omega, -one) for one in _loci(loop)]
    seen = (min(g for g, _ in every), min(d for _, d in every))
    together = _exact(held, plant, controller, period, late, tuple(range(m)), seen, most_delay)
    return TreeMargins(True, own, gains, delays, *together)


def passivity(
    coupling: TreeCoupling, controller: LinearSystem, period: float, *, speed: float = 1.0, highest: float = 50.0
) -> Passivity:
    """Return the shortage of passivity of a controlled robot at its joints, up to the frequency `highest` [Hz].

    No person moves it faster. Aliases of the hold are excluded. `period` [s]; `speed` [rad/s].
    """
    m = coupling.joints
    free = replace(coupling, cuff_stiffness=np.zeros((m, m)), cuff_damping=np.zeros((m, m)))
    plant = worn_tree(free, speed)
    kept = [i for i in range(len(plant.a)) if not 2 * m <= i < 4 * m]  # without the limb
    port = np.zeros((len(plant.a), m))
    inverse = np.linalg.inv(free.mass)
    port[m : 2 * m] = inverse
    port[5 * m : 6 * m] = -np.diag(free.drive_frequency**2 * free.drive_inertia) @ inverse
    a, b = plant.a[np.ix_(kept, kept)], np.hstack([plant.b[:, :m], port])[kept]
    c = plant.c[: 2 * m, kept]
    omega = np.geomspace(2.0 * np.pi * 0.05, min(2.0 * np.pi * highest, 0.9 * np.pi / period), 600)
    law = _response(controller, omega, period)
    short, below = 0.0, np.inf
    for w, linear in zip(omega, law, strict=True):
        s = 1j * w
        moved = c @ np.linalg.solve(s * np.eye(len(a)) - a, b)
        hold = (1.0 - np.exp(-s * period)) / (s * period) * np.exp(-s * coupling.delay)
        inputs = controller.b.shape[1]
        by_effort, by_port = moved[:, :m] * hold, moved[:, m:]
        felt = linear[:, : min(inputs, 2 * m)] @ by_port[: min(inputs, 2 * m)]
        if inputs == 3 * m:
            felt = felt + linear[:, 2 * m :]
        wanted = np.linalg.solve(np.eye(m) - linear[:, : min(inputs, 2 * m)] @ by_effort[: min(inputs, 2 * m)], felt)
        admittance = s * (by_port[:m] + by_effort[:m] @ wanted)
        impedance = np.linalg.inv(admittance)
        least = float(np.linalg.eigvalsh(0.5 * (impedance + impedance.conj().T))[0])
        if least < -1e-9:
            below = min(below, w / (2.0 * np.pi))
            short = max(short, -least)
    return Passivity(float(below), short)


def at_joints(
    tree: _core.KinematicTree, posture: np.ndarray, cuffs: Sequence[tuple[int, Sequence[float], Sequence[float]]]
) -> np.ndarray:
    """What cuffs' springs, or dampers, are at the joints, (m, m): J' K J summed. `cuffs`: link from 0, point of it [m],
    three of translation and three of rotation in the link's axes [N/m; N m/rad]."""
    posture = np.ascontiguousarray(posture, float)
    placements = tree.placements(posture)
    made = np.zeros((len(posture), len(posture)))
    for link, point, stiffness in cuffs:
        turn = placements[link][:, :3]
        jacobian = tree.jacobian(posture, link, np.asarray(point, float))
        for rows, three in ((jacobian[:3], stiffness[:3]), (jacobian[3:], stiffness[3:])):
            own = turn.T @ rows
            made += own.T @ np.diag(np.asarray(three, float)) @ own
    return made


@dataclass(frozen=True)
class MarginRow:
    """A row of the table of margins: one posture with one limb."""

    posture: str
    limb: str
    margins: TreeMargins


def margins_over(
    couplings: Mapping[str, TreeCoupling],
    controllers: Mapping[str, LinearSystem],
    period: float,
    *,
    limbs: Sequence[Limb] = DRAWN_LIMBS,
    speed: float = 1.0,
) -> Iterator[MarginRow]:
    """Yield the margins of a law at each posture, by name, with each limb; `period` [s], `speed` [rad/s]."""
    for name, coupling in couplings.items():
        for limb in limbs:
            made = tree_margins(with_limb(coupling, limb), controllers[name], period, speed=speed)
            yield MarginRow(name, limb.name, made)


def least_margins(rows: Sequence[MarginRow]) -> TreeMargins:
    """The least of each over postures and limbs."""
    found = [row.margins for row in rows]
    return TreeMargins(
        all(one.stable for one in found),
        max(one.radius for one in found),
        np.min([one.gain_db for one in found], axis=0),
        np.min([one.delay for one in found], axis=0),
        min(one.gain_together_db for one in found),
        min(one.delay_together for one in found),
    )


def _seen(coupling: TreeCoupling, controller: LinearSystem, speed: float) -> LinearSystem:
    """From efforts wanted to what a controller reads."""
    m, inputs = coupling.joints, controller.b.shape[1]
    if inputs not in (m, 2 * m, 3 * m) or controller.d.shape[0] != m:
        raise PellucidError(
            f"controller: found {inputs} inputs and {controller.d.shape[0]} outputs, expected {m}, {2 * m} or {3 * m} "
            f"(encoders; drives too; cuffs too) and {m}"
        )
    plant = worn_tree(coupling, speed)
    return LinearSystem(plant.a, plant.b[:, :m], plant.c[:inputs], plant.d[:inputs, :m])


def _response(system: LinearSystem, omega: np.ndarray, period: float) -> np.ndarray:
    """(n, p, m)."""
    z = np.exp(1j * np.asarray(omega) * period)
    if not len(system.a):
        return np.broadcast_to(system.d, (len(z), *system.d.shape)).astype(complex)
    return system.c @ np.linalg.solve(z[:, None, None] * np.eye(len(system.a)) - system.a, system.b) + system.d


def _opened(loop: np.ndarray, joint: int, others: list[int]) -> np.ndarray:
    """The loop of one joint with the others closed, (n,): what comes back of what is put in there."""
    here = loop[:, joint, joint]
    if not others:
        return here
    row, column = loop[:, joint, others], loop[:, others, joint]
    rest = np.eye(len(others)) - loop[:, others][:, :, others]
    return here + np.einsum("ni,ni->n", row, np.linalg.solve(rest, column[..., None])[..., 0])


def _loci(loop: np.ndarray) -> np.ndarray:
    """Eigenvalues of a loop, each followed from one frequency to the next, (m, n)."""
    from scipy.optimize import linear_sum_assignment

    found = np.linalg.eigvals(loop)
    for i in range(1, len(found)):
        found[i] = found[i][linear_sum_assignment(np.abs(found[i - 1][:, None] - found[i][None]))[1]]
    return found.T


def _exact(
    held: LinearSystem,
    plant: LinearSystem,
    controller: LinearSystem,
    period: float,
    late: np.ndarray,
    joints: tuple[int, ...],
    seen: tuple[float, float],
    most_delay: float,
) -> tuple[float, float]:
    """Gain [dB] and delay [s] margin of some commands from the closed loop's eigenvalues, looked for where the
    response crosses first."""
    which = np.isin(np.arange(len(late)), joints)

    def too_strong(decibel: float) -> bool:
        return radius(closed_tree(held, controller, np.where(which, 10.0 ** (decibel / 20.0), 1.0))) >= 1.0

    def too_late(delay: float) -> bool:
        return radius(closed_tree(sampled_each(plant, period, late + delay * which), controller)) >= 1.0

    gain = 20.0 * np.log10(seen[0]) if np.isfinite(seen[0]) else np.inf
    return (
        _refined(too_strong, gain, MOST_GAIN, 1.0, 1e-3),
        _refined(too_late, seen[1], most_delay, max(period, 0.004), 1e-4 * most_delay),
    )


def _refined(fails: Callable[[float], bool], guess: float, most: float, step: float, fine: float) -> float:
    """Where a condition first holds, by bisection about a guess; along a grid where the guess is none."""
    low, high = max(guess - step, 0.0), min(guess + step, most)
    if not (np.isfinite(guess) and guess < most and fails(high) and not (low > 0.0 and fails(low))):
        found = next((pair for pair in pairwise(np.arange(0.0, most + 1e-9, step)) if fails(pair[1])), None)
        if found is None:
            return float("inf")
        low, high = found
    while high - low > fine:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if fails(middle) else (middle, high)
    return float(low)
