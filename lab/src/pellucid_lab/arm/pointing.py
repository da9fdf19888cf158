"""Simulated people who point with an arm of four joints, with or without the virtual robot, and adapt.

A person plans a minimum-jerk movement of all joints to a posture that points at the target. The feedforward torques are
those of the arm and of the expected load of the robot. Muscles act as a servo about the plan (`wearer`). If the hand is
not near the target when the plan ends, a correction follows after the visual delay. The measured load updates the
expectation before the next movement: for each joint a regression on posture, velocity, its sign and acceleration over
the latest movements [1]_. After a correction the next movement is a little slower, otherwise a little faster.

.. [1] R. Shadmehr, M. A. Smith, J. W. Krakauer, "Error correction, sensory prediction, and adaptation in motor
   control", Annual Review of Neuroscience 33, 2010.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from pellucid.controllers.supervisor_faults import NO_FAULT
from pellucid.numerics.filters import zero_phase_lowpass
from pellucid.numerics.motion import moving_samples, tangential_speed
from pellucid.people.movements import MovementRule

from .bodies import built_tree
from .human_motion import GENERATED_REACHES, JOINTS
from .rig import ArmRig
from .wearer import HANDLE_AT, MUSCLES, Person, worn_arguments
from .worn_trial import MAX_MOTION_ERROR_RAD, ArmLaw

TARGET_RADIUS_M = 0.02
"""Distance of the hand from the target's centre at which it has arrived [m]."""

ARRIVED_SPEED_RAD_S = 0.15
"""Largest joint velocity of an arm that has arrived [rad/s]."""

ARRIVED_FOR_S = 0.1
"""Time for which both must hold [s]."""

VISION_DELAY_S = 0.12
"""Time from the end of a plan to a correction by what is seen [s]. Chosen by judgement; no measurement is recorded."""

CORRECTION_DURATION_S = 0.35
"""Duration of a correction [s]. Chosen by judgement; no measurement is recorded."""

MOVEMENT_LIMIT_S = 4.0
"""A movement that has not arrived by then has failed [s]."""

DWELL_S = 0.3
"""Time between arrival and the next target [s]."""

DURATION_RULE_S = (0.45, 0.40)
"""Duration of a plan at a comfortable pace: a constant [s], and a part for each radian of the largest joint's way."""

MINIMUM_JERK_PEAK = 1.875
"""Peak velocity of a minimum jerk over its mean one [1]."""

FAST_PACE = 0.6
"""Duration of a fast movement's plan over that of a comfortable one [1]."""

SLOWER_AFTER_CORRECTION = 1.04
"""Factor on the next plan's duration after a movement that was corrected [1]."""

QUICKER_AFTER_SUCCESS = 0.985
"""Factor on the next plan's duration after a movement that was not [1]."""

PACE_BOUNDS = (0.8, 1.6)
"""Smallest and largest factor on durations that adaptation reaches [1]."""

MEMORY_SHARE = 0.9
"""Weight of what earlier movements told, after each movement [1]. Chosen by judgement; no measurement is recorded."""

FELT_NOISE_NM = 0.5
"""Standard deviation of the torque that is felt at a joint [N*m]."""

LOAD_TRUST = np.array([4.0, 4.0, 4.0, 4.0, 4.0, 1.0, 1.5, 0.3])
"""Standard deviation of each coefficient of the expected load: a constant [N*m], four angles [N*m/rad], velocity
[N*m*s/rad], its sign [N*m], acceleration [kg*m^2]."""

FRICTION_WIDTH_RAD_S = 0.1
"""Velocity over which the expected friction changes its sign [rad/s]."""

REST_EXCITATION = 0.02
"""Excitation of both sides of a joint that gives no torque [1]: what tone and co-contraction leave."""

ANALYSIS_STEP = 5
"""Every such period is analysed."""

ACCELERATION_LOWPASS_HZ = 10.0
"""Zero-phase low-pass of velocities before the largest acceleration is looked for [Hz]: cuffs and friction shake."""

MIN_JOINT_WAY_RAD = 0.1
"""Smallest displacement of a joint that counts as moving [rad]."""


@dataclass(frozen=True)
class PointingTarget:
    """One target."""

    posture: tuple[float, float, float, float]  # posture that points at it [rad]
    fast: bool  # whether it is to be reached fast


