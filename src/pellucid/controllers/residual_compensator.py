"""From identified parameters to the core's residual compensator, with the linear loop that its margins come from."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np

from .._errors import PellucidError
from .control_law import WORN_LAW, ControlLaw, Limits, gate_values
from .coupling import Coupling, friction_slope
from .stability import LinearSystem, bears, swings

SWING_STEP_COUNT = 5
"""Number of steps in which a law that swings is weakened to nothing."""


@dataclass(frozen=True)
class Noise:
    """How far each thing is to be believed, from which the observer's gains follow."""

    encoder: float = 2e-4  # Standard deviation of the encoder's angle [rad]
    orthosis_torque: float = 0.2  # Torque that the orthosis's model misses, white over a period [N m]
    limb_torque: float = 1.0  # Torque that the limb's model misses, white over a period [N m]
    emg_drift: float = 8.0  # How fast the error of the EMG torque wanders [N m/sqrt(s)]


@dataclass(frozen=True)
class Law:
    """Carried parts of the effort, and gains that drive the remainder to zero."""

    # gravity, viscous, friction, inertia: Shares of the orthosis's own gravity, viscous and Coulomb friction, and of
    # its inertia times the limb's acceleration, that are carried for the wearer [1]
    gravity: float = 0.8
    viscous: float = 0.8
    friction: float = 0.5
    inertia: float = 0.7
    proportional: float = 1.0  # proportional, integral, derivative: On the estimated strap torque [1], [1/s], [s]
    integral: float = 0.0
    derivative: float = 0.0
    torque_gain: float = 0.3  # On how far the spring is from the torque wanted [1]
    # Factors over a swing: 0 its flexed end, 2 the middle on the way there, 4 the other end, 6 the way back [1]
    phase_gain: tuple[float, ...] = (1.0,) * 8
    # How far ahead the motion is predicted [s]; None: the actuator's delay and lag and half a period
    preview: float | None = None


@dataclass(frozen=True)
class ResidualDesign:
    """A residual compensator before it runs: numbers only."""

    coupling: Coupling  # What it was built for
    period: float  # [s]
    law: Law = field(default_factory=Law)  # Its shares and gains
    noise: Noise = field(default_factory=Noise)  # Noise from which the observer's gains follow
    limits: Limits = field(default_factory=Limits)  # Limits of the gate
    correction: tuple[float, ...] = ()  # The observer's gains
    # width, assist_width: Velocity over which friction changes its sign, in the observer and in what is carried [rad/s]
    width: float = 0.05
    assist_width: float = 0.6
    # Middle [rad] and angular frequency [rad/s] of a swing, for the gain by phase
    swing: tuple[float, float] = (0.0, 4.4)

    @property
    def preview(self) -> float:
        """Prediction horizon of the motion [s]."""
        if self.law.preview is not None:
            return self.law.preview
        m = self.coupling
        return m.delay + 2 * m.actuator_damping / m.actuator_frequency + self.period / 2

    def control_law(self) -> ControlLaw:
        """The core's law with its numbers."""
        m, law = self.coupling, self.law
        values = WORN_LAW.defaults | {name: value for name, value in vars(m).items() if name in WORN_LAW.parameters}
        values |= {
            "friction_width": self.width,
            "assist_width": self.assist_width,
            "gravity_share": law.gravity,
            "viscous_share": law.viscous,
            "friction_share": law.friction,
            "inertia_share": law.inertia,
            "torque_gain": law.torque_gain,
            "proportional": law.proportional,
            "integral": law.integral,
            "derivative": law.derivative,
            "preview": self.preview,
            "emg_limit": self.limits.emg_torque,
            "swing_angle": self.swing[0],
            "swing_rate": self.swing[1],
            **gate_values(self.limits, self.period),
        }
        values |= {f"phase_gain_{i}": gain for i, gain in enumerate(law.phase_gain)}
        names = ("position", "velocity", "mismatch", "mismatch_rate", "disturbance")
        values |= {f"correct_{name}": gain for name, gain in zip(names, self.correction, strict=True)}
        return ControlLaw(WORN_LAW.name, values, frozenset({"muscle"}))

    def linear(self, speed: float = 1.0, trust: float = 1.0) -> LinearSystem:
        """The controller near the hanging place, without gate and limits: from encoder and spring to torque wanted.
        `speed` [rad/s]."""
        m, law, step = self.coupling, self.law, self.period
        slope = friction_slope(speed, m.coulomb, self.width)
        row = np.eye(7)
        correct = np.append(self.correction, (0.0, 0.0))
        # Columns of the rows: the state x, the angle q and the torque tau.
        seen = np.hstack([row - np.outer(correct, row[0]), np.outer(correct, [1.0]), np.zeros((7, 1))])
        q, v, mismatch, rate, missing, slow, integral = seen
        spring = np.zeros(9)
        spring[8] = 1
        strap = m.strap_stiffness * mismatch + m.strap_damping * rate
        orthosis = (spring + strap - (m.orthosis_viscous + slope) * v - m.orthosis_gravity * q) / m.orthosis_inertia
        limb = (missing - strap - m.limb_viscous * (v + rate) - m.limb_gravity * (q + mismatch)) / m.limb_inertia
        integral = integral + law.integral * step * strap
        ahead = v + trust * (rate + self.preview * limb)

        def carried(viscous: float, coulomb: float, inertia: float) -> np.ndarray:
            drag = law.viscous * viscous + law.friction * friction_slope(speed, coulomb, self.assist_width)
            return drag * ahead + trust * law.inertia * inertia * limb

        wanted = (
            law.gravity * m.orthosis_gravity * (q + self.preview * v)
            + carried(m.orthosis_viscous, m.coulomb, m.orthosis_inertia)
            + law.proportional * strap
            + integral
            + law.derivative * (m.strap_stiffness * rate + m.strap_damping * (limb - orthosis))
        )
        drag = carried(m.actuator_viscous, m.actuator_coulomb, m.actuator_inertia)
        slow = slow + m.actuator_leak * step * (drag - slow)
        command = (wanted + drag - slow + law.torque_gain * (wanted - spring)) * float(np.mean(law.phase_gain))
        v = v + step * orthosis
        rate = rate + step * (limb - orthosis)
        following = np.array([q + step * v, v, mismatch + step * rate, rate, missing, slow, integral])
        used = [True] * 5 + [m.actuator_leak > 0, law.integral != 0]  # what nothing uses would stand on the unit circle
        states, inputs = np.flatnonzero(used), np.array([7, 8])
        return LinearSystem(
            following[np.ix_(states, states)], following[np.ix_(states, inputs)], command[None, states],
            command[None, inputs],
        )  # fmt: skip


