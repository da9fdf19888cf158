"""Simulated wearer of the virtual shank exoskeleton: intended motion and muscle excitations.

The feedforward command includes the leg's weight, inertia and tissue and part of the machine's friction, and leads by
the delay of the muscles. Feedback like that of a spring and a damper corrects the remaining error after the delay of a
reflex. The command accounts for the loss of force in shortening muscles. Synergists share torque by weights that vary
slowly, and activation is a nonlinear function of excitation.
"""

from __future__ import annotations

import numpy as np

from pellucid import _core
from pellucid.emg.models.muscle import Muscle
from pellucid.models.joint import GRAVITY

from ..noise import draw_noise, draw_wandering_path
from .machine import SeatedMachine
from .muscles import DriveMap
from .subject import SeatedSubject

UNIT_MUSCLE = Muscle(max_isometric_force=1.0, optimal_fibre_length=1.0, tendon_slack_length=0.0, max_velocity=1.0)
"""A muscle whose speeds and forces are relative: people's expectation of the force lost in shortening."""

MIN_FORCE_SHARE = 0.2
"""Smallest share of a force that remains after shortening [1]."""


def swing_path(rig: SeatedMachine, subject: SeatedSubject, n: int, rng: np.random.Generator) -> np.ndarray:
    """Positions that a swinging subject means to go through, shape (n,) [rad]; it begins hanging."""
    swing, fs = rig.constants.swing, rig.constants.instruments.rate
    pace, forward, backward = (draw_wandering_path(n, swing.memory, fs, rng) for _ in range(3))
    frequency = subject.frequency * (1.0 + swing.pace * (2.0 * pace - 1.0))
    front = swing.forward[0] + np.diff(swing.forward) * forward
    back = swing.backward[0] + np.diff(swing.backward) * backward
    phase = 2.0 * np.pi * np.cumsum(frequency) / fs
    begin = np.clip(np.arange(n) / (2.0 * fs), 0.0, 1.0)
    middle, size = 0.5 * (front - back), 0.5 * (front + back)
    return (middle + size * np.sin(phase)) * begin**2 * (3.0 - 2.0 * begin)


