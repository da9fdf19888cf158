r"""A worn robot of several joints as a linear loop about a posture, with the law that compensates it.

About a posture the robot, its wearer's limb and the cuffs between them are linear, with m joints each:

.. math::
   M \ddot q + (B + N)\dot q + K q = \tau + C, \quad
   M_h \ddot q_h + B_h \dot q_h + K_h q_h = -C, \quad
   C = S (q_h - q) + D (\dot q_h - \dot q)

with K the slope of gravity and N the describing functions of dry friction. A law is linear as well, sampled, and acts
through drives with a lag and a dead time. `controller.py` asks of this loop how much of the inertia a law may carry.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from .. import _core
from .._errors import PellucidError
from .coupling import friction_slope
from .stability import LinearSystem


@dataclass(frozen=True, eq=False)
class TreeCoupling:
    """A worn robot about a posture; matrices (m, m), else (m,), SI at the joints."""

    mass: np.ndarray
    viscous: np.ndarray
    slope: np.ndarray  # derivative of gravity by position
    coulomb: np.ndarray
    limb_mass: np.ndarray
    limb_viscous: np.ndarray  # (m, m)
    limb_slope: np.ndarray  # derivative of the limb's gravity, and of the muscles that hold a posture, by position
    cuff_stiffness: np.ndarray  # (m, m)
    cuff_damping: np.ndarray
    drive_frequency: np.ndarray  # natural frequency of the lag from commanded to actual effort [rad/s]
    drive_damping: np.ndarray  # [1]
    delay: float = 0.0  # before it; the loop's own sample and hold is not part of it [s]
    # What a torque loop around a series spring does not cancel of motor and gear, and the rate at which its integral
    # does after all; 0 of a drive that is not behind a spring
    drive_inertia: np.ndarray = field(default_factory=lambda: np.zeros(1))
    drive_viscous: np.ndarray = field(default_factory=lambda: np.zeros(1))
    drive_coulomb: np.ndarray = field(default_factory=lambda: np.zeros(1))
    drive_leak: np.ndarray = field(default_factory=lambda: np.zeros(1))

    def __post_init__(self):
        m = len(np.atleast_2d(self.mass))
        for name, value in vars(self).copy().items():
            if name == "delay":
                continue
            square = name in {"mass", "slope", "limb_mass", "limb_viscous", "limb_slope", "cuff_stiffness",
                              "cuff_damping"}  # fmt: skip
            made = np.array(value, dtype=float)
            made = np.diag(np.broadcast_to(made, m)) if square and made.ndim < 2 else made
            made = made if square else np.broadcast_to(made, (m,)).copy()
            if made.shape != ((m, m) if square else (m,)) or not np.isfinite(made).all():
                raise PellucidError(
                    f"TreeCoupling: found {name} {made.tolist()}, expected {m} joints of finite numbers"
                )
            object.__setattr__(self, name, made)
        for name in ("mass", "limb_mass"):
            if np.linalg.eigvalsh(getattr(self, name)).min() <= 0.0:
                raise PellucidError(
                    f"TreeCoupling: found a {name} matrix that is not positive definite, expected one of a possible "
                    "body"
                )
        if not (self.drive_frequency > 0.0).all():
            raise PellucidError("TreeCoupling: found drive_frequency <= 0, expected > 0")

    @property
    def joints(self) -> int:
        """m."""
        return len(self.mass)


@dataclass(frozen=True)
class Limb:
    """Inertia, stiffness and damping of a limb."""

    name: str
    mass: float  # factor of the limb's own mass
    stiffness: float  # stiffness beyond that which holds the posture, at each rotary joint [N m/rad]
    damping: float  # damping ratio with that stiffness and the joint's own mass


DRAWN_LIMBS: tuple[Limb, ...] = (
    Limb("limp", 1.0, 1.0, 0.1),
    Limb("light and limp", 0.5, 1.0, 0.1),
    Limb("heavy and limp", 2.0, 1.0, 0.1),
    Limb("at ease", 1.0, 8.0, 0.25),
    Limb("stiff", 1.0, 40.0, 0.25),
    Limb("light and stiff", 0.5, 80.0, 0.25),
)
"""From a limb that lets itself be carried to one with all muscles tense: stiffnesses of elbows and shoulders in the
literature are 2 to 80 N m/rad, damping 0.2 to 0.4 of critical. A limp one is held where it would fall, and no more:
otherwise no posture but hanging would be one."""


def with_limb(coupling: TreeCoupling, limb: Limb) -> TreeCoupling:
    """The same robot, worn by the same person as `limb` says."""
    mass = limb.mass * coupling.limb_mass
    slope, ways = np.linalg.eigh(0.5 * (coupling.limb_slope + coupling.limb_slope.T))
    held = ways @ np.diag(np.maximum(slope, 0.0)) @ ways.T
    return replace(
        coupling,
        limb_mass=mass,
        limb_slope=limb.mass * held + limb.stiffness * np.eye(len(mass)),
        limb_viscous=np.diag(2.0 * limb.damping * np.sqrt(limb.stiffness * np.diag(mass))),
    )


def worn_tree(coupling: TreeCoupling, speed: float = 1.0) -> LinearSystem:
    """From efforts wanted and efforts on the limb, (2 m), to encoders, drives, cuffs and what cuffs give, (4 m).

    States as of `stability.worn_orthosis`, m of each. `speed` [rad/s].
    """
    m, n = coupling.joints, coupling
    eye, none, wn = np.eye(m), np.zeros((m, m)), np.diag(n.drive_frequency)
    rubbing = np.diag([friction_slope(speed, f) for f in n.drive_coulomb])
    viscous = np.diag(n.viscous + [friction_slope(speed, f) for f in n.coulomb])
    cuff = np.hstack([none, none, n.cuff_stiffness, n.cuff_damping, none, none, none])
    robot = np.linalg.solve(n.mass, np.hstack([-n.slope, -viscous, none, none, eye, none, none]) + cuff)
    limb = np.hstack([-n.limb_slope, -n.limb_viscous, -n.limb_slope, -n.limb_viscous, none, none, none]) - cuff
    a = np.zeros((7 * m, 7 * m))
    q, v, d, e, t, u, i = (slice(k * m, (k + 1) * m) for k in range(7))
    a[q, v] = a[d, e] = a[t, u] = eye
    a[v], a[e] = robot, np.linalg.solve(n.limb_mass, limb) - robot
    a[u] = -(wn**2) @ np.diag(n.drive_inertia) @ robot
    a[u, v] -= wn**2 @ (np.diag(n.drive_viscous) + rubbing)
    a[u, t] -= wn**2
    a[u, u] -= 2.0 * np.diag(n.drive_damping) @ wn
    sprung = np.where(n.drive_inertia > 0.0, 1.0 / np.maximum(n.drive_inertia, 1e-300), 0.0)
    a[u, u] -= rubbing @ np.diag(sprung)
    a[u, i] = wn**2
    a[i, t] = -np.diag(n.drive_leak)
    b = np.zeros((7 * m, 2 * m))
    b[u, :m], b[e, m:], b[i, :m] = wn**2, np.linalg.inv(n.limb_mass), np.diag(n.drive_leak)
    c = np.zeros((4 * m, 7 * m))
    c[:m, q] = c[m : 2 * m, t] = c[3 * m :, d] = eye
    c[2 * m : 3 * m] = cuff
    kept = 7 * m if (n.drive_leak > 0.0).any() else 6 * m
    return LinearSystem(a[:kept, :kept], b[:kept], c[:, :kept], np.zeros((4 * m, 2 * m)))


def sampled_each(system: LinearSystem, period: float, delays: Sequence[float] | np.ndarray) -> LinearSystem:
    """A continuous system behind zero-order holds, each input with a dead time of its own, sampled exactly. `period`,
    `delays` (m,) [s]."""
    from scipy.linalg import expm

    n, m = system.b.shape

    def held(duration: float) -> tuple[np.ndarray, np.ndarray]:
        both = expm(np.block([[system.a, system.b], [np.zeros((m, n + m))]]) * duration)
        return both[:n, :n], both[:n, n:]

    phi, all_of_it = held(period)
    whole = [int(np.floor(delay / period + 1e-9)) for delay in delays]
    size = n + sum(w + 1 for w in whole)
    a, b = np.zeros((size, size)), np.zeros((size, m))
    a[:n, :n] = phi
    place = n
    for k, (delay, late) in enumerate(zip(delays, whole, strict=True)):
        part = max(delay / period - late, 0.0) * period
        early, recent = held(period - part) if part > 0.0 else (np.eye(n), all_of_it)
        old = held(part)[1] if part > 0.0 else np.zeros((n, m))
        for back, effect in ((late, recent[:, k]), (late + 1, early @ old[:, k])):
            # What was asked `back` periods ago; asked now, it is the input itself.
            if back == 0:
                b[:n, k] += effect
            else:
                a[:n, place + back - 1] += effect
        b[place, k] = 1.0
        for i in range(1, late + 1):
            a[place + i, place + i - 1] = 1.0
        place += late + 1
    c = np.hstack([system.c, np.zeros((system.c.shape[0], size - n))])
    return LinearSystem(a, b, c, np.zeros((c.shape[0], m)))


def closed_tree(plant: LinearSystem, controller: LinearSystem, gains: np.ndarray | float = 1.0) -> np.ndarray:
    """The closed loop's matrix, the plant's inputs being `gains` (m,) times the controller's outputs."""
    c = plant.c[: controller.b.shape[1]]
    b = plant.b * gains
    return np.block([[plant.a + b @ controller.d @ c, b @ controller.c], [controller.b @ c, controller.a]])


