"""PID on the estimated strap torque, tuned from the identified coupling: the most it can do within its margins."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from pellucid._errors import PellucidError
from pellucid.controllers.coupling import Coupling
from pellucid.controllers.residual_compensator import Law, ResidualDesign
from pellucid.controllers.stability import LinearSystem, sampled, worn_orthosis

from ...knee.loop_margins import bears_all


def strap_torque_gain(made: ResidualDesign, omega: Sequence[float], speed: float = 1.0) -> np.ndarray:
    """Return the gain from the limb's torque to the strap's in the closed loop without EMG, (len(omega),) [1].

    `omega` has angular frequencies [rad/s]; friction is linearised at `speed` [rad/s].
    """
    m = made.coupling
    plant = sampled(worn_orthosis(m, speed), made.period, m.delay)
    controller: LinearSystem = made.linear(speed, trust=0.0)
    command, limb = plant.b[:, :1], plant.b[:, 1:]
    seen, strap = plant.c[:2], plant.c[2:3]
    a = np.block(
        [[plant.a + command @ controller.d @ seen, command @ controller.c], [controller.b @ seen, controller.a]]
    )
    b = np.vstack([limb, np.zeros((len(controller.a), 1))])
    c = np.hstack([strap, np.zeros((1, len(controller.a)))])
    points = np.exp(1j * np.asarray(omega) * made.period)
    return np.array([abs((c @ np.linalg.solve(z * np.eye(len(a)) - a, b))[0, 0]) for z in points])


def tune_pid(
    made: ResidualDesign,
    plants: Sequence[Coupling],
    *,
    gain_db: float,
    delay: float,
    band: tuple[float, float] = (2.0, 6.5),
    proportional: Sequence[float] = (0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0),
    integral: Sequence[float] = (0.0, 1.5, 3.0, 6.0),
    derivative: Sequence[float] = (0.0, 0.03),
) -> ResidualDesign:
    """Return the gains with the smallest strap torque over a band, among those with these margins on every plant.
    `gain_db`, `delay` [dB], [s]; `band` [rad/s]; `proportional`, `integral`, `derivative` [1/s], [s]."""
    omega = np.linspace(*band, 8)
    tried = []
    for p, i, d in product(proportional, integral, derivative):
        law = Law(0, 0, 0, 0, proportional=p, integral=i, derivative=d, torque_gain=0)
        candidate = replace(made, law=law)
        tried.append((float(np.mean(strap_torque_gain(candidate, omega))), candidate))
    for _, candidate in sorted(tried, key=lambda pair: pair[0]):
        if bears_all(candidate, plants, gain_db=gain_db, delay=delay):
            return candidate
    raise PellucidError(f"tune_pid: no gains leave {gain_db:g} dB and {1e3 * delay:g} ms on every plant.")
