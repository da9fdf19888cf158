"""One trial on the virtual knee orthosis: wearer, controller and readings of the instruments."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from pellucid import _core

from ..emg_synthesis import Electrodes, EmgSynthesis
from .instruments import ImuReadings, Mounting, draw_mounting, take_imu
from .machine import KneeMachine
from .protocol import KneeTrial
from .subject import EXTENSOR_MUSCLE, FLEXOR_MUSCLE
from .wearer import Acting


class Controller(Protocol):
    """What decides the spring's torque, once per period.

    One with an attribute ``reads_motor_encoder`` that is true also gets `motor_position` [rad] by name.
    """

    def step(self, time: float, position: float, torque: float, emg: Sequence[tuple[float, float]]) -> float:
        """One period. `time` [s]; `position`, `torque` [rad], [N*m]; `emg` [V]; gives [N*m]."""
        ...


@dataclass(frozen=True)
class KneeTruth:
    """What no instrument shows, one sample per period, each shape (n,)."""

    # orthosis_position, orthosis_velocity, limb_position, limb_velocity: (n,) [rad], [rad/s]; without a wearer the
    # limb's say nothing
    orthosis_position: np.ndarray
    orthosis_velocity: np.ndarray
    limb_position: np.ndarray
    limb_velocity: np.ndarray
    # strap_torque, spring_torque, muscle_torque, motor_torque: (n,) On the orthosis and against the limb; of the
    # spring; of the muscles; of the motor [N*m]
    strap_torque: np.ndarray
    spring_torque: np.ndarray
    muscle_torque: np.ndarray
    motor_torque: np.ndarray
    excitation: np.ndarray  # (n, 2) Of lateral hamstring and rectus femoris [1]
    slip: np.ndarray  # (n,) Of the strap [rad]

    @property
    def mismatch(self) -> np.ndarray:
        """Limb less orthosis, shape (n,) [rad]."""
        return self.limb_position - self.orthosis_position


@dataclass(frozen=True)
class KneeReadings:
    """Instrument readings of one trial, and the true values."""

    trial: KneeTrial
    time: np.ndarray  # (n,) [s]
    position: np.ndarray  # position, motor_position: (n,) As the encoders say [rad]
    motor_position: np.ndarray
    torque: np.ndarray  # (n,) Of the spring, as the encoders say [N*m]
    command: np.ndarray  # (n,) Desired torque of the spring [N*m]
    emg_time: np.ndarray | None  # (k,) On the amplifier's clock [s]; None where nobody wears it
    emg: np.ndarray | None  # (k, 2) Of rectus femoris and lateral hamstring, in counts of the converter
    emg_quantum: float  # [V]
    imu: ImuReadings | None
    truth: KneeTruth


class _PositionLoop:
    """The actuator's own position loop: proportional, with damping by differences of what the encoder says."""

    def __init__(self, rig: KneeMachine, trial: KneeTrial, worn: bool) -> None:
        loop = rig.constants.position_loop
        gains = loop.worn if worn else loop.bench
        self._span = loop.velocity_span
        self._kp, self._kd = gains.kp, gains.kd / (self._span * rig.period)
        self._reference = trial.reference.tolist()
        self._errors: list[float] = []

    def step(self, k: int, position: float) -> float:
        error = self._reference[k] - position
        self._errors.append(error)
        before = self._errors[k - self._span] if k >= self._span else self._errors[0]
        return self._kp * error + self._kd * (error - before)


