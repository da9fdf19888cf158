"""One trial of a simulated person in the controlled virtual arm: cuff torques, deviation of the arm, computing time."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from .bodies import built_tree
from .human_motion import HumanMotion, generated_motion, recorded_motion
from .rig import ArmRig
from .wearer import HANDLE_AT, Person, worn_arguments

SETTLING_S = 1.0
"""Time at the start of a trial that no figure counts [s]."""

MAX_MOTION_ERROR_RAD = 1.5
"""Error of the arm from its motion at which a trial is stopped, because nothing holds the arm there [rad]."""


class ArmLaw(Protocol):
    """What drives the robot's four joints: anything with these two."""

    def reset(self) -> None:
        """Forget everything, at rest."""

    def step(self, time: float, position: np.ndarray, wrench: np.ndarray) -> np.ndarray:
        """Torque asked of each joint, shape (4,) [N m], at `time` [s] by what encoders on the motors say, `position`
        (4,) [rad], and force sensors in the cuff of the upper arm and in the handle, `wrench` (2, 6): the wearer's
        force [N] and moment [N m] on the robot, in the axes of its link."""


@dataclass(frozen=True, eq=False)
class WornTrial:
    """One trial; arrays of every period, n of them."""

    rate: float  # [Hz]
    motion: HumanMotion = field(repr=False)
    robot: np.ndarray = field(repr=False)  # robot, limb: (n, 4) [rad]
    limb: np.ndarray = field(repr=False)
    limb_velocity: np.ndarray = field(repr=False)  # (n, 4) [rad/s]
    slider: np.ndarray = field(repr=False)  # (n,) Where the free carriage is [m]
    effort: np.ndarray = field(repr=False)  # (n, 4) What the law asked [N m]
    on_limb: np.ndarray = field(repr=False)  # on_limb, on_robot: (n, 4) of the cuffs, at joints [N m]
    on_robot: np.ndarray = field(repr=False)
    pull: np.ndarray = field(repr=False)  # (n, 2, 6) Force and moment of each cuff on the robot [N; N m]
    wrench: np.ndarray = field(repr=False)  # (n, 2, 6) The same as sensors read it
    stopped: bool  # Whether it was cut short because nothing held any more

    @property
    def counted(self) -> slice:
        """Periods that figures count."""
        return slice(round(SETTLING_S * self.rate), None)

    @property
    def interaction(self) -> np.ndarray:
        """RMS of the torque that the robot puts on each of the wearer's joints, shape (4,) [N m]."""
        return np.sqrt(np.mean(self.on_limb[self.counted] ** 2, axis=0))

    @property
    def interaction_rms(self) -> float:
        """The same over all joints [N m]; infinite if the trial was stopped."""
        return float("inf") if self.stopped else float(np.sqrt(np.mean(self.on_limb[self.counted] ** 2)))

    @property
    def error(self) -> np.ndarray:
        """RMS of how far the arm is from where it was meant to be, shape (4,) [rad]."""
        meant = self.motion.position[: len(self.limb)]
        return np.sqrt(np.mean((self.limb - meant)[self.counted] ** 2, axis=0))

    @property
    def work(self) -> float:
        """What the wearer did against the robot and was not given back [J]."""
        power = -np.sum(self.on_limb * self.limb_velocity, axis=1)[self.counted]
        return float(np.sum(power) / self.rate)

    @property
    def exchanged(self) -> float:
        """Return the work exchanged between person and robot, both directions counted positive [J]."""
        return float(np.sum(np.abs(np.sum(self.on_limb * self.limb_velocity, axis=1)[self.counted])) / self.rate)


def motion_of(person: Person, rig: ArmRig, *, repetition: int = 1, seed: int = 1) -> HumanMotion:
    """Return a person's motion: recorded if the person stands for a recorded one, otherwise generated reaching of a
    `seed`.
    """
    rate = rig.constants.sampling.rate
    if person.recorded is None:
        return generated_motion(seed, rate)
    return recorded_motion(person.recorded, rate, repetition=repetition)


def run(
    rig: ArmRig,
    person: Person,
    law: ArmLaw,
    motion: HumanMotion,
    *,
    seed: int = 1,
    watched: Callable[[float], None] | None = None,
    joints: Callable[[np.ndarray], None] | None = None,
    until: Callable[[float], bool] | None = None,
) -> WornTrial:
    """Simulate a `motion` of a `person` in a robot under a `law`.

    `seed` determines the sensors' noise. `watched` receives the time. Before each step, `joints` receives the positions
    of the robot's joints behind their cables, shape (4,) [rad], as a second encoder reads them. `until` returns whether
    the trial may end at a time [s]."""
    rate, n = rig.constants.sampling.rate, len(motion.position)
    rng = np.random.default_rng([seed, 41])
    tree = built_tree(rig.constants, rotors=False)
    plant = rig.plant(**worn_arguments(person, tree, 1.0 / rate))
    wanted, speed = np.ascontiguousarray(motion.position), np.ascontiguousarray(motion.velocity)
    learnt = np.ascontiguousarray(person.learnt(motion))
    plant.reset(np.append(wanted[0], HANDLE_AT * person.forearm), wanted[0])
    law.reset()
    quanta, gains, most = rig.quanta, rig.gains, rig.limits
    steps = rig.constants.encoder.noise * rng.standard_normal((n, 4))
    sensor = rig.constants.force_sensor
    errors = np.repeat([sensor.force_noise, sensor.moment_noise], 3) * rng.standard_normal((n, 2, 6))
    first = rig.gravity(wanted[0])
    waiting = deque([first] * rig.constants.drive.delay)
    command = np.zeros(5)
    made = {"robot": np.empty((n, 5)), "limb": np.empty((n, 4)), "limb_velocity": np.empty((n, 4))}
    made |= {"effort": np.empty((n, 4)), "on_limb": np.empty((n, 4)), "on_robot": np.empty((n, 5))}
    made |= {"pull": np.empty((n, 2, 6)), "wrench": np.empty((n, 2, 6))}
    motor, felt, stopped, at = wanted[0], np.zeros((2, 6)), False, wanted[0]
    for i in range(n):
        if joints is not None:
            joints(at[:4])
        asked = law.step(i / rate, np.round(motor / quanta) * quanta + steps[i], felt)
        waiting.append(np.minimum(np.maximum(asked, -most), most))
        command[:4] = waiting.popleft() / gains
        at, _, motors, limb, limb_velocity, on_robot, on_limb, pull = plant.run(command, wanted[i], speed[i], learnt[i])
        made["robot"][i], made["limb"][i], made["limb_velocity"][i] = at, limb, limb_velocity
        made["effort"][i], made["on_limb"][i], made["on_robot"][i] = asked, on_limb, on_robot
        made["pull"][i] = pull
        made["wrench"][i] = felt = pull + errors[i]
        motor = motors[:4]
        if not np.abs(limb - wanted[i]).max() < MAX_MOTION_ERROR_RAD:
            stopped = True
            made = {name: array[: i + 1] for name, array in made.items()}
            break
        if watched is not None and i % 1000 == 0:
            watched(i / rate)
        if until is not None and until(i / rate):
            made = {name: array[: i + 1] for name, array in made.items()}
            break
    robot, on_robot = made.pop("robot"), made.pop("on_robot")
    return WornTrial(rate, motion, robot[:, :4], slider=robot[:, 4], on_robot=on_robot[:, :4], stopped=stopped, **made)