def observer_gains(coupling: Coupling, noise: Noise, period: float, speed: float = 1.0, width: float = 0.05) -> tuple:
    """The steady-state Kalman filter of q_e, v_e, D, dD and d on the encoder alone. `period` [s]; `speed`, `width`
    [rad/s]; gives [1, 1/s, 1, 1/s, N m/rad]."""
    from scipy.linalg import solve_discrete_are

    bare = ResidualDesign(coupling, period, law=Law(preview=0.0), correction=(0.0,) * 5, width=width)
    a = bare.linear(speed).a[:5, :5]
    m = coupling
    # A torque over one period changes a velocity and, in semi-implicit Euler, the angle with it.
    on_orthosis = np.array([period, 1, -period, -1, 0]) * period / m.orthosis_inertia * noise.orthosis_torque
    on_limb = np.array([0, 0, period, 1, 0]) * period / m.limb_inertia * noise.limb_torque
    drift = np.array([0, 0, 0, 0, 1.0]) * noise.emg_drift * np.sqrt(period)
    q = sum(np.outer(g, g) for g in (on_orthosis, on_limb, drift))
    c = np.array([[1.0, 0, 0, 0, 0]])
    scale = np.array([1e-2, 1e-1, 1e-2, 1e-1, 1.0])  # so that Riccati's equation is well scaled
    to, back = np.diag(1 / scale), np.diag(scale)
    try:
        p = solve_discrete_are((to @ a @ back).T, (c @ back).T, to @ q @ to, np.array([[noise.encoder**2]]))
    except np.linalg.LinAlgError as error:
        raise PellucidError(
            f"observer_gains: the filter's Riccati equation has no solution ({error}); check the noises and the "
            "coupling."
        ) from error
    p = back @ p @ back
    gain = p @ c.T / (c @ p @ c.T + noise.encoder**2)
    return tuple(float(g) for g in gain[:, 0])


def design(
    coupling: Coupling,
    period: float,
    *,
    law: Law | None = None,
    noise: Noise | None = None,
    limits: Limits | None = None,
    width: float = 0.05,
    assist_width: float = 0.6,
    swing: tuple[float, float] = (0.0, 4.4),
) -> ResidualDesign:
    """A residual compensator for an identified coupling. `period` [s]; `width`, `assist_width` [rad/s]; `swing`
    [rad], [rad/s]."""
    law, noise, limits = law or Law(), noise or Noise(), limits or Limits()
    gains = observer_gains(coupling, noise, period, width=width)
    return ResidualDesign(coupling, period, law, noise, limits, gains, width, assist_width, swing)


