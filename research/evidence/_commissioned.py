"""Virtual robots with drawn signs, gains and delays, which `pellucid.controllers.commissioning` is to find.

The plant shares nothing with the core and the law's model: friction on bristles with a Stribeck rise, a rotor
before a soft transmission, a drive with dead time and a lag of its current loop, an encoder with a quantum and noise.
Nothing of `pellucid` but the wave that a start plays is used here.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pellucid.controllers.commissioning import DRIVE_WAVE_FACTOR, START_COUNT, DriveCheck, StartLog, drive_check
from pellucid.study.results import ResultRow
from research.benchmarks._size import sized

ROBOT_COUNT = sized(40, smallest=4)
"""Number of virtual robots."""

SEED = 20290801
"""Seed of the robots, on which nothing was chosen."""

GAINS = (0.6, 1.6)
"""Smallest and largest gain of a drive [1]."""

DELAYS_S = (0.0, 8e-3)
"""Shortest and longest dead time of a drive."""

SOFT_SHARE = 0.4
"""Share of robots with a rotor before a soft transmission, of which a start tells the sign alone [1]."""

PERIOD_S = 1e-3
"""Control period."""

SUBSTEPS = 10
"""Steps of the integration in a period."""


@dataclass(frozen=True)
class DrawnRobot:
    """A joint and its drive, SI."""

    inertia: float
    rotor_share: float
    stiffness: float  # of the transmission [N m/rad]
    gravity: float  # torque per sine of the angle [N m]
    coulomb: float
    stribeck: float  # friction at rest over sliding friction [1]
    viscous: float
    gain: float  # with its sign
    delay: float  # dead time [s]
    lag: float  # of the current loop [s]
    quantum: float  # of the encoder [rad]
    noise: float  # [rad]
    model_inertia: float  # as it was identified
    effort: float  # amplitude of the wave of a start [N m]


def draw_robot(index: int, seed: int = SEED) -> DrawnRobot:
    """Draw a robot about the size of an elbow, a knee or a bench joint."""
    rng = np.random.default_rng([seed, index])
    inertia = float(np.exp(rng.uniform(*np.log((0.01, 0.5)))))
    coulomb = float(inertia * rng.uniform(2.0, 10.0))
    rotor = float(rng.uniform(0.1, 0.3)) if rng.random() < SOFT_SHARE else 0.0
    resonance = 2.0 * math.pi * float(rng.uniform(25.0, 200.0))
    model = inertia * float(rng.uniform(0.98, 1.02))
    return DrawnRobot(
        inertia=inertia, rotor_share=rotor, stiffness=inertia * rotor * (1.0 - rotor) * resonance**2,
        gravity=float(inertia * rng.uniform(0.0, 40.0)), coulomb=coulomb, stribeck=float(rng.uniform(1.0, 1.4)),
        viscous=float(inertia * rng.uniform(0.2, 2.0)),
        gain=float(rng.choice((-1.0, 1.0)) * rng.uniform(*GAINS)), delay=float(rng.uniform(*DELAYS_S)),
        lag=float(rng.uniform(0.3e-3, 1.5e-3)), quantum=float(rng.uniform(3e-5, 1.6e-4)),
        noise=float(rng.uniform(0.0, 5e-5)), model_inertia=model, effort=coulomb + 50.0 * model,
    )  # fmt: skip


def play_start(robot: DrawnRobot, index: int, start: int, seed: int = SEED) -> StartLog:
    """Play one start as a commissioning does: rest, a whole wave of twice 64 ms, and nothing after it."""
    rng = np.random.default_rng([seed, index, start])
    count, first, half = 464, 150, 32 * DRIVE_WAVE_FACTOR
    effort = np.zeros(count)
    effort[first : first + 2 * half] = robot.effort * np.sin(math.pi * (np.arange(2 * half) + 1) / half)
    # Wherever friction holds it.
    lean = 0.6 * robot.coulomb / max(robot.gravity, 1e-9)
    rest = float(rng.uniform(-1.0, 1.0)) * math.asin(min(lean, 0.9))
    motor = link = rest
    motor_speed = link_speed = bristle = given = 0.0
    stiffness = robot.coulomb / 1e-3
    dt = PERIOD_S / SUBSTEPS
    position = np.empty(count)
    rotor = robot.rotor_share * robot.inertia
    held = robot.delay / PERIOD_S
    for k in range(count):
        position[k] = robot.quantum * round((motor + robot.noise * rng.standard_normal()) / robot.quantum)
        for i in range(SUBSTEPS):
            at = k + i / SUBSTEPS - held
            asked = effort[int(at)] if at >= 0.0 else 0.0
            given += dt / (robot.lag + dt) * (robot.gain * asked - given)
            speed = motor_speed if rotor > 0.0 else link_speed
            level = robot.coulomb * (1.0 + (robot.stribeck - 1.0) / (1.0 + (speed / 0.1) ** 2))
            bending = speed - stiffness * abs(speed) / level * bristle
            bristle += dt * bending
            damping = math.sqrt(stiffness * (rotor or robot.inertia))
            resist = stiffness * bristle + damping * bending + robot.viscous * speed
            weight = robot.gravity * math.sin(link)
            if rotor > 0.0:
                damped = 0.1 * math.sqrt(robot.stiffness * rotor) * (motor_speed - link_speed)
                twist = robot.stiffness * (motor - link) + damped
                motor_speed += dt * (given - resist - twist) / rotor
                link_speed += dt * (twist - weight) / (robot.inertia - rotor)
                motor += dt * motor_speed
                link += dt * link_speed
            else:
                link_speed += dt * (given - resist - weight) / robot.inertia
                link += dt * link_speed
                motor = link
    return StartLog(f"start {start}", PERIOD_S * np.arange(count), position, effort)


def checked_robots() -> Iterator[tuple[DrawnRobot, DriveCheck]]:
    """Yield every simulated robot with the result of its commissioning."""
    for index in range(ROBOT_COUNT):
        robot = draw_robot(index)
        starts = [play_start(robot, index, start) for start in range(START_COUNT)]
        yield robot, drive_check(starts, robot.model_inertia)


def commissioned_rows() -> Iterator[ResultRow]:
    """Yield the results of commissioning all simulated robots."""
    made = list(checked_robots())
    wrong = sum(found.sign * robot.gain < 0.0 for robot, found in made)
    told = [(robot, found) for robot, found in made if math.isfinite(found.gain)]
    errors = [100.0 * abs(found.gain / abs(robot.gain) - 1.0) for robot, found in told]
    delays = [1e3 * abs(found.delay - robot.delay - robot.lag) for robot, found in told]

    def row(name: str, value: float, unit: str, note: str) -> ResultRow:
        return ResultRow(f"safety.commissioned.{name}", value, unit, "evidence", "simulated", None, note)

    yield row("robots", len(made), "1", f"{START_COUNT} starts each, nobody strapped in")
    yield row("wrong_signs", wrong, "1", f"of {len(made)}")
    soft = sum(robot.rotor_share > 0.0 for robot, _ in made)
    note = f"median {np.median(errors):.2g} %; told of {len(told)} robots, of which {soft} have a soft transmission"
    yield row("gain_error.worst", max(errors), "%", note)
    yield row("delay_error.worst", max(delays), "ms", f"median {np.median(delays):.2g} ms; dead time and lag together")