@dataclass(frozen=True)
class PointingMovement:
    """One movement, as it was done."""

    upward: bool  # whether the hand ends higher than it began
    fast: bool
    arrived: bool
    duration: float  # from the first motion to arrival [s]
    peak_velocity: float  # largest speed of the hand [m/s]
    peak_acceleration: float  # largest norm of the joints' accelerations [rad/s^2]
    corrections: int
    interaction: float  # RMS of the torque of the robot on the wearer's joints [N*m]; 0 without a robot
    agonists: float  # RMS excitation of the moving joints' agonists, mean over joints [1]
    antagonists: float  # RMS excitation of the moving joints' antagonists, mean over joints [1]

    @property
    def activity(self) -> float:
        """RMS excitation of both sides of the moving joints [1]."""
        return 0.5 * (self.agonists + self.antagonists)


@dataclass(frozen=True, eq=False)
class PointingBlock:
    """What one person did in one condition."""

    movements: tuple[PointingMovement, ...] = field(repr=False)
    stopped: bool  # whether a law's gate or an arm thrown off its plan ended it; `movements` are those before

    def mean(self, what: str, *, upward: bool | None = None, fast: bool | None = None, skip: int = 0) -> float:
        """Return the mean of a field over the movements of a kind except the first `skip`; NaN if there is none."""
        own = [
            getattr(m, what)
            for m in self.movements[skip:]
            if m.arrived and upward in (None, m.upward) and fast in (None, m.fast)
        ]
        return float(np.mean(own)) if own else float("nan")

    def emg_per_acceleration(
        self, control: PointingBlock, *, upward: bool, fast: bool, both_sides: bool = False, skip: int = 0
    ) -> float:
        """Return EMG/Acc of n joints, eq. 9 of the paper with agonists and accelerations of all moving joints [1].

        With `both_sides` the antagonists count, too: in a downward movement gravity does what the agonists would.
        """
        what = "activity" if both_sides else "agonists"
        own, usual = (
            block.mean(what, upward=upward, fast=fast, skip=skip)
            / block.mean("peak_acceleration", upward=upward, fast=fast, skip=skip)
            for block in (self, control)
        )
        return own / usual - 1.0


