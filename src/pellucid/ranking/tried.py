"""What a controller did to one wearer in one robot."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Tried:
    """One controller on one pair of a person and a robot in one task."""

    task: str
    controller: str
    pair: int
    torque: float  # Between robot and person, RMS while they move [N m]; NaN where nobody arrived
    given: float  # given, taken: Energy that the robot gave the person and took, a second of the task [W]
    taken: float
    # duration, peak_velocity, emg: Changes from no robot: of a movement, and of EMG over acceleration [%]
    duration: float | None = None
    peak_velocity: float | None = None
    emg: float | None = None
    fault_energy: float | None = None  # The most that any single fault a sensor can show gave until all was safe [J]
    cost: float | None = None  # Of a step on this machine, the median [s]
    gain: float | None = None  # gain, delay: Smallest margins of the linear loop [dB], [s]
    delay: float | None = None
    holds: bool | None = None  # Whether twice the command, and one 20 ms late, make nobody sway
    fault: str = "none"  # Of its gate at the end


def energies(power: np.ndarray, fs: float) -> tuple[float, float]:
    """What a power, shape (n,) [W] at a rate [Hz], gives and takes a second [W]."""
    seconds = len(power) / fs
    return float(np.sum(np.maximum(power, 0.0)) / fs / seconds), float(-np.sum(np.minimum(power, 0.0)) / fs / seconds)
