"""Somebody who points with the shank: targets, choice of a duration, corrections by eye, and the expected load.

Muscles and nerves are those of every wearer of the knee orthosis (`knee.wearer`), with weaker reflexes and with an
impedance of the muscles themselves, which a swinging leg does without. The duration that a person
chooses and the load that a person learns to expect follow the same equations as of people who point with the forearm.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..knee.machine import KneeMachine
from ..knee.subject import KneeSubject
from ..knee.wearer import Acting, following
from ..pointing.load_learning import load_regressor, update_expected_load
from ..pointing.movement_choice import preferred_duration
from ..pointing.session import MIN_REACTION_S
from .constants import KneePointingConstants

FELT_RATE_HZ = 100.0
"""Rate of the samples from which a person learns the load [Hz]."""


@dataclass
class Pointed:
    """One movement."""

    amplitude: float  # signed angle from the previous target to this one [rad]
    target: float  # [rad]
    begin: int  # index of the first period, in which the target steps
    end: int = -1  # index after the last period, in which the next target appears
    duration: float = float("nan")  # duration of the primary movement, as the person chose it [s]
    held: bool = False  # whether the person held the target; if not, the time for the movement ran out


class PointingLeg(Acting):
    """A person during one session of pointing, period by period.

    Parameters
    ----------
    rig : KneeMachine
        Orthosis and constants of its wearers.
    settings : KneePointingConstants
    subject : KneeSubject
    reward : float
        Value of arriving at a target [J].
    targets : ndarray, shape (m,)
        Targets one after another [rad]; the person begins at rest at the reference.
    n : int
        Largest number of periods.
    load : float
        Torque of the strap at rest [N*m].
    worn : bool
        Whether the orthosis is worn; without it there is no load to learn.
    """

    def __init__(
        self, rig: KneeMachine, settings: KneePointingConstants, subject: KneeSubject, reward: float,
        targets: np.ndarray, n: int, load: float, worn: bool, rng: np.random.Generator,
    ) -> None:  # fmt: skip
        reference = settings.pointing.reference
        super().__init__(_calmer(rig, settings), following(subject, np.full(n, reference)), n, reference, load, rng)
        self._settings, self._subject, self._reward, self._worn = settings, subject, reward, worn
        self._passive, self._rng, self._targets = rig.constants.passive, rng, list(targets)
        self._fs, self._ahead = 1.0 / rig.period, round(rig.constants.wearer.foresight / rig.period)
        self._expected, self._held = np.zeros(5), 0
        self.movements: list[Pointed] = []
        self.done = False
        self._target = reference
        self._next_target(0)

    @property
    def target(self) -> float:
        """Target now [rad]."""
        return self._target

    def step(self, k: int, position: float, velocity: float, load: float) -> float:
        """Decide what to do, and return the muscles' torque of one period [N*m]; see `Acting.step`."""
        if k == self._go_at:
            self._begin_movement(k)
        elif k == self._look_at:
            self._look(k)
        torque = super().step(k, position, velocity, load)
        impedance = self._settings.impedance
        torque += impedance.stiffness * (self._wanted[k] - position) + impedance.damping * (self._speed[k] - velocity)
        self.torque[-1] = torque
        pointing, movement = self._settings.pointing, self.movements[-1]
        self._held = self._held + 1 if abs(position - self._target) < pointing.tolerance else 0
        held = k > self._go_at and self._held >= round(pointing.hold * self._fs)
        if held or k + 1 - movement.begin >= round(pointing.longest * self._fs):
            movement.end, movement.held = k + 1, held
            if self._worn:
                self._learn(movement)
            self._next_target(k + 1)
        return torque

    def _next_target(self, k: int) -> None:
        if not self._targets:
            self.done = True
            return
        mean, spread = self._settings.planning.reaction
        reaction = max(mean + spread * self._rng.standard_normal(), MIN_REACTION_S)
        before, self._target, self._held = self._target, self._targets.pop(0), 0
        self.movements.append(Pointed(self._target - before, self._target, k))
        # The reaction time ends where the shank begins to move, which is as late as muscles are after a command.
        self._go_at, self._look_at = k + max(round(reaction * self._fs) - self._ahead, 1), -1

    def _begin_movement(self, k: int) -> None:
        planning, choice, subject = self._settings.planning, self._settings.choice, self._subject
        inertia, viscous, coulomb = np.maximum(self._expected[:3], 0.0)
        dynamics = subject.inertia + inertia, subject.limb.viscous + viscous, coulomb
        amplitude = self._target - self._wanted[min(k + self._ahead, len(self._wanted) - 1)]
        duration = preferred_duration(amplitude, dynamics, self._reward, choice, planning.sign_width)
        duration *= float(np.exp(planning.pace_spread * self._rng.standard_normal()))
        reach = planning.reach + planning.reach_spread * self._rng.standard_normal()
        self.movements[-1].duration = duration
        self._move(k, reach * amplitude, duration)
        self._look_at = k + self._ahead + round(self._settings.vision.check_share * duration * self._fs)

    def _look(self, k: int) -> None:
        """Correct what is seen to be left of the way, where it is more than people tolerate."""
        vision, fs = self._settings.vision, self._fs
        then = max(k - round(vision.delay * fs), 0)
        # The movement ends off its plan by as much as the shank was seen to be off it.
        left = self._target - self._wanted[-1] + self._wanted[then] - self._position[then]
        duration = max(vision.correction_share * self.movements[-1].duration, vision.correction_least)
        if abs(left) > vision.tolerance:
            self._move(k, left, duration)
        self._look_at = k + self._ahead + round((duration + vision.delay) * fs)

    def _move(self, k: int, amplitude: float, duration: float) -> None:
        """Add a movement of minimum jerk to what is planned from period `k` on."""
        n, fs = len(self._wanted), self._fs
        first = k + self._ahead
        m = min(max(round(duration * fs), 2) + 3, n - first)
        if m < 4:
            return
        s = np.clip(np.arange(m) / (duration * fs), 0.0, 1.0)
        way = np.array(self._wanted[first : first + m]) + amplitude * s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
        speed = np.gradient(way, self._period)
        torque = self._torque_of(way, speed, np.gradient(speed, self._period))
        self._wanted[first:] = [*way.tolist(), *[float(way[-1])] * (n - first - m)]
        self._speed[first:] = [*speed.tolist(), *[0.0] * (n - first - m)]
        end = self._torque_of(way[-1:], np.zeros(1), np.zeros(1)).tolist()
        self._planned[k:] = [*torque.tolist(), *end * (n - k - m)]

    def _torque_of(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Return the torque that a motion is expected to take, shape (n,) [N*m]."""
        subject, passive = self._subject, self._passive
        own = subject.inertia * a + subject.gravity * np.sin(q - subject.limb.ahead) + subject.limb.viscous * v
        own -= passive.torque * np.exp(np.minimum((passive.angle - q) / passive.scale, 5.0))
        return own + load_regressor(q, v, a, self._settings.planning.sign_width) @ self._expected

    def _learn(self, movement: Pointed) -> None:
        every = round(self._fs / FELT_RATE_HZ)
        part = slice(movement.begin, movement.end, every)
        q, v, load = (np.array(x[part]) for x in (self._position, self._velocity, self._load))
        if len(q) < 3:
            return
        a = np.gradient(v, every * self._period)
        settings = self._settings
        regressor = load_regressor(q, v, a, settings.planning.sign_width)
        self._expected = update_expected_load(self._expected, regressor, load, settings.learning)


def _calmer(rig: KneeMachine, settings: KneePointingConstants) -> KneeMachine:
    """Return the rig with reflexes and noise of a pointing leg instead of a swinging one."""
    share, constants = settings.impedance, rig.constants
    values = {f"wearer.{key}": share.reflex_share * constants.wearer[key] for key in ("stiffness", "damping")}
    values["muscles.variability"] = share.noise_share * constants.muscles.variability
    return rig.changed(values)