def draw_targets(count: int, rng: np.random.Generator) -> tuple[PointingTarget, ...]:
    """Return targets between low and high postures in turn, every second pair to be reached fast."""
    low, high = np.array(GENERATED_REACHES["low"]), np.array(GENERATED_REACHES["high"])
    middle = 0.5 * (low + high)
    ends = ((low, middle), (middle, high))
    made = []
    for i in range(count):
        a, b, c, d = (float(x) for x in rng.uniform(*ends[(i + 1) % 2]))
        made.append(PointingTarget((a, b, c, d), fast=(i // 2) % 2 == 1))
    return tuple(made)


class _Plan:
    """What is wanted from now on: positions, velocities and torques, held after the last."""

    def __init__(self, person: Person, start: np.ndarray, end: np.ndarray, seconds: float, rate: float, load):
        n = max(round(seconds * rate), 2)
        s = (np.arange(n) + 1.0) / n
        ease = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
        speed = 30.0 * s**2 * (1.0 - s) ** 2 / seconds
        change = 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s) / seconds**2
        way = end - start
        self.position, self.velocity = start + ease[:, None] * way, speed[:, None] * way
        acceleration = change[:, None] * way
        states = tuple(map(np.ascontiguousarray, (self.position, self.velocity, acceleration)))
        self.torque = person.tree.core.inverse_dynamics(*states) + expected_torque(load, *states)
        self.count = n

    def at(self, k: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        if k < self.count:
            return self.position[k], self.velocity[k], self.torque[k]
        return self.position[-1], np.zeros(4), self.torque[-1]


def load_features(position: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
    """Return what the expected load of each joint is linear in, shape (4, n, 8), of a motion with shape (n, 4)."""
    common = [np.ones((len(position), 1)), position]
    return np.stack([
        np.column_stack([*common, velocity[:, j], np.tanh(velocity[:, j] / FRICTION_WIDTH_RAD_S), acceleration[:, j]])
        for j in range(len(JOINTS))
    ])  # fmt: skip


def expected_torque(
    load: np.ndarray, position: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray
) -> np.ndarray:
    """Return the torque that a load (4, 8) is expected to take along a motion, shape (n, 4) [N*m]."""
    return np.einsum("jnk,jk->nj", load_features(position, velocity, acceleration), load)


class LoadMemory:
    """What a person expects of a load: a regression over the movements that were made, the latest ones weighing most.

    One movement follows one line of postures, along which posture, velocity and friction are hard to tell apart. A
    person who believed each movement by itself would expect torques at other postures that were never there.
    """

    def __init__(self) -> None:
        count = len(LOAD_TRUST)
        self._information = np.zeros((len(JOINTS), count, count))
        self._moment = np.zeros((len(JOINTS), count))
        self.coefficients = np.zeros((len(JOINTS), count))  # as `expected_torque` takes them

    def learn(self, position: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray, felt: np.ndarray) -> None:
        """Take in a movement with shape (n, 4) in which torques `felt` (n, 4) were taken [N*m]."""
        for j, rows in enumerate(load_features(position, velocity, acceleration)):
            # Neighbouring samples tell the same: ten of them count as one.
            weight = 1.0 / (10.0 * FELT_NOISE_NM**2)
            self._information[j] = MEMORY_SHARE * self._information[j] + weight * rows.T @ rows
            self._moment[j] = MEMORY_SHARE * self._moment[j] + weight * rows.T @ felt[:, j]
            prior = np.diag(1.0 / LOAD_TRUST**2)
            self.coefficients[j] = np.linalg.solve(self._information[j] + prior, self._moment[j])


def hand_place(person: Person, posture: np.ndarray) -> np.ndarray:
    """Return where the wrist is, shape (3,) [m]."""
    frame = person.tree.core.placements(np.ascontiguousarray(posture))[3]
    return frame[:, :3] @ np.array([0.0, 0.0, -person.forearm]) + frame[:, 3]


def point(
    rig: ArmRig,
    person: Person,
    law: ArmLaw | None,
    targets: Sequence[PointingTarget],
    *,
    seed: int = 1,
    asked_speed: np.ndarray | None = None,
) -> PointingBlock:
    """Simulate a person who points at `targets` one after another.

    Without a `law` the person wears nothing. `seed` draws the noise of sensors and of what is felt. With an
    `asked_speed`, shape (4,) [rad/s], the person was asked to move no joint faster, and plans no movement that does.
    """
    rate = rig.constants.sampling.rate
    period, worn = 1.0 / rate, law is not None
    rng = np.random.default_rng([seed, 43])
    arguments = worn_arguments(person, built_tree(rig.constants, rotors=False), period)
    if not worn:
        arguments["cuffs"] = arguments["cuffs"][:0]
    plant = rig.plant(**arguments)
    low, high = np.array(GENERATED_REACHES["low"]), np.array(GENERATED_REACHES["high"])
    posture = 0.75 * low + 0.25 * high
    load, pace = LoadMemory(), 1.0
    plan = _Plan(person, posture, posture, 0.5, rate, load.coefficients)
    plant.reset(np.append(posture, HANDLE_AT * person.forearm), posture)
    if law is not None:
        law.reset()
    quanta, gains, most, sensor = rig.quanta, rig.gains, rig.limits, rig.constants.force_sensor
    spread = np.repeat([sensor.force_noise, sensor.moment_noise], 3)
    waiting = deque([rig.gravity(posture)] * rig.constants.drive.delay)
    command, motor, felt, k_plan, period_count = np.zeros(5), posture, np.zeros((2, 6)), 0, 0
    movements: list[PointingMovement] = []
    limb = posture

    def advance(wanted: np.ndarray, speed: np.ndarray, learnt: np.ndarray):
        nonlocal motor, felt, period_count
        asked = np.zeros(4)
        if law is not None:
            noise = rig.constants.encoder.noise * rng.standard_normal(4)
            asked = law.step(period_count * period, np.round(motor / quanta) * quanta + noise, felt)
        waiting.append(np.minimum(np.maximum(asked, -most), most))
        command[:4] = waiting.popleft() / gains
        out = plant.run(command, *map(np.ascontiguousarray, (wanted, speed, learnt)))
        motor = out[2][:4]
        if worn:
            felt = out[7] + spread * rng.standard_normal((2, 6))
        period_count += 1
        return out[3], out[4], out[6]

    for target in (PointingTarget(tuple(posture), fast=False), *targets):
        goal = np.array(target.posture)
        place, first = hand_place(person, goal), hand_place(person, limb)
        begin = plan.at(k_plan)[0]
        seconds = DURATION_RULE_S[0] + DURATION_RULE_S[1] * float(np.abs(goal - begin).max())
        seconds *= pace * (FAST_PACE if target.fast else 1.0)
        if asked_speed is not None:
            seconds = max(seconds, MINIMUM_JERK_PEAK * float((np.abs(goal - begin) / asked_speed).max()))
        plan = _Plan(person, begin, goal, seconds, rate, load.coefficients)
        k_plan, kept, corrections, near, arrived = 0, [], 0, 0.0, False
        for k in range(round(MOVEMENT_LIMIT_S * rate)):
            wanted = plan.at(k_plan)
            limb, speed, on_limb = advance(*wanted)
            k_plan += 1
            if k % ANALYSIS_STEP == 0:
                kept.append(np.concatenate([limb, speed, on_limb]))
                if not np.abs(limb - wanted[0]).max() < MAX_MOTION_ERROR_RAD:
                    return PointingBlock(tuple(movements[1:]), stopped=True)
                off = float(np.linalg.norm(hand_place(person, limb) - place))
                there = off < TARGET_RADIUS_M and float(np.abs(speed).max()) < ARRIVED_SPEED_RAD_S
                near = near + ANALYSIS_STEP * period if there else 0.0
                if near >= ARRIVED_FOR_S:
                    arrived = True
                    break
                if k_plan > plan.count + round(VISION_DELAY_S * rate) and off >= TARGET_RADIUS_M:
                    # What is seen is how far the arm is off, not where the plan was to end.
                    shifted = plan.position[-1] + (goal - limb)
                    plan = _Plan(person, plan.position[-1], shifted, CORRECTION_DURATION_S, rate, load.coefficients)
                    k_plan, corrections = 0, corrections + 1
        table = np.array(kept)
        movement = _measured(person, table, target, first, place, corrections, arrived, ANALYSIS_STEP * period)
        if getattr(law, "stopped_by", NO_FAULT) != NO_FAULT:
            # The robot was off in some part of this movement.
            return PointingBlock(tuple(movements[1:]), stopped=True)
        movements.append(movement)
        for _ in range(round(DWELL_S * rate)):
            limb, _, _ = advance(*plan.at(k_plan))
            k_plan += 1
        acceleration = np.gradient(table[:, 4:8], ANALYSIS_STEP * period, axis=0)
        taken = -table[:, 8:12] + FELT_NOISE_NM * rng.standard_normal((len(table), 4)) * worn
        if worn:
            load.learn(table[:, :4], table[:, 4:8], acceleration, taken)
        pace *= SLOWER_AFTER_CORRECTION if corrections else QUICKER_AFTER_SUCCESS
        pace = float(np.clip(pace, *PACE_BOUNDS))
    # The first target is where the person stands already.
    return PointingBlock(tuple(movements[1:]), stopped=False)


def _measured(
    person: Person, table: np.ndarray, target: PointingTarget, first: np.ndarray, place: np.ndarray, corrections: int,
    arrived: bool, step: float,
) -> PointingMovement:  # fmt: skip
    position, velocity, on_limb = table[:, :4], table[:, 4:8], table[:, 8:12]
    acceleration = np.gradient(velocity, step, axis=0)
    states = tuple(map(np.ascontiguousarray, (position, velocity, acceleration)))
    torque = person.tree.core.inverse_dynamics(*states) - on_limb
    smooth = np.gradient(zero_phase_lowpass(velocity, ACCELERATION_LOWPASS_HZ, 2, 1.0 / step), step, axis=0)
    most = np.array([MUSCLES[name].max_torque for name in JOINTS])
    moved = np.array(target.posture) - position[0]
    moving = np.abs(moved) > MIN_JOINT_WAY_RAD
    share = np.sign(moved) * torque / most
    both = np.sqrt(share**2 + 4.0 * REST_EXCITATION**2)
    agonist, antagonist = (np.sqrt(np.mean((0.5 * (both + way * share)) ** 2, axis=0)) for way in (1.0, -1.0))
    hand = np.array([hand_place(person, q) for q in position])
    speed = tangential_speed(np.gradient(hand, step, axis=0)) if len(hand) > 1 else np.zeros(1)
    onset = moving_samples(speed, MovementRule().threshold)[0] if speed.any() else 0
    return PointingMovement(
        upward=bool(place[2] > first[2]), fast=target.fast, arrived=arrived,
        duration=(len(table) - onset) * step - ARRIVED_FOR_S, peak_velocity=float(speed.max()),
        peak_acceleration=float(np.linalg.norm(smooth, axis=1).max()), corrections=corrections,
        interaction=float(np.sqrt(np.mean(on_limb**2))),
        agonists=float(agonist[moving].mean()) if moving.any() else float("nan"),
        antagonists=float(antagonist[moving].mean()) if moving.any() else float("nan"),
    )  # fmt: skip