def first_failing(
    made: ResidualDesign, cases: Sequence[tuple[Coupling, float, float]], *, gain_db: float, delay: float
) -> int | None:
    """Return the index of the first case that does not bear the margins wanted, or None.

    `cases` are plants, speeds [rad/s] and shares of EMG; `gain_db` and `delay` are the margins in dB and s.
    """

    def fails(plant: Coupling, loop: LinearSystem, speed: float) -> bool:
        return not bears(plant, loop, made.period, gain_db=gain_db, delay=delay, speed=speed)

    return _first_case(made, cases, fails)


def _first_case(
    made: ResidualDesign,
    cases: Sequence[tuple[Coupling, float, float]],
    fails: Callable[[Coupling, LinearSystem, float], bool],
) -> int | None:
    """Return the index of the first case whose plant, loop and speed fail, or None."""
    loop = cache(made.linear)
    return next((i for i, (plant, *at) in enumerate(cases) if fails(plant, loop(*at), at[0])), None)


def weakenings(count: int = 5) -> list[tuple[float, float]]:
    """Factors on the friction carried and on the gains of the strap, from none to all taken away [1]."""
    left = [1.0 - i / count for i in range(count + 1)]
    return sorted(((f, s) for f in left for s in left), key=lambda pair: (round(-sum(pair), 6), pair[0]))


def first_swinging(
    made: ResidualDesign, cases: Sequence[tuple[Coupling, float, float]], small: bool = False
) -> int | None:
    """Return the index of the first case on which a law does not come to rest, or None.

    `cases` are as in `first_failing`. With `small` only small motions are asked about, and else those at the limit of
    rate, too.
    """
    rate = math.inf if small else made.limits.rate

    def fails(plant: Coupling, loop: LinearSystem, speed: float) -> bool:
        return swings(plant, loop, made.period, effort=made.limits.effort, rate=rate, speed=speed)

    return _first_case(made, cases, fails)


def within(
    made: ResidualDesign,
    plants: Sequence[Coupling],
    *,
    gain_db: float,
    delay: float,
    speeds: Sequence[float] = (0.1, 0.5, 1.5, 4.0),
    wrong_plants: Sequence[Coupling] = (),
) -> ResidualDesign:
    """A law weakened as little as these margins ask, in its gains on the strap and in the friction that it carries;
    then in its share of inertia and those gains until it comes to rest on `wrong_plants`, too, without a margin.
    `gain_db`, `delay` [dB], [s]; `speeds` [rad/s]."""
    cases = [(plant, speed, trust) for speed in speeds for trust in (0.0, 1.0) for plant in plants]
    for rubbed, pulled in weakenings():
        tried = replace(made, law=_weakened(replace(made.law, friction=rubbed * made.law.friction), pulled))
        failing = first_failing(tried, cases, gain_db=gain_db, delay=delay)
        if failing is None:
            break
        cases.insert(0, cases.pop(failing))  # what one law did not bear, the next will hardly
    else:
        raise PellucidError(
            f"within: no weaker law leaves {gain_db:g} dB and {1e3 * delay:g} ms on every plant; ask for smaller "
            "margins, or for fewer plants."
        )
    others = [(plant, speed, trust) for speed in speeds for trust in (0.0, 1.0) for plant in wrong_plants]
    for step in range(SWING_STEP_COUNT + 1):
        left = 1.0 - step / SWING_STEP_COUNT
        law = _weakened(replace(tried.law, inertia=left * tried.law.inertia), left) if step else tried.law
        weaker, failing = replace(tried, law=law), None
        for small in (True, False):
            if failing is None:
                failing = first_swinging(weaker, others, small)
        if failing is not None:
            others.insert(0, others.pop(failing))
        elif step == 0 or first_failing(weaker, cases, gain_db=gain_db, delay=delay) is None:
            return weaker
    raise PellucidError(
        "within: found no lower gains with which the motion settles for every plant, expected some: remove the "
        "stiffest of wrong_plants"
    )


def _weakened(law: Law, left: float) -> Law:
    """Return a law with so much left of its gains on the strap [1]."""
    return replace(
        law, proportional=left * law.proportional, integral=left * law.integral, derivative=left * law.derivative
    )
