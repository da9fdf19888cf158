"""Results of one controller with one wearer and one robot."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class ControllerTrial:
    """Results of one controller on one pair of a person and a robot in one task."""

    task: str
    controller: str
    pair: int
    torque: float  # RMS torque between robot and person during movements [N m]; NaN if the person never arrived
    given: float  # energy that the robot gave the person, per second of the task [W]
    taken: float  # energy that the robot took from the person, per second of the task [W]
    duration: float | None = None  # change of a movement's duration against no robot [%]
    peak_velocity: float | None = None  # change of a movement's peak velocity against no robot [%]
    deviation: float | None = None  # RMS of how far the person's joints are from the intended motion [rad]
    emg: float | None = None  # change of EMG over acceleration against no robot [%]
    fault_energy: float | None = None  # largest energy given by a single detectable fault until the robot is safe [J]
    cost: float | None = None  # median time of a step on this machine [s]
    instructions: float | None = None  # mean instructions of a step on a Cortex-M4F, of a foreign law in C
    gain: float | None = None  # smallest gain margin of the linear loop [dB]
    delay: float | None = None  # smallest delay margin of the linear loop [s]
    holds: bool | None = None  # whether the leg stays quiet with twice the command and with one 20 ms late
    fault: str = "none"  # fault of the safety gate at the end
    indices: Mapping[str, float] | None = None  # every index of `transparency_indices`; None where none was computed


def given_and_taken_power(power: np.ndarray, fs: float) -> tuple[float, float]:
    """Return the means of the positive and of the negated negative part of a power, shape (n,) [W] at a rate [Hz]."""
    seconds = len(power) / fs
    return float(np.sum(np.maximum(power, 0.0)) / fs / seconds), float(-np.sum(np.minimum(power, 0.0)) / fs / seconds)
