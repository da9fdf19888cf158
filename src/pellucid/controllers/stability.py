"""How much gain and delay a worn orthosis's loop bears: the linear sampled loop, exactly, with dead time and lag.

The loop is opened where the controller hands its torque to the actuator. Its gain margin is the factor by which the
whole command may be too strong, its delay margin the dead time that may be added, before a closed-loop eigenvalue
leaves the unit circle; nothing is approximated but the linearisation. Friction enters as its describing function, and
so does the gate's limit of the command's rate, which `swings` asks about.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from .coupling import Coupling, friction_slope

RATE_RATIOS = np.linspace(0.02, 1.0, 50)
"""Largest rate that is allowed over that of a sine, for which the limit's describing function is tabulated [1]."""

WAVE_POINT_COUNT = 1000
"""Number of points of one period of the sine of that table."""

SWING_AMPLITUDE_SHARES = np.linspace(0.2, 1.0, 5)
"""Amplitudes of a swinging command, as shares of the limit of effort [1]."""

FASTEST_SWING_HZ = 40.0
"""Highest frequency at which a loop is asked whether it swings [Hz]."""

SWING_FREQUENCY_COUNT = 80
"""Number of frequencies, evenly spaced in their logarithm, at which it is asked."""


@dataclass(frozen=True)
class LinearSystem:
    """x' = A x + B u, y = C x + D u: continuous, or sampled (x' the next state)."""

    a: np.ndarray  # a, b, c, d: Shapes (n, n), (n, m), (p, n), (p, m)
    b: np.ndarray
    c: np.ndarray
    d: np.ndarray


def worn_orthosis(coupling: Coupling, speed: float = 1.0) -> LinearSystem:
    """Actuator, orthosis, strap and a passive limb, hanging: from torque wanted to encoder and spring.

    tau_e" + (2 zeta w + N/J_a) tau_e' + w^2 tau_e = w^2 (u - (b_a + N) v - J_a a + i), i' = leak (u - tau_e), N the
    describing function of the actuator's Coulomb friction.

    `speed` [rad/s]; gives [N m], [rad].
    """
    m, wn = coupling, coupling.actuator_frequency
    viscous = m.orthosis_viscous + friction_slope(speed, m.coulomb)
    strap = np.array([0, 0, m.strap_stiffness, m.strap_damping, 0, 0, 0])
    orthosis = np.array([-m.orthosis_gravity, -viscous, 0, 0, 1, 0, 0]) + strap
    limb = np.array([-m.limb_gravity, -m.limb_viscous, -m.limb_gravity, -m.limb_viscous, 0, 0, 0]) - strap
    a = np.zeros((7, 7))
    a[0, 1] = a[2, 3] = a[4, 5] = 1
    a[1] = orthosis / m.orthosis_inertia
    a[3] = limb / m.limb_inertia - a[1]
    a[5] = -(wn**2) * m.actuator_inertia * a[1]
    rubbing = friction_slope(speed, m.actuator_coulomb)
    a[5, 1] -= wn**2 * (m.actuator_viscous + rubbing)
    a[5, 4] -= wn**2
    a[5, 5] -= 2 * m.actuator_damping * wn
    if m.actuator_inertia > 0:
        a[5, 5] -= rubbing / m.actuator_inertia  # it rubs at the motor, which the spring's deflection moves as well
    a[5, 6] = wn**2
    a[6, 4] = -m.actuator_leak
    b = np.zeros((7, 2))
    b[5, 0], b[3, 1], b[6, 0] = wn**2, 1 / m.limb_inertia, m.actuator_leak
    c = np.array([[1, 0, 0, 0, 0, 0, 0], [0, 0, 0, 0, 1, 0, 0], strap, [0, 0, 1, 0, 0, 0, 0]], dtype=float)
    n = 7 if m.actuator_leak > 0 else 6
    return LinearSystem(a[:n, :n], b[:n], c[:, :n], np.zeros((4, 2)))


def sampled(system: LinearSystem, period: float, delay: float = 0.0) -> LinearSystem:
    """A continuous system behind a zero-order hold and a dead time of any length, sampled exactly.

    x[k+1] = Phi x[k] + Gamma_0 u[k-n] + Gamma_1 u[k-n-1], where delay = (n + f) period.

    `period` [s]; `delay` [s].
    """
    from scipy.linalg import expm

    n, m = system.b.shape

    def held(duration: float) -> tuple[np.ndarray, np.ndarray]:
        both = expm(np.block([[system.a, system.b], [np.zeros((m, n + m))]]) * duration)
        return both[:n, :n], both[:n, n:]

    whole = int(np.floor(delay / period + 1e-9))
    fraction = max(delay / period - whole, 0.0) * period
    phi, _ = held(period)
    early, recent = held(period - fraction)
    _, old = held(fraction)
    under_way = whole + 1
    a = np.zeros((n + m * under_way, n + m * under_way))
    b = np.zeros((n + m * under_way, m))
    a[:n, :n] = phi
    # The states behind the plant's are u[k-1], u[k-2], ...
    place = [b[:n]] + [a[:n, n + m * i : n + m * (i + 1)] for i in range(under_way)]
    place[whole] += recent
    place[whole + 1] += early @ old
    b[n : n + m] = np.eye(m)
    for i in range(1, under_way):
        a[n + m * i : n + m * (i + 1), n + m * (i - 1) : n + m * i] = np.eye(m)
    c = np.hstack([system.c, np.zeros((system.c.shape[0], m * under_way))])
    return LinearSystem(a, b, c, np.zeros((c.shape[0], m)))