def gravity_slope(tree: _core.KinematicTree, posture: np.ndarray) -> np.ndarray:
    """How the effort that holds a robot changes with each joint, (m, m). `posture` (m,) [rad; m]."""
    apart = 1e-5
    steps = posture + apart * np.concatenate([np.eye(len(posture)), -np.eye(len(posture))])
    held = tree.gravity(np.ascontiguousarray(steps))
    m = len(posture)
    slope = (held[:m] - held[m:]).T / (2.0 * apart)
    return 0.5 * (slope + slope.T)  # a potential's second derivative is symmetric


@dataclass(frozen=True, eq=False)
class LinearShares:
    """What a compensation of n joints does near a posture, its limits and gate aside; (m,) each or one for all.

    The filters are those of `include/pellucid/motion_estimator.hpp` and `torque_feedback.hpp`.
    """

    gravity: np.ndarray | float = 1.0
    friction: np.ndarray | float = 0.8
    inertia: np.ndarray | float = 0.0
    friction_lead: np.ndarray | float = 0.0  # s
    bandwidth: np.ndarray | float = 100.0  # bandwidth of the motion's estimator [rad/s]
    proportional: np.ndarray | float = 0.0  # on the interaction
    integral: np.ndarray | float = 0.0  # 1/s
    leak: np.ndarray | float = 0.0  # 1/s
    lowpass: np.ndarray | float = 100.0  # rad/s
    drift: np.ndarray | float = 0.0  # rad/s