class Nerves:
    """Excitations of all muscles, period by period, and the activations they become. `path` (n,) [rad]; `start`
    [rad]."""

    def __init__(
        self,
        rig: SeatedMachine,
        subject: SeatedSubject,
        n: int,
        path: np.ndarray | None,
        start: float,
        rng: np.random.Generator,
    ) -> None:
        self._subject, self._period = subject, rig.period
        fs, muscles, wearer = rig.constants.instruments.rate, rig.constants.muscles, rig.constants.wearer
        count = len(subject.muscles)
        shares = np.array([m.share for m in subject.muscles])
        unseen = draw_noise((count, n), muscles.unseen, muscles.unseen_memory, fs, rng)
        self._share = (shares[:, None] * np.maximum(1.0 + unseen, 0.1)).T
        waver = draw_noise((count, n), muscles.variability, muscles.variability_memory, fs, rng)
        self._waver = np.maximum(1.0 + waver, 0.0).T
        idle = draw_noise((count, n), wearer.spontaneous, wearer.spontaneous_memory, fs, rng)
        self._idle = np.abs(idle).T
        self.late = max(1, round(subject.delay * fs))
        self._reflex = max(1, round(wearer.reflex_delay * fs))
        self._stiffness, self._damping = wearer.stiffness, wearer.damping
        self._extending = len(subject.extensors)
        self.excitation = np.zeros((n, count))
        self.activation = np.zeros((n + self.late, count))
        self._positions, self._velocities = [start] * self._reflex, [0.0] * self._reflex
        self._path = None
        if path is not None:
            self._extensors = DriveMap(subject.extensors, subject.hip, subject.rest)
            self._flexors = DriveMap(subject.flexors, subject.hip, subject.rest)
            ahead = self.late + round(wearer.activation_foresight * fs)
            self._path, self._rate = path.tolist(), (np.gradient(path) * fs).tolist()
            self._plan = np.append(self._planned(rig, path)[ahead:], np.full(ahead, 0.0)).tolist()
            self._toward = np.append(path[ahead:], np.full(ahead, path[-1])).tolist()
            moving = wearer.weakening * np.append(self._rate[ahead:], np.zeros(ahead))
            # Never believed to be weaker than that: nobody drives a muscle to pull nothing.
            weaker = (np.maximum(UNIT_MUSCLE.force_velocity(way * moving), MIN_FORCE_SHARE) for way in (-1.0, 1.0))
            self._weaker = np.column_stack(list(weaker)).tolist()

    def _planned(self, rig: SeatedMachine, path: np.ndarray) -> np.ndarray:
        """Torque that the subject believes a path to take, shape (n,) [N m]."""
        fs, subject, motor = rig.constants.instruments.rate, self._subject, rig.constants.actuator
        velocity = np.gradient(path) * fs
        acceleration = np.gradient(velocity) * fs
        sine, cosine = rig.exoskeleton_gravity
        body = (subject.inertia + rig.exoskeleton_inertia) * acceleration
        body += GRAVITY * subject.moment * np.sin(path - subject.ahead) + sine * np.sin(path) + cosine * np.cos(path)
        dry = 0.5 * (motor.coulomb_positive + motor.coulomb_negative) * np.tanh(velocity / 0.2)
        friction = dry + (motor.viscous + subject.viscous) * velocity
        tissue = self._extensors.passive(subject.rest + path) - self._flexors.passive(subject.rest + path)
        return (1.0 + subject.belief) * body + rig.constants.wearer.friction_belief * friction - tissue

    def step(self, k: int, position: float, velocity: float) -> list[float]:
        """Return the activations of one period, one for each muscle, from the sensed position and velocity of the
        shank.

        `position` [rad], `velocity` [rad/s].
        """
        self._positions.append(position)
        self._velocities.append(velocity)
        if self._path is None:
            self.excitation[k] = self._idle[k]
        else:
            felt, speed = self._positions[k], self._velocities[k]
            past = max(0, k - self._reflex)
            wanted = self._plan[k]
            wanted += self._stiffness * (self._path[past] - felt) + self._damping * (self._rate[past] - speed)
            self._send(k, wanted)
        if (k + 1) % self.late == 0:
            self._arrive(k + 1 - self.late, k + 1)
        return self.activation[k].tolist()

    def _send(self, k: int, torque: float) -> None:
        """Excite both groups so that `torque` [N m] is what is left of their pulling against each other."""
        subject, both = self._subject, self._subject.cocontraction
        # Groups hand over smoothly: each pulls a little when the other ends.
        extend = 0.5 * (torque + (torque * torque + 0.25) ** 0.5) + both
        knee, (extensors, flexors) = subject.rest + self._toward[k], self._weaker[k]
        drives = (
            self._extensors.drive(extend / extensors, knee),
            self._flexors.drive((extend - torque) / flexors, knee),
        )
        drive = np.repeat(drives, (self._extending, len(subject.muscles) - self._extending)) * self._share[k]
        bend = np.expm1(subject.shape)
        excitation = np.log1p(np.clip(drive, 0.0, 1.0) * bend) / subject.shape
        self.excitation[k] = np.clip(excitation * self._waver[k] + self._idle[k], 0.0, 1.0)

    def _arrive(self, begin: int, end: int) -> None:
        """Activations of later periods, from excitations that reach the muscles then."""
        late = self.late
        made = activations(self._subject, self.excitation[begin:end], self.activation[begin + late - 1], self._period)
        self.activation[begin + late : end + late] = made


def activations(subject: SeatedSubject, excitation: np.ndarray, start: np.ndarray, period: float) -> np.ndarray:
    """Activations from excitations that have arrived at the muscles, both of shape (n, muscles) [1]."""
    drive = np.expm1(subject.shape * np.clip(excitation, 0.0, 1.0)) / np.expm1(subject.shape)
    made = [
        _core.activation_dynamics(
            column, period=period, activation_time=subject.activation_time,
            deactivation_time=subject.deactivation_time, start=float(a),
        )
        for column, a in zip(np.ascontiguousarray(drive.T), start, strict=True)
    ]  # fmt: skip
    return np.array(made).T


def maximal_excitation(rig: SeatedMachine, subject: SeatedSubject, n: int, rng: np.random.Generator) -> np.ndarray:
    """Excitations, shape (n, muscles) [1], of somebody who extends twice with all their might against a clamp."""
    muscles, fs = rig.constants.muscles, rig.constants.instruments.rate
    t = np.arange(n) / n
    shown = sum(np.clip(np.minimum(t - a, b - t) / 0.03, 0.0, 1.0) for a, b in ((0.12, 0.42), (0.60, 0.90)))
    count, extending = len(subject.muscles), len(subject.extensors)
    level = np.full(count, 0.08)
    # In an attempt at the maximum every synergist is driven as much as it can be.
    level[:extending] = subject.maximal * rng.uniform(0.96, 1.0, extending)
    waver = 1.0 + draw_noise((count, n), muscles.variability, muscles.variability_memory, fs, rng)
    return np.clip(shown[:, None] * level * waver.T, 0.0, 1.0)
