"""Simulated sessions of pointing with the shank: one person in one condition, target by target."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from pellucid import _core
from pellucid.controllers.supervisor_faults import NO_FAULT

from ..emg_synthesis import Electrodes, EmgSynthesis
from ..knee.instruments import Mounting
from ..knee.rig import KneeRig
from ..knee.subject import EXTENSOR_MUSCLE, FLEXOR_MUSCLE
from .constants import KneePointingConstants
from .pointing_leg import Pointed, PointingLeg

CONTROL_CONDITION = "Ctrl"
"""Name of the control condition, in which no orthosis is worn."""

STRAP_PARAMETERS = ("strap_stiffness", "strap_damping", "strap_relaxing_stiffness")
"""Parameters of the plant that couple the shank to the orthosis; without it they are 0."""


class LegLaw(Protocol):
    """A law of the worn orthosis, called once a period."""

    @property
    def fault(self) -> str:
        """Fault that its supervisor has latched."""
        ...

    def step(
        self, time: float, position: float, torque: float, emg: Sequence[tuple[float, float]] = (), *,
        motor_position: float | None = None,
    ) -> float:  # fmt: skip
        """Return the torque that the spring is to have [N*m]; `emg` has the samples since the last period [V]."""
        ...


@dataclass(frozen=True)
class LegSession:
    """One session of one person: what happened, one sample per period, and what the EMG amplifier wrote."""

    fs: float  # [Hz]
    target: np.ndarray  # (n,) [rad]
    # (n,) each: limb's position, velocity [rad, rad/s], the orthosis's encoder [rad], the strap's torque on the
    # orthosis, the command and the spring's torque [N*m], and the orthosis's velocity [rad/s]
    signals: Mapping[str, np.ndarray]
    movements: tuple[Pointed, ...]
    emg_time: np.ndarray  # (k,) [s]
    emg: np.ndarray  # (k, 2) counts of rectus femoris and lateral hamstring
    worn: bool  # whether the orthosis was worn
    fault: str  # fault that the law's supervisor has latched at the end


def simulate_leg_session(
    rig: KneeRig, settings: KneePointingConstants, reward: float, law: LegLaw | None, rng: np.random.Generator, *,
    worn: bool, mounting: Mounting,
) -> LegSession:  # fmt: skip
    """Simulate the movements of a rig's single subject in one condition.

    Without a `law` the spring is asked for no torque; without an orthosis (`worn` is False) nothing couples the shank
    to it.
    """
    (subject,) = rig.subjects.values()
    pointing, loop = settings.pointing, rig.constants.torque_loop
    of_task, of_body, of_emg = rng.spawn(3)
    lifts = np.deg2rad(of_task.permutation(np.repeat(pointing.amplitudes, pointing.repetitions)))
    targets = np.ravel([(pointing.reference + lift, pointing.reference) for lift in lifts])
    n = round(len(targets) * pointing.longest / rig.period)
    parameters = rig.plant(subject)
    if not worn:
        parameters[[list(_core.COUPLED_PARAMETER_NAMES).index(name) for name in STRAP_PARAMETERS]] = 0.0
    plant = _core.CoupledPlant(
        parameters, period=rig.period, substeps=loop.substeps, delay=loop.delay, torque_span=loop.torque_span,
        position0=pointing.reference, torque0=0.0,
    )  # fmt: skip
    reading = plant.read()
    acting = PointingLeg(rig, settings, subject, reward, targets, n, reading[7] if worn else 0.0, worn, of_body)
    usual = (subject.emg_gain[muscle] for muscle in (EXTENSOR_MUSCLE, FLEXOR_MUSCLE))
    gains = tuple(gain * factor for gain, factor in zip(usual, mounting.emg_gain, strict=True))
    synthesis = EmgSynthesis(Electrodes(gains, rig.constants.emg), n, rig.period, of_emg)
    readings, commands, shown, samples, k = [], [], [], [], 0
    while k < n and not acting.done:
        readings.append(reading)
        desired = 0.0 if law is None else law.step(
            k * rig.period, reading[0], reading[2], samples, motor_position=reading[1]
        )  # fmt: skip
        shown.append(acting.target)
        muscle = acting.step(k, reading[5], reading[6], reading[7] if worn else 0.0)
        commands.append(desired)
        velocity = reading[6]
        reading = plant.step(desired, muscle, 0.0)
        if law is not None:
            flexor, extensor = acting.amplitude[k]
            samples = synthesis.period(k, (extensor, flexor), (reading[6] - velocity) / rig.period)
        k += 1
    table = np.array([*readings, reading])
    amplitude, acceleration = np.array(acting.amplitude)[:, ::-1], np.diff(table[:, 6]) / rig.period
    amplitude = np.pad(amplitude, ((0, n - k), (0, 0)), mode="edge")
    counts = synthesis.whole(amplitude, np.pad(acceleration, (0, n - k)))
    taken = synthesis.time < k * rig.period
    signals = {
        "position": table[:-1, 5], "velocity": table[:-1, 6], "encoder": table[:-1, 0], "interaction": table[:-1, 7],
        "spring": table[:-1, 8], "link": table[:-1, 4], "command": np.array(commands),
    }  # fmt: skip
    return LegSession(
        1.0 / rig.period, np.array(shown), signals, tuple(m for m in acting.movements if m.end > 0),
        synthesis.time[taken], counts[taken], worn, NO_FAULT if law is None else law.fault,
    )  # fmt: skip