def linear_law(
    coupling: TreeCoupling, shares: LinearShares, period: float, *, width: np.ndarray | float, speed: float = 1.0
) -> LinearSystem:
    """Such a compensation built from what is known of `coupling`'s robot: from encoders, drives and cuffs, (3 m), to
    efforts wanted. `period` [s]; `width` (m,) of friction's smooth sign, `speed` [rad/s]."""
    m = coupling.joints
    n = {name: np.broadcast_to(np.asarray(value, float), m) for name, value in vars(shares).items()}
    width = np.broadcast_to(np.asarray(width, float), m)
    drag = n["friction"] * (
        coupling.viscous + [friction_slope(speed, f, w) for f, w in zip(coupling.coulomb, width, strict=True)]
    )
    sensed = (n["proportional"] > 0.0).any() or (n["integral"] > 0.0).any()
    a, b = np.zeros((6 * m, 6 * m)), np.zeros((6 * m, 3 * m))
    for k in range(m):
        gains = _estimator_gains(float(n["bandwidth"][k]), period)
        foresees = np.array([[1.0, period, 0.5 * period**2], [0.0, 1.0, period], [0.0, 0.0, 1.0]])
        here = [k, m + k, 2 * m + k]
        a[np.ix_(here, here)] = foresees - np.outer(gains, foresees[0])
        b[here, k] = gains
        smooth, slow = 1.0 - np.exp(-n["lowpass"][k] * period), 1.0 - np.exp(-n["drift"][k] * period)
        s, d, i = 3 * m + k, 4 * m + k, 5 * m + k
        a[s, s], b[s, 2 * m + k] = 1.0 - smooth, smooth
        a[d], b[d] = slow * a[s], slow * b[s]
        a[d, d] += 1.0 - slow
        a[i], b[i] = n["integral"][k] * period * (a[s] - a[d]), n["integral"][k] * period * (b[s] - b[d])
        a[i, i] += np.exp(-n["leak"][k] * period)
    out = np.hstack([
        n["gravity"][:, None] * coupling.slope,
        np.diag(drag),
        np.diag(drag * n["friction_lead"]) + n["inertia"][:, None] * coupling.mass,
        np.diag(n["proportional"]), -np.diag(n["proportional"]), np.eye(m),
    ])  # fmt: skip
    # The law answers with what it has just learnt; a state that nothing uses would stand on the unit circle.
    used = [*range(3 * m)]
    for k in range(m):
        if n["proportional"][k] > 0.0 or n["integral"][k] > 0.0:
            used += [3 * m + k]
            used += [4 * m + k] if n["drift"][k] > 0.0 else []
            used += [5 * m + k] if n["integral"][k] > 0.0 else []
    inputs = 3 * m if sensed else m
    a, b = a[np.ix_(used, used)], b[used, :inputs]
    out = out[:, used]
    return LinearSystem(a, b, out @ a, out @ b)


def _estimator_gains(bandwidth: float, period: float) -> np.ndarray:
    """On the innovation of position, velocity and acceleration: a Butterworth filter's poles, sampled, (3,)."""
    turn = bandwidth * period
    real, radius_ = np.exp(-turn), np.exp(-0.5 * turn)
    pair = 2.0 * radius_ * np.cos(np.sqrt(0.75) * turn)
    s1, s2, s3 = real + pair, real * pair + radius_**2, real * radius_**2
    first = 1.0 - s3
    third = 2.0 * (s2 - s1 + first)
    return np.array([first, (3.0 - s1 - first - 0.25 * third) / period, 0.5 * third / period**2])
