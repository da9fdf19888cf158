"""One trial on the virtual shank exoskeleton: motor, gear, shells, shank and muscles, and what the instruments wrote.

The shells let shank and exoskeleton move a little against each other. With positions q_e and q_l from hanging:

    (I_e + J) q_e'' = T - friction - m_e g c_e sin q_e - tau,     tau = k (q_e - q_l) + b (q_e' - q_l')
          I_l q_l'' = tau + tau_muscles - m_l g c_l sin(q_l - ahead) - b_l q_l'
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from pellucid.models.joint import GRAVITY

from ..emg_synthesis import Electrodes, EmgSynthesis
from ..noise import draw_noise
from .machine import SeatedMachine
from .muscles import Muscles
from .protocol import SeatedTrial
from .wearer import Nerves, activations, maximal_excitation


@dataclass(frozen=True)
class SeatedTruth:
    """What no instrument shows, one sample per period."""

    position: np.ndarray  # position, velocity: (n,) Of the shank [rad], [rad/s]
    velocity: np.ndarray
    # muscle_torque, shell_torque, motor_torque: (n,) Of all muscles, positive in extension; of the exoskeleton on the
    # shank; of the motor before the gear's friction [N m]
    muscle_torque: np.ndarray
    shell_torque: np.ndarray
    motor_torque: np.ndarray
    # excitation, activation, force: (n, muscles) [1], [1], [N]; extensors, then flexors
    excitation: np.ndarray = field(repr=False)
    activation: np.ndarray = field(repr=False)
    force: np.ndarray = field(repr=False)


@dataclass(frozen=True)
class SeatedReadings:
    """What the instruments read of one trial, and its truth."""

    trial: SeatedTrial
    time: np.ndarray  # time, position, torque, command: (n,) [s], [rad], and as the drive says and was told [N m]
    position: np.ndarray
    torque: np.ndarray
    command: np.ndarray
    # knee, hip: As written down: of the knee where the shank hangs, and of the hip [rad]; None where nobody sits there
    knee: float | None
    hip: float | None
    emg_time: np.ndarray | None  # (k,) [s]
    emg: np.ndarray | None  # (k, channels) In counts of the converter
    truth: SeatedTruth


def run_seated_trial(rig: SeatedMachine, trial: SeatedTrial, *, rng: np.random.Generator) -> SeatedReadings:
    """One trial, from rest to its last period."""
    of_body, of_drive, of_emg = rng.spawn(3)
    n, instruments, subject = len(trial.reference), rig.constants.instruments, trial.subject
    moved = _clamped(rig, trial, of_body) if trial.task == "maximal" else _moved(rig, trial, of_body)
    truth, command, acceleration, seen = moved
    count = instruments.encoder
    emg_time = emg = knee = hip = None
    if subject is not None:
        table = rig.constants.emg
        every = [*table.muscles, *table.leaking]
        columns = [[m.name for m in subject.muscles].index(name) for name in every]
        synthesis = EmgSynthesis(Electrodes(subject.emg_gain, table), n, rig.period, of_emg)
        emg_time = synthesis.time
        emg = synthesis.whole(truth.excitation[:, columns], acceleration)[:, : len(table.muscles)]
        # A goniometer is read once for every subject, not once for every trial.
        once = np.random.default_rng([rig.constants.difference.seed, 7, *subject.name.encode()])
        off = rig.constants.posture.goniometer * once.standard_normal(2)
        knee, hip = float(subject.rest + off[0]), float(subject.hip + off[1])
    current = truth.motor_torque * (1.0 + rig.constants.actuator.constant_error)
    return SeatedReadings(
        trial,
        np.arange(n) * rig.period,
        count * np.round(seen / count),
        current + draw_noise((n,), instruments.torque_noise, 0.0, instruments.rate, of_drive),
        command,
        knee,
        hip,
        emg_time,
        emg,
        truth,
    )


def _clamped(rig: SeatedMachine, trial: SeatedTrial, rng: np.random.Generator):
    """Only the clamp yields, as much as an encoder sees; the muscles pull at it."""
    subject, n = trial.subject, len(trial.reference)
    excitation = maximal_excitation(rig, subject, n, rng)
    late = max(1, round(subject.delay / rig.period))
    arrived = np.concatenate([np.zeros((late, excitation.shape[1])), excitation[:-late]])
    activation = activations(subject, arrived, np.zeros(excitation.shape[1]), rig.period)
    knee = subject.rest + trial.reference[0]
    muscles = Muscles(subject.muscles, subject.hip, subject.rest, knee, rig.period)
    pulled = [muscles.step(a, knee) for a in activation.tolist()]
    torque, force = np.array([p[0] for p in pulled]), np.array([p[1] for p in pulled])
    still = np.zeros(n)
    position = trial.reference + rig.constants.mvc.clamp_compliance * torque
    truth = SeatedTruth(position, still, torque, still, still, excitation, activation, force)
    return truth, still, still, position


def _moved(rig: SeatedMachine, trial: SeatedTrial, rng: np.random.Generator):
    """Truth, the motor's command, the shank's acceleration, and the exoskeleton's position."""
    n, period, subject = len(trial.reference), rig.period, trial.subject
    motor, loop, substeps = rig.constants.actuator, rig.constants.position_loop, rig.constants.instruments.substeps
    sine, cosine = rig.exoskeleton_gravity
    inertia, quantum, step = rig.exoskeleton_inertia, rig.constants.instruments.encoder, period / substeps
    up, down, viscous = motor.coulomb_positive, motor.coulomb_negative, motor.viscous
    rest_speed, loss, limit = motor.rest_speed, motor.load_loss, motor.torque_limit
    cogging, waves = motor.cogging, motor.cogging_wave_number
    driven, reference = trial.task == "driven", trial.reference.tolist()
    nerves = muscles = None
    q_e = q_l = reference[0]
    leg, leg_moment, stiffness, soft, ahead, leg_viscous = 1.0, 0.0, 0.0, 0.0, 0.0, 0.0
    if subject is not None:
        leg, leg_moment, ahead, leg_viscous = subject.inertia, GRAVITY * subject.moment, subject.ahead, subject.viscous
        stiffness, soft = subject.stiffness, rig.constants.shells.damping
        nerves = Nerves(rig, subject, n, None if driven else trial.reference, q_l, rng)
        muscles = Muscles(subject.muscles, subject.hip, subject.rest, subject.rest + q_l, period)
    v_e = v_l = tau = pulled = 0.0
    errors: list[float] = []
    span, kp, kd = loop.velocity_span, loop.kp, loop.kd / (loop.velocity_span * period)
    rows, commands, activation, force = [], [], [], []
    sin, tanh = math.sin, math.tanh
    for k in range(n):
        torque = 0.0
        if driven:
            error = reference[k] - quantum * round(q_e / quantum)
            errors.append(error)
            torque = kp * error + kd * (error - (errors[k - span] if k >= span else errors[0]))
            torque = min(max(torque, -limit), limit)
        if nerves is not None:
            active = nerves.step(k, q_l, v_l)
            pulled, forces = muscles.step(active, subject.rest + q_l)
            activation.append(active)
            force.append(forces)
        rows.append((q_e, q_l, v_l, pulled, tau, torque))
        commands.append(torque)
        for _ in range(substeps):
            tau = stiffness * (q_e - q_l) + soft * (v_e - v_l)
            dry = tanh(v_e / rest_speed)
            drag = (up if v_e > 0.0 else down) * dry + viscous * v_e + loss * abs(torque) * dry
            ripple = cogging * sin(waves * q_e)
            v_e += step * (torque + ripple - drag - sine * sin(q_e) - cosine * math.cos(q_e) - tau) / inertia
            v_l += step * (tau + pulled - leg_moment * sin(q_l - ahead) - leg_viscous * v_l) / leg
            q_e += step * v_e
            q_l += step * v_l
    table = np.array(rows)
    speed = np.append(table[:, 2], v_l)
    truth = SeatedTruth(
        position=table[:, 1],
        velocity=table[:, 2],
        muscle_torque=table[:, 3],
        shell_torque=table[:, 4],
        motor_torque=table[:, 5],
        excitation=nerves.excitation if nerves else np.zeros((n, 0)),
        activation=np.array(activation) if activation else np.zeros((n, 0)),
        force=np.array(force) if force else np.zeros((n, 0)),
    )
    return truth, np.array(commands), np.diff(speed) / period, table[:, 0]