def closed_loop(plant: LinearSystem, controller: LinearSystem, gain: float = 1.0) -> np.ndarray:
    """The closed loop's matrix: the plant's first input is `gain` times the controller's output. Gives (n, n)."""
    inputs = controller.b.shape[1]
    b, c = gain * plant.b[:, :1], plant.c[:inputs]
    return np.block([[plant.a + b @ controller.d @ c, b @ controller.c], [controller.b @ c, controller.a]])


def radius(matrix: np.ndarray) -> float:
    """Largest magnitude of a matrix's eigenvalues [1]. `matrix` (n, n)."""
    return float(np.abs(np.linalg.eigvals(matrix)).max())


def loop_response(plant: LinearSystem, controller: LinearSystem, omega: np.ndarray, period: float) -> np.ndarray:
    """The open loop at some frequencies, L = -C P, so that 1 + L = 0 is the verge of stability. `omega` (n,)
    [rad/s]; `period` [s]; gives (n,)."""

    points = np.exp(1j * np.asarray(omega) * period)

    def response(system: LinearSystem) -> np.ndarray:
        shifted = points[:, None, None] * np.eye(len(system.a)) - system.a
        return system.c @ np.linalg.solve(shifted, np.broadcast_to(system.b, (len(points), *system.b.shape))) + system.d

    inputs = controller.b.shape[1]
    return -(response(controller) @ response(plant)[:, :inputs, :1])[:, 0, 0]


def bears(
    coupling: Coupling, controller: LinearSystem, period: float, *, gain_db: float, delay: float, speed: float = 1.0
) -> bool:
    """Whether a loop is stable as it is, and with the factor and with the added dead time asked for, and half of
    each.

    A loop that is unstable for a narrow range in between alone is not found.

    `gain_db`, `delay` [dB], [s].
    """
    held = _held(coupling, speed, period, 0.0)
    if any(radius(closed_loop(held, controller, 10 ** (decibel / 20))) >= 1 for decibel in (gain_db, 0.0, gain_db / 2)):
        return False
    return not any(
        radius(closed_loop(_held(coupling, speed, period, float(late)), controller)) >= 1 for late in (delay, delay / 2)
    )


@lru_cache(maxsize=1)
def rate_limit_table() -> np.ndarray:
    """Return the describing function of a limit of the rate at `RATE_RATIOS`: first harmonic over the sine, complex.

    A limit that is reached in every half-wave makes a triangle of a sine of amplitude A and frequency w. With
    K = rate / (A w) below 0.54 it has the gain 4 K / pi and is late by arccos(pi K / 2).
    """
    angle = 2.0 * np.pi * np.arange(6 * WAVE_POINT_COUNT) / WAVE_POINT_COUNT
    most = RATE_RATIOS * 2.0 * np.pi / WAVE_POINT_COUNT
    limited, waves = np.zeros_like(RATE_RATIOS), np.empty((len(angle), len(RATE_RATIOS)))
    for i, wanted in enumerate(np.sin(angle)):
        limited = limited + np.clip(wanted - limited, -most, most)
        waves[i] = limited
    last = slice(-WAVE_POINT_COUNT, None)
    return 2j * np.mean(waves[last] * np.exp(-1j * angle[last])[:, None], axis=0)


def swings(
    coupling: Coupling, controller: LinearSystem, period: float, *, effort: float, rate: float, speed: float = 1.0
) -> bool:
    """Return whether a loop is unstable, or goes on swinging once its command is as fast as its limit of rate allows.

    Margins are those of small motions. A command that swings fast enough to reach the limit of rate is weaker, and
    later by up to a quarter of its period; where the loop then returns as much as it was given, it does not come to
    rest. It is asked for commands up to the limit of effort, by the limit's describing function.

    Parameters
    ----------
    coupling : Coupling
        Plant on which the controller is tried.
    controller : LinearSystem
        Controller from encoder and spring to the torque wanted.
    period : float
        Control period [s].
    effort, rate : float
        Limits of the command [N m] and of its rate [N m/s].
    speed : float
        Speed at which friction is linear [rad/s].
    """
    held = _held(coupling, speed, period, 0.0)
    if radius(closed_loop(held, controller)) >= 1:
        return True
    slowest = rate / effort
    if not slowest < 2.0 * np.pi * FASTEST_SWING_HZ:
        return False
    omega = np.geomspace(slowest, 2.0 * np.pi * FASTEST_SWING_HZ, SWING_FREQUENCY_COUNT)
    response, table = loop_response(held, controller, omega, period), rate_limit_table()
    for amplitude in SWING_AMPLITUDE_SHARES * effort:
        ratio = np.minimum(rate / (amplitude * omega), 1.0)
        gain = np.interp(ratio, RATE_RATIOS, table.real) + 1j * np.interp(ratio, RATE_RATIOS, table.imag)
        limited = response * gain
        turn = np.floor((np.unwrap(np.angle(limited)) + np.pi) / (2.0 * np.pi))
        at_half_a_turn = np.flatnonzero(turn[1:] != turn[:-1])
        if np.abs(limited[at_half_a_turn]).max(initial=0.0) >= 1.0:
            return True
    return False


def _seen_by_controller(coupling: Coupling, speed: float) -> LinearSystem:
    """Transfer functions from the desired torque to encoder and spring."""
    plant = worn_orthosis(coupling, speed)
    return LinearSystem(plant.a, plant.b[:, :1], plant.c[:2], plant.d[:2, :1])


@lru_cache(maxsize=4096)
def _held(coupling: Coupling, speed: float, period: float, late: float) -> LinearSystem:
    """The same sampled, that much later: a search asks for the same plant again and again."""
    return sampled(_seen_by_controller(coupling, speed), period, coupling.delay + late)