def run_trial(
    rig: KneeMachine,
    trial: KneeTrial,
    *,
    rng: np.random.Generator,
    controller: Controller | None = None,
    mounting: Mounting | None = None,
) -> KneeReadings:
    """One trial, from rest in balance to its last period; a controller gets raw EMG while somebody wears it."""
    n, period, loop, wearer = len(trial.reference), rig.period, rig.constants.torque_loop, trial.wearer
    of_body, of_emg, of_imu, of_mounting = rng.spawn(4)
    mounting = mounting or draw_mounting(rig, of_mounting)
    plant = _core.CoupledPlant(
        rig.plant(wearer.subject if wearer else None, trial.link, locked=trial.locked),
        period=period,
        substeps=loop.substeps,
        delay=loop.delay,
        torque_span=loop.torque_span,
        position0=trial.start,
        torque0=rig.orthosis_load(trial.start) if trial.mode == "position" else 0.0,
    )
    reading = plant.read()
    acting = synthesis = None
    if wearer is not None:
        acting = Acting(rig, wearer, n, reading[5], reading[7], of_body)
        usual = (wearer.subject.emg_gain[muscle] for muscle in (EXTENSOR_MUSCLE, FLEXOR_MUSCLE))
        gains = tuple(gain * factor for gain, factor in zip(usual, mounting.emg_gain, strict=True))
        faults = trial.faults
        electrodes = Electrodes(gains, rig.constants.emg, faults.emg_rate, faults.emg_detached, faults.emg_clipped)
        synthesis = EmgSynthesis(electrodes, n, period, of_emg)
    hold = _PositionLoop(rig, trial, wearer is not None) if trial.mode == "position" else None
    slip_at, slip_by = _slip(trial, period)
    reference, step = trial.reference.tolist(), plant.step
    reads_motor = getattr(controller, "reads_motor_encoder", False)
    readings, commands, slips = [], [], []
    muscle, samples, base, limb_added, base_torque = 0.0, [], trial.base, 0.0, 0.0
    for k in range(n):
        readings.append(reading)
        position = reading[0]
        if controller is not None:
            motor = {"motor_position": reading[1]} if reads_motor else {}
            desired = controller.step(k * period, position, reading[2], samples, **motor)
        elif hold is not None:
            desired = hold.step(k, position)
        else:
            desired = reference[k]
        if acting is not None:
            muscle = acting.step(k, reading[5], reading[6], reading[10])
        commands.append(desired)
        slips.append(plant.slip)
        velocity = reading[6]
        if base is not None:
            base_torque, limb_added = base.torques(k, reading[3], reading[5], reading[6])
        reading = step(desired, muscle + limb_added, slip_by if k == slip_at else 0.0, base_torque)
        if controller is not None and synthesis is not None:
            flexor, extensor = acting.amplitude[k]
            samples = synthesis.period(k, (extensor, flexor), (reading[6] - velocity) / period)
    table = np.array([*readings, reading])
    truth = KneeTruth(
        orthosis_position=table[:-1, 3],
        orthosis_velocity=table[:-1, 4],
        limb_position=table[:-1, 5],
        limb_velocity=table[:-1, 6],
        strap_torque=table[:-1, 7],
        spring_torque=table[:-1, 8],
        muscle_torque=np.array(acting.torque) if acting else np.zeros(n),
        motor_torque=table[1:, 9],
        excitation=np.array(acting.excitation) if acting else np.zeros((n, 2)),
        slip=np.array(slips),
    )
    emg = None
    if synthesis is not None:
        emg = synthesis.whole(np.array(acting.amplitude)[:, ::-1], np.diff(table[:, 6]) / period)
    return KneeReadings(
        trial,
        np.arange(n) * period,
        _rolled(table[:-1, 0], trial.faults.encoder_turn),
        table[:-1, 1],
        table[:-1, 2],
        np.clip(commands, -rig.constants.actuator.torque_limit, rig.constants.actuator.torque_limit),
        synthesis.time if synthesis else None,
        emg,
        synthesis.quantum if synthesis else 0.0,
        _imu(rig, trial, table, mounting, of_imu),
        truth,
    )


def _slip(trial: KneeTrial, period: float) -> tuple[int, float]:
    if trial.faults.slip is None:
        return -1, 0.0
    return round(trial.faults.slip[0] / period), trial.faults.slip[1]


def _rolled(position: np.ndarray, turn: float | None) -> np.ndarray:
    if turn is None:
        return position
    return np.mod(position + turn + np.pi, 2.0 * np.pi) - np.pi


def _imu(
    rig: KneeMachine,
    trial: KneeTrial,
    table: np.ndarray,
    mounting: Mounting,
    rng: np.random.Generator,
) -> ImuReadings | None:
    wearer = trial.wearer
    if trial.imu is None or (trial.imu == "ankle" and wearer is None):
        return None
    angle, velocity = (5, 6) if trial.imu == "ankle" else (3, 4)
    subject = wearer.subject if trial.imu == "ankle" else None
    return take_imu(
        rig, subject, table[:-1, angle], table[:-1, velocity], mounting, rng, dropout=trial.faults.imu_dropout
    )
